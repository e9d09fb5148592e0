//! On macOS a Python module has to say that Python itself comes later; elsewhere linkers take that for granted.

#![allow(clippy::disallowed_methods, reason = "cargo tells build scripts everything by the environment")]

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    if std::env::var("CARGO_CFG_TARGET_OS").is_ok_and(|system| system == "macos") {
        println!("cargo::rustc-cdylib-link-arg=-undefined");
        println!("cargo::rustc-cdylib-link-arg=dynamic_lookup");
    }
}
