//! The results as a Markdown table.

use std::fmt::Write;

use super::lines::ResultLine;

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
