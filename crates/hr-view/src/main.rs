//! The `hr-view` command.

use std::process::ExitCode;

fn main() -> ExitCode {
    // A fault of ours is an error like any other to the user: one line and status 1.
    std::panic::set_hook(Box::new(|fault| {
        let text = fault.to_string().split_whitespace().collect::<Vec<_>>().join(" ");
        drop(std::io::Write::write_fmt(
            &mut std::io::stderr(),
            format_args!("hr-view: internal error, please report it with the scene: {text}\n"),
        ));
    }));
    std::panic::catch_unwind(|| hr_view::main_with(std::env::args_os())).unwrap_or(ExitCode::FAILURE)
}
