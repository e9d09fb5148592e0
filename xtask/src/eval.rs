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
}
