//! The `hr-bench` command.
fn main() {}
