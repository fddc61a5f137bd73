//! A mesh on the device.

use super::WindowError;
use super::chunks::{Chunk, Chunked};
use super::frame::FrameUniform;
use super::gpu::{Gpu, fitting};
use super::layouts::Layouts;
use super::parts::Parts;
use super::textures::Uploader;
use super::tone::finite;
use crate::at_pixels::Part;
use crate::display::DisplayMesh;
use bytemuck::{Pod, Zeroable};
use glam::{Mat3, Vec4};
use glossy_ext::Rgb;
use wgpu::util::DeviceExt;

/// The near plane, as a share of the scene's diagonal: closer than anyone goes to a wall, and depth does not mind.
const NEAR: f32 = 1e-4;

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

/// What light at pixels needs beside it.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Oriented {
    normal: [f32; 3],
    color: [f32; 3],
    leaf: u32,
}

pub(super) const VERTEX_ATTRIBUTES: [wgpu::VertexAttribute; 5] =
    wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Float32x3, 3 => Float32x3, 4 => Float32x2];
pub(super) const GLOSSY_ATTRIBUTES: [wgpu::VertexAttribute; 1] = wgpu::vertex_attr_array![5 => Float32x3];
pub(super) const ORIENTED_ATTRIBUTES: [wgpu::VertexAttribute; 3] =
    wgpu::vertex_attr_array![5 => Float32x3, 6 => Float32x3, 7 => Uint32];

/// A part of one of the lists.
pub(super) struct ListBuffers {
    pub(super) vertices: wgpu::Buffer,
    /// What else there is of each vertex, if anything is: its glossy radiance, or what light at pixels needs.
    pub(super) beside: Option<wgpu::Buffer>,
    pub(super) indices: wgpu::Buffer,
    pub(super) chunks: Vec<Chunk>,
    /// Samples that light at pixels is made of.
    pub(super) samples: Option<wgpu::BindGroup>,
}

/// Everything of a mesh that lives on the device.
pub(super) struct SceneBuffers {
    pub(super) diffuse: Vec<ListBuffers>,
    pub(super) glossy: Vec<ListBuffers>,
    pub(super) sampled: Vec<ListBuffers>,
    /// Kinds of lobes that its samples are reflected by ([`AtPixels::kinds`](crate::at_pixels::AtPixels::kinds)).
    pub(super) kinds: u32,
    /// Per texture.
    pub(super) materials: Vec<wgpu::BindGroup>,
    pub(super) frame: wgpu::Buffer,
    pub(super) frame_group: wgpu::BindGroup,
    pub(super) near: f32,
}

impl SceneBuffers {
    /// Uploads a checked mesh, split into its lists.
    pub(super) fn new(gpu: &Gpu, layouts: &Layouts, mesh: &DisplayMesh, parts: &Parts) -> Result<Self, WindowError> {
        let device = &gpu.device;
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
        let diagonal = mesh.diagonal();
        let diffuse = parts.diffuse.iter().map(|part| ListBuffers::new(gpu, mesh, part)).collect::<Result<_, _>>()?;
        let glossy = parts.glossy.iter().map(|part| ListBuffers::new(gpu, mesh, part)?.with_radiance(gpu, part));
        let glossy = glossy.collect::<Result<_, _>>()?;
        let mut sampled = Vec::new();
        if let (Some(light), Some(layouts)) = (&parts.at_pixels, &layouts.sampled) {
            let reflectors = storage(gpu, "reflectors", &light.reflectors);
            for (lists, samples) in &parts.sampled {
                let group = samples_group(gpu, &layouts.samples, samples, &reflectors);
                for part in lists {
                    let list = ListBuffers::new(gpu, mesh, part)?;
                    sampled.push(list.with_samples(gpu, mesh, part, &light.colors, &group)?);
                }
            }
        }
        Ok(Self {
            diffuse,
            glossy,
            sampled,
            kinds: parts.at_pixels.as_ref().map_or(0, |light| light.kinds),
            materials,
            frame,
            frame_group,
            near: if diagonal > 0.0 { NEAR * diagonal } else { NEAR },
        })
    }
}

impl ListBuffers {
    fn new(gpu: &Gpu, mesh: &DisplayMesh, part: &Chunked) -> Result<Self, WindowError> {
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
        let vertices: Vec<Vertex> = part.list.vertices.iter().map(vertex).collect();
        Ok(Self {
            vertices: filled(gpu, "vertices", &vertices, wgpu::BufferUsages::VERTEX)?,
            beside: None,
            indices: filled(gpu, "indices", &part.list.indices, wgpu::BufferUsages::INDEX)?,
            chunks: part.chunks.clone(),
            samples: None,
        })
    }

    /// With room for a radiance per vertex.
    fn with_radiance(self, gpu: &Gpu, part: &Chunked) -> Result<Self, WindowError> {
        let bytes = (part.list.vertices.len() * size_of::<Rgb>()) as u64;
        let beside = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("glossy radiance"),
            size: fitting(bytes, gpu.capacity().buffer)?,
            usage: wgpu::BufferUsages::VERTEX | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        Ok(Self { beside: Some(beside), ..self })
    }

    /// With what its light at pixels is made of.
    fn with_samples(
        self,
        gpu: &Gpu,
        mesh: &DisplayMesh,
        part: &Chunked,
        colors: &[Rgb],
        group: &wgpu::BindGroup,
    ) -> Result<Self, WindowError> {
        let oriented = part.list.vertices.iter().zip(&part.list.leaves).map(|(&v, &leaf)| Oriented {
            normal: mesh.normals[v as usize].to_array(),
            color: colors.get(v as usize).copied().map_or([1.0; 3], |color| finite(color).to_array()),
            leaf,
        });
        let oriented: Vec<Oriented> = oriented.collect();
        let beside = filled(gpu, "orientation", &oriented, wgpu::BufferUsages::VERTEX)?;
        Ok(Self { beside: Some(beside), samples: Some(group.clone()), ..self })
    }

    /// Makes it what is drawn next.
    pub(super) fn bind(&self, pass: &mut wgpu::RenderPass<'_>) {
        pass.set_vertex_buffer(0, self.vertices.slice(..));
        if let Some(beside) = &self.beside {
            pass.set_vertex_buffer(1, beside.slice(..));
        }
        if let Some(samples) = &self.samples {
            pass.set_bind_group(2, samples, &[]);
        }
        pass.set_index_buffer(self.indices.slice(..), wgpu::IndexFormat::Uint32);
    }

    /// Uploads the radiances of its vertices.
    pub(super) fn set_radiance(&self, gpu: &Gpu, radiance: &[Rgb]) {
        if let Some(beside) = &self.beside {
            gpu.queue.write_buffer(beside, 0, bytemuck::cast_slice(radiance));
        }
    }
}

/// A buffer with these contents.
fn filled<T: Pod>(
    gpu: &Gpu,
    label: &'static str,
    contents: &[T],
    usage: wgpu::BufferUsages,
) -> Result<wgpu::Buffer, WindowError> {
    fitting(size_of_val(contents) as u64, gpu.capacity().buffer)?;
    let contents = bytemuck::cast_slice(contents);
    Ok(gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: Some(label), contents, usage }))
}

/// The same for what pixels read, whose size has been looked at; never without anything, for that cannot be bound.
fn storage<T: Pod>(gpu: &Gpu, label: &'static str, contents: &[T]) -> wgpu::Buffer {
    let nothing = [T::zeroed()];
    let contents = bytemuck::cast_slice(if contents.is_empty() { &nothing } else { contents });
    let usage = wgpu::BufferUsages::STORAGE;
    gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: Some(label), contents, usage })
}

/// What pixels read of some leaves.
fn samples_group(
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
    samples: &Part,
    reflectors: &wgpu::Buffer,
) -> wgpu::BindGroup {
    let leaves = storage(gpu, "leaves", &samples.leaves);
    let runs = storage(gpu, "runs", &samples.runs);
    let arrivals = storage(gpu, "arrivals", &samples.arrivals);
    let buffers = [&leaves, &runs, &arrivals, reflectors];
    let entries = (0..)
        .zip(buffers)
        .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() });
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("samples"),
        layout,
        entries: &entries.collect::<Vec<_>>(),
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
