//! Pictures without a screen: screenshots, and frames drawn by the device without a window.

use super::WindowError;
use super::frame::Frame;
use super::gauge::Gauge;
use super::gpu::{Gpu, one_line};
use super::layouts::Layouts;
use super::parts::Parts;
use super::pipelines::Pass;
use super::scene_buffers::SceneBuffers;
use super::shown::Shown;
use super::tone::Tone;
use super::view::View;
use crate::display::Walkable;
use hr_scene::whole_file::write_whole;
use hr_scene::{Camera, SceneError};
use image::ImageEncoder;
use std::io;
use std::path::Path;

/// Format of pictures in memory.
pub(super) const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;

/// A texture to draw a picture on and to read it back from.
pub(super) fn target(gpu: &Gpu, [width, height]: [u32; 2]) -> Result<wgpu::Texture, WindowError> {
    let limit = gpu.device.limits().max_texture_dimension_2d;
    if width > limit || height > limit {
        return Err(WindowError::TooLarge { size: width.max(height).into(), limit: limit.into() });
    }
    Ok(gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("snapshot"),
        size: wgpu::Extent3d { width: width.max(1), height: height.max(1), depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: FORMAT,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    }))
}

/// An 8-bit sRGB picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Snapshot {
    /// Width in pixels, ≥ 1.
    pub width: u32,
    /// Height in pixels, ≥ 1.
    pub height: u32,
    /// `4 · width · height` bytes RGBA, row 0 on top.
    pub rgba: Vec<u8>,
}

impl Snapshot {
    /// Draws what a camera sees with the graphics device, the same picture as the window's, without a window.
    ///
    /// # Errors
    /// [`WindowError::NoAdapter`] without a graphics device, [`WindowError::Mesh`] for a mesh that does not
    /// [check](crate::display::DisplayMesh::check), [`WindowError::TooLarge`] where mesh or picture exceed the device.
    pub fn of(walk: &dyn Walkable, camera: &Camera, tone: Option<&Tone>) -> Result<Self, WindowError> {
        let mesh = walk.mesh();
        mesh.check()?;
        let gpu = Gpu::new()?;
        let layouts = Layouts::new(&gpu);
        let size = [camera.width.max(1), camera.height.max(1)];
        let view = View::of_camera(camera);
        let mut shown = Shown::new(&gpu, &layouts, walk, Parts::new(walk, gpu.capacity(), walk.prefers_pixels()))?;
        shown.follow(&gpu, walk, &view, size, 0.0);
        let tone = tone.copied().unwrap_or_else(|| Tone::for_view(walk, camera));
        let frame = Frame { view: &view, tone: &tone, mesh, gauge: Gauge::OFF, marks: &[] };
        Self::draw(&gpu, &layouts, &shown.buffers, size, &frame)
    }

    /// Draws one frame into memory.
    pub(super) fn draw(
        gpu: &Gpu,
        layouts: &Layouts,
        scene: &SceneBuffers,
        [width, height]: [u32; 2],
        frame: &Frame<'_>,
    ) -> Result<Self, WindowError> {
        let texture = target(gpu, [width, height])?;
        let size = texture.size();
        let row = (4 * width).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("snapshot"),
            size: u64::from(row) * u64::from(height),
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        Pass::new(gpu, layouts, FORMAT, gpu.samples(FORMAT)).draw(
            gpu,
            scene,
            &mut encoder,
            &view,
            [width, height],
            frame,
        );
        encoder.copy_texture_to_buffer(
            texture.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &buffer,
                layout: wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None },
            },
            size,
        );
        gpu.queue.submit([encoder.finish()]);
        let (sender, receiver) = std::sync::mpsc::channel();
        // A receiver that is gone has given up on the picture.
        buffer.map_async(wgpu::MapMode::Read, .., move |result| drop(sender.send(result)));
        gpu.device.poll(wgpu::PollType::wait_indefinitely()).map_err(|e| WindowError::Device(one_line(&e)))?;
        gpu.fault()?;
        match receiver.try_recv() {
            Ok(Ok(())) => {}
            _ => {
                return Err(WindowError::Device("the picture could not be read back".into()));
            }
        }
        let mapped = buffer.get_mapped_range(..).map_err(|e| WindowError::Device(one_line(&e)))?;
        let bytes = mapped.to_vec();
        let rgba = bytes.chunks(row as usize).flat_map(|line| &line[..4 * width as usize]).copied().collect();
        Ok(Self { width, height, rgba })
    }

    /// Writes a PNG file, whole or not at all.
    ///
    /// # Errors
    /// [`WindowError::Save`] where it cannot be written.
    pub fn save_png(&self, path: &Path) -> Result<(), WindowError> {
        let written = write_whole(path, |out| {
            let encoder = image::codecs::png::PngEncoder::new(out);
            let done = encoder.write_image(&self.rgba, self.width, self.height, image::ExtendedColorType::Rgba8);
            done.map_err(io::Error::other)
        });
        written.map_err(|error| {
            let reason = match &error {
                SceneError::Io { source, .. } => one_line(source),
                other => one_line(other),
            };
            WindowError::Save { path: path.to_path_buf(), reason }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::window::Blank;

    fn drawn(prepare: impl Fn(&Gpu), size: [u32; 2]) -> Option<Result<Snapshot, WindowError>> {
        let gpu = match Gpu::new() {
            Ok(gpu) => gpu,
            Err(error) => {
                eprintln!("skipped, no graphics device: {error}");
                return None;
            }
        };
        let (layouts, nothing) = (Layouts::new(&gpu), Blank::new("nothing"));
        let mut shown = Shown::new(&gpu, &layouts, &nothing, Parts::new(&nothing, gpu.capacity(), false))
            .expect("nothing is not too much");
        let view = View::looking(glam::DVec3::ZERO, glam::DVec3::X, glam::DVec3::Z, 60.0, 1.0);
        prepare(&gpu);
        shown.follow(&gpu, &nothing, &view, size, 0.0);
        let tone = Tone::for_mesh(nothing.mesh());
        let frame = Frame { view: &view, tone: &tone, mesh: nothing.mesh(), gauge: Gauge::OFF, marks: &[] };
        Some(Snapshot::draw(&gpu, &layouts, &shown.buffers, size, &frame))
    }

    #[test]
    fn nothing_is_black() {
        let Some(picture) = drawn(|_| (), [3, 2]) else { return };
        let picture = picture.expect("a picture of nothing");
        assert!(picture.rgba.chunks(4).all(|p| p == [0, 0, 0, 255]), "black: {:?}", picture.rgba);
    }

    #[test]
    fn a_device_that_is_lost_is_an_error() {
        let Some(picture) = drawn(|gpu| gpu.device.destroy(), [3, 2]) else { return };
        assert!(matches!(picture, Err(WindowError::Device(_))), "{picture:?}");
    }

    #[test]
    fn pictures_beyond_the_device_are_refused() {
        let Some(picture) = drawn(|_| (), [1 << 30, 1]) else { return };
        assert!(matches!(picture, Err(WindowError::TooLarge { .. })), "{picture:?}");
    }
}
