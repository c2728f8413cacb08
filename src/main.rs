//! The `tenter` command.
fn main() {}
