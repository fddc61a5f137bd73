//! The program: load, solve, show.

use crate::args::Args;
use crate::display::Walkable;
use crate::progress::Progress;
use crate::window::{self, WindowError, WindowOptions};
use crate::{Mode, ViewError};
use hr_scene::whole_file::write_whole;
use hr_scene::{Camera, Exposure, Image, ImageKind, Scene, SceneError, ToneMap};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Frames of the walkthrough: eight seconds at 30 frames a second.
const FRAMES: usize = 240;

/// Where frames go when there is no window and nobody said where.
const FALLBACK_FRAMES: &str = "hr-view-frames";

/// A solved scene: to walk through, and to take pictures of.
pub trait Shown: Walkable {
    /// Linear radiance as a camera sees it. `watch` is told the share that is done, from any thread.
    fn image(&self, camera: &Camera, mode: Mode, watch: &(dyn Fn(f32) + Sync)) -> Image;

    /// What `--stats` writes, `display` being the seconds that showing took.
    fn stats(&self, display: f64) -> serde_json::Value;
}

/// How a solution is to be shown.
enum Output {
    Window,
    Image(PathBuf),
    Frames(PathBuf),
}

impl Output {
    /// What the command line asks for; refuses what could not be written before anything is computed.
    fn of(args: &Args) -> Result<Self, ViewError> {
        if let Some(path) = &args.image {
            ImageKind::of(path)?;
            return Ok(Self::Image(path.clone()));
        }
        Ok(args.frames.clone().map_or(Self::Window, Self::Frames))
    }
}

/// Does what the command line says.
///
/// # Errors
/// Anything that keeps it from being done; the text is one line for the user.
pub fn run(args: &Args) -> Result<(), ViewError> {
    let output = Output::of(args)?;
    let progress = Progress::new();
    if let Some(threads) = args.threads {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
        pool.map_err(|error| ViewError::Arguments(format!("--threads {threads}: {error}; ask for fewer")))?;
    }
    let scene = load(args, &progress)?;
    let solved = solve(&scene, args, &progress)?;
    let begin = progress.elapsed();
    show(solved.as_ref(), &scene, args, &output, &progress)?;
    if let Some(path) = &args.stats {
        let stats = solved.stats((progress.elapsed() - begin).as_secs_f64());
        write_whole(path, |out| {
            serde_json::to_writer_pretty(&mut *out, &stats)?;
            writeln!(out)
        })?;
    }
    Ok(())
}

/// The scene, with the camera of the command line first.
fn load(args: &Args, progress: &Progress) -> Result<Arc<Scene>, ViewError> {
    progress.at(&format!("loading {}", args.scene), 0.0, None);
    // The camera first: it is read at once, and a mistake in it shows before the wait for a large scene.
    let camera = args.camera.as_deref().map(Camera::load).transpose()?;
    let mut scene = Scene::load(&args.scene)?;
    for warning in &scene.warnings {
        let times = if warning.count > 1 { format!(", {} times", warning.count) } else { String::new() };
        progress.say(&format!("warning: {} ({}{times})", warning.text, warning.first));
    }
    if let Some(camera) = camera {
        scene.cameras.insert(0, ("--camera".to_owned(), camera));
    } else if scene.cameras.is_empty() {
        scene.cameras.push(("default".to_owned(), scene.default_camera()));
    }
    Ok(Arc::new(scene))
}

/// Solves for the light to the accuracy asked for, or until the time is up.
fn solve(_scene: &Arc<Scene>, _args: &Args, _progress: &Progress) -> Result<Box<dyn Shown>, ViewError> {
    Err(ViewError::Arguments("this build cannot solve scenes; build hr-view with its solver".into()))
}

/// Shows a solution as asked, or as frames where no window can be opened.
fn show(solved: &dyn Shown, scene: &Scene, args: &Args, output: &Output, progress: &Progress) -> Result<(), ViewError> {
    match output {
        Output::Image(path) => image(solved, scene, args.mode, path, progress),
        Output::Frames(folder) => frames(solved, scene, args.mode, folder, progress),
        Output::Window => {
            progress.clear();
            match window::open(solved, &WindowOptions::default()) {
                Ok(()) => Ok(()),
                Err(error @ (WindowError::NoDisplay(_) | WindowError::NoAdapter(_))) => {
                    progress.say(&format!("{error}; writing frames to {FALLBACK_FRAMES} instead"));
                    frames(solved, scene, args.mode, Path::new(FALLBACK_FRAMES), progress)
                }
                Err(error) => Err(error.into()),
            }
        }
    }
}

fn image(solved: &dyn Shown, scene: &Scene, mode: Mode, path: &Path, progress: &Progress) -> Result<(), ViewError> {
    let watch = |share| progress.at("taking the picture", share, None);
    let image = solved.image(&scene.default_camera(), mode, &watch);
    image.save(path, &ToneMap::default(), scene.primaries)?;
    Ok(())
}

/// Numbered PNG files, all exposed alike: as the first one wants it.
fn frames(solved: &dyn Shown, scene: &Scene, mode: Mode, folder: &Path, progress: &Progress) -> Result<(), ViewError> {
    std::fs::create_dir_all(folder).map_err(|source| SceneError::Io { path: folder.to_path_buf(), source })?;
    let mut tone_map = ToneMap::default();
    for (number, camera) in scene.walkthrough(FRAMES).iter().enumerate() {
        let watch = |share| progress.at("writing frames", (number as f32 + share) / FRAMES as f32, None);
        let image = solved.image(camera, mode, &watch);
        if number == 0 {
            tone_map.exposure = Exposure::Factor(tone_map.factor(&image.pixels, scene.primaries));
        }
        image.save(&folder.join(format!("frame-{number:04}.png")), &tone_map, scene.primaries)?;
    }
    Ok(())
}
