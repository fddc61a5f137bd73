//! A mesh on the device.

use super::WindowError;
use super::chunks::{Chunk, Chunked};
use super::gauge::{DECADES, Gauge, RAMP};
use super::gpu::Gpu;
use super::overlay::Marks;
use super::pipelines::Layouts;
use super::textures::Uploader;
use super::tone::{BRIGHTEST, Tone, finite};
use super::view::View;
use crate::display::DisplayMesh;
use bytemuck::{Pod, Zeroable};
use glam::{Mat3, Vec3, Vec4};
use glossy_ext::Rgb;
use std::f32::consts::LOG2_10;
use wgpu::util::DeviceExt;

/// The near plane, as a share of the scene's diagonal: closer than anyone goes to a wall, and depth does not mind.
const NEAR: f32 = 1e-4;

/// `Frame` of the shader.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(super) struct FrameUniform {
    eye: [f32; 4],
    right: [f32; 4],
    up: [f32; 4],
    forward: [f32; 4],
    to_srgb: [[f32; 4]; 3],
    numerator: [f32; 4],
    denominator: [f32; 4],
    luminance: [f32; 4],
    scale: [f32; 4],
    ramp: [[f32; 4]; RAMP.len()],
}

/// A vertex that never changes.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Vertex {
    position: [f32; 3],
    irradiance: [f32; 3],
    tint: [f32; 3],
    emission: [f32; 3],
    uv: [f32; 2],
}

pub(super) const VERTEX_ATTRIBUTES: [wgpu::VertexAttribute; 5] =
    wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Float32x3, 3 => Float32x3, 4 => Float32x2];
pub(super) const GLOSSY_ATTRIBUTES: [wgpu::VertexAttribute; 1] = wgpu::vertex_attr_array![5 => Float32x3];

/// One of the two lists.
pub(super) struct ListBuffers {
    pub(super) vertices: wgpu::Buffer,
    pub(super) indices: wgpu::Buffer,
    pub(super) chunks: Vec<Chunk>,
}

/// Everything of a mesh that lives on the device.
pub(super) struct SceneBuffers {
    pub(super) diffuse: ListBuffers,
    pub(super) glossy: ListBuffers,
    pub(super) glossy_radiance: wgpu::Buffer,
    /// Per texture.
    pub(super) materials: Vec<wgpu::BindGroup>,
    pub(super) frame: wgpu::Buffer,
    pub(super) frame_group: wgpu::BindGroup,
    pub(super) near: f32,
}

impl SceneBuffers {
    /// Uploads a checked mesh, split into its lists.
    pub(super) fn new(
        gpu: &Gpu,
        layouts: &Layouts,
        mesh: &DisplayMesh,
        lists: &[Chunked; 2],
    ) -> Result<Self, WindowError> {
        let device = &gpu.device;
        let [diffuse, glossy] = lists;
        let frame = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("frame"),
            size: size_of::<FrameUniform>() as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let frame_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("frame"),
            layout: &layouts.frame,
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: frame.as_entire_binding() }],
        });
        let uploader = Uploader::new(gpu);
        let textures = mesh.textures.iter().map(|texture| (uploader.upload(texture), texture.transform));
        let materials = textures.map(|(texture, place)| material(device, &layouts.material, &texture, place)).collect();
        let limit = device.limits().max_buffer_size;
        let glossy_bytes = (glossy.list.vertices.len() * size_of::<Rgb>()).max(size_of::<Rgb>()) as u64;
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
            near: if diagonal > 0.0 { NEAR * diagonal } else { NEAR },
        })
    }

    /// Uploads the radiances of the glossy list.
    pub(super) fn set_glossy(&self, gpu: &Gpu, radiance: &[Rgb]) {
        gpu.queue.write_buffer(&self.glossy_radiance, 0, bytemuck::cast_slice(radiance));
    }
}

/// What one picture shows and how.
pub(super) struct Frame<'a> {
    pub(super) view: &'a View,
    pub(super) tone: &'a Tone,
    pub(super) mesh: &'a DisplayMesh,
    pub(super) gauge: Gauge,
    /// What is drawn over it.
    pub(super) marks: &'a [Marks],
}

impl Frame<'_> {
    pub(super) fn uniform(&self, near: f32, [width, height]: [u32; 2], format: wgpu::TextureFormat) -> FrameUniform {
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
            luminance: column(self.mesh.primaries.luminance_weights().as_vec3(), self.gauge.quantity.number()),
            scale: [self.gauge.high.log2() - DECADES * LOG2_10, (DECADES * LOG2_10).recip(), 0.0, 0.0],
            ramp: RAMP.map(|[r, g, b]| [r, g, b, 0.0]),
        }
    }
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
    list: &Chunked,
    limit: u64,
) -> Result<ListBuffers, WindowError> {
    fitting((list.list.vertices.len() * size_of::<Vertex>()) as u64, limit)?;
    fitting((list.list.indices.len() * size_of::<u32>()) as u64, limit)?;
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
    let vertices: Vec<Vertex> = list.list.vertices.iter().map(vertex).collect();
    let buffer = |label, contents: &[u8], usage| {
        device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: Some(label), contents, usage })
    };
    Ok(ListBuffers {
        vertices: buffer("vertices", bytemuck::cast_slice(&vertices), wgpu::BufferUsages::VERTEX),
        indices: buffer("indices", bytemuck::cast_slice(&list.list.indices), wgpu::BufferUsages::INDEX),
        chunks: list.chunks.clone(),
    })
}

/// A buffer size, if the device can hold it.
pub(super) fn fitting(size: u64, limit: u64) -> Result<u64, WindowError> {
    if size <= limit { Ok(size) } else { Err(WindowError::TooLarge { size, limit }) }
}
