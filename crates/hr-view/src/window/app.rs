//! Events in, frames out.

use super::gpu::Gpu;
use super::hud::{Facts, Hud, Settings};
use super::lists::{VertexList, split};
use super::refresh::{Refresh, Refreshed};
use super::scene_buffers::{Frame, Pass, SceneBuffers};
use super::snapshot::Snapshot;
use super::tone::Tone;
use super::view::View;
use super::walker::Walker;
use super::{WindowError, WindowOptions, reason};
use crate::display::Walkable;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};
use winit::application::ApplicationHandler;
use winit::dpi::{LogicalSize, PhysicalPosition};
use winit::event::{DeviceEvent, DeviceId, ElementState, MouseButton, MouseScrollDelta, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow};
use winit::keyboard::{Key, KeyCode, NamedKey, PhysicalKey};
use winit::window::{CursorGrabMode, Window, WindowId};

/// Turn of a captured mouse in radians per count.
const CAPTURED_TURN: f64 = 0.0022;

/// Pixels of a touchpad's scrolling that count as one notch of a wheel.
const NOTCH: f64 = 40.0;

/// Stops per press of + or −.
const STOPS: f32 = 1.0 / 3.0;

/// The keys of the cameras in order.
const CAMERA_KEYS: [KeyCode; 10] = [
    KeyCode::Digit1,
    KeyCode::Digit2,
    KeyCode::Digit3,
    KeyCode::Digit4,
    KeyCode::Digit5,
    KeyCode::Digit6,
    KeyCode::Digit7,
    KeyCode::Digit8,
    KeyCode::Digit9,
    KeyCode::Digit0,
];

/// The application as the event loop knows it: nothing before the window system is ready.
pub(super) struct App<'a> {
    walk: &'a dyn Walkable,
    options: WindowOptions,
    live: Option<Live<'a>>,
    failure: Option<WindowError>,
}

impl<'a> App<'a> {
    pub(super) fn new(walk: &'a dyn Walkable, options: WindowOptions) -> Self {
        Self { walk, options, live: None, failure: None }
    }

    /// The error that ended the walk, if any.
    pub(super) fn finish(self) -> Result<(), WindowError> {
        self.failure.map_or(Ok(()), Err)
    }

    /// Runs a step of the open window; ends the walk where it fails.
    fn step(&mut self, event_loop: &ActiveEventLoop, step: impl FnOnce(&mut Live<'a>) -> Result<Next, WindowError>) {
        let Some(live) = &mut self.live else { return };
        match step(live) {
            Ok(Next::Go) => {}
            Ok(Next::Quit) => event_loop.exit(),
            Err(error) => {
                self.failure.get_or_insert(error);
                event_loop.exit();
            }
        }
    }
}

impl ApplicationHandler for App<'_> {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        if self.live.is_some() {
            return;
        }
        match Live::new(self.walk, self.options, event_loop) {
            Ok(live) => self.live = Some(live),
            Err(error) => {
                self.failure.get_or_insert(error);
                event_loop.exit();
            }
        }
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        self.step(event_loop, |live| live.window_event(&event));
    }

    fn device_event(&mut self, event_loop: &ActiveEventLoop, _: DeviceId, event: DeviceEvent) {
        if let DeviceEvent::MouseMotion { delta: (x, y) } = event {
            self.step(event_loop, |live| {
                if live.mouse == Mouse::Captured {
                    live.walker.turn(x * CAPTURED_TURN, -y * CAPTURED_TURN);
                    live.window.request_redraw();
                }
                Ok(Next::Go)
            });
        }
    }

    fn about_to_wait(&mut self, event_loop: &ActiveEventLoop) {
        let Some(live) = &mut self.live else { return };
        let now = Instant::now();
        match live.again {
            Some(at) if at <= now => {
                live.again = None;
                live.window.request_redraw();
                event_loop.set_control_flow(ControlFlow::Wait);
            }
            Some(at) => event_loop.set_control_flow(ControlFlow::WaitUntil(at)),
            None => event_loop.set_control_flow(ControlFlow::Wait),
        }
    }

    fn exiting(&mut self, _: &ActiveEventLoop) {
        // Surface and window go before the event loop does.
        self.live = None;
    }
}

/// Whether to go on.
enum Next {
    Go,
    Quit,
}

/// What the mouse does.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Mouse {
    Free,
    /// The left button is down.
    Dragging,
    Captured,
}

/// The open window with everything that it shows.
struct Live<'a> {
    walk: &'a dyn Walkable,
    window: Arc<Window>,
    surface: wgpu::Surface<'static>,
    gpu: Gpu,
    config: wgpu::SurfaceConfiguration,
    lists: [VertexList; 2],
    scene: SceneBuffers,
    pass: Pass,
    refresh: Refresh,
    refreshed: Refreshed,
    evaluation: Duration,
    /// What the glossy radiances were computed for: the view, the picture's shape, the tolerance.
    computed_for: Option<(View, [u32; 2], f32)>,
    hud: Hud,
    settings: Settings,
    automatic: Tone,
    walker: Walker,
    camera: Option<usize>,
    mouse: Mouse,
    /// Where the cursor was last, in pixels.
    cursor: Option<PhysicalPosition<f64>>,
    /// When the last frame began, while something moves.
    last_frame: Option<Instant>,
    frame_time: Duration,
    /// When to draw again without an event.
    again: Option<Instant>,
    device: String,
}

impl<'a> Live<'a> {
    fn new(walk: &'a dyn Walkable, options: WindowOptions, event_loop: &ActiveEventLoop) -> Result<Self, WindowError> {
        let [width, height] = options.size.map(|side| side.clamp(64, 16_384));
        let attributes = Window::default_attributes()
            .with_title(format!("{} — hr-view", walk.name()))
            .with_inner_size(LogicalSize::new(width, height))
            // Shown when there is something to show: failing leaves no flash of a window behind.
            .with_visible(false);
        let window = event_loop.create_window(attributes).map_err(|e| WindowError::NoDisplay(reason(&e)))?;
        let window = Arc::new(window);
        let (gpu, surface) = Gpu::with_surface(&window, &event_loop.owned_display_handle())?;
        let config = configuration(&gpu, &surface, &window)?;
        let mesh = walk.mesh();
        let lists = split(mesh);
        let scene = SceneBuffers::new(&gpu, mesh, &lists)?;
        // Walking smoothly comes before smooth edges.
        let samples = if gpu.is_slow() { 1 } else { gpu.samples(config.format) };
        let pass = Pass::new(&gpu, &scene, config.format, samples);
        gpu.fault()?;
        let info = gpu.adapter.get_info();
        let walker = Walker::new(walk);
        let tolerance = if options.tolerance.is_finite() { options.tolerance.to_degrees().max(0.0) } else { 0.0 };
        let live = Self {
            walk,
            refresh: Refresh::new(walk, &lists[1]),
            refreshed: Refreshed::default(),
            evaluation: Duration::ZERO,
            computed_for: None,
            hud: Hud::new(&gpu, &window, config.format),
            settings: Settings { stops: 0.0, tolerance, fov_x: walker.view.fov_x },
            automatic: Tone::for_mesh(mesh),
            camera: (!walk.cameras().is_empty()).then_some(0),
            walker,
            mouse: Mouse::Free,
            cursor: None,
            last_frame: None,
            frame_time: Duration::ZERO,
            again: None,
            device: format!("{} ({:?}), samples per pixel: {samples}", info.name, info.backend),
            window,
            surface,
            gpu,
            config,
            lists,
            scene,
            pass,
        };
        live.configure();
        live.window.set_visible(true);
        live.window.request_redraw();
        Ok(live)
    }

    fn window_event(&mut self, event: &WindowEvent) -> Result<Next, WindowError> {
        let (taken, looks_different) = self.hud.event(&self.window, event);
        if looks_different && !matches!(event, WindowEvent::RedrawRequested) {
            self.window.request_redraw();
        }
        match event {
            WindowEvent::CloseRequested => return Ok(Next::Quit),
            WindowEvent::RedrawRequested => self.redraw()?,
            WindowEvent::Resized(size) => {
                let limit = self.gpu.device.limits().max_texture_dimension_2d;
                (self.config.width, self.config.height) = (size.width.min(limit), size.height.min(limit));
                self.configure();
                self.window.request_redraw();
            }
            WindowEvent::ScaleFactorChanged { .. } | WindowEvent::Occluded(false) => self.window.request_redraw(),
            WindowEvent::Focused(false) => {
                self.walker.release();
                self.set_mouse(Mouse::Free);
            }
            WindowEvent::KeyboardInput { event, is_synthetic: false, .. } if !taken || !event.state.is_pressed() => {
                let PhysicalKey::Code(code) = event.physical_key else {
                    return Ok(Next::Go);
                };
                if self.walker.key(code, event.state.is_pressed()) {
                    self.window.request_redraw();
                } else if event.state.is_pressed() {
                    return self.command(code, &event.logical_key, event.repeat);
                }
            }
            WindowEvent::MouseInput { state, button, .. } => self.mouse_button(*state, *button, taken),
            WindowEvent::CursorMoved { position, .. } => self.drag(*position),
            WindowEvent::CursorLeft { .. } if self.mouse != Mouse::Dragging => self.cursor = None,
            WindowEvent::MouseWheel { delta, .. } if !taken => {
                self.walker.change_speed(match delta {
                    MouseScrollDelta::LineDelta(_, y) => f64::from(*y),
                    MouseScrollDelta::PixelDelta(p) => p.y / NOTCH,
                });
                self.hud.say(format!("walking speed {:.3} units/s", self.walker.speed()));
                self.window.request_redraw();
            }
            _ => {}
        }
        Ok(Next::Go)
    }

    /// What a key does that does not move.
    fn command(&mut self, code: KeyCode, key: &Key, repeat: bool) -> Result<Next, WindowError> {
        match (code, key) {
            (_, Key::Named(NamedKey::Escape)) => return Ok(Next::Quit),
            // By what is printed on them: their places differ between keyboards.
            (_, Key::Character(c)) if c == "+" || c == "=" => self.settings.stops += STOPS,
            (_, Key::Character(c)) if c == "-" || c == "_" => self.settings.stops -= STOPS,
            (KeyCode::Backspace, _) => self.settings.stops = 0.0,
            _ if repeat => return Ok(Next::Go),
            (KeyCode::KeyH | KeyCode::F1, _) => self.hud.show_help = !self.hud.show_help,
            (KeyCode::KeyT, _) => self.hud.show_line = !self.hud.show_line,
            (KeyCode::KeyF | KeyCode::F12, _) => self.screenshot()?,
            (KeyCode::KeyC, _) => self.toggle_capture(),
            _ => match CAMERA_KEYS.iter().position(|&k| k == code) {
                Some(index) => self.go_to(index),
                None => return Ok(Next::Go),
            },
        }
        self.settings.stops = self.settings.stops.clamp(-30.0, 30.0);
        self.window.request_redraw();
        Ok(Next::Go)
    }

    fn go_to(&mut self, index: usize) {
        match self.walk.cameras().get(index) {
            Some((name, camera)) => {
                self.walker.view = View::of_camera(camera);
                self.settings.fov_x = self.walker.view.fov_x;
                self.camera = Some(index);
                self.hud.say(format!("camera {}: {name}", index + 1));
            }
            None => {
                let count = self.walk.cameras().len();
                self.hud.say(format!("no camera {}; the scene has {count}", index + 1));
            }
        }
    }

    fn mouse_button(&mut self, state: ElementState, button: MouseButton, taken: bool) {
        match (button, state) {
            (MouseButton::Left, ElementState::Pressed) if !taken && self.mouse == Mouse::Free => {
                self.mouse = Mouse::Dragging;
            }
            (MouseButton::Left, ElementState::Released) if self.mouse == Mouse::Dragging => {
                self.mouse = Mouse::Free;
            }
            (MouseButton::Right, ElementState::Pressed) if !taken => self.toggle_capture(),
            _ => {}
        }
    }

    /// A drag across the whole picture turns by the whole field of view, like turning one's head that far.
    fn drag(&mut self, position: PhysicalPosition<f64>) {
        let last = self.cursor.replace(position);
        if let (Mouse::Dragging, Some(last)) = (self.mouse, last) {
            let [width, height] = [self.config.width, self.config.height].map(|side| f64::from(side.max(1)));
            let turn = self.walker.view.breadth(width / height) / width;
            self.walker.turn((position.x - last.x) * turn, (last.y - position.y) * turn);
            self.window.request_redraw();
        }
    }

    fn toggle_capture(&mut self) {
        let wanted = if self.mouse == Mouse::Captured { Mouse::Free } else { Mouse::Captured };
        self.set_mouse(wanted);
    }

    fn set_mouse(&mut self, wanted: Mouse) {
        if wanted == Mouse::Captured {
            // X11 can only confine, Wayland and macOS only lock.
            let grab = self.window.set_cursor_grab(CursorGrabMode::Locked);
            if let Err(error) = grab.or_else(|_| self.window.set_cursor_grab(CursorGrabMode::Confined)) {
                self.hud.say(format!("the mouse cannot be captured here ({}); drag instead", reason(&error)));
                self.window.request_redraw();
                return;
            }
            self.window.set_cursor_visible(false);
        } else if self.mouse == Mouse::Captured {
            // Nothing is lost where the grab is gone already.
            drop(self.window.set_cursor_grab(CursorGrabMode::None));
            self.window.set_cursor_visible(true);
        }
        self.mouse = wanted;
    }

    fn tone(&self) -> Tone {
        Tone { exposure: self.automatic.exposure * self.settings.stops.exp2(), ..self.automatic }
    }

    /// Applies the configuration, unless the window is minimised.
    fn configure(&self) {
        if self.config.width > 0 && self.config.height > 0 {
            self.surface.configure(&self.gpu.device, &self.config);
        }
    }

    fn redraw(&mut self) -> Result<(), WindowError> {
        let size = [self.config.width, self.config.height];
        if size.contains(&0) {
            self.last_frame = None;
            return Ok(());
        }
        let begin = Instant::now();
        if let Some(last) = self.last_frame {
            self.walker.advance(begin - last);
            self.frame_time = begin - last;
        } else {
            // The first frame of a movement has no predecessor to measure from; a step makes the key feel at once.
            self.walker.advance(Duration::from_millis(if self.walker.is_moving() { 10 } else { 0 }));
        }
        self.walker.view.fov_x = self.settings.fov_x;
        self.refresh_glossy(size);
        let Some(output) = self.next_output()? else {
            return Ok(());
        };
        let facts = Facts {
            scene: self.walk.name(),
            camera: self.camera.and_then(|i| self.walk.cameras().get(i)).map(|(name, _)| name.as_str()),
            triangles: self.walk.mesh().triangle_count(),
            vertices: self.walk.mesh().positions.len(),
            glossy: self.walk.mesh().glossy.len(),
            evaluated: self.refreshed.evaluated,
            evaluation: self.evaluation,
            frame: self.frame_time,
            device: &self.device,
        };
        let before = self.settings;
        let layout = self.hud.layout(&self.window, &facts, &mut self.settings);
        self.again = layout.again;
        let target = output.texture.create_view(&wgpu::TextureViewDescriptor::default());
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let frame = Frame { view: &self.walker.view, tone: &self.tone(), mesh: self.walk.mesh() };
        self.pass.draw(&self.gpu, &self.scene, &mut encoder, &target, size, &frame);
        self.hud.draw(&self.gpu, &mut encoder, &target, size, layout);
        self.gpu.queue.submit([encoder.finish()]);
        self.window.pre_present_notify();
        self.gpu.queue.present(output);
        self.gpu.fault()?;
        if self.walker.is_moving() || self.settings != before {
            self.last_frame = Some(begin);
            self.window.request_redraw();
        } else {
            if self.last_frame.is_none() {
                self.frame_time = begin.elapsed();
            }
            self.last_frame = None;
        }
        Ok(())
    }

    /// Brings glossy radiances up to date where the eye, the picture's edges or the tolerance have changed.
    fn refresh_glossy(&mut self, size: [u32; 2]) {
        let wanted = (self.walker.view, size, self.settings.tolerance);
        if self.computed_for == Some(wanted) {
            return;
        }
        self.computed_for = Some(wanted);
        let begin = Instant::now();
        let view = &self.walker.view;
        let sight = view.sight(self.walk.mesh().origin, f64::from(size[0]) / f64::from(size[1]));
        let tolerance = self.settings.tolerance.to_radians();
        self.refreshed = self.refresh.update(self.walk, &self.lists[1], view.eye, &sight, tolerance);
        if self.refreshed.evaluated > 0 {
            self.scene.set_glossy(&self.gpu, self.refresh.radiance());
        }
        self.evaluation = begin.elapsed();
    }

    /// The next image to draw on; `None` where this frame is to be left out.
    fn next_output(&mut self) -> Result<Option<wgpu::SurfaceTexture>, WindowError> {
        use wgpu::CurrentSurfaceTexture as Current;
        match self.surface.get_current_texture() {
            Current::Success(output) => return Ok(Some(output)),
            Current::Suboptimal(output) => {
                // Good enough for now; the resize that it announces brings a new configuration.
                return Ok(Some(output));
            }
            Current::Timeout => self.window.request_redraw(),
            // The window system tells when it is seen again.
            Current::Occluded => {}
            Current::Outdated => {
                self.configure();
                self.window.request_redraw();
            }
            Current::Lost => {
                self.surface = self.gpu.surface(&self.window)?;
                self.config = configuration(&self.gpu, &self.surface, &self.window)?;
                self.configure();
                self.window.request_redraw();
            }
            Current::Validation => {}
        }
        self.last_frame = None;
        self.gpu.fault()?;
        Ok(None)
    }

    /// Saves what is seen, without the head-up display, beside the other screenshots in the current folder.
    fn screenshot(&mut self) -> Result<(), WindowError> {
        let size = [self.config.width, self.config.height];
        if size.contains(&0) {
            return Ok(());
        }
        self.refresh_glossy(size);
        let frame = Frame { view: &self.walker.view, tone: &self.tone(), mesh: self.walk.mesh() };
        let picture = Snapshot::draw(&self.gpu, &self.scene, size, &frame)?;
        let path = (1..).map(|n| PathBuf::from(format!("hr-view-{n:03}.png"))).find(|path| !path.exists());
        let Some(path) = path else { return Ok(()) };
        match picture.save_png(&path) {
            Ok(()) => {
                let shown = std::path::absolute(&path).unwrap_or(path);
                self.hud.say(format!("saved {}", shown.display()));
            }
            // A folder that is read-only is no reason to end the walk.
            Err(error) => self.hud.say(error.to_string()),
        }
        Ok(())
    }
}

/// How the surface is drawn on: 8 bits, encoded by our own shader where possible, as egui prefers, without tearing.
fn configuration(
    gpu: &Gpu,
    surface: &wgpu::Surface<'_>,
    window: &Window,
) -> Result<wgpu::SurfaceConfiguration, WindowError> {
    use wgpu::TextureFormat::{Bgra8Unorm, Bgra8UnormSrgb, Rgba8Unorm, Rgba8UnormSrgb};
    let size = window.inner_size();
    let formats = surface.get_capabilities(&gpu.adapter).formats;
    let wanted = [Bgra8Unorm, Rgba8Unorm, Bgra8UnormSrgb, Rgba8UnormSrgb];
    let format = wanted.into_iter().find(|f| formats.contains(f)).or_else(|| formats.first().copied());
    let limit = gpu.device.limits().max_texture_dimension_2d;
    let none = || WindowError::NoAdapter("it cannot draw on this window".into());
    let format = format.ok_or_else(none)?;
    let config = surface.get_default_config(&gpu.adapter, size.width, size.height).ok_or_else(none)?;
    Ok(wgpu::SurfaceConfiguration {
        format,
        width: size.width.min(limit),
        height: size.height.min(limit),
        present_mode: wgpu::PresentMode::AutoVsync,
        ..config
    })
}
