//! The sharp command.

fn main() {}
