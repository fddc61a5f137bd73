//! The open window: events in, frames out.

use super::canvas::{Canvas, Output};
use super::frame::Frame;
use super::gauge::Gauge;
use super::gpu::{Gpu, one_line};
use super::hud::{Facts, Hud, Settings};
use super::input::{Command, command};
use super::layouts::Layouts;
use super::looking::Looking;
use super::parts::Parts;
use super::pipelines::Pass;
use super::screen::{News, Prepared, Screen, Status, Wish};
use super::shown::Shown;
use super::snapshot::Snapshot;
use super::tone::Tone;
use super::tour::Tour;
use super::view::View;
use super::walker::Walker;
use super::{Blank, Walked, WindowError, WindowOptions, full, reason, unused};
use crate::display::Walkable;
use hr_scene::Camera;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Sender;
use std::time::{Duration, Instant};
use winit::dpi::{LogicalSize, PhysicalPosition};
use winit::event::{ElementState, MouseButton, MouseScrollDelta, WindowEvent};
use winit::event_loop::{ActiveEventLoop, EventLoopProxy};
use winit::keyboard::PhysicalKey;
use winit::window::{CursorGrabMode, Window};

/// Turn of a captured mouse in radians per count.
const CAPTURED_TURN: f64 = 0.0022;

/// Pixels of a touchpad's scrolling that count as one notch of a wheel.
const NOTCH: f64 = 40.0;

/// A mouse that is moved by no more pixels between press and release clicks.
const STILL: f64 = 3.0;

/// While the eye moves, glossy vertices wait until its direction has changed by this (radians, 1°), which nobody sees
/// then; when it comes to rest, all are made exact.
const MOVING: f32 = 0.017_453_3;

/// Glossy light is computed at pixels, unless somebody insists, where a frame is thought to take no longer than this. It
/// is measured with a picture of this size.
const LONGEST: Duration = Duration::from_millis(250);
const TRIAL: [u32; 2] = [128, 80];

/// Whether to go on.
pub(super) enum Next {
    Go,
    Quit,
}

/// What the mouse does.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Mouse {
    Free,
    /// The left button is down.
    Pressed,
    /// And the mouse has been moved since.
    Dragging,
    Captured,
}

/// The open window with everything that it shows.
pub(super) struct Live {
    window: Arc<Window>,
    gpu: Gpu,
    canvas: Canvas,
    layouts: Layouts,
    pass: Pass,
    walk: Arc<dyn Walkable>,
    shown: Shown,
    /// Whether glossy light is wanted the other way round than the solution prefers it, as who prepares solutions knows it.
    is_turned: Arc<AtomicBool>,
    /// Whether somebody has chosen himself where it is computed.
    has_chosen: bool,
    /// For what was seen from where the eye last jumped to, or somebody asked for it; held while walking.
    automatic: Tone,
    /// From there, unless that is the start.
    metered: Option<Camera>,
    gauge: Gauge,
    looking: Looking,
    hud: Hud,
    settings: Settings,
    status: Status,
    wishes: Option<Sender<Wish>>,
    walker: Walker,
    tour: Tour,
    camera: Option<usize>,
    mouse: Mouse,
    /// Where the cursor was last, in pixels.
    cursor: Option<PhysicalPosition<f64>>,
    /// Where it was when the left button went down.
    pressed: Option<PhysicalPosition<f64>>,
    /// When the last frame began, while something moves.
    last_frame: Option<Instant>,
    frame_time: Duration,
    /// When to draw again without an event.
    again: Option<Instant>,
    device: String,
    walked: Walked,
}

impl Live {
    pub(super) fn new(options: &WindowOptions, event_loop: &ActiveEventLoop) -> Result<Self, WindowError> {
        let [width, height] = options.size.map(|side| side.clamp(64, 16_384));
        let walk: Arc<dyn Walkable> = Arc::new(Blank::new(&options.name));
        let attributes = Window::default_attributes()
            .with_title(title(walk.name(), &Status::default()))
            .with_inner_size(LogicalSize::new(width, height))
            // Shown when there is something to show: failing leaves no flash of a window behind.
            .with_visible(false);
        let window = event_loop.create_window(attributes).map_err(|e| WindowError::NoDisplay(reason(&e)))?;
        let window = Arc::new(window);
        let (gpu, surface) = Gpu::with_surface(&window, &event_loop.owned_display_handle())?;
        let canvas = Canvas::new(&gpu, surface, &window)?;
        let layouts = Layouts::new(&gpu);
        // Walking smoothly comes before smooth edges.
        let samples = if gpu.is_slow() { 1 } else { gpu.samples(canvas.format()) };
        let pass = Pass::new(&gpu, &layouts, canvas.format(), samples);
        let Prepared { parts, tone, .. } = Prepared::new(Arc::clone(&walk), gpu.capacity(), false)?;
        let shown = Shown::new(&gpu, &layouts, walk.as_ref(), parts)?;
        gpu.fault()?;
        let info = gpu.adapter.get_info();
        let walker = Walker::new(walk.as_ref());
        let tolerance = if options.tolerance.is_finite() { options.tolerance.to_degrees().max(0.0) } else { 0.0 };
        let live = Self {
            hud: Hud::new(&gpu, &window, canvas.format()),
            settings: Settings { stops: 0.0, tolerance, fov_x: walker.view.fov_x },
            status: Status::default(),
            wishes: options.wishes.clone(),
            tour: Tour::new(options.path.clone(), options.path_file.clone()),
            automatic: tone,
            metered: None,
            gauge: Gauge::OFF,
            looking: Looking::default(),
            camera: None,
            walker,
            mouse: Mouse::Free,
            cursor: None,
            pressed: None,
            last_frame: None,
            frame_time: Duration::ZERO,
            again: None,
            device: format!("{} ({:?}), samples per pixel: {samples}", info.name, info.backend),
            walked: Walked::default(),
            walk,
            shown,
            is_turned: Arc::default(),
            has_chosen: false,
            window,
            gpu,
            canvas,
            layouts,
            pass,
        };
        live.window.set_visible(true);
        live.window.request_redraw();
        Ok(live)
    }

    /// What solutions are shown on.
    pub(super) fn screen(&self, proxy: EventLoopProxy<News>) -> Screen {
        Screen::new(proxy, self.gpu.capacity(), Arc::clone(&self.is_turned))
    }

    /// What was done so far.
    pub(super) fn walked(&self) -> Walked {
        self.walked
    }

    /// When to wake up without an event, if that is not now.
    pub(super) fn next_frame(&mut self) -> Option<Instant> {
        if self.again.is_some_and(|at| at <= Instant::now()) {
            self.again = None;
            self.window.request_redraw();
        }
        self.again
    }

    /// Takes what those tell who solve.
    pub(super) fn news(&mut self, news: News) -> Result<Next, WindowError> {
        match news {
            News::Show(prepared) => self.show(*prepared)?,
            News::Status(status) => {
                self.window.set_title(&title(self.walk.name(), &status));
                self.status = status;
            }
            News::Message(text) => self.hud.say(text),
            News::Close => return Ok(Next::Quit),
        }
        self.window.request_redraw();
        Ok(Next::Go)
    }

    fn show(&mut self, prepared: Prepared) -> Result<(), WindowError> {
        let Prepared { walk, parts, wants_pixels, tone, tour } = prepared;
        let is_first = self.walk.mesh().positions.is_empty();
        match Shown::new(&self.gpu, &self.layouts, walk.as_ref(), parts) {
            Ok(shown) => self.shown = shown,
            // What there is may still be walked through.
            Err(error @ WindowError::TooLarge { .. }) if !is_first => {
                self.hud.say(error.to_string());
                return Ok(());
            }
            Err(error) => return Err(error),
        }
        self.automatic = self.metered.as_ref().map_or(tone, |camera| Tone::for_view(walk.as_ref(), camera));
        self.walker.enter(walk.as_ref(), is_first);
        if is_first {
            self.settings.fov_x = self.walker.view.fov_x;
            self.camera = (!walk.cameras().is_empty()).then_some(0);
        }
        if self.tour.is_empty() {
            self.tour.suggest(tour);
        }
        self.window.set_title(&title(walk.name(), &self.status));
        self.walk = walk;
        if wants_pixels && !self.has_chosen && self.shown.left.is_some() {
            let frame = self.frame_at_pixels()?;
            if frame > LONGEST {
                self.set_pixels(false)?;
                let seconds = frame.as_secs_f64();
                self.hud
                    .say(format!("at pixels a frame takes {seconds:.1} s here: glossy light at vertices, K insists"));
            } else if is_first {
                self.tell_of_pixels();
            }
        } else if wants_pixels && is_first {
            self.tell_of_pixels();
        }
        self.gauge.high = self.gauge.quantity.high(self.walk.mesh());
        self.looking.update(&self.gpu, self.walk.as_ref())
    }

    /// Shows glossy light at pixels instead of vertices, or the other way round.
    fn turn_pixels(&mut self) -> Result<(), WindowError> {
        let wants_pixels = self.shown.left.is_none();
        self.has_chosen = true;
        self.set_pixels(wants_pixels)?;
        if wants_pixels {
            self.tell_of_pixels();
        } else {
            self.hud.say("glossy light at vertices".to_owned());
        }
        Ok(())
    }

    fn set_pixels(&mut self, wants_pixels: bool) -> Result<(), WindowError> {
        let parts = Parts::new(self.walk.as_ref(), self.gpu.capacity(), wants_pixels);
        self.is_turned.store(wants_pixels != self.walk.prefers_pixels(), Ordering::Relaxed);
        self.shown = Shown::new(&self.gpu, &self.layouts, self.walk.as_ref(), parts)?;
        Ok(())
    }

    /// How long a frame takes with the light that is at pixels, by a small picture of what is seen now.
    fn frame_at_pixels(&mut self) -> Result<Duration, WindowError> {
        let texture = self.gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("trial"),
            size: wgpu::Extent3d { width: TRIAL[0], height: TRIAL[1], depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: self.canvas.format(),
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
            view_formats: &[],
        });
        let target = texture.create_view(&wgpu::TextureViewDescriptor::default());
        let (tone, mut took) = (self.tone(), Duration::ZERO);
        let frame = Frame {
            view: &self.walker.view,
            tone: &tone,
            mesh: self.walk.mesh(),
            gauge: Gauge::OFF,
            marks: self.looking.marks(),
        };
        // The first one makes the device compile its shaders.
        for _ in 0..2 {
            let begin = Instant::now();
            let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            self.pass.draw(&self.gpu, &self.shown.buffers, &mut encoder, &target, TRIAL, &frame);
            self.gpu.queue.submit([encoder.finish()]);
            let waited = self.gpu.device.poll(wgpu::PollType::wait_indefinitely());
            waited.map_err(|error| WindowError::Device(one_line(&error)))?;
            took = begin.elapsed();
        }
        let pixels = |[width, height]: [u32; 2]| f64::from(width) * f64::from(height);
        Ok(took.mul_f64((pixels(self.canvas.size()) / pixels(TRIAL)).max(1.0)))
    }

    /// Says what has become of the wish for glossy light at pixels.
    fn tell_of_pixels(&mut self) {
        self.hud.say(match &self.shown.left {
            None if self.gpu.capacity().storage.is_none() => {
                "this device cannot compute glossy light at pixels; it stays at vertices".to_owned()
            }
            None => "nothing here has glossy light at pixels; it stays at vertices".to_owned(),
            Some(left) if left.is_empty() => "glossy light at each pixel".to_owned(),
            Some(left) => format!("glossy light at each pixel, but at vertices on {}", left.join(", ")),
        });
    }

    pub(super) fn window_event(&mut self, event: &WindowEvent) -> Result<Next, WindowError> {
        let (taken, looks_different) = self.hud.event(&self.window, event);
        if looks_different && !matches!(event, WindowEvent::RedrawRequested) {
            self.window.request_redraw();
        }
        match event {
            WindowEvent::CloseRequested => return Ok(Next::Quit),
            WindowEvent::RedrawRequested => self.redraw()?,
            WindowEvent::Resized(size) => {
                self.canvas.resize(&self.gpu, [size.width, size.height]);
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
                    self.tour.take_over();
                    self.window.request_redraw();
                } else if event.state.is_pressed()
                    && let Some(command) = command(code, &event.logical_key, event.repeat)
                {
                    return self.command(command);
                }
            }
            WindowEvent::MouseInput { state, button, .. } => self.mouse_button(*state, *button, taken)?,
            WindowEvent::CursorMoved { position, .. } => self.drag(*position),
            WindowEvent::CursorLeft { .. } if matches!(self.mouse, Mouse::Free | Mouse::Captured) => self.cursor = None,
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
    fn command(&mut self, command: Command) -> Result<Next, WindowError> {
        let stops = self.settings.stops;
        match command {
            Command::Leave if self.looking.leave() => self.look()?,
            Command::Leave => return Ok(Next::Quit),
            Command::Expose(more) => self.settings.stops = (stops + more).clamp(-30.0, 30.0),
            Command::AutomaticExposure => {
                self.settings.stops = 0.0;
                self.meter();
            }
            Command::Help => self.hud.show_help = !self.hud.show_help,
            Command::Lines => self.hud.show_lines = !self.hud.show_lines,
            Command::Screenshot => self.screenshot()?,
            Command::Capture => self.toggle_capture(),
            Command::Camera(index) => self.go_to(index),
            Command::Solve(wish) => self.wish(wish),
            Command::Record => {
                let camera = self.walker.view.camera(self.canvas.size());
                let said = self.tour.record(Instant::now(), camera);
                self.hud.say(said);
            }
            Command::Emission(factor) => self.edit(|material| Wish::Emission { material, factor }),
            Command::Roughness(factor) => self.edit(|material| Wish::Roughness { material, factor }),
            Command::Links => {
                self.looking.toggle_links();
                self.look()?;
            }
            Command::Elements => {
                self.looking.toggle_elements();
                self.look()?;
            }
            Command::Clusters => {
                let said = self.looking.next_clusters(self.walk.as_ref());
                self.hud.say(said);
                self.look()?;
            }
            Command::Gauge => {
                let quantity = self.gauge.quantity.next();
                self.gauge = Gauge { quantity, high: quantity.high(self.walk.mesh()) };
            }
            Command::Pixels => self.turn_pixels()?,
            Command::Play => {
                let said = self.tour.play(Instant::now());
                self.hud.say(said);
            }
        }
        self.window.request_redraw();
        Ok(Next::Go)
    }

    /// Draws what is seen of the inside anew.
    fn look(&mut self) -> Result<(), WindowError> {
        self.window.request_redraw();
        self.looking.update(&self.gpu, self.walk.as_ref())
    }

    /// Passes on what is wanted of the solution.
    fn wish(&mut self, wish: Wish) {
        let heard = self.wishes.as_ref().is_some_and(|wishes| wishes.send(wish).is_ok());
        if !heard {
            self.hud.say("nobody solves here".to_owned());
        }
    }

    /// Wants another material where a point was picked.
    fn edit(&mut self, wish: impl FnOnce(u32) -> Wish) {
        match self.looking.material() {
            Some(material) => self.wish(wish(material)),
            None => self.hud.say("click what is to be changed first".to_owned()),
        }
    }

    fn go_to(&mut self, index: usize) {
        match self.walk.cameras().get(index) {
            Some((name, camera)) => {
                self.tour.take_over();
                self.walker.view = View::of_camera(camera);
                self.settings.fov_x = self.walker.view.fov_x;
                self.camera = Some(index);
                self.hud.say(format!("camera {}: {name}", index + 1));
                self.meter();
            }
            None => {
                let count = self.walk.cameras().len();
                self.hud.say(format!("no camera {}; the scene has {count}", index + 1));
            }
        }
    }

    fn mouse_button(&mut self, state: ElementState, button: MouseButton, taken: bool) -> Result<(), WindowError> {
        match (button, state, self.mouse) {
            (MouseButton::Left, ElementState::Pressed, Mouse::Free) if !taken => {
                self.mouse = Mouse::Pressed;
                self.pressed = self.cursor;
            }
            (MouseButton::Left, ElementState::Released, Mouse::Pressed) => {
                self.mouse = Mouse::Free;
                self.pick()?;
            }
            (MouseButton::Left, ElementState::Released, Mouse::Dragging) => self.mouse = Mouse::Free,
            (MouseButton::Right, ElementState::Pressed, _) if !taken => self.toggle_capture(),
            _ => {}
        }
        Ok(())
    }

    /// Looks inside the point under the cursor.
    fn pick(&mut self) -> Result<(), WindowError> {
        let Some(cursor) = self.cursor else { return Ok(()) };
        let size = self.canvas.size();
        self.looking.pick(self.walker.view.eye, self.walker.view.direction([cursor.x, cursor.y], size));
        self.look()
    }

    /// The mouse was moved by so many counts, wherever the cursor is.
    pub(super) fn mouse_moved(&mut self, (x, y): (f64, f64)) {
        if self.mouse == Mouse::Captured {
            self.turn(x * CAPTURED_TURN, -y * CAPTURED_TURN);
        }
    }

    /// A drag across the whole picture turns by the whole field of view, like turning one's head that far.
    fn drag(&mut self, position: PhysicalPosition<f64>) {
        let last = self.cursor.replace(position);
        let moved = |from: PhysicalPosition<f64>| (position.x - from.x).hypot(position.y - from.y);
        if self.mouse == Mouse::Pressed && self.pressed.is_none_or(|from| moved(from) > STILL) {
            self.mouse = Mouse::Dragging;
        }
        if let (Mouse::Dragging, Some(last)) = (self.mouse, last) {
            let [width, height] = self.canvas.size().map(|side| f64::from(side.max(1)));
            let turn = self.walker.view.breadth(width / height) / width;
            self.turn((position.x - last.x) * turn, (last.y - position.y) * turn);
        }
    }

    /// Turns by angles in radians to the right and up.
    fn turn(&mut self, right: f64, rise: f64) {
        self.tour.take_over();
        self.walker.turn(right, rise);
        self.window.request_redraw();
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

    /// Exposes for what is seen now.
    fn meter(&mut self) {
        let camera = self.walker.view.camera(self.canvas.size());
        self.automatic = Tone::for_view(self.walk.as_ref(), &camera);
        self.metered = Some(camera);
    }

    fn tone(&self) -> Tone {
        Tone { exposure: self.automatic.exposure * self.settings.stops.exp2(), ..self.automatic }
    }

    /// The scale of false colours; what is brighter in the picture is higher on it.
    fn gauge(&self) -> Gauge {
        Gauge { high: self.gauge.high / self.settings.stops.exp2(), ..self.gauge }
    }

    /// Moves the eye on to where it is now.
    fn advance(&mut self, now: Instant) {
        if let Some(camera) = self.tour.camera(now) {
            self.walker.view = View::of_camera(&camera);
            self.settings.fov_x = self.walker.view.fov_x;
        }
        if let Some(last) = self.last_frame {
            self.walker.advance(now - last);
            self.frame_time = now - last;
        } else {
            // The first frame of a movement has no predecessor to measure from; a step makes the key feel at once.
            self.walker.advance(Duration::from_millis(if self.walker.is_moving() { 10 } else { 0 }));
        }
        self.walker.view.fov_x = self.settings.fov_x;
        let (view, size) = (&self.walker.view, self.canvas.size());
        self.tour.note(now, || view.camera(size));
    }

    fn redraw(&mut self) -> Result<(), WindowError> {
        let size = self.canvas.size();
        if size.contains(&0) {
            self.last_frame = None;
            return Ok(());
        }
        let begin = Instant::now();
        self.advance(begin);
        self.follow(size);
        let output = match self.canvas.next(&self.gpu, &self.window)? {
            Output::Image(output) => output,
            Output::Later { soon } => {
                if soon {
                    self.window.request_redraw();
                }
                self.last_frame = None;
                return self.gpu.fault();
            }
        };
        let (mesh, gauge) = (self.walk.mesh(), self.gauge());
        let facts = Facts {
            scene: self.walk.name(),
            camera: self.camera.and_then(|i| self.walk.cameras().get(i)).map(|(name, _)| name.as_str()),
            triangles: mesh.triangle_count(),
            vertices: mesh.positions.len(),
            glossy: if self.shown.left.is_some() { self.shown.refreshed.visible } else { mesh.glossy.len() },
            at_pixels: self.shown.left.is_some(),
            evaluated: self.shown.refreshed.evaluated,
            evaluation: self.shown.evaluation,
            frame: self.frame_time,
            device: &self.device,
            status: &self.status,
            inside: self.looking.text(),
            gauge,
        };
        let before = self.settings;
        let layout = self.hud.layout(&self.window, &facts, &mut self.settings);
        self.again = layout.again;
        let target = output.texture.create_view(&wgpu::TextureViewDescriptor::default());
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let frame = Frame { view: &self.walker.view, tone: &self.tone(), mesh, gauge, marks: self.looking.marks() };
        self.pass.draw(&self.gpu, &self.shown.buffers, &mut encoder, &target, size, &frame);
        self.hud.draw(&self.gpu, &mut encoder, &target, size, layout);
        self.gpu.queue.submit([encoder.finish()]);
        self.window.pre_present_notify();
        self.gpu.queue.present(output);
        self.gpu.fault()?;
        self.walked.frames += 1;
        if self.walker.is_moving() || self.tour.is_playing() || self.settings != before {
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

    /// Brings glossy radiances up to date.
    fn follow(&mut self, size: [u32; 2]) {
        let moves = self.walker.is_moving() || self.tour.is_playing();
        let tolerance = self.settings.tolerance.to_radians().max(if moves { MOVING } else { 0.0 });
        let evaluated = self.shown.follow(&self.gpu, self.walk.as_ref(), &self.walker.view, size, tolerance);
        self.walked.evaluated += evaluated as u64;
    }

    /// Saves what is seen, without the head-up display, beside the other screenshots in the current folder.
    fn screenshot(&mut self) -> Result<(), WindowError> {
        let size = self.canvas.size();
        if size.contains(&0) {
            return Ok(());
        }
        self.follow(size);
        let frame = Frame {
            view: &self.walker.view,
            tone: &self.tone(),
            mesh: self.walk.mesh(),
            gauge: self.gauge(),
            marks: self.looking.marks(),
        };
        let picture = Snapshot::draw(&self.gpu, &self.layouts, &self.shown.buffers, size, &frame)?;
        let Some(path) = unused("hr-view", "png") else { return Ok(()) };
        match picture.save_png(&path) {
            Ok(()) => self.hud.say(format!("saved {}", full(&path).display())),
            // A folder that is read-only is no reason to end the walk.
            Err(error) => self.hud.say(error.to_string()),
        }
        Ok(())
    }
}

/// The window's title: the scene, and how far its solution is.
fn title(name: &str, status: &Status) -> String {
    match &status.activity {
        Some(_) if status.paused => format!("{name} — paused — hr-view"),
        Some(_) => format!("{name} — {:.0} % — hr-view", 100.0 * status.fraction),
        None => format!("{name} — hr-view"),
    }
}
