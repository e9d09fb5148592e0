//! What a suite of problems came to: its lines, its tables, its figures and one page with all of them.
//!
//! Everything here is a function of `results.jsonl` and of the pictures beside the plans: equal results
//! give equal bytes.

mod calibration;
mod figure;
mod gallery;
mod lines;
mod methods;
mod page;
mod reuse;
mod rows;
mod tables;
mod time;

use std::path::{Path, PathBuf};

use sharp_plan::write_atomic;

use crate::outcome::Failure;
use crate::render::svg_to_png;

pub(crate) use lines::{
    BaselineLine, Machine, ResultLine, default_regions, problem_folder, read_baselines, row_text, variant,
};
pub(crate) use methods::totals;
pub(crate) use tables::table;

/// What a report is made from.
#[derive(Debug)]
pub(crate) struct Evaluation<'a> {
    /// Problems in the order of the suite.
    pub(crate) lines: Vec<&'a ResultLine>,
    /// Baselines under the same noise; may be empty.
    pub(crate) baselines: Vec<BaselineLine>,
    /// The command that makes the same report again.
    pub(crate) command: String,
    /// Where the plans of `lines` lie.
    pub(crate) out: &'a Path,
}

/// Writes `methods.md`, all methods under each noise, into `OUT/report`.
///
/// # Errors
/// Returns an error if the file cannot be written.
pub(crate) fn write_methods(lines: &[&ResultLine], out: &Path) -> Result<(), Failure> {
    Ok(write_atomic(&out.join("report/methods.md"), methods::tables(lines).as_bytes())?)
}

/// Writes `tables.md`, every figure as SVG and PNG, and `index.html` into `OUT/report`; returns the
/// path of the page.
///
/// # Errors
/// Returns an error if a picture of a plan cannot be read or a file cannot be written.
pub(crate) fn write(evaluation: &Evaluation<'_>) -> Result<PathBuf, Failure> {
    let folder = evaluation.out.join("report");
    write_atomic(&folder.join("tables.md"), table(&evaluation.lines).as_bytes())?;
    let figures = figures(evaluation);
    for figure in &figures {
        let (plain, side_px) = figure.to_plain_svg();
        write_atomic(&folder.join(format!("{}.svg", figure.name)), figure.to_svg().as_bytes())?;
        write_atomic(&folder.join(format!("{}.png", figure.name)), &svg_to_png(&plain, side_px)?)?;
    }
    let pictures = gallery::collect(evaluation)?;
    let page = folder.join("index.html");
    write_atomic(&page, page::html(evaluation, &figures, &pictures).as_bytes())?;
    Ok(page)
}

/// All figures, in the order of the page.
fn figures(evaluation: &Evaluation<'_>) -> Vec<figure::Figure> {
    let (lines, baselines) = (&evaluation.lines, &evaluation.baselines);
    vec![
        time::figure(lines),
        rows::success(lines, baselines),
        calibration::figure(lines),
        reuse::figure(lines),
        rows::driving(lines, baselines),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn evaluate(lines: &[ResultLine], out: &Path) -> String {
        let baseline = ResultLine { method: "track".into(), ..ResultLine::example("<b>", "limo", "none", 1) };
        let evaluation = Evaluation {
            lines: lines.iter().collect(),
            baselines: vec![BaselineLine::from(&baseline)],
            command: "sharp eval \"quick\" --out <here>".into(),
            out,
        };
        let page = write(&evaluation).expect("a report");
        std::fs::read_to_string(page).expect("a page")
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
                time_s: crate::report::SolveTimes::default(),
                ..ResultLine::example("a", "husky", "interface", 3)
            },
        ]
    }

    #[test]
    fn the_page_has_every_figure_and_nothing_from_elsewhere() {
        let folder = tempfile::tempdir().expect("a folder");
        let html = evaluate(&lines(), folder.path());
        for name in ["time", "success", "calibration", "reuse", "driving"] {
            assert!(html.contains(&format!("<section id=\"{name}\">")), "no figure {name}");
            for ending in ["svg", "png"] {
                let path = folder.path().join("report").join(format!("{name}.{ending}"));
                assert!(path.is_file(), "no {}", path.display());
            }
        }
        for foreign in ["NaN", "inf<", "<script", "<link", "src=\"http", "url(http", "@import"] {
            assert!(!html.contains(foreign), "the page has {foreign}");
        }
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
