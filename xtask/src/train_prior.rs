//! `cargo xtask train-prior`: trains the shipped priors again through `sharp prior train`.

use crate::process::{exit_code, flag, sharp};

/// The robots that a prior is shipped for.
const ROBOTS: [&str; 2] = ["husky", "limo"];

/// Trains the prior of the robot that `args` name, or of both; without `--out` it replaces the shipped one.
///
/// # Errors
/// Returns an error if cargo cannot be started.
pub(crate) fn run(args: &[String]) -> anyhow::Result<u8> {
    for call in calls(args) {
        let call: Vec<&str> = call.iter().map(String::as_str).collect();
        let code = exit_code(&mut sharp("", &call))?;
        if code != 0 {
            return Ok(code);
        }
    }
    Ok(0)
}

/// The arguments of `sharp`, once for each robot.
fn calls(args: &[String]) -> Vec<Vec<String>> {
    let named = flag(args, "--robot");
    let robots = named.map_or(ROBOTS.to_vec(), |robot| vec![robot]);
    let call = |robot: &str| {
        let mut call = vec!["prior".to_owned(), "train".to_owned()];
        if named.is_none() {
            call.extend(["--robot".to_owned(), robot.to_owned()]);
        }
        if flag(args, "--out").is_none() {
            call.extend(["--out".to_owned(), format!("crates/sharp-drive/assets/prior-{robot}.safetensors")]);
        }
        call.extend_from_slice(args);
        call
    };
    robots.into_iter().map(call).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_priors_are_trained_unless_a_robot_is_named() {
        let words = |calls: Vec<Vec<String>>| calls.iter().map(|call| call.join(" ")).collect::<Vec<_>>();
        assert_eq!(
            words(calls(&["--seed=2".to_owned()])),
            [
                "prior train --robot husky --out crates/sharp-drive/assets/prior-husky.safetensors --seed=2",
                "prior train --robot limo --out crates/sharp-drive/assets/prior-limo.safetensors --seed=2",
            ]
        );
        let args = ["--robot", "limo", "--out", "here"].map(String::from);
        assert_eq!(words(calls(&args)), ["prior train --robot limo --out here"]);
    }
}
