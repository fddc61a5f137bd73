//! Between those who solve and the window: pictures and news come in, wishes go out.

use super::gpu::Capacity;
use super::parts::Parts;
use super::tone::Tone;
use crate::camera_path::CameraPath;
use crate::display::{MeshError, Walkable};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use winit::event_loop::EventLoopProxy;

/// What the one at the window wants of the solution.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Wish {
    /// Half the error.
    Finer,
    /// Twice the error.
    Coarser,
    /// Wait with what is being done, or go on with it.
    Pause,
    /// No more of it: show what there is.
    Stop,
    /// A material that shines so many times as much.
    Emission {
        /// Index of the material.
        material: u32,
        /// Times what it is now, > 0.
        factor: f32,
    },
    /// A material whose gloss is so many times as wide.
    Roughness {
        /// Index of the material.
        material: u32,
        /// Times what it is now, > 0.
        factor: f32,
    },
}

/// How far the solution is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Status {
    /// What is being done, such as "refining links"; `None` where all is done.
    pub activity: Option<String>,
    /// Share of it that is done, 0…1.
    pub fraction: f32,
    /// Relative error that is asked for.
    pub asked: f32,
    /// Relative error that the solution in the window is believed to have; `None` where there is none yet.
    pub shown: Option<f32>,
    /// Whether it waits until it may go on.
    pub paused: bool,
}

/// A solution, ready for the device.
pub(super) struct Prepared {
    pub(super) walk: Arc<dyn Walkable>,
    pub(super) parts: Parts,
    /// Whether its glossy light was wanted at pixels.
    pub(super) wants_pixels: bool,
    pub(super) tone: Tone,
    pub(super) tour: CameraPath,
}

impl Prepared {
    /// Everything that can be done without the device.
    pub(super) fn new(walk: Arc<dyn Walkable>, capacity: Capacity, wants_pixels: bool) -> Result<Self, MeshError> {
        let mesh = walk.mesh();
        mesh.check()?;
        let parts = Parts::new(walk.as_ref(), capacity, wants_pixels);
        Ok(Self { parts, wants_pixels, tone: Tone::for_start(walk.as_ref()), tour: walk.tour(), walk })
    }
}

/// What the window is told.
pub(super) enum News {
    Show(Box<Prepared>),
    Status(Status),
    Message(String),
    Close,
}

/// The window as those see it who solve. Nobody minds if it has been closed meanwhile.
#[derive(Clone, Debug)]
pub struct Screen {
    proxy: EventLoopProxy<News>,
    capacity: Capacity,
    /// Whether glossy light is wanted the other way round than the solution prefers it.
    is_turned: Arc<AtomicBool>,
}

impl Screen {
    pub(super) fn new(proxy: EventLoopProxy<News>, capacity: Capacity, is_turned: Arc<AtomicBool>) -> Self {
        Self { proxy, capacity, is_turned }
    }

    /// Shows a solution instead of the one before. The eye stays where it is. What can be computed without the device is
    /// computed on the calling thread.
    ///
    /// # Errors
    /// Where the mesh is broken; the window then goes on with what it had.
    pub fn show(&self, walk: Arc<dyn Walkable>) -> Result<(), MeshError> {
        let wants_pixels = walk.prefers_pixels() != self.is_turned.load(Ordering::Relaxed);
        let prepared = Prepared::new(walk, self.capacity, wants_pixels)?;
        self.send(News::Show(Box::new(prepared)));
        Ok(())
    }

    /// Tells how far the solution is. Every call draws a frame: call it a few times per second.
    pub fn status(&self, status: Status) {
        self.send(News::Status(status));
    }

    /// Shows a message for some seconds.
    pub fn say(&self, message: impl Into<String>) {
        self.send(News::Message(message.into()));
    }

    /// Closes the window.
    pub fn close(&self) {
        self.send(News::Close);
    }

    fn send(&self, news: News) {
        drop(self.proxy.send_event(news));
    }
}
