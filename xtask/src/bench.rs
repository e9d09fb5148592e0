//! `cargo xtask bench`: runs the benches of one crate or of all.

use anyhow::bail;

use crate::process::{cargo, exit_code};
use crate::tree::Tree;

/// Benches the crate that the first argument names, or every crate; the rest goes to criterion.
///
/// # Errors
/// Returns an error if the crate has no bench or cargo cannot be started.
pub(crate) fn run(args: &[String]) -> anyhow::Result<u8> {
    let tree = Tree::load()?;
    let (package, rest) = match args.split_first() {
        Some((name, rest)) if !name.starts_with('-') => (Some(name.as_str()), rest),
        _ => (None, args),
    };
    let benches = benches(&tree, package);
    if benches.is_empty() {
        bail!("no bench in {}", package.unwrap_or("any crate"));
    }
    for (_, bench) in benches {
        // The bench profile, or one package alone with its own choice of features, would compile
        // burn once more.
        let call = ["bench", "--profile", "release", "--workspace", "--bench", bench, "--"];
        let code = exit_code(cargo(&call).args(rest))?;
        if code != 0 {
            return Ok(code);
        }
    }
    Ok(0)
}

/// The (crate, bench) pairs of `only`, or of all crates.
fn benches<'a>(tree: &'a Tree, only: Option<&str>) -> Vec<(&'a str, &'a str)> {
    let pairs = tree.files.keys().filter_map(|path| {
        let (package, file) = path.strip_prefix("crates/")?.split_once("/benches/")?;
        let name = file.strip_suffix("/main.rs").or_else(|| file.strip_suffix(".rs"))?;
        (!name.contains('/')).then_some((package, name))
    });
    pairs.filter(|(package, _)| only.is_none_or(|only| only == *package)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn benches_are_files_or_folders_with_a_main() {
        let tree = Tree::of(&[
            ("crates/sharp-rl/benches/sac.rs", ""),
            ("crates/sharp-rl/benches/sac.json", ""),
            ("crates/sharp-sim/benches/step/main.rs", ""),
            ("crates/sharp-sim/benches/step/maps.rs", ""),
            ("crates/sharp-sim/src/lib.rs", ""),
        ]);
        assert_eq!(benches(&tree, None), [("sharp-rl", "sac"), ("sharp-sim", "step")]);
        assert_eq!(benches(&tree, Some("sharp-sim")), [("sharp-sim", "step")]);
    }
}
