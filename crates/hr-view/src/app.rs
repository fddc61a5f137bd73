//! The program: load, solve, show.

use crate::ViewError;
use crate::args::Args;
use crate::camera_path::CameraPath;
use crate::export::{self, Format};
use crate::glossy::Mode;
use crate::html;
use crate::interrupt::{Interrupt, STOPPING};
use crate::loading::load;
use crate::metering;
use crate::progress::Progress;
use crate::raycast::{RayCaster, Spared};
use crate::session;
use crate::solution_file;
use crate::solved::{Accuracy, Purpose, Solved, Wanted};
use crate::stats::{self, Times};
use crate::window::WindowError;
use hr_diffuse::{Budget, Phase, Settings};
use hr_scene::{Camera, Exposure, Film, ImageKind, Rgb, Scene, SceneError, ToneMap};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// Frames of the walkthrough.
const FRAMES: usize = 60;
/// Size of frames, unless a camera of the command line has another one.
const FRAME_SIZE: [u32; 2] = [640, 400];
/// Rays per pixel of frames, squared.
const FRAME_GRID: u32 = 2;
/// Frames share one exposure: that of so many places along the way.
const METERED: usize = 12;

/// Where frames go when there is no window and nobody said where.
const FALLBACK_FRAMES: &str = "hr-view-frames";

/// How a solution is to be shown.
enum Output {
    Window,
    Image(PathBuf),
    Frames(PathBuf),
    Html(PathBuf),
    Export(PathBuf, Format),
}

impl Output {
    /// What the command line asks for; refuses what could not be written before anything is computed.
    fn of(args: &Args) -> Result<Self, ViewError> {
        for path in [&args.stats, &args.save].into_iter().flatten() {
            has_folder(path)?;
        }
        if let Some(path) = &args.image {
            ImageKind::of(path)?;
            has_folder(path)?;
            return Ok(Self::Image(path.clone()));
        }
        if let Some(path) = &args.html {
            has_folder(path)?;
            return Ok(Self::Html(path.clone()));
        }
        if let Some(path) = &args.export {
            let format = Format::of(path)?;
            has_folder(path)?;
            return Ok(Self::Export(path.clone(), format));
        }
        if let Some(folder) = &args.frames {
            make_folder(folder)?;
            return Ok(Self::Frames(folder.clone()));
        }
        Ok(Self::Window)
    }

    /// How glossy light is shown best in it: pixel by pixel in a single picture, or else in a way that follows the eye at little cost. A
    /// table shows none.
    fn mode(&self) -> Mode {
        match self {
            Self::Image(_) | Self::Export(_, Format::Csv) => Mode::Samples,
            Self::Frames(_) | Self::Html(_) | Self::Export(..) | Self::Window => Mode::Distributions,
        }
    }

    /// Where all of its pictures are taken from, a table has none; `None` where that is not known before.
    fn cameras(&self, scene: &Scene, args: &Args, path: &CameraPath) -> Option<Vec<Camera>> {
        match self {
            Self::Image(_) => Some(vec![scene.default_camera()]),
            Self::Frames(_) => Some(walk(scene, args, path, FRAMES)),
            Self::Export(_, Format::Csv) => Some(Vec::new()),
            Self::Html(_) | Self::Export(..) | Self::Window => None,
        }
    }
}

/// Cameras along the way of frames: of the size that the command line says, if it does.
fn walk(scene: &Scene, args: &Args, path: &CameraPath, count: usize) -> Vec<Camera> {
    if !path.is_empty() {
        return path.cameras(count);
    }
    let [width, height] = FRAME_SIZE;
    let cameras = scene.walkthrough(count).into_iter();
    cameras.map(|camera| if args.camera.is_some() { camera } else { Camera { width, height, ..camera } }).collect()
}

/// Whether a file can be written there: its folder is one, and it is none itself.
fn has_folder(path: &Path) -> Result<(), SceneError> {
    let fault = |text: String| SceneError::Io { path: path.to_path_buf(), source: std::io::Error::other(text) };
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    match std::fs::metadata(folder) {
        Ok(found) if !found.is_dir() => Err(fault(format!("{} is a file; name a folder", folder.display()))),
        Ok(_) if path.is_dir() => Err(fault("this is a folder; give a file name".into())),
        Ok(_) => Ok(()),
        Err(error) => Err(fault(format!("the folder {}: {error}; make it first, or name another", folder.display()))),
    }
}

fn make_folder(folder: &Path) -> Result<(), SceneError> {
    let fault = |source: std::io::Error| match source.kind() {
        ErrorKind::AlreadyExists => std::io::Error::other("this is a file; give a folder"),
        _ => source,
    };
    std::fs::create_dir_all(folder)
        .map_err(|source| SceneError::Io { path: folder.to_path_buf(), source: fault(source) })
}

/// What there is to show, and how.
struct Show<'a> {
    args: &'a Args,
    mode: Mode,
    solved: &'a Solved,
    accuracy: Accuracy,
    progress: &'a Progress,
    /// Time that loading took, and when showing began.
    loaded: Duration,
    begin: Duration,
}

/// Does what the command line says.
///
/// # Errors
/// Anything that keeps it from being done; the text is one line for the user.
pub fn run(args: &Args) -> Result<(), ViewError> {
    let output = Output::of(args)?;
    let progress = Arc::new(Progress::new());
    if let Some(threads) = args.threads {
        // For all of the process: the window's thread cannot be one of a pool of its own.
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
        pool.map_err(|error| ViewError::Arguments(format!("--threads {threads}: {error}; ask for fewer")))?;
    }
    // The window records to a file that is not there yet.
    let path = args.path.as_deref().filter(|path| path.exists() || !matches!(output, Output::Window));
    let path = path.map(CameraPath::load).transpose()?.unwrap_or_default();
    let (output, why) = match output {
        Output::Window => match session::window(args, &path, &progress) {
            Ok(()) => return Ok(()),
            Err(ViewError::Window(error @ (WindowError::NoDisplay(_) | WindowError::NoAdapter(_)))) => {
                (Output::Frames(FALLBACK_FRAMES.into()), Some(error))
            }
            Err(error) => return Err(error),
        },
        output => (output, None),
    };
    let mode = args.mode.unwrap_or_else(|| output.mode());
    let scene = load(args, &progress)?;
    if let Some(why) = why {
        progress.say(&format!("{why}; writing frames to {FALLBACK_FRAMES} instead"));
    }
    let loaded = progress.elapsed();
    let (solved, accuracy) = match &args.load {
        Some(path) => solution_file::load(path, scene)?,
        None => {
            let begun = args.resume.as_deref().map(|path| solution_file::load(path, Arc::clone(&scene))).transpose()?;
            // What is kept is for every mode, and for all who may look at it.
            let cameras = output.cameras(&scene, args, &path).filter(|_| args.save.is_none());
            let distributions = mode == Mode::Distributions || args.save.is_some();
            let purpose = Purpose { distributions, cameras: cameras.as_deref() };
            solve(scene, begun, args, purpose, &progress)?
        }
    };
    if let Some(path) = &args.save {
        progress.at("keeping the solution", 0.0);
        solution_file::save(path, &solved, accuracy)?;
    }
    let begin = progress.elapsed();
    let show = Show { args, mode, solved: &solved, accuracy, progress: &progress, loaded, begin };
    match output {
        Output::Image(file) => show.image(&file),
        Output::Html(file) => show.html(&file),
        Output::Export(file, _) => show.export(&file),
        Output::Frames(folder) => show.frames(&folder, &path),
        Output::Window => Ok(()),
    }
}

/// Solves for the light, or goes on with what was begun, to the accuracy asked for, or until the time is up or the user has
/// seen enough. Also tells how exact the solution is.
fn solve(
    scene: Arc<Scene>,
    begun: Option<(Solved, Accuracy)>,
    args: &Args,
    purpose: Purpose<'_>,
    progress: &Progress,
) -> Result<(Solved, Accuracy), ViewError> {
    let interrupt = Interrupt::listen();
    let mut stopped = false;
    let ask = &mut |state: &hr_diffuse::Progress| {
        progress.solving(state);
        if interrupt.is_raised() && !stopped && state.phase != Phase::Reconstruct {
            progress.say(STOPPING);
            stopped = true;
        }
        if stopped { Wanted::Now } else { Wanted::Whole }
    };
    let time = args.time_budget.map(|budget| Duration::from_secs_f64(budget).saturating_sub(progress.elapsed()));
    let budget = Budget { time, ..Budget::default() };
    let settings = Settings { error: args.error, budget, transport: args.transport };
    Ok(match begun {
        Some((solved, accuracy)) => solved.resumed(settings, purpose, accuracy, ask)?,
        None => Solved::awaited(scene, settings, purpose, ask)?,
    })
}

impl Show<'_> {
    fn image(&self, path: &Path) -> Result<(), ViewError> {
        let scene = &self.solved.scene;
        let watch = |share| self.progress.at("taking the picture", share);
        let (caster, camera) = (self.caster(), scene.default_camera());
        let film = match ImageKind::of(path)? {
            ImageKind::Png => caster.film(&camera, &watch),
            ImageKind::Pfm | ImageKind::Exr => Film::new(caster.render(&camera, &watch), Vec::new()),
        };
        self.warn_if_black(film.image.pixels.iter().all(|pixel| *pixel == Rgb::ZERO));
        film.save(path, &ToneMap::default(), scene.primaries)?;
        self.write_stats(caster.spared())
    }

    fn html(&self, path: &Path) -> Result<(), ViewError> {
        self.progress.at("writing the page", 0.0);
        html::write(self.solved, path)?;
        self.write_stats(Spared::default())
    }

    fn export(&self, path: &Path) -> Result<(), ViewError> {
        self.progress.at("writing the solution", 0.0);
        export::write(self.solved, path)?;
        self.write_stats(Spared::default())
    }

    /// Numbered PNG files, all exposed alike.
    fn frames(&self, folder: &Path, path: &CameraPath) -> Result<(), ViewError> {
        make_folder(folder)?;
        let scene = &self.solved.scene;
        let caster = self.caster().with_grid(FRAME_GRID);
        let exposure = metering::exposure(self.solved, self.mode, &walk(scene, self.args, path, METERED));
        self.warn_if_black(exposure.is_none());
        let tone_map = ToneMap { exposure: Exposure::Factor(exposure.unwrap_or(1.0)), ..ToneMap::default() };
        for (number, camera) in walk(scene, self.args, path, FRAMES).into_iter().enumerate() {
            let watch = |share| self.progress.at("writing frames", (number as f32 + share) / FRAMES as f32);
            let film = caster.film(&camera, &watch);
            film.save(&folder.join(format!("frame-{number:04}.png")), &tone_map, scene.primaries)?;
        }
        self.progress.say(&format!("{FRAMES} frames written to {}", folder.display()));
        self.write_stats(caster.spared())
    }

    /// Where nothing shines at all, that has been said.
    fn warn_if_black(&self, is_black: bool) {
        if is_black && !self.solved.scene.is_dark() {
            self.progress.say(
                "warning: all is black: nothing that is lit is in view; give --camera a view of it, and see whether lamps are \
                 enclosed or surfaces face away",
            );
        }
    }

    fn caster(&self) -> RayCaster<'_> {
        RayCaster::new(&self.solved.scene, &self.solved.solution, self.mode)
    }

    /// What `--stats` asks for, up to now.
    fn write_stats(&self, spared: Spared) -> Result<(), ViewError> {
        let Some(path) = &self.args.stats else { return Ok(()) };
        let now = self.progress.elapsed();
        let times =
            Times { load: self.loaded.as_secs_f64(), show: (now - self.begin).as_secs_f64(), total: now.as_secs_f64() };
        stats::write(path, self.solved, self.accuracy, &times, spared)
    }
}
