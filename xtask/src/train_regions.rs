//! `cargo xtask train-regions`: trains the region network through `sharp regions train`.

use crate::process::{exit_code, flag, sharp};

/// The backend that trains fastest on a processor.
const DEVICE: &str = "ndarray";

/// Passes `args` on; without `--device` the network trains on [`DEVICE`].
///
/// # Errors
/// Returns an error if cargo cannot be started.
pub(crate) fn run(args: &[String]) -> anyhow::Result<u8> {
    let (features, args) = call(args);
    exit_code(&mut sharp(features, &args))
}

/// The cargo features to build with and the arguments of `sharp`.
fn call(args: &[String]) -> (&'static str, Vec<&str>) {
    let mut call = vec!["regions", "train"];
    let device = flag(args, "--device").unwrap_or_else(|| {
        call.extend(["--device", DEVICE]);
        DEVICE
    });
    call.extend(args.iter().map(String::as_str));
    (if device == DEVICE { DEVICE } else { "" }, call)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_device_is_ndarray_unless_named() {
        let args = ["--resume".to_owned()];
        assert_eq!(call(&args), ("ndarray", vec!["regions", "train", "--device", "ndarray", "--resume"]));
        let args = ["--device=flex".to_owned()];
        assert_eq!(call(&args), ("", vec!["regions", "train", "--device=flex"]));
    }
}
