//! The window: walks through a solution.
//!
//! Nothing is computed or drawn while nothing changes. Vertex radiances are linear; exposure, curve and sRGB encoding
//! happen per pixel.

mod app;
mod gpu;
mod hud;
pub(crate) mod lists;
mod refresh;
mod scene_buffers;
mod snapshot;
mod textures;
pub(crate) mod tone;
mod view;
mod walker;

pub use snapshot::Snapshot;
pub use tone::{Curve, Tone};

use crate::display::{MeshError, Walkable};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use winit::event_loop::EventLoop;

/// How the window opens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WindowOptions {
    /// Size of the picture in logical pixels (those of a screen without scaling).
    pub size: [u32; 2],
    /// Change of direction in radians that a glossy vertex is evaluated again for; 0 is any change.
    pub tolerance: f32,
}

impl Default for WindowOptions {
    fn default() -> Self {
        Self { size: [1280, 800], tolerance: 0.0 }
    }
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

/// Opens a window and walks until it is closed. Call it on the main thread, once per process: window systems want it
/// so.
///
/// # Errors
/// [`WindowError::NoDisplay`] or [`WindowError::NoAdapter`], at once and before anything is shown, where there is no
/// screen or no graphics device; the others as they happen.
pub fn open(walk: &dyn Walkable, options: &WindowOptions) -> Result<(), WindowError> {
    walk.mesh().check()?;
    let event_loop = event_loop()?;
    let mut app = app::App::new(walk, *options);
    let ended = event_loop.run_app(&mut app);
    app.finish()?;
    ended.map_err(|error| WindowError::NoDisplay(reason(&error)))
}

/// Connects to the window system.
fn event_loop() -> Result<EventLoop<()>, WindowError> {
    // Where a library of the window system is missing, winit panics instead of saying so.
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| {}));
    let built = catch_unwind(AssertUnwindSafe(|| EventLoop::builder().build()));
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
