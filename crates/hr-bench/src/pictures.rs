//! Committed pictures of built-in scenes: a change of looks is seen, and meant.
//!
//! `hr-bench pictures` draws them anew and puts each beside the committed one and the difference; `--accept` commits to what it
//! drew. A test draws them, too.

use crate::BenchError;
use crate::args::PicturesArgs;
use crate::run::{Out, camera, say};
use hr_diffuse::Settings;
use hr_scene::whole_file::write_whole;
use hr_scene::{Camera, Scene, ToneMap};
use hr_view::Mode;
use hr_view::raycast::RayCaster;
use hr_view::solved::Solved;
use hr_view::walkthrough::Walkthrough;
use hr_view::window::{Snapshot, WindowError};
use image::imageops::replace;
use image::{ImageFormat, Rgb, RgbImage};
use std::io::{self, Cursor, Write};
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

/// Width of a picture, pixels; heights are three quarters of it.
const WIDTH: u32 = 160;
/// The error that scenes are solved to: little work, and faults of coarse solutions are seen.
const ERROR: f32 = 0.3;
/// A pixel fails where one of its channels is off by more than this of 255: rounding differs from processor to processor.
const TOLERANCE: u8 = 8;
/// A picture of the ray caster fails where more than this share of its pixels do, …
const FAILING: f64 = 0.01;
/// … one of the graphics device where this does: each draws edges in its own way.
const FAILING_ON_DEVICE: f64 = 0.1;
/// Differences are shown so many times as large.
const MAGNIFIED: u8 = 8;
/// Pixels between pictures that stand side by side.
const GAP: u32 = 4;

/// How a picture is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Drawn {
    /// By the ray caster.
    By(Mode),
    /// By the graphics device, as the window does it.
    Window,
}

/// A picture that was drawn.
struct Picture {
    name: &'static str,
    /// None where there is nothing to draw it with.
    image: Option<RgbImage>,
    /// Share of its pixels that may be off.
    most: f64,
}

/// Pictures of a scene: their names, cameras, and how they are drawn.
type Shots = &'static [(&'static str, &'static str, Drawn)];

/// All pictures, by scene. Final gathers are noise at this size: whatever changes changes all of it.
const ALL: [(&str, Shots); 5] = [
    ("cornell", &[("cornell", "standard", Drawn::By(Mode::Distributions))]),
    ("three-lights", &[("three-lights", "side", Drawn::By(Mode::Distributions))]),
    ("area-light", &[("area-light", "front", Drawn::By(Mode::Samples))]),
    (
        "glossy-sphere",
        &[
            ("glossy-sphere-distributions", "low", Drawn::By(Mode::Distributions)),
            ("glossy-sphere-samples", "low", Drawn::By(Mode::Samples)),
        ],
    ),
    ("room", &[("room", "main", Drawn::By(Mode::Distributions)), ("room-window", "main", Drawn::Window)]),
];

/// Draws all pictures and compares them with those that are committed.
///
/// # Errors
/// [`BenchError::Compare`] where one has changed and that is not accepted; others where scenes cannot be solved, or files cannot be read
/// or written.
pub fn report(args: &PicturesArgs, out: Out<'_>) -> Result<(), BenchError> {
    for folder in std::iter::once(&args.out).chain(args.accept.then_some(&args.committed)) {
        std::fs::create_dir_all(folder).map_err(|source| BenchError::Write { path: folder.clone(), source })?;
    }
    let mut changed = Vec::new();
    say(out, "| picture | pixels that differ |\n| --- | ---: |")?;
    for Picture { name, image, most } in drawn()? {
        let Some(picture) = image else {
            say(out, &format!("| {name} | not drawn: there is no graphics device |"))?;
            continue;
        };
        let file = format!("{name}.png");
        let committed = args.committed.join(&file);
        match read(&committed) {
            Ok(before) if before.dimensions() == picture.dimensions() => {
                let share = failing(&before, &picture);
                say(out, &format!("| {name} | {:.2} % |", 100.0 * share))?;
                write(&beside(&before, &picture), &args.out.join(&file))?;
                if share > most {
                    changed.push(name);
                }
            }
            Ok(_) | Err(_) if args.accept => say(out, &format!("| {name} | new |"))?,
            Ok(_) => changed.push(name),
            Err(error) => return Err(error),
        }
        if args.accept {
            write(&picture, &committed)?;
        }
    }
    if changed.is_empty() || args.accept {
        return Ok(());
    }
    let (names, folder) = (changed.join(", "), args.out.display());
    Err(BenchError::Compare(format!("{names}: not as committed; look into {folder}, and --accept what is better")))
}

/// Draws all pictures.
fn drawn() -> Result<Vec<Picture>, BenchError> {
    let mut all = Vec::new();
    for (scene, shots) in ALL {
        let scene = Arc::new(Scene::load(scene)?);
        let solved = Solved::new(scene, Settings::with_error(ERROR), true, &mut |_| ControlFlow::Continue(()))?;
        let solved = Arc::new(solved);
        for &(name, view, by) in shots {
            let camera = Camera { width: WIDTH, height: WIDTH * 3 / 4, ..camera(&solved.scene, Some(view))? };
            let most = if by == Drawn::Window { FAILING_ON_DEVICE } else { FAILING };
            all.push(Picture { name, image: draw(&solved, &camera, by)?, most });
        }
    }
    Ok(all)
}

/// Draws one; none where there is nothing to draw it with.
fn draw(solved: &Arc<Solved>, camera: &Camera, by: Drawn) -> Result<Option<RgbImage>, BenchError> {
    let bytes = match by {
        Drawn::By(mode) => {
            let film = RayCaster::new(&solved.scene, &solved.solution, mode).film(camera, &|_| ());
            film.to_srgb8(&ToneMap::default(), solved.scene.primaries)
        }
        Drawn::Window => {
            let walk = Walkthrough::new(Arc::clone(solved), Mode::Distributions);
            match Snapshot::of(&walk, camera, None) {
                Ok(picture) => picture.rgba.chunks_exact(4).flat_map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect(),
                Err(WindowError::NoAdapter(_)) => return Ok(None),
                Err(error) => return Err(error.into()),
            }
        }
    };
    Ok(RgbImage::from_raw(camera.width, camera.height, bytes))
}

/// Share of pixels that are off.
fn failing(before: &RgbImage, now: &RgbImage) -> f64 {
    let is_off = |(a, b): (&Rgb<u8>, &Rgb<u8>)| (0..3).any(|c| a[c].abs_diff(b[c]) > TOLERANCE);
    let off = before.pixels().zip(now.pixels()).filter(|pair| is_off(*pair)).count();
    off as f64 / f64::from(now.width() * now.height())
}

/// What is committed, what is drawn now, and the difference.
fn beside(before: &RgbImage, now: &RgbImage) -> RgbImage {
    let (width, height) = now.dimensions();
    let difference = RgbImage::from_fn(width, height, |x, y| {
        let (a, b) = (before.get_pixel(x, y), now.get_pixel(x, y));
        Rgb([0, 1, 2].map(|c| a[c].abs_diff(b[c]).saturating_mul(MAGNIFIED)))
    });
    let mut all = RgbImage::new(3 * width + 2 * GAP, height);
    for (place, picture) in [before, now, &difference].into_iter().enumerate() {
        replace(&mut all, picture, place as i64 * i64::from(width + GAP), 0);
    }
    all
}

fn read(path: &Path) -> Result<RgbImage, BenchError> {
    let mend = "draw it anew with --accept";
    let wrong = |what: String| BenchError::Format { path: path.into(), what, mend };
    let bytes = std::fs::read(path).map_err(|source| BenchError::Read { path: path.into(), source })?;
    let picture = image::load_from_memory(&bytes).map_err(|error| wrong(error.to_string()))?;
    Ok(picture.into_rgb8())
}

fn write(picture: &RgbImage, path: &Path) -> Result<(), BenchError> {
    let mut bytes = Cursor::new(Vec::new());
    let unwritable = |error| BenchError::Write { path: path.into(), source: io::Error::other(error) };
    picture.write_to(&mut bytes, ImageFormat::Png).map_err(unwritable)?;
    Ok(write_whole(path, |file| file.write_all(bytes.get_ref()))?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_as_committed() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("pictures");
        for Picture { name, image, most } in drawn().expect("built-in scenes can be drawn") {
            let Some(picture) = image else { continue };
            let before = read(&folder.join(format!("{name}.png"))).expect("a committed picture");
            assert_eq!(before.dimensions(), picture.dimensions(), "{name}: pixels");
            let share = failing(&before, &picture);
            assert!(share <= most, "{name}: {share} of all pixels differ; see hr-bench pictures");
        }
    }

    #[test]
    fn what_differs_is_counted_and_shown() {
        let before = RgbImage::from_pixel(4, 2, Rgb([100, 100, 100]));
        let mut now = before.clone();
        now.put_pixel(1, 1, Rgb([100, 100 - TOLERANCE - 1, 100]));
        now.put_pixel(3, 0, Rgb([100 + TOLERANCE, 100, 100]));
        assert!((failing(&before, &now) - 0.125).abs() < 1e-9, "one pixel of eight");
        let all = beside(&before, &now);
        assert_eq!(all.dimensions(), (12 + 2 * GAP, 2), "three pictures and two gaps");
        let difference = all.get_pixel(8 + 2 * GAP + 1, 1);
        assert_eq!(difference.0, [0, MAGNIFIED * (TOLERANCE + 1), 0], "the difference, magnified");
    }
}
