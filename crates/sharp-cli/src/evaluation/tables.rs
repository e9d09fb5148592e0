//! The results as Markdown tables.

use std::fmt::Write;

use super::cases::Results;
use super::figure::{Figure, Table};
use super::lines::ResultLine;

/// The numbers of every figure, and one row for every result of SHARP in the setting of the page.
pub(super) fn document(results: &Results<'_>, figures: &[Figure]) -> String {
    let mut text = String::from("# SHARP evaluation\n");
    for Figure { name, title, caption, table, .. } in figures {
        // Writing to a string cannot fail.
        let _ = write!(text, "\n## {title}\n\n{caption} ([figure]({name}.svg))\n\n{}", markdown(table));
    }
    text + "\n## Every result\n\n" + &table(&results.sharp(results.main))
}

fn markdown(table: &Table) -> String {
    let row = |cells: &mut dyn Iterator<Item = &str>| {
        let cells: Vec<String> = cells.map(|cell| cell.replace('|', "\\|")).collect();
        format!("| {} |\n", cells.join(" | "))
    };
    let mut text = row(&mut table.columns.iter().copied());
    text += &row(&mut table.columns.iter().map(|_| "---"));
    text.extend(table.rows.iter().map(|cells| row(&mut cells.iter().map(String::as_str))));
    text
}

/// One row a result.
pub(crate) fn table(lines: &[&ResultLine]) -> String {
    let mut text = String::from(
        "| env | problem | robot | options | success | 95 % interval | predicted | reused | driving s | regions s | abstraction s | search s | guides s | learn s | verify s | total s |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for line in lines {
        let (tally, time) = (line.tally(), &line.time_s);
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "| {} | P{} | {} | {} | {}/{} | {:.2}-{:.2} | {:.3} | {}/{} | {:.1} | {:.2} | {:.2} | {:.2} | {:.2} | {:.1} | {:.1} | {:.1} |",
            line.env,
            line.problem,
            line.robot,
            line.options,
            line.successes,
            line.episodes,
            tally.lower95(),
            tally.upper95(),
            line.predicted_success,
            line.reuse.reused,
            line.reuse.uses,
            line.mean_sim_time_s,
            time.regions,
            time.abstraction,
            time.search,
            time.guide,
            time.learn,
            time.verify,
            time.total
        );
    }
    text
}
