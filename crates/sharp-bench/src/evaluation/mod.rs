//! What a suite of problems came to: its lines, its tables, its figures and one page with all of them.
//!
//! Everything here is a function of `results.jsonl` and of the pictures beside the plans: equal results
//! give equal bytes.

mod ablations;
mod calibration;
mod cases;
mod figure;
mod gallery;
mod methods;
mod missing;
mod noise;
mod ompl;
mod page;
mod paper;
mod phases;
mod reuse;
mod rows;
mod tables;

use std::path::{Path, PathBuf};

use sharp_draw::{PngError, svg_to_png};
use sharp_plan::{FileError, write_atomic};

use self::cases::Results;
use self::figure::Figure;
use crate::result::ResultLine;

pub use methods::totals;
pub use paper::{PaperLeg, PaperLine, PaperRow, paper_rows, write_paper};
pub use tables::table;

/// What a report is made from.
#[derive(Debug)]
pub struct ReportInput<'a> {
    /// All results there are, of SHARP in any setting and of the baselines.
    pub lines: Vec<&'a ResultLine>,
    /// The command that makes the same report again.
    pub command: String,
    /// Where the plans of `lines` lie.
    pub out: &'a Path,
}

/// Why a report cannot be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReportError {
    /// A file of the report cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
    /// A picture of a plan is there but cannot be read.
    #[error("{}: {source}", path.display())]
    Picture {
        /// The picture.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A figure cannot be drawn.
    #[error(transparent)]
    Drawing(#[from] PngError),
}

/// Writes `tables.md`, `methods.md`, `ompl.log`, every figure as SVG and PNG, every picture as PNG, and
/// `index.html` into `OUT/report`; returns the path of the page.
///
/// # Errors
/// Returns an error if a picture of a plan cannot be read or a file cannot be written.
pub fn write_report(input: &ReportInput<'_>) -> Result<PathBuf, ReportError> {
    let folder = input.out.join("report");
    let results = Results::new(&input.lines);
    let figures = figures(&results);
    for figure in &figures {
        let (svg, side_px) = figure.to_svg();
        write_atomic(&folder.join(format!("{}.svg", figure.name)), svg.as_bytes())?;
        write_atomic(&folder.join(format!("{}.png", figure.name)), &svg_to_png(&svg, side_px)?)?;
    }
    let galleries = gallery::collect(&results.sharp(results.main), input.out)?;
    for picture in galleries.iter().flat_map(|gallery| &gallery.pictures) {
        write_atomic(&folder.join(format!("{}.png", picture.name)), &picture.png)?;
    }
    write_atomic(&folder.join("methods.md"), methods::tables(&results.lines).as_bytes())?;
    write_atomic(&folder.join("ompl.log"), ompl::log(&results.lines).as_bytes())?;
    let missing = missing::missing(&results, input.out);
    write_atomic(&folder.join("tables.md"), tables::document(&results, &figures).as_bytes())?;
    let page = folder.join("index.html");
    let parts = page::Parts { results, command: &input.command, figures, galleries, missing };
    write_atomic(&page, page::html(&parts).as_bytes())?;
    Ok(page)
}

/// The environment that the paper shows apart, in its appendix B.
const APART: &str = "d";

/// All figures that have something to show, in the order of the page.
fn figures(results: &Results<'_>) -> Vec<Figure> {
    let sharp = results.sharp(results.main);
    if sharp.is_empty() {
        return vec![];
    }
    let compared = results.compared();
    let (apart, others): (Vec<_>, Vec<_>) = compared.iter().copied().partition(|line| line.env == APART);
    let there = |lines: &[&ResultLine]| !lines.is_empty();
    let figures = [
        there(&others).then(|| rows::time("time", "Time until it can drive", &others)),
        there(&others).then(|| rows::success("success", "Success of each problem", &others)),
        Some(phases::figure(&sharp)),
        Some(rows::driving(&compared)),
        Some(calibration::figure(&sharp)),
        noise::figure(results),
        ablations::figure(results),
        there(&apart).then(|| rows::time("time-d", "Environment D: time (appendix B)", &apart)),
        there(&apart).then(|| rows::success("success-d", "Environment D: success (appendix B)", &apart)),
        Some(reuse::figure(&sharp)),
    ];
    figures.into_iter().flatten().collect()
}

#[cfg(test)]
#[path = "tests/browser.rs"]
mod browser;

#[cfg(test)]
mod tests {
    use super::*;

    /// Writes the report of `lines` and returns its page.
    pub(super) fn evaluate(lines: &[ResultLine], out: &Path) -> String {
        let evaluation = ReportInput {
            lines: lines.iter().collect(),
            command: "sharp eval \"quick\" --out <here>".into(),
            out,
        };
        let page = write_report(&evaluation).expect("a report");
        std::fs::read_to_string(page).expect("a page")
    }

    /// What a whole evaluation leaves, one line of each sort.
    pub(super) fn whole() -> Vec<ResultLine> {
        let line = ResultLine::example("a", "husky", "interface", 1);
        let mut lines = lines();
        lines.extend([
            ResultLine { noise: "nominal*2".into(), ..line.clone() },
            ResultLine { regions: "grid".into(), ..line.clone() },
            ResultLine { env: "d".into(), ..line.clone() },
            ResultLine { system: "track".into(), status: "driven".into(), ..line.clone() },
            line,
        ]);
        lines
    }

    /// A solved problem, one that was never driven to its end, and one without a plan.
    fn lines() -> Vec<ResultLine> {
        vec![
            ResultLine::example("<b>", "limo", "centroid", 1),
            ResultLine {
                successes: 0,
                mean_sim_time_s: 0.0,
                ..ResultLine::example("a", "husky", "interface", 2)
            },
            ResultLine {
                status: "no_plan".into(),
                successes: 0,
                predicted_success: 0.0,
                time_s: crate::times::SolveTimes::default(),
                ..ResultLine::example("a", "husky", "interface", 3)
            },
        ]
    }

    #[test]
    fn the_page_has_every_figure_and_nothing_from_elsewhere() {
        let folder = tempfile::tempdir().expect("a folder");
        let html = evaluate(&whole(), folder.path());
        let report = folder.path().join("report");
        let names = [
            "time",
            "success",
            "phases",
            "driving",
            "calibration",
            "noise",
            "ablations",
            "time-d",
            "success-d",
            "reuse",
        ];
        let markdown = std::fs::read_to_string(report.join("tables.md")).expect("tables");
        for name in names {
            assert!(html.contains(&format!("<section id=\"{name}\">")), "no figure {name}");
            assert!(markdown.contains(&format!("({name}.svg)")), "no table {name}");
            for ending in ["svg", "png"] {
                let path = report.join(format!("{name}.{ending}"));
                assert!(path.is_file(), "no {}", path.display());
            }
        }
        assert!(report.join("ompl.log").is_file(), "no log for Planner Arena");
        for foreign in ["NaN", "inf<", "<script", "<link", "src=\"http", "url(http", "@import"] {
            assert!(!html.contains(foreign), "the page has {foreign}");
        }
    }

    #[test]
    fn what_was_not_measured_is_left_out_with_its_command() {
        let folder = tempfile::tempdir().expect("a folder");
        let html = evaluate(&lines(), folder.path());
        for name in ["noise", "ablations", "time-d"] {
            assert!(!html.contains(&format!("<section id=\"{name}\">")), "an empty figure {name}");
        }
        assert!(html.contains("--methods sharp --regions grid</code>"), "{html}");
        assert!(!html.contains("Nothing to show"), "{html}");
    }

    #[test]
    fn text_of_others_is_escaped() {
        let folder = tempfile::tempdir().expect("a folder");
        let html = evaluate(&lines(), folder.path());
        assert!(html.contains("&lt;b&gt;") && !html.contains("<b>"), "the name of an environment");
        assert!(html.contains("sharp eval &quot;quick&quot; --out &lt;here&gt;"), "the command");
    }

    #[test]
    fn equal_results_give_equal_bytes() {
        let folder = tempfile::tempdir().expect("a folder");
        let first = evaluate(&lines(), folder.path());
        assert_eq!(first, evaluate(&lines(), folder.path()));
    }

    #[test]
    fn nothing_selected_is_a_report_too() {
        let folder = tempfile::tempdir().expect("a folder");
        let html = evaluate(&[], folder.path());
        assert!(html.contains("0 of 0 executions"), "{html}");
    }
}
