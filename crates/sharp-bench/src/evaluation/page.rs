//! The page: one file that opens anywhere, without a network, a script or a font.

use std::collections::BTreeSet;
use std::fmt::{Display, Write};

use sharp_draw::escape;

use super::cases::{Results, Setting, tally};
use super::figure::{Figure, Table};
use super::gallery::Gallery;
use super::missing::Missing;
use crate::result::ResultLine;

const STYLE: &str = include_str!("page.css");

/// What the page is put together from.
#[derive(Debug)]
pub(super) struct Parts<'a> {
    pub(super) results: Results<'a>,
    /// The command that makes the same page again.
    pub(super) command: &'a str,
    pub(super) figures: Vec<Figure>,
    pub(super) galleries: [Gallery; 2],
    pub(super) missing: Vec<Missing>,
}

/// The whole document.
pub(super) fn html(parts: &Parts<'_>) -> String {
    let mut html = String::from(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>SHARP evaluation</title>\n<style>\n",
    );
    html += STYLE;
    html += "</style>\n</head>\n<body>\n";
    html += &head(parts);
    html += &navigation(parts);
    html.extend(parts.figures.iter().map(section));
    html.extend(parts.galleries.iter().filter(|gallery| !gallery.pictures.is_empty()).map(gallery));
    if !parts.missing.is_empty() {
        html += &missing(&parts.missing);
    }
    html + "</body>\n</html>\n"
}

/// What was run, and how it ended.
fn head(parts: &Parts<'_>) -> String {
    let lines = parts.results.sharp(parts.results.main);
    let solved = lines.iter().filter(|line| line.is_solved()).count();
    let tally = tally(&lines);
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
    let _ = writeln!(html, "<p>{}</p>", escape(&what_was_run(&parts.results)));
    let _ = writeln!(html, "<pre>{}</pre>", escape(parts.command));
    html
}

fn what_was_run(results: &Results<'_>) -> String {
    let compared = results.compared();
    let (lines, baselines): (Vec<&ResultLine>, Vec<&ResultLine>) =
        compared.into_iter().partition(|line| line.is_of_sharp());
    let names = |of: fn(&ResultLine) -> &str| listed(lines.iter().map(|line| of(line)));
    let Setting { learning, regions, noise, variant } = results.main;
    let mut text = format!(
        "sharp {}; environments {}; robots {}; options {}; regions {regions}; noise {noise}; learning {learning}; \
         seed {}",
        names(|line| &line.version),
        names(|line| &line.env),
        names(|line| &line.robot),
        names(|line| &line.options),
        listed(lines.iter().map(|line| line.seed)),
    );
    if variant != Setting::USUAL.variant {
        let _ = write!(text, "; {}", variant.replace('_', " "));
    }
    if !baselines.is_empty() {
        let _ = write!(text, "; baselines {}", listed(baselines.iter().map(|line| &line.system)));
    }
    text + "."
}

/// Each of `items` once, in order.
fn listed<T: Ord + Display>(items: impl Iterator<Item = T>) -> String {
    let items: Vec<String> = items.collect::<BTreeSet<T>>().iter().map(ToString::to_string).collect();
    items.join(", ")
}

fn navigation(parts: &Parts<'_>) -> String {
    let mut html = String::from("<nav>");
    let figures = parts.figures.iter().map(|figure| (figure.name, figure.title));
    let galleries = parts.galleries.iter().filter(|gallery| !gallery.pictures.is_empty());
    let missing = (!parts.missing.is_empty()).then_some(("missing", "Not measured"));
    for (name, title) in figures.chain(galleries.map(|gallery| (gallery.name, gallery.title))).chain(missing)
    {
        let _ = write!(html, "<a href=\"#{name}\">{title}</a>");
    }
    html + "</nav>\n"
}

fn section(figure: &Figure) -> String {
    let Figure { name, title, caption, .. } = figure;
    let mut html = format!("<section id=\"{name}\">\n<h2>{title}</h2>\n<p>{}</p>\n", escape(caption));
    html += &figure.legend.to_svg("legend");
    html += "<div class=\"panels\">\n";
    for panel in &figure.panels {
        html += &panel.chart.to_svg(&format!("{title}: {}", panel.title));
    }
    html += "</div>\n";
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
    let mut html = String::from(
        "<details>\n<summary>The numbers</summary>\n<div class=\"wide\" tabindex=\"0\"><table>\n",
    );
    html += &cells("th", &mut table.columns.iter().copied());
    for row in &table.rows {
        html += &cells("td", &mut row.iter().map(String::as_str));
    }
    html + "</table></div>\n</details>\n"
}

/// Thumbnails that open large where they are: the picture is in the file once.
fn gallery(Gallery { name, title, text, pictures }: &Gallery) -> String {
    let mut html =
        format!("<section id=\"{name}\">\n<h2>{title}</h2>\n<p>{text}</p>\n<div class=\"pictures\">\n");
    for picture in pictures {
        let (id, caption, uri) = (escape(&picture.name), escape(&picture.caption), &picture.uri);
        let _ = writeln!(
            html,
            "<figure id=\"{id}\"><a class=\"open\" href=\"#{id}\"><img src=\"{uri}\" alt=\"{caption}\"></a>\
             <figcaption>{caption} (<a href=\"{id}.png\">PNG</a>) \
             <a class=\"close\" href=\"#{name}\">close</a></figcaption></figure>"
        );
    }
    html + "</div>\n</section>\n"
}

/// What the results lack, with the commands that add it.
fn missing(missing: &[Missing]) -> String {
    let mut html = String::from(
        "<section id=\"missing\">\n<h2>Not measured</h2>\n<p>Left out above, and the command that adds it to \
         the same folder:</p>\n<ul>\n",
    );
    for Missing { what, command } in missing {
        let _ = writeln!(html, "<li>{}: <code>{}</code></li>", escape(what), escape(command));
    }
    html + "</ul>\n</section>\n"
}
