//! The `hr-view` command.
fn main() {}
