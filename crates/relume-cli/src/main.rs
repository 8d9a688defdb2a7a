//! The `relume` command.

fn main() {}
