//! `cargo xtask bench yardstick`: the regret of policies against value iteration.

use std::process::Command;

use anyhow::Context;

use crate::peers::succeed;
use crate::process::{cargo, exit_code, flag};
use crate::tree::root;

/// Built with the whole workspace: one package alone would compile burn once more.
const BUILD: [&str; 5] = ["build", "--release", "--workspace", "--example", "yardstick"];

/// Compares on `--options N` options (20), `--episodes N` each (400), of `--robot R` (both) under `--noise N` (nominal); lines,
/// table and picture go to `--out DIR` (out/yardstick). Goes on where it was.
///
/// # Errors
/// Returns an error if a flag is unreadable, or if the comparison cannot be built or run.
pub(crate) fn run(args: &[String]) -> anyhow::Result<u8> {
    let usual = |name, value| flag(args, name).unwrap_or(value);
    let options: u32 = usual("--options", "20").parse().context("--options")?;
    let episodes: u32 = usual("--episodes", "400").parse().context("--episodes")?;
    let seed: u64 = usual("--seed", "1").parse().context("--seed")?;
    succeed(&mut cargo(&BUILD))?;
    let robots = flag(args, "--robot").map_or(vec!["husky", "limo"], |robot| vec![robot]);
    for robot in robots {
        let mut example = Command::new(root().join("target/release/examples/yardstick"));
        example.current_dir(root()).args([
            usual("--out", "out/yardstick"),
            robot,
            usual("--noise", "nominal"),
        ]);
        let code = exit_code(example.args([options.to_string(), episodes.to_string(), seed.to_string()]))?;
        if code != 0 {
            return Ok(code);
        }
    }
    Ok(0)
}
