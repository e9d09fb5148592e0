//! An engine of one's own: a process a job, as one would start them on other machines over ssh.
//!
//! `cargo run --release -p sharp-bench --example own_engine`

#![allow(clippy::disallowed_methods, reason = "a program, which workers start again with arguments")]

use std::path::Path;
use std::process::Command;

use sharp_bench::conformance::check_engine;
use sharp_bench::{BenchError, Engine, EngineMonitor, Manifest, run_job};

/// Starts this program again for each job; it could as well be `sharp jobs run DIR --index N`.
#[derive(Debug)]
struct Processes;

impl Engine for Processes {
    fn run(
        &self,
        manifest: &Manifest,
        indices: &[usize],
        monitor: &dyn EngineMonitor,
    ) -> Result<Vec<BenchError>, BenchError> {
        let program = std::env::current_exe().map_err(|error| BenchError::Engine(error.to_string()))?;
        let mut failed = Vec::new();
        for &index in indices {
            if monitor.should_stop() {
                break;
            }
            manifest.job(index)?;
            let status = Command::new(&program).arg(&manifest.dir).arg(index.to_string()).status();
            match status {
                Ok(status) if status.success() => {}
                Ok(status) => failed.push(BenchError::Engine(format!("job {index}: {status}"))),
                Err(error) => return Err(BenchError::Engine(error.to_string())),
            }
        }
        Ok(failed)
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let [folder, index] = &arguments[..] {
        let manifest = Manifest::open(Path::new(folder)).expect("the folder of a manifest");
        let ended = run_job(&manifest, index.parse().expect("a number"), &());
        std::process::exit(i32::from(ended.is_err()));
    }
    let folder = tempfile::tempdir().expect("a folder");
    check_engine(&Processes, folder.path()).expect("an engine");
}
