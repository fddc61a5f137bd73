//! What the library is measured by: path-traced references, distances between images, and reports of accuracy and
//! speed. Not published; the `hr-bench` command is its face.
//!
//! | subcommand | what it measures |
//! | --- | --- |
//! | `reference` | nothing: it path traces a reference image |
//! | `compare` | distance of an image to a reference |
//! | `accuracy` | pictures of solutions against references |
//! | `curve` | the diffuse solver's error over its time, against reference irradiances and its own finest solution |
//! | `growth` | time and memory of generated scenes over their size |
//! | `threads` | what more threads bring, and that they change nothing |
//! | `transport` | gathering against shooting |
//! | `edits` | other light and paint, moved objects and lamps against fresh solves |
//! | `form-factors` | form factors against closed forms and brute force |
//! | `bounds` | how tight the oracle's bounds are |
//! | `visibility` | rays per second, and links that need none |
//! | `paper` | what the paper's tables and figures compare |
//! | `view` | time of frames along a walk |
//! | `guide` | nothing: it makes the guide's pictures |
//! | `pictures` | whether built-in scenes look as they did |

pub mod accuracy;
pub mod args;
pub mod bounds;
pub mod compare;
pub mod curve;
pub mod edits;
pub mod error;
pub mod float_image;
pub mod form_factors;
pub mod frames;
pub mod growth;
pub mod guide;
pub mod irradiance;
pub mod measure;
pub mod paper;
pub mod pictures;
pub mod plot;
pub mod run;
mod side_by_side;
pub mod threads;
pub mod together;
pub mod transport;
pub mod views;
pub mod visibility;

pub use error::BenchError;

use clap::Parser;
use clap::error::ErrorKind;
use std::ffi::OsString;
use std::io::Write;
use std::process::ExitCode;

/// The program: reads the command line, does what it says, and ends with status 0, or with 1 and one line on standard
/// error.
pub fn main_with(line: impl IntoIterator<Item = OsString>) -> ExitCode {
    let cli = match args::Cli::try_parse_from(line) {
        Ok(cli) => cli,
        Err(error) => {
            let fine = matches!(error.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion);
            drop(error.print());
            return if fine { ExitCode::SUCCESS } else { ExitCode::FAILURE };
        }
    };
    match run::run(&cli, &mut std::io::stdout().lock()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            drop(writeln!(std::io::stderr(), "hr-bench: {error}"));
            ExitCode::FAILURE
        }
    }
}
