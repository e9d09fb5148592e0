//! The page as a browser shows it, on a desk and on a telephone; where there is no browser, the test says so.

use std::path::Path;

use super::tests::{evaluate, whole};
use crate::tests::browser::{browser, title_after};

/// Opens the page in a frame of WIDTH pixels, unfolds everything, and writes what it finds to the title:
/// pixels by which the page is too wide, figures, figures without area, pixels of the smallest text,
/// errors of scripts and files.
const FRAME: &str = r#"<!DOCTYPE html><title>waiting</title>
<iframe id="frame" src="index.html" style="border:0;width:WIDTHpx;height:4000px"></iframe>
<script>
let errors = 0;
window.onerror = () => errors++;
frame.onload = () => {
  const page = frame.contentDocument, root = page.documentElement;
  page.querySelectorAll('details').forEach(details => details.open = true);
  const figures = [...page.querySelectorAll('.panels svg')].map(svg => svg.getBoundingClientRect());
  const empty = figures.filter(box => box.width * box.height == 0).length;
  const texts = [...page.querySelectorAll('svg text')].map(text => text.getBoundingClientRect().height);
  const broken = [...page.images].filter(image => image.naturalWidth == 0).length;
  document.title = ['seen', root.scrollWidth - root.clientWidth, figures.length, empty,
    Math.floor(Math.min(...texts)), errors + broken].join(' ');
};
</script>"#;

/// What [`FRAME`] finds in a page that is shown `width_px` wide, and what the browser complained of.
fn look(browser: &str, report: &Path, width_px: u32) -> (Vec<i64>, String) {
    let frame = FRAME.replace("WIDTH", &width_px.to_string());
    let (title, complaints) = title_after(browser, report, &frame);
    let numbers = title.split(' ').map(|number| number.parse().expect("a number")).collect();
    (numbers, complaints)
}

#[test]
fn a_browser_draws_every_figure_on_a_desk_and_on_a_telephone() {
    let Some(browser) = browser() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let html = evaluate(&whole(), folder.path());
    let panels: usize = html
        .split("<div class=\"panels\">")
        .skip(1)
        .map(|part| part.split("</div>").next().unwrap_or_default().matches("<svg").count())
        .sum();
    for width_px in [1280, 390] {
        let (numbers, complaints) = look(browser, &folder.path().join("report"), width_px);
        let [too_wide_px, figures, empty, smallest_px, errors] = numbers[..] else { panic!("{numbers:?}") };
        assert_eq!(complaints, "", "at {width_px}");
        assert_eq!((too_wide_px, errors), (0, 0), "at {width_px}: the page does not scroll sideways");
        assert_eq!((figures, empty), (panels as i64, 0), "at {width_px}: every figure has its place");
        assert!(smallest_px >= 10, "at {width_px}: text of {smallest_px} pixels");
    }
}
