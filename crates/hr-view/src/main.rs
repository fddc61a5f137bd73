//! The `hr-view` command.

use std::process::ExitCode;

fn main() -> ExitCode {
    hr_view::main()
}
