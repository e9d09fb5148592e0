//! Development tasks: `cargo xtask COMMAND`.
//!
//! Nothing is computed here: the tasks call cargo and the `sharp` command. This package knows no
//! other of the workspace, so that it builds in seconds.

#![allow(clippy::disallowed_methods, reason = "a development tool reads arguments, clock and environment")]

mod baselines;
mod bench;
mod ci;
mod downstream;
mod eval;
mod examples;
mod fuzz;
mod packages;
mod paper_row;
mod paper_table;
mod peers;
mod peers_learning;
mod peers_option;
mod peers_regions;
mod process;
mod soak;
mod stats;
mod tidy;
mod train_prior;
mod train_regions;
mod tree;
mod yardstick;

use std::process::ExitCode;

use crate::tree::Tree;

const USAGE: &str = "\
usage: cargo xtask COMMAND

  ci [STEPS]             everything that must pass: format, tidy, packages, clippy, docs, tests,
                         examples, downstream, fuzz; or only the steps named
  tidy                   house rules that no compiler checks
  soak [NAMES]           tests/soak with many cases: hours; or only the tests that a name is part of
  fuzz [TARGETS] [--seconds S]
                         libFuzzer on what reads files and lines (tests/fuzz), S seconds each (20)
  stats                  a table of lines, functions and docs of each crate
  train-regions [ARGS]   sharp regions train ARGS, on the ndarray device by default
  train-prior [ARGS]     sharp prior train ARGS, for both robots by default
  eval [--profile smoke|quick|paper] [ARGS]
                         sharp eval of that suite
  baselines [ARGS]       sharp eval of every baseline on every problem under every noise
  paper-table [--minutes N] [--only TEXT] [--trial ROW]
                         the paper's protocol from end to end: measures what is missing for N
                         minutes (0), of the rows whose name holds TEXT, and writes results.md;
                         --trial measures one row with a library of its own and keeps nothing
  bench [CRATE] [ARGS]   the benches of one crate or of all; ARGS go to criterion
  bench peers [sim|learning|option|regions]
                         the same work here and in other programs, as JSON lines
                         [--rounds N] [--seconds S] [--map M] [--option-limit S]
                         [--option-seeds N] [--peer-threads N] [--problem P]
  bench yardstick        what policies cost beside value iteration that knows slip and pull
                         [--robot R] [--noise N] [--options N] [--episodes N] [--seed N] [--out DIR]";

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let (command, rest) = match args.split_first() {
        Some((command, rest)) => (command.as_str(), rest),
        None => ("help", &[][..]),
    };
    let outcome = match command {
        "ci" => ci::run(rest),
        "tidy" => tidy::run(),
        "soak" => soak::run(rest),
        "fuzz" => fuzz::run(rest),
        "stats" => Tree::load().map(|tree| {
            print!("{}", stats::table(&tree));
            0
        }),
        "train-prior" => train_prior::run(rest),
        "train-regions" => train_regions::run(rest),
        "eval" => eval::run(rest),
        "baselines" => baselines::run(rest),
        "paper-table" => paper_table::run(rest),
        "bench" if rest.first().is_some_and(|word| word == "peers") => peers::run(&rest[1..]),
        "bench" if rest.first().is_some_and(|word| word == "yardstick") => yardstick::run(&rest[1..]),
        "bench" => bench::run(rest),
        "help" | "-h" | "--help" => {
            println!("{USAGE}");
            Ok(0)
        }
        unknown => {
            eprintln!("unknown command {unknown:?}\n\n{USAGE}");
            Ok(2)
        }
    };
    match outcome {
        Ok(code) => ExitCode::from(code),
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::from(2)
        }
    }
}
