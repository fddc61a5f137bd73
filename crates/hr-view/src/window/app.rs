//! The application as the event loop knows it.

use super::live::{Live, Next};
use super::screen::{News, Screen};
use super::{Walked, WindowError, WindowOptions};
use winit::application::ApplicationHandler;
use winit::event::{DeviceEvent, DeviceId, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoopProxy};
use winit::window::WindowId;

/// What to do once the window is open.
type Start = Box<dyn FnOnce(Screen)>;

/// Nothing before the window system is ready; then the open window.
pub(super) struct App {
    options: WindowOptions,
    start: Option<(Start, EventLoopProxy<News>)>,
    live: Option<Live>,
    failure: Option<WindowError>,
    walked: Walked,
}

impl App {
    pub(super) fn new(options: WindowOptions, start: Start, proxy: EventLoopProxy<News>) -> Self {
        Self { options, start: Some((start, proxy)), live: None, failure: None, walked: Walked::default() }
    }

    /// What was done, or the error that ended the walk.
    pub(super) fn finish(self) -> Result<Walked, WindowError> {
        self.failure.map_or(Ok(self.walked), Err)
    }

    /// Runs a step of the open window; ends the walk where it fails.
    fn step(&mut self, event_loop: &ActiveEventLoop, step: impl FnOnce(&mut Live) -> Result<Next, WindowError>) {
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

impl ApplicationHandler<News> for App {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        let Some((start, proxy)) = self.start.take() else { return };
        match Live::new(&self.options, event_loop) {
            Ok(live) => {
                start(live.screen(proxy));
                self.live = Some(live);
            }
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
        if let DeviceEvent::MouseMotion { delta } = event {
            self.step(event_loop, |live| {
                live.mouse_moved(delta);
                Ok(Next::Go)
            });
        }
    }

    fn user_event(&mut self, event_loop: &ActiveEventLoop, news: News) {
        self.step(event_loop, |live| live.news(news));
    }

    fn about_to_wait(&mut self, event_loop: &ActiveEventLoop) {
        let next = self.live.as_mut().and_then(Live::next_frame);
        event_loop.set_control_flow(next.map_or(ControlFlow::Wait, ControlFlow::WaitUntil));
    }

    fn exiting(&mut self, _: &ActiveEventLoop) {
        // Surface and window go before the event loop does.
        if let Some(live) = self.live.take() {
            self.walked = live.walked();
        }
    }
}
