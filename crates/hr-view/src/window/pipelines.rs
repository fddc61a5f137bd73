//! How a scene is drawn: shader, layouts, pipelines, and intermediate targets.

use super::gpu::{DEPTH, Gpu};
use super::overlay::Overlay;
use super::scene_buffers::{Frame, GLOSSY_ATTRIBUTES, SceneBuffers, VERTEX_ATTRIBUTES, Vertex};
use glossy_ext::Rgb;

/// What all scenes and output formats share.
pub(super) struct Layouts {
    pub(super) frame: wgpu::BindGroupLayout,
    pub(super) material: wgpu::BindGroupLayout,
    /// Without and with a texture.
    scene: [wgpu::PipelineLayout; 2],
    shader: wgpu::ShaderModule,
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
        Self { frame, material, scene, shader: device.create_shader_module(wgpu::include_wgsl!("scene.wgsl")) }
    }
}

/// Pipelines and intermediate targets for one output format.
pub(super) struct Pass {
    format: wgpu::TextureFormat,
    samples: u32,
    /// Without and with a texture.
    diffuse: [wgpu::RenderPipeline; 2],
    glossy: [wgpu::RenderPipeline; 2],
    overlay: Overlay,
    /// Chunks to be drawn, by their distance; kept for its memory.
    order: Vec<(f32, usize)>,
    targets: Option<Targets>,
}

/// Intermediate targets of one size.
struct Targets {
    size: [u32; 2],
    depth: wgpu::TextureView,
    /// `None` without multisampling.
    color: Option<wgpu::TextureView>,
}

impl Pass {
    pub(super) fn new(gpu: &Gpu, layouts: &Layouts, format: wgpu::TextureFormat, samples: u32) -> Self {
        let pipeline = |entry: &str,
                        fragment: &str,
                        layout: &wgpu::PipelineLayout,
                        buffers: &[Option<wgpu::VertexBufferLayout<'_>>]| {
            gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(entry),
                layout: Some(layout),
                vertex: wgpu::VertexState {
                    module: &layouts.shader,
                    entry_point: Some(entry),
                    compilation_options: wgpu::PipelineCompilationOptions::default(),
                    buffers,
                },
                primitive: wgpu::PrimitiveState {
                    cull_mode: Some(wgpu::Face::Back),
                    ..wgpu::PrimitiveState::default()
                },
                depth_stencil: Some(wgpu::DepthStencilState {
                    format: DEPTH,
                    depth_write_enabled: Some(true),
                    depth_compare: Some(wgpu::CompareFunction::Greater),
                    stencil: wgpu::StencilState::default(),
                    bias: wgpu::DepthBiasState::default(),
                }),
                multisample: wgpu::MultisampleState { count: samples, ..wgpu::MultisampleState::default() },
                fragment: Some(wgpu::FragmentState {
                    module: &layouts.shader,
                    entry_point: Some(fragment),
                    compilation_options: wgpu::PipelineCompilationOptions::default(),
                    targets: &[Some(format.into())],
                }),
                multiview_mask: None,
                cache: None,
            })
        };
        let fixed = Some(wgpu::VertexBufferLayout {
            array_stride: size_of::<Vertex>() as u64,
            step_mode: wgpu::VertexStepMode::Vertex,
            attributes: &VERTEX_ATTRIBUTES,
        });
        let following = Some(wgpu::VertexBufferLayout {
            array_stride: size_of::<Rgb>() as u64,
            step_mode: wgpu::VertexStepMode::Vertex,
            attributes: &GLOSSY_ATTRIBUTES,
        });
        let both = |list: &str, buffers: &[Option<wgpu::VertexBufferLayout<'_>>]| {
            [("plain", &layouts.scene[0]), ("textured", &layouts.scene[1])]
                .map(|(kind, layout)| pipeline(&format!("{list}_{kind}"), &format!("{kind}_fragment"), layout, buffers))
        };
        Self {
            format,
            samples,
            diffuse: both("diffuse", std::slice::from_ref(&fixed)),
            glossy: both("glossy", &[fixed.clone(), following]),
            overlay: Overlay::new(gpu, layouts, format, samples),
            order: Vec::new(),
            targets: None,
        }
    }

    /// Draws the scene and marks over it onto `output`, which has this pass's format and `size` ≥ 1 × 1.
    pub(super) fn draw(
        &mut self,
        gpu: &Gpu,
        scene: &SceneBuffers,
        encoder: &mut wgpu::CommandEncoder,
        output: &wgpu::TextureView,
        size: [u32; 2],
        frame: &Frame<'_>,
    ) {
        gpu.queue.write_buffer(&scene.frame, 0, bytemuck::bytes_of(&frame.uniform(scene.near, size, self.format)));
        if self.targets.as_ref().is_none_or(|t| t.size != size) {
            self.targets = Some(Targets {
                size,
                depth: target(gpu, size, self.samples, DEPTH),
                color: (self.samples > 1).then(|| target(gpu, size, self.samples, self.format)),
            });
        }
        let Some(targets) = &self.targets else { return };
        let (view, resolve_target) = match &targets.color {
            Some(color) => (color, Some(output)),
            None => (output, None),
        };
        let store = if resolve_target.is_some() { wgpu::StoreOp::Discard } else { wgpu::StoreOp::Store };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("scene"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view,
                depth_slice: None,
                resolve_target,
                ops: wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::BLACK), store },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &targets.depth,
                depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(0.0), store: wgpu::StoreOp::Discard }),
                stencil_ops: None,
            }),
            ..wgpu::RenderPassDescriptor::default()
        });
        let sight = frame.view.sight(frame.mesh.origin, f64::from(size[0]) / f64::from(size[1]));
        pass.set_bind_group(0, &scene.frame_group, &[]);
        for (list, pipelines, follows) in [(&scene.diffuse, &self.diffuse, false), (&scene.glossy, &self.glossy, true)]
        {
            if list.chunks.is_empty() {
                continue;
            }
            pass.set_vertex_buffer(0, list.vertices.slice(..));
            if follows {
                pass.set_vertex_buffer(1, scene.glossy_radiance.slice(..));
            }
            pass.set_index_buffer(list.indices.slice(..), wgpu::IndexFormat::Uint32);
            // The nearest first, so that what is hidden is not shaded.
            self.order.clear();
            let seen = list.chunks.iter().enumerate().filter(|(_, chunk)| chunk.may_be_seen(&sight));
            self.order.extend(seen.map(|(i, chunk)| (chunk.distance(&sight), i)));
            self.order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
            let mut last = None;
            for &(_, i) in &self.order {
                let chunk = &list.chunks[i];
                if last != Some(chunk.texture) {
                    last = Some(chunk.texture);
                    pass.set_pipeline(&pipelines[usize::from(chunk.texture.is_some())]);
                    if let Some(texture) = chunk.texture {
                        pass.set_bind_group(1, &scene.materials[texture as usize], &[]);
                    }
                }
                pass.draw_indexed(chunk.indices.clone(), 0, 0..1);
            }
        }
        self.overlay.draw(&mut pass, frame.marks);
    }
}

/// An intermediate target.
fn target(gpu: &Gpu, [width, height]: [u32; 2], sample_count: u32, format: wgpu::TextureFormat) -> wgpu::TextureView {
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("target"),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
        view_formats: &[],
    });
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}

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
