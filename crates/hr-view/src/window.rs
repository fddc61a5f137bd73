//! The window: walks through a solution.
//!
//! Nothing is computed or drawn while nothing changes. Vertex radiances are linear; exposure, curve and sRGB encoding
//! happen per pixel.

mod app;
mod canvas;
mod chunks;
mod frame;
mod gauge;
mod gpu;
mod hud;
mod input;
mod layouts;
pub(crate) mod lists;
mod live;
mod looking;
mod offscreen;
mod overlay;
mod parts;
mod pipelines;
mod refresh;
mod scene_buffers;
mod screen;
mod shown;
mod sight;
mod snapshot;
mod textures;
pub(crate) mod tone;
mod tour;
mod view;
mod walker;

pub use offscreen::{Begun, FrameCost, Offscreen};
pub use screen::{Screen, Status, Wish};
pub use snapshot::Snapshot;
pub use tone::{Curve, Tone};

use crate::camera_path::CameraPath;
use crate::display::{DisplayMesh, MeshError, Walkable};
use glam::DVec3;
use glossy_ext::Rgb;
use hr_scene::Camera;
use screen::News;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::Sender;
use winit::event_loop::EventLoop;

/// How the window opens.
#[derive(Clone, Debug)]
pub struct WindowOptions {
    /// What the title says before there is a solution.
    pub name: String,
    /// Size of the picture in logical pixels (those of a screen without scaling).
    pub size: [u32; 2],
    /// Change of direction in radians that a glossy vertex is evaluated again for; 0 is any change.
    pub tolerance: f32,
    /// A walk to play; where it is empty, that of the solution is played.
    pub path: CameraPath,
    /// The file that walks are recorded to; by default they go to numbered files of the current folder.
    pub path_file: Option<PathBuf>,
    /// Who hears what is wanted of the solution; by default nobody.
    pub wishes: Option<Sender<Wish>>,
}

impl Default for WindowOptions {
    fn default() -> Self {
        Self {
            name: String::new(),
            size: [1280, 800],
            tolerance: 0.0,
            path: CameraPath::default(),
            path_file: None,
            wishes: None,
        }
    }
}

/// What was done until the window was closed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Walked {
    /// Frames drawn.
    pub frames: u64,
    /// Glossy vertices evaluated.
    pub evaluated: u64,
}

/// Why there is no window, or no window any more.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum WindowError {
    /// There is no screen to open a window on. Draw frames instead.
    #[error("no window can be opened here ({0}); run in a graphical session, or use --frames or --image")]
    NoDisplay(String),
    /// There is no graphics device. Draw frames instead.
    #[error("no graphics device for the window ({0}); install a Vulkan or OpenGL driver, or use --frames or --image")]
    NoAdapter(String),
    /// The graphics device failed.
    #[error("the graphics device failed: {0}; close other programs that use it, or use --frames or --image")]
    Device(String),
    /// Mesh or picture do not fit the graphics device.
    #[error("the graphics device holds at most {limit} of {size} bytes or pixels; ask for a coarser solution or less")]
    TooLarge {
        /// What is needed.
        size: u64,
        /// What there is.
        limit: u64,
    },
    /// The mesh is broken.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// A picture could not be saved.
    #[error("{path}: {reason}; choose a folder that can be written to", path = path.display())]
    Save {
        /// Where to.
        path: PathBuf,
        /// What the system says.
        reason: String,
    },
}

/// Opens a window on a solution and walks until it is closed. Call it on the main thread, once per process: window
/// systems want it so.
///
/// # Errors
/// [`WindowError::NoDisplay`] or [`WindowError::NoAdapter`], at once and before anything is shown, where there is no
/// screen or no graphics device; the others as they happen.
pub fn open(walk: Arc<dyn Walkable>, options: &WindowOptions) -> Result<Walked, WindowError> {
    walk.mesh().check()?;
    open_live(options, move |screen| {
        // It has been checked.
        drop(screen.show(walk));
    })
}

/// Opens a window without anything in it yet. Once it is there, `start` is told the screen to show solutions on; it must
/// return soon, having started a thread that solves. Call it on the main thread, once per process.
///
/// # Errors
/// Like [`open`]; where they are errors of opening the window, `start` has not been called.
pub fn open_live(options: &WindowOptions, start: impl FnOnce(Screen) + 'static) -> Result<Walked, WindowError> {
    let event_loop = event_loop()?;
    let mut app = app::App::new(options.clone(), Box::new(start), event_loop.create_proxy());
    let ended = event_loop.run_app(&mut app);
    let walked = app.finish()?;
    ended.map_err(|error| WindowError::NoDisplay(reason(&error)))?;
    Ok(walked)
}

/// What is shown before there is a solution: nothing.
#[derive(Debug)]
struct Blank {
    name: String,
    mesh: DisplayMesh,
}

impl Blank {
    fn new(name: &str) -> Self {
        Self { name: name.to_owned(), mesh: DisplayMesh::default() }
    }
}

impl Walkable for Blank {
    fn name(&self) -> &str {
        &self.name
    }
    fn mesh(&self) -> &DisplayMesh {
        &self.mesh
    }
    fn cameras(&self) -> &[(String, Camera)] {
        &[]
    }
    fn glossy_radiance(&self, _: DVec3, _: &[u32], out: &mut [Rgb]) {
        out.fill(Rgb::ZERO);
    }
}

/// The first numbered file of the current folder that is not there yet.
fn unused(stem: &str, extension: &str) -> Option<PathBuf> {
    (1..).map(|n| PathBuf::from(format!("{stem}-{n:03}.{extension}"))).find(|path| !path.exists())
}

/// A path as the user finds it.
fn full(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf())
}

/// Connects to the window system.
fn event_loop() -> Result<EventLoop<News>, WindowError> {
    // Where a library of the window system is missing, winit panics instead of saying so.
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| {}));
    let built = catch_unwind(AssertUnwindSafe(|| EventLoop::with_user_event().build()));
    std::panic::set_hook(hook);
    match built {
        Ok(Ok(event_loop)) => Ok(event_loop),
        Ok(Err(error)) => Err(WindowError::NoDisplay(reason(&error))),
        Err(panic) => {
            let text = panic.downcast_ref::<String>().map(String::as_str);
            let text = text.or_else(|| panic.downcast_ref::<&str>().copied());
            Err(WindowError::NoDisplay(text.unwrap_or("the window system could not be reached").replace('\n', " ")))
        }
    }
}

/// What the window system says, without the place in winit's source that it begins with.
fn reason(error: &dyn std::error::Error) -> String {
    let text = gpu::one_line(error);
    let after = text.split_once(".rs:").map(|(_, rest)| rest.trim_start_matches(|c: char| c.is_ascii_digit()));
    after.map_or(text.as_str(), |rest| rest.trim_start_matches(": ")).trim_end_matches('.').to_owned()
}
