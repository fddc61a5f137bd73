//! A mesh on the device, and drawing it.

use super::WindowError;
use super::gpu::{DEPTH, Gpu};
use super::lists::VertexList;
use super::textures::Uploader;
use super::tone::{BRIGHTEST, Tone, finite};
use super::view::View;
use crate::display::{Batch, DisplayMesh};
use bytemuck::{Pod, Zeroable};
use glam::{Mat3, Vec3, Vec4};
use glossy_ext::Rgb;
use wgpu::util::DeviceExt;

/// The near plane, as a share of the scene's diagonal: closer than anyone goes to a wall, and depth does not mind.
const NEAR: f32 = 1e-4;

/// `Frame` of the shader.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct FrameUniform {
    eye: [f32; 4],
    right: [f32; 4],
    up: [f32; 4],
    forward: [f32; 4],
    to_srgb: [[f32; 4]; 3],
    numerator: [f32; 4],
    denominator: [f32; 4],
}

/// A vertex that never changes.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Vertex {
    position: [f32; 3],
    irradiance: [f32; 3],
    tint: [f32; 3],
    emission: [f32; 3],
    uv: [f32; 2],
}

const VERTEX_ATTRIBUTES: [wgpu::VertexAttribute; 5] =
    wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Float32x3, 3 => Float32x3, 4 => Float32x2];
const GLOSSY_ATTRIBUTES: [wgpu::VertexAttribute; 1] = wgpu::vertex_attr_array![5 => Float32x3];

/// One of the two lists.
struct ListBuffers {
    vertices: wgpu::Buffer,
    indices: wgpu::Buffer,
    batches: Vec<Batch>,
}

/// Everything of a mesh that lives on the device.
pub(super) struct SceneBuffers {
    diffuse: ListBuffers,
    glossy: ListBuffers,
    glossy_radiance: wgpu::Buffer,
    /// Per texture, and last a white one.
    materials: Vec<wgpu::BindGroup>,
    frame: wgpu::Buffer,
    frame_group: wgpu::BindGroup,
    layout: wgpu::PipelineLayout,
    shader: wgpu::ShaderModule,
    near: f32,
}

impl SceneBuffers {
    /// Uploads a checked mesh, split into its lists.
    pub(super) fn new(gpu: &Gpu, mesh: &DisplayMesh, lists: &[VertexList; 2]) -> Result<Self, WindowError> {
        let device = &gpu.device;
        let [diffuse, glossy] = lists;
        let frame = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("frame"),
            size: size_of::<FrameUniform>() as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let frame_layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("frame"),
            entries: &[uniform_entry(0, wgpu::ShaderStages::VERTEX_FRAGMENT)],
        });
        let frame_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("frame"),
            layout: &frame_layout,
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: frame.as_entire_binding() }],
        });
        let material_layout = material_layout(device);
        let uploader = Uploader::new(gpu);
        let textures = mesh.textures.iter().map(|texture| (uploader.upload(texture), texture.transform));
        let materials = textures.chain([(uploader.white(), Mat3::IDENTITY)]);
        let materials = materials.map(|(texture, place)| material(device, &material_layout, &texture, place)).collect();
        let limit = device.limits().max_buffer_size;
        let glossy_bytes = (glossy.vertices.len() * size_of::<Rgb>()).max(size_of::<Rgb>()) as u64;
        let diagonal = mesh.diagonal();
        Ok(Self {
            diffuse: list_buffers(device, mesh, diffuse, limit)?,
            glossy: list_buffers(device, mesh, glossy, limit)?,
            glossy_radiance: device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("glossy radiance"),
                size: fitting(glossy_bytes, limit)?,
                usage: wgpu::BufferUsages::VERTEX | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }),
            materials,
            frame,
            frame_group,
            layout: device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some("scene"),
                bind_group_layouts: &[Some(&frame_layout), Some(&material_layout)],
                immediate_size: 0,
            }),
            shader: device.create_shader_module(wgpu::include_wgsl!("scene.wgsl")),
            near: if diagonal > 0.0 { NEAR * diagonal } else { NEAR },
        })
    }

    /// Uploads the radiances of the glossy list.
    pub(super) fn set_glossy(&self, gpu: &Gpu, radiance: &[Rgb]) {
        gpu.queue.write_buffer(&self.glossy_radiance, 0, bytemuck::cast_slice(radiance));
    }
}

/// Pipelines and intermediate targets for one output format.
pub(super) struct Pass {
    format: wgpu::TextureFormat,
    samples: u32,
    diffuse: wgpu::RenderPipeline,
    glossy: wgpu::RenderPipeline,
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
    pub(super) fn new(gpu: &Gpu, scene: &SceneBuffers, format: wgpu::TextureFormat, samples: u32) -> Self {
        let pipeline = |entry: &str, buffers: &[Option<wgpu::VertexBufferLayout<'_>>]| {
            gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(entry),
                layout: Some(&scene.layout),
                vertex: wgpu::VertexState {
                    module: &scene.shader,
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
                    module: &scene.shader,
                    entry_point: Some("fragment"),
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
        Self {
            format,
            samples,
            diffuse: pipeline("diffuse_vertex", std::slice::from_ref(&fixed)),
            glossy: pipeline("glossy_vertex", &[fixed.clone(), following]),
            targets: None,
        }
    }

    /// Draws the scene onto `output`, which has this pass's format and `size` ≥ 1 × 1.
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
        pass.set_bind_group(0, &scene.frame_group, &[]);
        for (list, pipeline, follows) in [(&scene.diffuse, &self.diffuse, false), (&scene.glossy, &self.glossy, true)] {
            if list.batches.is_empty() {
                continue;
            }
            pass.set_pipeline(pipeline);
            pass.set_vertex_buffer(0, list.vertices.slice(..));
            if follows {
                pass.set_vertex_buffer(1, scene.glossy_radiance.slice(..));
            }
            pass.set_index_buffer(list.indices.slice(..), wgpu::IndexFormat::Uint32);
            let white = scene.materials.len() - 1;
            for batch in &list.batches {
                let material = batch.texture.map_or(white, |t| t as usize);
                pass.set_bind_group(1, &scene.materials[material], &[]);
                pass.draw_indexed(batch.indices.clone(), 0, 0..1);
            }
        }
    }
}

/// What one picture shows and how.
pub(super) struct Frame<'a> {
    pub(super) view: &'a View,
    pub(super) tone: &'a Tone,
    pub(super) mesh: &'a DisplayMesh,
}

impl Frame<'_> {
    fn uniform(&self, near: f32, [width, height]: [u32; 2], format: wgpu::TextureFormat) -> FrameUniform {
        let (view, tone) = (self.view, self.tone);
        let [x, y] = view.scales(f64::from(width) / f64::from(height)).map(|s| s as f32);
        let (n, d) = (tone.curve.numerator, tone.curve.denominator);
        let column = |v: Vec3, w: f32| Vec4::from((v, w)).to_array();
        FrameUniform {
            eye: column((view.eye - self.mesh.origin).as_vec3(), 0.0),
            right: column(view.right.as_vec3(), x),
            up: column(view.up.as_vec3(), y),
            forward: column(view.forward.as_vec3(), near),
            to_srgb: [0, 1, 2].map(|i| column(tone.to_srgb.col(i), 0.0)),
            numerator: [n[0], n[1], tone.exposure, BRIGHTEST],
            denominator: [d[0], d[1], d[2], if format.is_srgb() { 0.0 } else { 1.0 }],
        }
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

fn material(
    device: &wgpu::Device,
    layout: &wgpu::BindGroupLayout,
    (view, sampler): &(wgpu::TextureView, wgpu::Sampler),
    transform: Mat3,
) -> wgpu::BindGroup {
    let [u, v] = [0, 1].map(|row| Vec4::from((transform.row(row), 0.0)).to_array());
    let placement = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: Some("placement"),
        contents: bytemuck::cast_slice(&[u, v]),
        usage: wgpu::BufferUsages::UNIFORM,
    });
    device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("material"),
        layout,
        entries: &[
            wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::TextureView(view) },
            wgpu::BindGroupEntry { binding: 1, resource: wgpu::BindingResource::Sampler(sampler) },
            wgpu::BindGroupEntry { binding: 2, resource: placement.as_entire_binding() },
        ],
    })
}

fn list_buffers(
    device: &wgpu::Device,
    mesh: &DisplayMesh,
    list: &VertexList,
    limit: u64,
) -> Result<ListBuffers, WindowError> {
    fitting((list.vertices.len() * size_of::<Vertex>()) as u64, limit)?;
    fitting((list.indices.len() * size_of::<u32>()) as u64, limit)?;
    let vertex = |&v: &u32| {
        let v = v as usize;
        Vertex {
            position: mesh.positions[v].to_array(),
            irradiance: finite(mesh.irradiance[v]).to_array(),
            tint: finite(mesh.tint[v]).to_array(),
            emission: finite(mesh.emission[v]).to_array(),
            uv: mesh.uv[v].to_array(),
        }
    };
    let vertices: Vec<Vertex> = list.vertices.iter().map(vertex).collect();
    let buffer = |label, contents: &[u8], usage| {
        device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: Some(label), contents, usage })
    };
    Ok(ListBuffers {
        vertices: buffer("vertices", bytemuck::cast_slice(&vertices), wgpu::BufferUsages::VERTEX),
        indices: buffer("indices", bytemuck::cast_slice(&list.indices), wgpu::BufferUsages::INDEX),
        batches: list.batches.clone(),
    })
}

/// A buffer size, if the device can hold it.
fn fitting(size: u64, limit: u64) -> Result<u64, WindowError> {
    if size <= limit { Ok(size) } else { Err(WindowError::TooLarge { size, limit }) }
}
