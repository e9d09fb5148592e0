//! The sharp command: from a map to a policy.

mod render;

fn main() {}
