//! How a scene is drawn: pipelines, and intermediate targets.

use super::frame::Frame;
use super::gauge::Quantity;
use super::gpu::{DEPTH, Gpu};
use super::layouts::Layouts;
use super::overlay::Overlay;
use super::scene_buffers::{GLOSSY_ATTRIBUTES, ORIENTED_ATTRIBUTES, Oriented, SceneBuffers, VERTEX_ATTRIBUTES, Vertex};
use glossy_ext::Rgb;

/// Pipelines and intermediate targets for one output format.
pub(super) struct Pass {
    layouts: Layouts,
    format: wgpu::TextureFormat,
    samples: u32,
    /// Those of the last frame.
    pipelines: Option<Pipelines>,
    overlay: Overlay,
    /// Distances of the chunks to be drawn, and which they are of which list; kept for its memory.
    order: Vec<(f32, usize, usize)>,
    targets: Option<Targets>,
}

/// Intermediate targets of one size.
struct Targets {
    size: [u32; 2],
    depth: wgpu::TextureView,
    /// `None` without multisampling.
    color: Option<wgpu::TextureView>,
}

/// For each list, without and with a texture.
struct Pipelines {
    /// What of shaders is fixed: false colours, and kinds of lobes.
    fixed: (bool, u32),
    diffuse: [wgpu::RenderPipeline; 2],
    glossy: [wgpu::RenderPipeline; 2],
    /// For light at pixels, where the device can.
    sampled: Option<[wgpu::RenderPipeline; 2]>,
}

impl Pipelines {
    fn new(
        gpu: &Gpu,
        layouts: &Layouts,
        format: wgpu::TextureFormat,
        samples: u32,
        (false_colors, kinds): (bool, u32),
    ) -> Self {
        // Software devices compute both sides of a condition, whatever it is.
        let flag = |is_set: bool| if is_set { 1.0 } else { 0.0 };
        // Where smooth edges take too long outlines of senders do, too: on a processor they double the time of a frame.
        let outlines = ("OUTLINES", flag(samples > 1));
        let constants = [("FALSE_COLORS", flag(false_colors)), ("KINDS", f64::from(kinds)), outlines];
        let pipeline = |shader: &wgpu::ShaderModule,
                        constants: &[(&str, f64)],
                        entry: &str,
                        fragment: &str,
                        layout: &wgpu::PipelineLayout,
                        buffers: &[Option<wgpu::VertexBufferLayout<'_>>]| {
            let options = wgpu::PipelineCompilationOptions { constants, ..Default::default() };
            gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(entry),
                layout: Some(layout),
                vertex: wgpu::VertexState {
                    module: shader,
                    entry_point: Some(entry),
                    compilation_options: options.clone(),
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
                    module: shader,
                    entry_point: Some(fragment),
                    compilation_options: options.clone(),
                    targets: &[Some(format.into())],
                }),
                multiview_mask: None,
                cache: None,
            })
        };
        let whole = Some(wgpu::VertexBufferLayout {
            array_stride: size_of::<Vertex>() as u64,
            step_mode: wgpu::VertexStepMode::Vertex,
            attributes: &VERTEX_ATTRIBUTES,
        });
        let beside = |stride: usize, attributes| {
            Some(wgpu::VertexBufferLayout {
                array_stride: stride as u64,
                step_mode: wgpu::VertexStepMode::Vertex,
                attributes,
            })
        };
        let following = beside(size_of::<Rgb>(), &GLOSSY_ATTRIBUTES);
        let oriented = beside(size_of::<Oriented>(), &ORIENTED_ATTRIBUTES);
        let both = |list: &str, buffers: &[Option<wgpu::VertexBufferLayout<'_>>]| {
            [("plain", &layouts.scene[0]), ("textured", &layouts.scene[1])].map(|(kind, layout)| {
                pipeline(
                    &layouts.shader,
                    &constants[..1],
                    &format!("{list}_{kind}"),
                    &format!("{kind}_fragment"),
                    layout,
                    buffers,
                )
            })
        };
        let sampled = layouts.sampled.as_ref().map(|sampled| {
            [("plain", &sampled.scene[0]), ("textured", &sampled.scene[1])].map(|(kind, layout)| {
                let fragment = format!("sampled_{kind}_fragment");
                pipeline(&sampled.shader, &constants, "sampled", &fragment, layout, &[whole.clone(), oriented.clone()])
            })
        });
        Self {
            fixed: (false_colors, kinds),
            diffuse: both("diffuse", std::slice::from_ref(&whole)),
            glossy: both("glossy", &[whole.clone(), following]),
            sampled,
        }
    }
}

impl Pass {
    pub(super) fn new(gpu: &Gpu, layouts: &Layouts, format: wgpu::TextureFormat, samples: u32) -> Self {
        Self {
            layouts: layouts.clone(),
            format,
            samples,
            pipelines: None,
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
        let fixed = (frame.gauge.quantity != Quantity::Picture, scene.kinds);
        let pipelines = match self.pipelines.take().filter(|pipelines| pipelines.fixed == fixed) {
            Some(pipelines) => pipelines,
            None => Pipelines::new(gpu, &self.layouts, self.format, self.samples, fixed),
        };
        let pipelines = &*self.pipelines.insert(pipelines);
        let diffuse = scene.diffuse.iter().map(|list| (list, &pipelines.diffuse));
        let glossy = scene.glossy.iter().map(|list| (list, &pipelines.glossy));
        let sampled = scene.sampled.iter().filter_map(|list| Some((list, pipelines.sampled.as_ref()?)));
        let lists: Vec<_> = diffuse.chain(glossy).chain(sampled).collect();
        // The nearest first, so that what is hidden is not shaded.
        self.order.clear();
        for (at, (list, _)) in lists.iter().enumerate() {
            let seen = list.chunks.iter().enumerate().filter(|(_, chunk)| chunk.may_be_seen(&sight));
            self.order.extend(seen.map(|(i, chunk)| (chunk.distance(&sight), at, i)));
        }
        self.order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let (mut last_list, mut last_texture) = (None, None);
        for &(_, at, i) in &self.order {
            let (list, pipelines) = lists[at];
            let chunk = &list.chunks[i];
            if last_list != Some(at) {
                (last_list, last_texture) = (Some(at), None);
                list.bind(&mut pass);
            }
            if last_texture != Some(chunk.texture) {
                last_texture = Some(chunk.texture);
                pass.set_pipeline(&pipelines[usize::from(chunk.texture.is_some())]);
                if let Some(texture) = chunk.texture {
                    pass.set_bind_group(1, &scene.materials[texture as usize], &[]);
                }
            }
            pass.draw_indexed(chunk.indices.clone(), 0, 0..1);
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
