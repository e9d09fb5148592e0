//! `sharp library list|check`: what a library holds, and whether its files are sound.

use std::path::Path;

use serde::Serialize;
use sharp_plan::OptionLibrary;

use crate::args::Library;
use crate::outcome::{Exit, Failure, say, to_json};

#[derive(Serialize)]
struct Report {
    schema: &'static str,
    options: Vec<Entry>,
}

#[derive(Serialize)]
struct Entry {
    world: String,
    option: String,
    episodes: u32,
    successes: u32,
    /// `None` where it never succeeded.
    cost_s: Option<f64>,
}

pub(crate) fn run(command: &Library, json: bool) -> Result<Exit, Failure> {
    let (dir, is_check) = match command {
        Library::List { dir } => (dir, false),
        Library::Check { dir } => (dir, true),
    };
    let options = entries(dir, is_check)?;
    if json {
        say!("{}", to_json(&Report { schema: "sharp.library/1", options }));
    } else if is_check {
        say!("{} options, every file sound", options.len());
    } else {
        for Entry { world, option, episodes, successes, cost_s } in &options {
            let cost = cost_s.map_or("never succeeded".to_owned(), |cost_s| format!("cost {cost_s:.1} s"));
            say!("{world}  {option:<14} holds {successes}/{episodes}, {cost}");
        }
    }
    Ok(Exit::Done)
}

/// Opens every world of the library, for a check with its abstractions; a damaged file is an error that names it.
fn entries(dir: &Path, is_check: bool) -> Result<Vec<Entry>, Failure> {
    let unreadable = |error| Failure::new("FILE_UNREADABLE", format!("{}: {error}", dir.display()));
    let mut worlds: Vec<String> = std::fs::read_dir(dir)
        .map_err(unreadable)?
        .filter_map(Result::ok)
        .filter(|entry| is_world(&entry.path()))
        .filter_map(|entry| entry.file_name().into_string().ok())
        .collect();
    worlds.sort();
    if worlds.is_empty() {
        let whole = if is_world(dir) { "; the folder above it may be one" } else { "" };
        let message = format!("{} is no library: no folder in it holds options{whole}", dir.display());
        return Err(Failure::new("FILE_UNREADABLE", message));
    }
    let mut entries = Vec::new();
    for world in worlds {
        let library = OptionLibrary::open(dir, &world)?;
        if is_check {
            OptionLibrary::check_abstractions(dir, &world)?;
        }
        entries.extend(library.iter().map(|(id, stored)| Entry {
            world: world.clone(),
            option: id.to_string(),
            episodes: stored.learnt.estimate.count.episodes,
            successes: stored.learnt.estimate.count.successes,
            cost_s:
                Some(stored.learnt.cost_s(sharp_drive::FAILURE_COST_S)).filter(|cost_s| cost_s.is_finite()),
        }));
    }
    Ok(entries)
}

/// Returns true if `folder` holds what a library keeps of one world: options, options that are being saved, abstractions or
/// buildings. The files of a plan have other names.
fn is_world(folder: &Path) -> bool {
    let files = std::fs::read_dir(folder).into_iter().flatten().flatten();
    files.filter_map(|file| file.file_name().into_string().ok()).any(|name| {
        // As in c_20-19: the family of the option, and its states.
        let mut bytes = name.bytes();
        let is_option =
            bytes.next().is_some_and(|family| family.is_ascii_lowercase()) && bytes.next() == Some(b'_');
        let is_other = ["saving-", "abstraction-", "building-"].iter().any(|kind| name.starts_with(kind));
        name.ends_with(".ron") && (is_option || is_other)
    })
}
