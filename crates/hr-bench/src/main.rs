//! The `hr-bench` command.

use std::process::ExitCode;

fn main() -> ExitCode {
    hr_bench::main_with(std::env::args_os())
}
