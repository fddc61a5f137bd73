//! Shaders, and the layouts of what they read: the same for all scenes and output formats.

use super::gpu::Gpu;

/// What all scenes and output formats share.
#[derive(Clone)]
pub(super) struct Layouts {
    pub(super) frame: wgpu::BindGroupLayout,
    pub(super) material: wgpu::BindGroupLayout,
    /// Without and with a texture.
    pub(super) scene: [wgpu::PipelineLayout; 2],
    pub(super) shader: wgpu::ShaderModule,
    /// For light at pixels, where the device can.
    pub(super) sampled: Option<SampledLayouts>,
}

/// The same where samples are reflected at the pixel.
#[derive(Clone)]
pub(super) struct SampledLayouts {
    pub(super) samples: wgpu::BindGroupLayout,
    pub(super) scene: [wgpu::PipelineLayout; 2],
    pub(super) shader: wgpu::ShaderModule,
}

impl Layouts {
    pub(super) fn new(gpu: &Gpu) -> Self {
        let device = &gpu.device;
        let frame = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("frame"),
            entries: &[uniform_entry(0, wgpu::ShaderStages::VERTEX_FRAGMENT)],
        });
        let material = material_layout(device);
        let layout = |groups: &[Option<&wgpu::BindGroupLayout>]| {
            device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some("scene"),
                bind_group_layouts: groups,
                immediate_size: 0,
            })
        };
        let scene = [layout(&[Some(&frame)]), layout(&[Some(&frame), Some(&material)])];
        let sampled = gpu.capacity().storage.map(|_| {
            let samples = samples_layout(device);
            SampledLayouts {
                scene: [
                    layout(&[Some(&frame), None, Some(&samples)]),
                    layout(&[Some(&frame), Some(&material), Some(&samples)]),
                ],
                samples,
                shader: device.create_shader_module(wgpu::ShaderModuleDescriptor {
                    label: Some("samples"),
                    source: wgpu::ShaderSource::Wgsl([SCENE, SAMPLES].concat().into()),
                }),
            }
        });
        let shader = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("scene"),
            source: wgpu::ShaderSource::Wgsl(SCENE.into()),
        });
        Self { frame, material, scene, shader, sampled }
    }
}

const SCENE: &str = include_str!("scene.wgsl");
const SAMPLES: &str = include_str!("samples.wgsl");

fn uniform_entry(binding: u32, visibility: wgpu::ShaderStages) -> wgpu::BindGroupLayoutEntry {
    wgpu::BindGroupLayoutEntry {
        binding,
        visibility,
        ty: wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Uniform,
            has_dynamic_offset: false,
            min_binding_size: None,
        },
        count: None,
    }
}

fn material_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let entry =
        |binding, ty| wgpu::BindGroupLayoutEntry { binding, visibility: wgpu::ShaderStages::FRAGMENT, ty, count: None };
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("material"),
        entries: &[
            entry(
                0,
                wgpu::BindingType::Texture {
                    sample_type: wgpu::TextureSampleType::Float { filterable: true },
                    view_dimension: wgpu::TextureViewDimension::D2,
                    multisampled: false,
                },
            ),
            entry(1, wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering)),
            uniform_entry(2, wgpu::ShaderStages::FRAGMENT),
        ],
    })
}

/// Leaves, runs, arrivals, reflectors.
fn samples_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let entry = |binding| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::FRAGMENT,
        ty: wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Storage { read_only: true },
            has_dynamic_offset: false,
            min_binding_size: None,
        },
        count: None,
    };
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("samples"),
        entries: &[0, 1, 2, 3].map(entry),
    })
}
