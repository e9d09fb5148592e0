//! The `sharp` command: from a map to a policy that knows its odds.

#![allow(
    clippy::disallowed_methods,
    reason = "a command reads the clock, the environment and the terminal so that no library has to"
)]

mod args;
mod commands;
mod input;
mod lines;
mod outcome;
mod progress;

use std::process::ExitCode;

use clap::{CommandFactory, Parser};

use crate::args::{Cli, PriorCommand, Regions, Subcommands};
use crate::outcome::{Exit, Failure, say};

fn main() -> ExitCode {
    let cli = Cli::try_parse().unwrap_or_else(|error| refuse(&error));
    if stops_gently(&cli.command) {
        progress::listen_for_interrupts();
    }
    let exit = dispatch(&cli).unwrap_or_else(|failure| {
        if cli.json {
            say!("{}", failure.to_json());
        }
        eprintln!("error: {failure}");
        Exit::Broken
    });
    ExitCode::from(exit as u8)
}

/// Ends the program with what `error` says of the call, as JSON too where that is asked for. Help and versions come this way
/// as well, and are no errors.
fn refuse(error: &clap::Error) -> ! {
    let wants_json = std::env::args_os().take_while(|arg| arg != "--").any(|arg| arg == "--json");
    if wants_json && error.use_stderr() {
        say!("{}", Failure::from(error).to_json());
    }
    error.exit()
}

/// Whether an interrupt is a wish to stop that the command asks for; all others end at once.
const fn stops_gently(command: &Subcommands) -> bool {
    matches!(
        command,
        Subcommands::Solve(_)
            | Subcommands::Learn(_)
            | Subcommands::Baseline(_)
            | Subcommands::Eval(_)
            | Subcommands::Jobs(_)
            | Subcommands::Prior(PriorCommand::Train(_))
            | Subcommands::Regions(Regions::Train(_))
    )
}

fn dispatch(cli: &Cli) -> Result<Exit, Failure> {
    if let Some(threads) = cli.threads {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads as usize);
        pool.build_global().map_err(anyhow::Error::from)?;
    }
    match &cli.command {
        Subcommands::Solve(args) => commands::solve::run(args, cli.seed, cli.json),
        Subcommands::Learn(args) => commands::learn::run(args, cli.seed, cli.json),
        Subcommands::Run(args) => commands::run::run(args, cli.seed, cli.json),
        Subcommands::Export(args) => commands::export::run(args, cli.json),
        Subcommands::Serve(args) if args.library.is_some() => commands::serve_library::run(args, cli.seed),
        Subcommands::Serve(args) => commands::serve::run(args),
        Subcommands::Abstract(args) => commands::abstraction::run(args, cli.seed, cli.json),
        Subcommands::Regions(command) => commands::regions::run(command, cli.seed, cli.json),
        Subcommands::Prior(command) => commands::prior::run(command, cli.seed, cli.json),
        Subcommands::Map(command) => commands::map::run(command, cli.json),
        Subcommands::Library(command) => commands::library::run(command, cli.json),
        Subcommands::Robot(command) => commands::robot::run(command, cli.json),
        Subcommands::Baseline(args) => commands::baseline::run(args, cli.seed, cli.json),
        Subcommands::Eval(args) => commands::eval::run(args, cli.seed, cli.json),
        Subcommands::Jobs(command) => commands::jobs::run(command, cli.seed, cli.json),
        Subcommands::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(*shell, &mut Cli::command(), "sharp", &mut script);
            outcome::say_bytes(&script);
            Ok(Exit::Done)
        }
        Subcommands::Man { out } => commands::man::run(Cli::command(), out.as_deref(), cli.json),
    }
}
