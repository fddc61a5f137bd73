//! Files that someone's program got wrong: small scenes of every format, mutated by bytes, words and lines, are loaded and
//! solved. Either there is a solution, its light finite and not negative, or a typed error of one line; soon, and without
//! more memory than the file is worth.
//!
//! `FUZZ_CASES` sets how many files there are of each kind, `FUZZ_FIRST` the number of the first one: a message that
//! names a case says how to see it again.

mod corpus;
mod mutate;

use corpus::{Folder, Kind};
use glossy_ext::GlossyField;
use glossy_ext::haar::Refinement;
use hr_diffuse::{Budget, GeometryError, Settings, SolveError, Solver};
use hr_scene::{Camera, Scene, SceneError};
use mutate::{Source, mutated};
use peak_alloc::PeakAlloc;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError, mpsc};
use std::time::Duration;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Memory is the process's: one case at a time.
static ALONE: Mutex<()> = Mutex::new(());

/// Files of each kind, where `FUZZ_CASES` does not say.
const CASES: u32 = 300;
/// A file is refused, or solved, by this time. A second would do; machines that test may be busy.
const SOON: Duration = Duration::from_secs(30);
/// Most memory for loading and solving: a few words of MGF may be worth millions of surfaces.
const MOST_MEMORY: usize = 4 << 30;
/// Scenes with more surfaces than this are not solved.
const MOST_SURFACES: usize = 400;

fn number(name: &str, otherwise: u32) -> u32 {
    std::env::var(name).ok().and_then(|value| value.parse().ok()).unwrap_or(otherwise)
}

/// Loads a file; tells whether there was a scene.
fn check_scene(path: &Path) -> Result<bool, String> {
    let scene = match Scene::load(&path.to_string_lossy()) {
        Ok(scene) => Arc::new(scene),
        Err(error) => return check_error(&error).map(|()| false),
    };
    if scene.warnings.iter().any(|warning| warning.text.chars().any(char::is_control)) {
        return Err(format!("a warning is more than a line: {:?}", scene.warnings));
    }
    if scene.surfaces.len() > MOST_SURFACES {
        return Ok(true);
    }
    let budget = Budget { time: Some(Duration::from_millis(50)), memory: Some(1 << 20) };
    let field = GlossyField::new(&scene.reflectors(), Refinement::default());
    let mut solver = match Solver::new(&scene.input(), Settings { budget, ..Settings::with_error(0.5) }, field) {
        Ok(solver) => solver,
        // What loading cannot see, or mend.
        Err(SolveError::NoSteadyState { .. } | SolveError::Light { .. }) => return Ok(true),
        Err(SolveError::MaterialValue { what: "exitance", .. }) => return Ok(true),
        Err(SolveError::Surface { source: GeometryError::Vanishing, .. }) => return Ok(true),
        Err(SolveError::Surface { surface, source }) => {
            return Err(format!("{source}, though it was loaded: {:?}", scene.surfaces[surface]));
        }
        Err(error) => return Err(format!("a scene that was loaded cannot be solved: {error}")),
    };
    solver.solve(&mut |_| ControlFlow::Continue(()));
    let solution = solver.finish(&mut |_| ControlFlow::Break(()));
    let light = solution.exitant.radiosity.iter().chain(&solution.exitant.irradiance);
    for light in light.chain(&solution.vertices.irradiance) {
        if !light.is_finite() || light.min_element() < 0.0 {
            return Err(format!("light of {light}"));
        }
    }
    Ok(true)
}

fn check_camera(path: &Path) -> Result<bool, String> {
    match Camera::load(path) {
        Ok(camera) if camera.direction(0.5, 0.5).is_finite() => Ok(true),
        Ok(camera) => Err(format!("it looks nowhere: {camera:?}")),
        Err(error) => check_error(&error).map(|()| false),
    }
}

fn check_error(error: &SceneError) -> Result<(), String> {
    let text = error.to_string();
    let fine = !text.is_empty() && text.len() < 1000 && !text.chars().any(char::is_control);
    if fine { Ok(()) } else { Err(format!("not a message of one line: {text:?}")) }
}

/// Mutates files of a kind and looks at what becomes of them.
fn fuzz(kind: Kind) {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let folder = Folder::new(kind);
    let first = number("FUZZ_FIRST", 0);
    let count = number("FUZZ_CASES", CASES);
    let check = if kind == Kind::Camera { check_camera } else { check_scene };
    assert_eq!(check(&folder.main()), Ok(true), "{kind:?}: what is mutated is sound");
    let mut sound = 0;
    for case in first..first.saturating_add(count) {
        let mut source = Source::new(kind as u32, case);
        let files = folder.files();
        // The file itself, mostly, or one that it refers to.
        let file = source.below(2 * files.len()).min(files.len() - 1);
        let other = source.below(files.len());
        let changed = mutated(&files[file].1, &files[other].1, &mut source);
        let what = format!("{kind:?}, FUZZ_FIRST={case} FUZZ_CASES=1, {}", files[file].0);
        folder.write(&files[file].0, &changed);
        MEMORY.reset_peak_usage();
        let before = MEMORY.current_usage();
        let (done, is_done) = mpsc::channel();
        let path = folder.main();
        let thread = std::thread::spawn(move || {
            // Nobody may be waiting any more.
            let _ = done.send(check(&path));
        });
        let result = match is_done.recv_timeout(SOON) {
            Ok(result) => result,
            Err(mpsc::RecvTimeoutError::Timeout) => panic!("{what}: it takes more than {SOON:?}"),
            Err(mpsc::RecvTimeoutError::Disconnected) => panic!("{what}: it panics: {:?}", thread.join().err()),
        };
        match result {
            Ok(is_sound) => sound += u32::from(is_sound),
            Err(fault) => panic!("{what}: {fault}"),
        }
        let memory = MEMORY.peak_usage().saturating_sub(before);
        assert!(memory < MOST_MEMORY, "{what}: {memory} bytes");
        folder.write(&files[file].0, &files[file].1);
    }
    // Neither is nothing changed nor everything broken.
    if count >= CASES {
        assert!(sound > count / 20 && sound < count - count / 20, "{kind:?}: {sound} of {count} are sound");
    }
}

#[test]
fn mgf() {
    fuzz(Kind::Mgf);
}

#[test]
fn obj() {
    fuzz(Kind::Obj);
}

#[test]
fn gltf() {
    fuzz(Kind::Gltf);
}

#[test]
fn glb() {
    fuzz(Kind::Glb);
}

#[test]
fn camera() {
    fuzz(Kind::Camera);
}
