//! What is drawn over the picture: lines and surfaces of one colour each.

use super::WindowError;
use super::gpu::{DEPTH, Gpu, fitting};
use super::layouts::Layouts;
use crate::inside::Mark;
use bytemuck::{Pod, Zeroable};
use wgpu::util::DeviceExt;

/// A corner on the device.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Corner {
    at: [f32; 3],
    color: [f32; 4],
}

const ATTRIBUTES: [wgpu::VertexAttribute; 2] = wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x4];

/// How marks hide and are hidden.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Layer {
    /// Lines on surfaces, hidden by what is before them.
    OnSurfaces,
    /// Triangles in the scene.
    Solid,
    /// Lines seen through everything.
    OnTop,
}

impl Layer {
    /// In the order in which they are drawn.
    const ALL: [Self; 3] = [Self::OnSurfaces, Self::Solid, Self::OnTop];
}

/// Marks of one layer on the device.
pub(super) struct Marks {
    layer: Layer,
    corners: wgpu::Buffer,
    count: u32,
}

impl Marks {
    /// Uploads marks; `None` where there are none.
    pub(super) fn new(gpu: &Gpu, layer: Layer, marks: &[Mark]) -> Result<Option<Self>, WindowError> {
        if marks.is_empty() {
            return Ok(None);
        }
        fitting(size_of_val(marks) as u64, gpu.device.limits().max_buffer_size)?;
        let corners: Vec<Corner> =
            marks.iter().map(|mark| Corner { at: mark.at.to_array(), color: mark.color }).collect();
        let corners = gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some("marks"),
            contents: bytemuck::cast_slice(&corners),
            usage: wgpu::BufferUsages::VERTEX,
        });
        Ok(Some(Self { layer, corners, count: u32::try_from(marks.len()).unwrap_or(u32::MAX) }))
    }
}

/// Pipelines for one output format.
pub(super) struct Overlay {
    pipelines: [wgpu::RenderPipeline; 3],
}

impl Overlay {
    pub(super) fn new(gpu: &Gpu, layouts: &Layouts, format: wgpu::TextureFormat, samples: u32) -> Self {
        let shader = gpu.device.create_shader_module(wgpu::include_wgsl!("overlay.wgsl"));
        let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("overlay"),
            bind_group_layouts: &[Some(&layouts.frame)],
            immediate_size: 0,
        });
        let pipelines = Layer::ALL.map(|layer| {
            let (topology, writes, compare) = match layer {
                Layer::OnSurfaces => (wgpu::PrimitiveTopology::LineList, false, wgpu::CompareFunction::Greater),
                Layer::Solid => (wgpu::PrimitiveTopology::TriangleList, true, wgpu::CompareFunction::Greater),
                Layer::OnTop => (wgpu::PrimitiveTopology::LineList, false, wgpu::CompareFunction::Always),
            };
            gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some("overlay"),
                layout: Some(&layout),
                vertex: wgpu::VertexState {
                    module: &shader,
                    entry_point: Some("overlay_vertex"),
                    compilation_options: wgpu::PipelineCompilationOptions::default(),
                    buffers: &[Some(wgpu::VertexBufferLayout {
                        array_stride: size_of::<Corner>() as u64,
                        step_mode: wgpu::VertexStepMode::Vertex,
                        attributes: &ATTRIBUTES,
                    })],
                },
                primitive: wgpu::PrimitiveState { topology, ..wgpu::PrimitiveState::default() },
                depth_stencil: Some(wgpu::DepthStencilState {
                    format: DEPTH,
                    depth_write_enabled: Some(writes),
                    depth_compare: Some(compare),
                    stencil: wgpu::StencilState::default(),
                    bias: wgpu::DepthBiasState::default(),
                }),
                multisample: wgpu::MultisampleState { count: samples, ..wgpu::MultisampleState::default() },
                fragment: Some(wgpu::FragmentState {
                    module: &shader,
                    entry_point: Some("overlay_fragment"),
                    compilation_options: wgpu::PipelineCompilationOptions::default(),
                    targets: &[Some(wgpu::ColorTargetState {
                        format,
                        blend: Some(wgpu::BlendState::ALPHA_BLENDING),
                        write_mask: wgpu::ColorWrites::ALL,
                    })],
                }),
                multiview_mask: None,
                cache: None,
            })
        });
        Self { pipelines }
    }

    /// Draws marks in a pass whose first group is the frame.
    pub(super) fn draw(&self, pass: &mut wgpu::RenderPass<'_>, marks: &[Marks]) {
        for (layer, pipeline) in Layer::ALL.iter().zip(&self.pipelines) {
            for marks in marks.iter().filter(|marks| marks.layer == *layer) {
                pass.set_pipeline(pipeline);
                pass.set_vertex_buffer(0, marks.corners.slice(..));
                pass.draw(0..marks.count, 0..1);
            }
        }
    }
}
