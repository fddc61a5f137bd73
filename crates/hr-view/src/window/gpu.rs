//! The graphics device.

use super::WindowError;
use std::sync::{Arc, Mutex, PoisonError};

/// Multisampling where the device can.
const SAMPLES: u32 = 4;

/// The depth buffer: floats, as reversed depth wants them.
pub(super) const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// A device with its queue, and the first error that it reported outside of any call.
pub(super) struct Gpu {
    pub(super) adapter: wgpu::Adapter,
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    fault: Arc<Mutex<Option<String>>>,
}

impl Gpu {
    /// The best device that can draw on `surface`, or any device for pictures without a window.
    pub(super) fn new(
        instance: &wgpu::Instance,
        surface: Option<&wgpu::Surface<'static>>,
    ) -> Result<Self, WindowError> {
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
        Ok(Self { adapter, device, queue, fault })
    }

    /// The first error that was reported since the start, once.
    pub(super) fn fault(&self) -> Result<(), WindowError> {
        match self.fault.lock().unwrap_or_else(PoisonError::into_inner).take() {
            Some(text) => Err(WindowError::Device(text)),
            None => Ok(()),
        }
    }

    /// Samples per pixel for a target of this format.
    pub(super) fn samples(&self, format: wgpu::TextureFormat) -> u32 {
        let can = |format| self.adapter.get_texture_format_features(format).flags;
        let resolves = can(format).contains(wgpu::TextureFormatFeatureFlags::MULTISAMPLE_RESOLVE);
        let both = [format, DEPTH].into_iter().all(|f| can(f).sample_count_supported(SAMPLES));
        if both && resolves { SAMPLES } else { 1 }
    }
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
