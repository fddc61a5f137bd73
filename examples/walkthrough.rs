//! Walks through a scene: `cargo run --release --example walkthrough`, or with a scene and options of `hr-view`, such
//! as `cargo run --release --example walkthrough -- cornell --error 0.02`.

use std::process::ExitCode;

fn main() -> ExitCode {
    hr_view::main()
}
