//! The page: one file that opens anywhere, without a network, a script or a font.

use std::collections::BTreeSet;
use std::fmt::{Display, Write};

use sharp_plan::Tally;

use super::Evaluation;
use super::figure::{Figure, Table};
use super::gallery::Picture;
use super::lines::ResultLine;
use crate::render::{Lettering, escape};

const STYLE: &str = include_str!("page.css");

/// The whole document.
pub(super) fn html(evaluation: &Evaluation<'_>, figures: &[Figure], pictures: &[Picture]) -> String {
    let mut html = String::from(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>SHARP evaluation</title>\n<style>\n",
    );
    html += STYLE;
    html += "</style>\n</head>\n<body>\n";
    html += &head(evaluation);
    html += &navigation(figures, pictures);
    for figure in figures {
        html += &section(figure);
    }
    if !pictures.is_empty() {
        html += &gallery(pictures);
    }
    html + "</body>\n</html>\n"
}

/// What was run, and how it ended.
fn head(evaluation: &Evaluation<'_>) -> String {
    let lines = &evaluation.lines;
    let solved = lines.iter().filter(|line| line.is_solved()).count();
    let tally = lines.iter().fold(Tally::default(), |sum, line| Tally {
        episodes: sum.episodes + line.episodes,
        successes: sum.successes + line.successes,
    });
    let mut html = String::from("<h1>SHARP evaluation</h1>\n");
    // Writing to a string cannot fail.
    let _ = writeln!(
        html,
        "<p><strong>{} of {} executions succeeded</strong> ({:.1} %, 95 % interval {:.1} to {:.1} %); \
         {solved} of {} problems were solved.</p>",
        tally.successes,
        tally.episodes,
        100.0 * tally.rate(),
        100.0 * tally.lower95(),
        100.0 * tally.upper95(),
        lines.len()
    );
    let _ = writeln!(html, "<p>{}</p>", escape(&what_was_run(evaluation)));
    let _ = writeln!(html, "<pre>{}</pre>", escape(&evaluation.command));
    html
}

fn what_was_run(evaluation: &Evaluation<'_>) -> String {
    let lines = &evaluation.lines;
    let names = |of: fn(&ResultLine) -> &str| listed(lines.iter().map(|line| of(line)));
    let mut text = format!(
        "sharp {}; environments {}; robots {}; options {}; regions {}; noise {}; learning {}; seed {}",
        names(|line| &line.version),
        names(|line| &line.env),
        names(|line| &line.robot),
        names(|line| &line.options),
        names(|line| &line.regions),
        names(|line| &line.noise),
        names(|line| &line.learning),
        listed(lines.iter().map(|line| line.seed)),
    );
    if !evaluation.baselines.is_empty() {
        let _ = write!(text, "; baselines {}", listed(evaluation.baselines.iter().map(|line| &line.method)));
    }
    text + "."
}

/// Each of `items` once, in order.
fn listed<T: Ord + Display>(items: impl Iterator<Item = T>) -> String {
    let items: Vec<String> = items.collect::<BTreeSet<T>>().iter().map(ToString::to_string).collect();
    items.join(", ")
}

fn navigation(figures: &[Figure], pictures: &[Picture]) -> String {
    let mut html = String::from("<nav>");
    let pictures = (!pictures.is_empty()).then_some(("pictures", "Pictures"));
    for (name, title) in figures.iter().map(|figure| (figure.name, figure.title)).chain(pictures) {
        let _ = write!(html, "<a href=\"#{name}\">{title}</a>");
    }
    html + "</nav>\n"
}

fn section(figure: &Figure) -> String {
    let Figure { name, title, caption, .. } = figure;
    let mut html = format!("<section id=\"{name}\">\n<h2>{title}</h2>\n<p>{}</p>\n", escape(caption));
    if figure.panels.is_empty() {
        html += "<p>Nothing to show.</p>\n";
    } else {
        html += &figure.legend.to_svg("legend", Lettering::Text);
        html += "<div class=\"panels\">\n";
        for panel in &figure.panels {
            html += &panel.chart.to_svg(&format!("{title}: {}", panel.title), Lettering::Text);
        }
        html += "</div>\n";
    }
    html += &table(&figure.table);
    let _ = writeln!(
        html,
        "<p>This figure as a file: <a href=\"{name}.svg\">SVG</a>, <a href=\"{name}.png\">PNG</a>.</p>\n</section>"
    );
    html
}

fn table(table: &Table) -> String {
    let cells = |tag: &str, cells: &mut dyn Iterator<Item = &str>| {
        let row: String = cells.map(|cell| format!("<{tag}>{}</{tag}>", escape(cell))).collect();
        format!("<tr>{row}</tr>\n")
    };
    let mut html = String::from("<details>\n<summary>The numbers</summary>\n<div class=\"wide\"><table>\n");
    html += &cells("th", &mut table.columns.iter().copied());
    for row in &table.rows {
        html += &cells("td", &mut row.iter().map(String::as_str));
    }
    html + "</table></div>\n</details>\n"
}

/// Thumbnails that open large where they are: the picture is in the file once.
fn gallery(pictures: &[Picture]) -> String {
    let mut html = String::from(
        "<section id=\"pictures\">\n<h2>Pictures</h2>\n\
         <p>For each environment and kind of option: critical regions, abstract states and options, and the \
         executions of one problem (guides blue, arrivals green, failures red). A picture opens large.</p>\n\
         <div class=\"pictures\">\n",
    );
    for Picture { id, caption, uri } in pictures {
        let caption = escape(caption);
        let _ = writeln!(
            html,
            "<figure id=\"{id}\"><a class=\"open\" href=\"#{id}\"><img src=\"{uri}\" alt=\"{caption}\"></a>\
             <figcaption>{caption} <a class=\"close\" href=\"#pictures\">close</a></figcaption></figure>"
        );
    }
    html + "</div>\n</section>\n"
}
