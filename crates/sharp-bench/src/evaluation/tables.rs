//! The results as Markdown tables.

use std::fmt::Write;

use super::cases::Results;
use super::figure::{Figure, Table};
use crate::result::ResultLine;

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

/// A column: its name, and what a result has in it.
type ResultColumn = (&'static str, fn(&ResultLine) -> String);

/// What a result of SHARP may differ in besides its problem.
const SETTINGS: [ResultColumn; 6] = [
    ("learning", |line| line.learning.clone()),
    ("regions", |line| line.regions.clone()),
    ("noise", |line| line.noise.clone()),
    ("variant", |line| line.variant.clone()),
    ("trial", |line| line.trial.to_string()),
    ("seed", |line| line.seed.to_string()),
];

/// One row a result, with a column for every setting in which some of them differ.
#[must_use]
pub fn table(lines: &[&ResultLine]) -> String {
    let differs = |(_, of): &ResultColumn| lines.windows(2).any(|pair| of(pair[0]) != of(pair[1]));
    let settings: Vec<ResultColumn> = SETTINGS.into_iter().filter(differs).collect();
    let mut columns = vec!["env", "problem", "robot", "options"];
    columns.extend(settings.iter().map(|(name, _)| name));
    columns.extend(["success", "95 % interval", "predicted", "reused", "driving s", "regions s"]);
    columns.extend(["abstraction s", "search s", "guides s", "learn s", "verify s", "total s"]);
    let row = |line: &&ResultLine| {
        let mut row =
            vec![line.env.clone(), format!("P{}", line.problem), line.robot.clone(), line.options.clone()];
        row.extend(settings.iter().map(|(_, of)| of(line)));
        row.extend(measured(line));
        row
    };
    markdown(&Table { columns, rows: lines.iter().map(row).collect() })
}

fn measured(line: &ResultLine) -> [String; 12] {
    let (tally, time) = (line.tally(), &line.time_s);
    [
        format!("{}/{}", line.successes, line.episodes),
        format!("{:.2}-{:.2}", tally.lower95(), tally.upper95()),
        format!("{:.3}", line.predicted_success),
        format!("{}/{}", line.reuse.reused, line.reuse.uses),
        format!("{:.1}", line.mean_sim_time_s),
        format!("{:.2}", time.regions),
        format!("{:.2}", time.abstraction),
        format!("{:.2}", time.search),
        format!("{:.2}", time.guide),
        format!("{:.1}", time.learn),
        format!("{:.1}", time.verify),
        format!("{:.1}", time.total),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_have_a_column_where_they_differ() {
        let line = ResultLine::example("a", "limo", "centroid", 1);
        let louder = ResultLine { noise: "nominal*2".into(), ..line.clone() };
        let rows =
            |lines: &[&ResultLine]| -> Vec<String> { table(lines).lines().map(str::to_owned).collect() };
        let one = rows(&[&line]);
        assert!(one[0].starts_with("| env | problem | robot | options | success |"), "{one:?}");
        assert!(
            one[2].starts_with("| a | P1 | limo | centroid | 20/20 | 0.80-1.00 | 0.980 | 1/4 |"),
            "{one:?}"
        );
        let two = rows(&[&line, &louder]);
        assert!(two[0].starts_with("| env | problem | robot | options | noise | success |"), "{two:?}");
        assert!(two[3].starts_with("| a | P1 | limo | centroid | nominal*2 | 20/20 |"), "{two:?}");
        let columns = |row: &str| row.matches('|').count();
        assert!(two.iter().all(|row| columns(row) == columns(&two[0])), "{two:?}");
    }
}
