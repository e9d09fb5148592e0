//! `cargo xtask eval`: runs a suite of experiments through `sharp eval`.

use crate::process::{exit_code, flag, sharp};

/// Runs the suite that `--profile` names (`smoke` by default); other arguments are passed on.
///
/// # Errors
/// Returns an error if cargo cannot be started.
pub(crate) fn run(args: &[String]) -> anyhow::Result<u8> {
    let call = call(args);
    exit_code(&mut sharp("", &call.iter().map(String::as_str).collect::<Vec<_>>()))
}

/// The arguments of `sharp`.
fn call(args: &[String]) -> Vec<String> {
    let profile = flag(args, "--profile").unwrap_or("smoke");
    let mut call = vec!["eval".to_owned(), profile.to_owned()];
    let mut rest = args.iter();
    while let Some(arg) = rest.next() {
        if arg == "--profile" {
            rest.next();
        } else if !arg.starts_with("--profile=") {
            call.push(arg.clone());
        }
    }
    if flag(args, "--out").is_none() {
        call.extend(["--out".to_owned(), format!("out/eval-{profile}")]);
    }
    call
}

/// `args`, and those of `usual` whose flag is not among them.
pub(crate) fn with_usual(args: &[String], usual: &[(&str, &str)]) -> Vec<String> {
    let absent = usual.iter().filter(|(name, _)| flag(args, name).is_none());
    let mut all = args.to_vec();
    all.extend(absent.flat_map(|(name, value)| [(*name).to_owned(), (*value).to_owned()]));
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(line: &str) -> Vec<String> {
        line.split_whitespace().map(String::from).collect()
    }

    #[test]
    fn the_profile_becomes_the_suite() {
        for (args, expected) in [
            ("", "eval smoke --out out/eval-smoke"),
            ("--profile paper --resume", "eval paper --resume --out out/eval-paper"),
            ("--out here --profile=quick", "eval quick --out here"),
        ] {
            assert_eq!(call(&words(args)), words(expected), "{args}");
        }
    }

    #[test]
    fn what_is_usual_gives_way_to_what_is_asked() {
        let usual = [("--noise", "none,harsh"), ("--out", "out/baselines")];
        assert_eq!(
            with_usual(&words("--out=here --envs a"), &usual),
            words("--out=here --envs a --noise none,harsh")
        );
    }
}
