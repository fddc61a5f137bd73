//! The window's surface: what is drawn on it appears.

use super::WindowError;
use super::gpu::Gpu;
use std::sync::Arc;
use winit::window::Window;

/// The surface and how it is drawn on.
pub(super) struct Canvas {
    surface: wgpu::Surface<'static>,
    config: wgpu::SurfaceConfiguration,
}

/// What there is to draw on.
pub(super) enum Output {
    Image(wgpu::SurfaceTexture),
    /// Nothing for this frame; whether to ask again soon.
    Later {
        soon: bool,
    },
}

impl Canvas {
    pub(super) fn new(gpu: &Gpu, surface: wgpu::Surface<'static>, window: &Window) -> Result<Self, WindowError> {
        let config = configuration(gpu, &surface, window)?;
        let canvas = Self { surface, config };
        canvas.configure(gpu);
        Ok(canvas)
    }

    pub(super) fn format(&self) -> wgpu::TextureFormat {
        self.config.format
    }

    /// Width and height in pixels; 0 while the window is minimised.
    pub(super) fn size(&self) -> [u32; 2] {
        [self.config.width, self.config.height]
    }

    pub(super) fn resize(&mut self, gpu: &Gpu, size: [u32; 2]) {
        let limit = gpu.device.limits().max_texture_dimension_2d;
        [self.config.width, self.config.height] = size.map(|side| side.min(limit));
        self.configure(gpu);
    }

    /// Applies the configuration, unless the window is minimised.
    fn configure(&self, gpu: &Gpu) {
        if !self.size().contains(&0) {
            self.surface.configure(&gpu.device, &self.config);
        }
    }

    /// The next image to draw on.
    pub(super) fn next(&mut self, gpu: &Gpu, window: &Arc<Window>) -> Result<Output, WindowError> {
        use wgpu::CurrentSurfaceTexture as Current;
        Ok(match self.surface.get_current_texture() {
            // A suboptimal one is good enough for now; the resize that it announces brings a new configuration.
            Current::Success(output) | Current::Suboptimal(output) => Output::Image(output),
            Current::Timeout => Output::Later { soon: true },
            // The window system tells when it is seen again.
            Current::Occluded | Current::Validation => Output::Later { soon: false },
            Current::Outdated => {
                self.configure(gpu);
                Output::Later { soon: true }
            }
            Current::Lost => {
                *self = Self::new(gpu, gpu.surface(window)?, window)?;
                Output::Later { soon: true }
            }
        })
    }
}

/// How the surface is drawn on: 8 bits, encoded by our own shader where possible, as egui prefers, without tearing.
fn configuration(
    gpu: &Gpu,
    surface: &wgpu::Surface<'_>,
    window: &Window,
) -> Result<wgpu::SurfaceConfiguration, WindowError> {
    use wgpu::TextureFormat::{Bgra8Unorm, Bgra8UnormSrgb, Rgba8Unorm, Rgba8UnormSrgb};
    let size = window.inner_size();
    let formats = surface.get_capabilities(&gpu.adapter).formats;
    let wanted = [Bgra8Unorm, Rgba8Unorm, Bgra8UnormSrgb, Rgba8UnormSrgb];
    let format = wanted.into_iter().find(|f| formats.contains(f)).or_else(|| formats.first().copied());
    let limit = gpu.device.limits().max_texture_dimension_2d;
    let none = || WindowError::NoAdapter("it cannot draw on this window".into());
    let format = format.ok_or_else(none)?;
    let config = surface.get_default_config(&gpu.adapter, size.width, size.height).ok_or_else(none)?;
    Ok(wgpu::SurfaceConfiguration {
        format,
        width: size.width.min(limit),
        height: size.height.min(limit),
        present_mode: wgpu::PresentMode::AutoVsync,
        ..config
    })
}
