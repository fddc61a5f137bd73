//! Walk through a glossy global illumination solution: a window, a command line, frames.

pub mod display;
pub mod window;
