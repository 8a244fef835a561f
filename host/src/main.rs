//! The `jointrig` command.
fn main() {}
