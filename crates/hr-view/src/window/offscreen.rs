//! Frames without a window, one after the other, and what each costs.

use super::frame::Frame;
use super::gauge::Gauge;
use super::gpu::{Gpu, one_line};
use super::layouts::Layouts;
use super::parts::Parts;
use super::pipelines::Pass;
use super::shown::Shown;
use super::tone::Tone;
use super::view::View;
use super::{WindowError, snapshot};
use crate::display::Walkable;
use hr_scene::Camera;
use std::time::{Duration, Instant};

/// What one frame cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FrameCost {
    /// From its beginning until the device has drawn it.
    pub whole: Duration,
    /// From its beginning until the device has all that it needs: what is done outside of the rasteriser.
    pub outside: Duration,
    /// Glossy vertices on triangles that may be seen.
    pub visible: usize,
    /// Glossy vertices evaluated.
    pub evaluated: usize,
}

/// Draws frames as the window does, at one size.
pub struct Offscreen<'a> {
    walk: &'a dyn Walkable,
    gpu: Gpu,
    pass: Pass,
    shown: Shown,
    tone: Tone,
    size: [u32; 2],
    target: wgpu::TextureView,
}

impl<'a> Offscreen<'a> {
    /// For a solution, frames of a size in pixels.
    ///
    /// # Errors
    /// [`WindowError::NoAdapter`] without a graphics device, [`WindowError::Mesh`] for a mesh that does not
    /// [check](crate::display::DisplayMesh::check), [`WindowError::TooLarge`] where mesh or picture exceed the device.
    pub fn new(walk: &'a dyn Walkable, size: [u32; 2]) -> Result<Self, WindowError> {
        let mesh = walk.mesh();
        mesh.check()?;
        let gpu = Gpu::new()?;
        let layouts = Layouts::new(&gpu);
        let target = snapshot::target(&gpu, size)?.create_view(&wgpu::TextureViewDescriptor::default());
        // As in the window.
        let samples = if gpu.is_slow() { 1 } else { gpu.samples(snapshot::FORMAT) };
        let pass = Pass::new(&gpu, &layouts, snapshot::FORMAT, samples);
        let shown = Shown::new(&gpu, &layouts, walk, Parts::new(walk, gpu.capacity(), walk.prefers_pixels()))?;
        gpu.fault()?;
        Ok(Self { walk, pass, shown, tone: Tone::for_start(walk), size, target, gpu })
    }

    /// The device that draws.
    #[must_use]
    pub fn adapter(&self) -> String {
        let info = self.gpu.adapter.get_info();
        format!("{} ({:?}, {:?})", info.name, info.device_type, info.backend)
    }

    /// Bytes of buffers and textures on the device; `None` where the graphics system does not tell.
    #[must_use]
    pub fn device_bytes(&self) -> Option<u64> {
        self.gpu.device.generate_allocator_report().map(|report| report.total_allocated_bytes)
    }

    /// Draws what a camera sees; its picture's size is not looked at. `tolerance` in radians, as in
    /// [`WindowOptions`](super::WindowOptions::tolerance).
    ///
    /// # Errors
    /// Where the device fails.
    pub fn frame(&mut self, camera: &Camera, tolerance: f32) -> Result<FrameCost, WindowError> {
        let begun = self.begin(camera, tolerance);
        self.end(begun)
    }

    /// The first half of a [`frame`](Self::frame): all that is done outside of the rasteriser, which rests meanwhile.
    #[must_use]
    pub fn begin(&mut self, camera: &Camera, tolerance: f32) -> Begun {
        let begin = Instant::now();
        let view = View::of_camera(camera);
        self.shown.follow(&self.gpu, self.walk, &view, self.size, tolerance);
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let frame = Frame { view: &view, tone: &self.tone, mesh: self.walk.mesh(), gauge: Gauge::OFF, marks: &[] };
        self.pass.draw(&self.gpu, &self.shown.buffers, &mut encoder, &self.target, self.size, &frame);
        Begun { commands: encoder.finish(), begin, outside: begin.elapsed() }
    }

    /// The second half: until the device has drawn it.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn end(&mut self, begun: Begun) -> Result<FrameCost, WindowError> {
        let Begun { commands, begin, outside } = begun;
        self.gpu.queue.submit([commands]);
        let waited = self.gpu.device.poll(wgpu::PollType::wait_indefinitely());
        waited.map_err(|error| WindowError::Device(one_line(&error)))?;
        self.gpu.fault()?;
        let refreshed = self.shown.refreshed;
        Ok(FrameCost { whole: begin.elapsed(), outside, visible: refreshed.visible, evaluated: refreshed.evaluated })
    }
}

/// A frame that the device has yet to draw.
pub struct Begun {
    commands: wgpu::CommandBuffer,
    begin: Instant,
    outside: Duration,
}
