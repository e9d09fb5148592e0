//! `sharp man`: manual pages, one a command, from the definitions that `--help` shows.

use std::path::Path;

use clap::Command;
use sharp_plan::write_atomic;

use crate::outcome::{Exit, Failure, say, say_bytes};

/// Writes a page for `command` and for each command below it into the folder `out`, or prints the first of them.
pub(crate) fn run(mut command: Command, out: Option<&Path>, json: bool) -> Result<Exit, Failure> {
    command.build();
    let Some(out) = out else {
        say_bytes(&page(&command)?);
        return Ok(Exit::Done);
    };
    let mut names = Vec::new();
    write(&command, out, &mut names)?;
    if json {
        let names = serde_json::to_string(&names).map_err(anyhow::Error::from)?;
        say!("{{\"schema\":\"sharp.man/1\",\"pages\":{names}}}");
    } else {
        say!("{} pages written to {}", names.len(), out.display());
    }
    Ok(Exit::Done)
}

fn write(command: &Command, out: &Path, names: &mut Vec<String>) -> Result<(), Failure> {
    let name = command.get_display_name().unwrap_or_else(|| command.get_name()).to_owned() + ".1";
    write_atomic(&out.join(&name), &page(command)?)?;
    names.push(name);
    command.get_subcommands().filter(|it| it.get_name() != "help").try_for_each(|it| write(it, out, names))
}

/// The page of `command` alone.
fn page(command: &Command) -> Result<Vec<u8>, Failure> {
    let mut page = Vec::new();
    clap_mangen::Man::new(command.clone()).render(&mut page).map_err(anyhow::Error::from)?;
    Ok(page)
}
