//! The graphics device.

use super::WindowError;
use std::sync::{Arc, Mutex, PoisonError};
use wgpu::Backends;
use winit::event_loop::OwnedDisplayHandle;
use winit::window::Window;

/// Multisampling where the device can.
const SAMPLES: u32 = 4;

/// The depth buffer: floats, as reversed depth wants them.
pub(super) const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// The graphics systems to try, in order: OpenGL only where there is nothing else, for its drivers are slow to start.
const SYSTEMS: [Backends; 2] = [Backends::PRIMARY, Backends::GL];

/// Storage buffers of the shader that reflects samples, and the least size that it is worth it with.
const STORAGE_BUFFERS: u32 = 4;
const LEAST_STORAGE: u64 = 1 << 20;

/// How large a device's buffers may be, in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Capacity {
    /// Any buffer.
    pub(super) buffer: u64,
    /// What a pixel's shader reads as a whole; `None` where it reads none.
    pub(super) storage: Option<u64>,
}

/// A device with its queue, and the first error that it reported outside of any call.
pub(super) struct Gpu {
    instance: wgpu::Instance,
    pub(super) adapter: wgpu::Adapter,
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    fault: Arc<Mutex<Option<String>>>,
}

impl Gpu {
    /// The best device for pictures without a window.
    pub(super) fn new() -> Result<Self, WindowError> {
        first(|systems| Self::open(instance(systems, None), None))
    }

    /// The best device that can draw on a window, and the window's surface.
    pub(super) fn with_surface(
        window: &Arc<Window>,
        display: &OwnedDisplayHandle,
    ) -> Result<(Self, wgpu::Surface<'static>), WindowError> {
        first(|systems| {
            let instance = instance(systems, Some(display));
            let surface = surface(&instance, window)?;
            Ok((Self::open(instance, Some(&surface))?, surface))
        })
    }

    /// Another surface on the window, after the first was lost.
    pub(super) fn surface(&self, window: &Arc<Window>) -> Result<wgpu::Surface<'static>, WindowError> {
        surface(&self.instance, window)
    }

    fn open(instance: wgpu::Instance, surface: Option<&wgpu::Surface<'static>>) -> Result<Self, WindowError> {
        let options = wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            compatible_surface: surface,
            ..wgpu::RequestAdapterOptions::default()
        };
        let adapter = pollster::block_on(instance.request_adapter(&options))
            .map_err(|error| WindowError::NoAdapter(one_line(&error)))?;
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("hr-view"),
            // All that there is: a large scene needs large buffers, and nothing here has to run on lesser devices.
            required_limits: adapter.limits(),
            ..wgpu::DeviceDescriptor::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))
            .map_err(|error| WindowError::Device(one_line(&error)))?;
        let fault = Arc::new(Mutex::new(None));
        let report = |fault: &Arc<Mutex<Option<String>>>| {
            let fault = Arc::clone(fault);
            move |text: String| {
                fault.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(text);
            }
        };
        let on_error = report(&fault);
        device.on_uncaptured_error(Arc::new(move |error| on_error(one_line(&error))));
        let on_loss = report(&fault);
        device.set_device_lost_callback(move |reason, text| {
            // Dropping the device is how every session ends.
            if reason != wgpu::DeviceLostReason::Destroyed {
                on_loss(format!("the device was lost: {}", text.replace('\n', " ")));
            }
        });
        Ok(Self { instance, adapter, device, queue, fault })
    }

    /// The first error that was reported since the start, once.
    pub(super) fn fault(&self) -> Result<(), WindowError> {
        match self.fault.lock().unwrap_or_else(PoisonError::into_inner).take() {
            Some(text) => Err(WindowError::Device(text)),
            None => Ok(()),
        }
    }

    /// How large its buffers may be.
    pub(super) fn capacity(&self) -> Capacity {
        let limits = self.device.limits();
        let buffer = limits.max_buffer_size;
        let can = self.adapter.get_downlevel_capabilities().flags.contains(wgpu::DownlevelFlags::FRAGMENT_STORAGE)
            && limits.max_storage_buffers_per_shader_stage >= STORAGE_BUFFERS;
        let storage = can.then(|| limits.max_storage_buffer_binding_size.min(buffer));
        Capacity { buffer, storage: storage.filter(|&most| most >= LEAST_STORAGE) }
    }

    /// Whether the device is the processor, where every sample of a pixel costs what a pixel costs.
    pub(super) fn is_slow(&self) -> bool {
        self.adapter.get_info().device_type == wgpu::DeviceType::Cpu
    }

    /// Texture samples along the direction in which a texture is squeezed: floors are seen at grazing angles.
    pub(super) fn anisotropy(&self) -> u16 {
        if self.is_slow() { 1 } else { 16 }
    }

    /// Samples per pixel that a smooth picture in this format takes.
    pub(super) fn samples(&self, format: wgpu::TextureFormat) -> u32 {
        let can = |format| self.adapter.get_texture_format_features(format).flags;
        let resolves = can(format).contains(wgpu::TextureFormatFeatureFlags::MULTISAMPLE_RESOLVE);
        let both = [format, DEPTH].into_iter().all(|f| can(f).sample_count_supported(SAMPLES));
        if both && resolves { SAMPLES } else { 1 }
    }
}

/// The first graphics system that works; if none does, why not the first.
fn first<T>(open: impl Fn(Backends) -> Result<T, WindowError>) -> Result<T, WindowError> {
    let [best, other] = SYSTEMS;
    open(best).or_else(|error| open(other).map_err(|_| error))
}

/// A graphics system; `WGPU_BACKEND` and the like choose among several.
fn instance(systems: Backends, display: Option<&OwnedDisplayHandle>) -> wgpu::Instance {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle_from_env();
    descriptor.backends = Backends::from_env().unwrap_or(systems);
    wgpu::Instance::new(match display {
        Some(display) => descriptor.with_display_handle(Box::new(display.clone())),
        None => descriptor,
    })
}

/// A surface on the window; it keeps the window alive.
fn surface(instance: &wgpu::Instance, window: &Arc<Window>) -> Result<wgpu::Surface<'static>, WindowError> {
    instance.create_surface(Arc::clone(window)).map_err(|error| WindowError::NoAdapter(one_line(&error)))
}

/// A buffer size, if the device can hold it.
pub(super) fn fitting(size: u64, limit: u64) -> Result<u64, WindowError> {
    if size <= limit { Ok(size) } else { Err(WindowError::TooLarge { size, limit }) }
}

/// An error with its causes, in one line.
pub(super) fn one_line(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        let more = error.to_string();
        if !text.contains(&more) {
            text = format!("{text}: {more}");
        }
        cause = error.source();
    }
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
