//! Walk through a glossy global illumination solution: a window, a command line, images and frames.

pub mod app;
pub mod args;
pub mod at_pixels;
pub mod camera_path;
pub mod display;
pub mod error;
pub mod export;
pub mod facets;
pub mod glossy;
pub mod html;
pub mod inside;
pub mod interrupt;
mod loading;
pub mod metering;
pub mod path_tracer;
pub mod progress;
pub mod raycast;
mod seen;
mod session;
pub mod solution_file;
pub mod solved;
pub mod stats;
pub mod walkthrough;
mod watched;
pub mod window;

pub use args::{Args, Parsed};
pub use error::ViewError;
pub use glossy::Mode;

use std::ffi::OsString;
use std::io::Write;
use std::process::ExitCode;

/// The program with the process's own command line. A fault of ours is an error like any other to the user: one line
/// and status 1.
pub fn main() -> ExitCode {
    std::panic::set_hook(Box::new(|fault| {
        let text = one_line(&fault.to_string());
        drop(writeln!(std::io::stderr(), "hr-view: internal error, please report it with the scene: {text}"));
    }));
    std::panic::catch_unwind(|| main_with(std::env::args_os())).unwrap_or(ExitCode::FAILURE)
}

/// The program: reads the command line, does what it says, and ends with status 0, or with 1 and one line on standard
/// error.
pub fn main_with(line: impl IntoIterator<Item = OsString>) -> ExitCode {
    let done = match Args::read(line) {
        Ok(Parsed::Run(args)) => app::run(&args),
        Ok(Parsed::Print(text)) => {
            // Whoever closes the pipe has read enough.
            drop(write!(std::io::stdout(), "{text}"));
            Ok(())
        }
        Err(error) => Err(error),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            drop(writeln!(std::io::stderr(), "hr-view: {}", one_line(&error.to_string())));
            ExitCode::FAILURE
        }
    }
}

/// Error texts of files and libraries may bring their own line breaks.
fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
