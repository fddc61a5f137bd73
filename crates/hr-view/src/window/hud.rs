//! Text and controls over the picture.

use super::gauge::{DECADES, Gauge, Quantity, color};
use super::gpu::Gpu;
use super::input::HELP;
use super::screen::Status;
use egui::{Align2, Color32, Frame, Margin, RichText};
use std::time::{Duration, Instant};
use winit::event::WindowEvent;
use winit::window::Window;

/// How long a message stays.
const MESSAGE: Duration = Duration::from_secs(4);

/// Size of the scale of false colours in points, and of how many bars it is made.
const LEGEND: egui::Vec2 = egui::vec2(300.0, 14.0);
const LEGEND_STEPS: u16 = 100;

/// What the lines at the top tell.
pub(super) struct Facts<'a> {
    pub(super) scene: &'a str,
    /// Name of the camera that was chosen last.
    pub(super) camera: Option<&'a str>,
    pub(super) triangles: usize,
    pub(super) vertices: usize,
    /// Vertices whose glossy light is computed, and how many of them were.
    pub(super) glossy: usize,
    pub(super) evaluated: usize,
    /// Whether glossy light is that of pixels, but for those vertices.
    pub(super) at_pixels: bool,
    /// Time of the glossy evaluation of the last frame.
    pub(super) evaluation: Duration,
    /// Time from frame to frame while something moves; before that, the time of the first frame.
    pub(super) frame: Duration,
    pub(super) device: &'a str,
    pub(super) status: &'a Status,
    /// Figures of the point that was picked.
    pub(super) inside: &'a [String],
    pub(super) gauge: Gauge,
}

/// What the help's controls change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Settings {
    /// Stops (factors of two) brighter than automatic exposure.
    pub(super) stops: f32,
    /// Change of direction in degrees that a glossy vertex is evaluated again for.
    pub(super) tolerance: f32,
    /// Horizontal field of view in degrees of a camera's own picture.
    pub(super) fov_x: f64,
}

/// egui with its state and renderer.
pub(super) struct Hud {
    context: egui::Context,
    state: egui_winit::State,
    renderer: egui_wgpu::Renderer,
    pub(super) show_lines: bool,
    pub(super) show_help: bool,
    message: Option<(String, Instant)>,
}

/// A laid-out frame of the head-up display.
pub(super) struct Layout {
    primitives: Vec<egui::ClippedPrimitive>,
    textures: egui::TexturesDelta,
    pixels_per_point: f32,
    /// When egui wants to be drawn again.
    pub(super) again: Option<Instant>,
}

impl Hud {
    pub(super) fn new(gpu: &Gpu, window: &Window, format: wgpu::TextureFormat) -> Self {
        let context = egui::Context::default();
        context.set_theme(egui::Theme::Dark);
        let largest = gpu.device.limits().max_texture_dimension_2d as usize;
        let scale = Some(window.scale_factor() as f32);
        let state = egui_winit::State::new(context.clone(), egui::ViewportId::ROOT, window, scale, None, Some(largest));
        let renderer = egui_wgpu::Renderer::new(&gpu.device, format, egui_wgpu::RendererOptions::default());
        Self { context, state, renderer, show_lines: true, show_help: false, message: None }
    }

    /// Lets egui see an event; whether it takes it for itself, and whether it looks different after it.
    pub(super) fn event(&mut self, window: &Window, event: &WindowEvent) -> (bool, bool) {
        // Its own idea of Tab, arrows and the like must not follow us while no control is shown.
        let response = self.state.on_window_event(window, event);
        (self.show_help && response.consumed, self.show_help && response.repaint)
    }

    /// Shows a message for a while.
    pub(super) fn say(&mut self, message: String) {
        self.message = Some((message, Instant::now() + MESSAGE));
    }

    /// Lays everything out; the help's controls change `settings`.
    pub(super) fn layout(&mut self, window: &Window, facts: &Facts<'_>, settings: &mut Settings) -> Layout {
        let now = Instant::now();
        self.message = self.message.take().filter(|(_, until)| *until > now);
        let input = self.state.take_egui_input(window);
        let (show_lines, message) = (self.show_lines, self.message.as_ref().map(|(text, _)| text.as_str()));
        let mut show_help = self.show_help;
        let output = self.context.run_ui(input, |ui| {
            let context = ui.ctx().clone();
            if show_lines {
                lines(&context, facts, settings);
            }
            if !facts.inside.is_empty() {
                label(&context, "inside", Align2::RIGHT_TOP, [-8.0, 8.0], &facts.inside.join("\n"));
            }
            if facts.gauge.quantity != Quantity::Picture {
                legend(&context, facts.gauge);
            }
            if let Some(text) = message {
                label(&context, "message", Align2::CENTER_BOTTOM, [0.0, -16.0], text);
            }
            if show_help {
                help(&context, facts, settings, &mut show_help);
            }
        });
        self.show_help = show_help;
        self.state.handle_platform_output(window, output.platform_output);
        let delay = output.viewport_output.get(&egui::ViewportId::ROOT).map(|o| o.repaint_delay);
        let again = delay.and_then(|delay| now.checked_add(delay));
        let fades = self.message.as_ref().map(|(_, until)| *until);
        Layout {
            primitives: self.context.tessellate(output.shapes, output.pixels_per_point),
            textures: output.textures_delta,
            pixels_per_point: output.pixels_per_point,
            again: [again, fades].into_iter().flatten().min(),
        }
    }

    /// Draws a layout over `output`.
    pub(super) fn draw(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        output: &wgpu::TextureView,
        size: [u32; 2],
        layout: Layout,
    ) {
        let Layout { primitives, mut textures, pixels_per_point, .. } = layout;
        for (id, deltas) in &textures.set {
            for delta in deltas {
                self.renderer.update_texture(&gpu.device, &gpu.queue, *id, delta);
            }
        }
        let screen = egui_wgpu::ScreenDescriptor { size_in_pixels: size, pixels_per_point };
        // Only paint callbacks give command buffers, and there are none.
        drop(self.renderer.update_buffers(&gpu.device, &gpu.queue, encoder, &primitives, &screen));
        let pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("head-up display"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: output,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations { load: wgpu::LoadOp::Load, store: wgpu::StoreOp::Store },
            })],
            ..wgpu::RenderPassDescriptor::default()
        });
        self.renderer.render(&mut pass.forget_lifetime(), &primitives, &screen);
        for id in &textures.free {
            self.renderer.free_texture(id);
        }
        // egui panics over a delta that is dropped as it is: it takes it for forgotten.
        textures.clear();
    }
}

/// A dark, half transparent box, readable over any picture.
fn backdrop() -> Frame {
    Frame::NONE.fill(Color32::from_black_alpha(170)).inner_margin(Margin::symmetric(8, 5)).corner_radius(4)
}

fn label(context: &egui::Context, id: &str, anchor: Align2, offset: [f32; 2], text: &str) {
    egui::Area::new(egui::Id::unique(id)).anchor(anchor, offset).interactable(false).show(context, |ui| {
        backdrop().show(ui, |ui| {
            ui.add(egui::Label::new(RichText::new(text).color(Color32::WHITE)).wrap_mode(egui::TextWrapMode::Extend));
        });
    });
}

fn lines(context: &egui::Context, facts: &Facts<'_>, settings: &Settings) {
    let milliseconds = facts.frame.as_secs_f64() * 1e3;
    let rate = if milliseconds > 0.0 { 1e3 / milliseconds } else { 0.0 };
    let camera = facts.camera.map(|name| format!(" · {name}")).unwrap_or_default();
    let vertices = format!(
        "glossy {} of {} vertices in {:.1} ms",
        facts.evaluated,
        facts.glossy,
        facts.evaluation.as_secs_f64() * 1e3
    );
    let glossy = match (facts.at_pixels, facts.glossy) {
        (false, _) => vertices,
        (true, 0) => "glossy at pixels".to_owned(),
        (true, _) => format!("glossy at pixels, {vertices}"),
    };
    let text = format!(
        "{}{camera}   {milliseconds:.1} ms  {rate:.0} fps   {} triangles   {glossy}   {:+.1} EV   H help\n{}",
        facts.scene,
        facts.triangles,
        settings.stops,
        solving(facts.status),
    );
    label(context, "lines", Align2::LEFT_TOP, [8.0, 8.0], text.trim_end());
}

/// How far the solution is, and how good the one that is shown.
fn solving(status: &Status) -> String {
    let percent = |share: f32| 100.0 * share;
    let shown = status.shown.map(|error| format!("shown: error about {:.1} %", percent(error)));
    let Some(activity) = &status.activity else { return shown.unwrap_or_default() };
    let paused = if status.paused { "paused, P goes on   " } else { "" };
    let shown = shown.map(|shown| format!("   {shown}")).unwrap_or_default();
    let asked = format!("error of {:.1} % asked for", percent(status.asked));
    format!("{paused}{activity}   {:.0} %   {asked}{shown}", percent(status.fraction))
}

/// The scale of false colours.
fn legend(context: &egui::Context, gauge: Gauge) {
    egui::Area::new(egui::Id::unique("legend")).anchor(Align2::LEFT_BOTTOM, [8.0, -8.0]).interactable(false).show(
        context,
        |ui| {
            backdrop().show(ui, |ui| {
                let text = |ui: &mut egui::Ui, text: String| ui.label(RichText::new(text).color(Color32::WHITE));
                text(ui, gauge.quantity.label().to_owned());
                let (place, _) = ui.allocate_exact_size(LEGEND, egui::Sense::hover());
                let width = place.width() / f32::from(LEGEND_STEPS);
                for step in 0..LEGEND_STEPS {
                    let left = place.left() + width * f32::from(step);
                    let size = egui::vec2(width + 0.5, place.height());
                    let bar = egui::Rect::from_min_size(egui::pos2(left, place.top()), size);
                    let share = (f32::from(step) + 0.5) / f32::from(LEGEND_STEPS);
                    let [r, g, b] = color(share);
                    ui.painter().rect_filled(bar, 0.0, egui::Rgba::from_rgb(r, g, b));
                }
                ui.horizontal(|ui| {
                    ui.set_width(place.width());
                    ui.columns(4, |columns| {
                        for (i, column) in (0_u8..).zip(columns) {
                            let value = gauge.high * 10_f32.powf(f32::from(i) - DECADES);
                            text(column, short(value));
                        }
                    });
                });
            });
        },
    );
}

/// A number on a scale, short.
fn short(value: f32) -> String {
    if (1e-3..1e5).contains(&value) {
        let digits = (2.0 - value.log10().floor()).clamp(0.0, 6.0);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0…6")]
        let text = format!("{value:.*}", digits as usize);
        let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
        text.to_owned()
    } else {
        format!("{value:.1e}")
    }
}

fn help(context: &egui::Context, facts: &Facts<'_>, settings: &mut Settings, open: &mut bool) {
    let window = egui::Window::new("Help").open(open).collapsible(false).resizable(false);
    window.anchor(Align2::CENTER_CENTER, [0.0, 0.0]).show(context, |ui| {
        egui::Grid::new("keys").num_columns(2).spacing([24.0, 4.0]).show(ui, |ui| {
            for (keys, action) in HELP {
                ui.label(RichText::new(keys).strong());
                ui.label(action);
                ui.end_row();
            }
        });
        ui.separator();
        egui::Grid::new("settings").num_columns(2).spacing([24.0, 4.0]).show(ui, |ui| {
            ui.label("Exposure");
            ui.add(egui::Slider::new(&mut settings.stops, -10.0..=10.0).suffix(" EV").fixed_decimals(1));
            ui.end_row();
            ui.label("Field of view");
            ui.add(egui::Slider::new(&mut settings.fov_x, 20.0..=120.0).suffix("°").fixed_decimals(0));
            ui.end_row();
            ui.label("Glossy tolerance").on_hover_text(
                "How far the direction toward the eye must turn before a glossy vertex is computed again; 0 is always.",
            );
            ui.add(egui::Slider::new(&mut settings.tolerance, 0.0..=5.0).suffix("°").fixed_decimals(2));
            ui.end_row();
        });
        ui.separator();
        ui.label(RichText::new(format!("{} vertices · {}", facts.vertices, facts.device)).weak());
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        let cases =
            [(5000.0, "5000"), (0.05, "0.05"), (1.5, "1.5"), (2e7, "2.0e7"), (1e-5, "1.0e-5"), (0.0123, "0.0123")];
        for (value, text) in cases {
            assert_eq!(short(value), text, "{value}");
        }
    }
}
