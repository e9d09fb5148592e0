//! The page as a browser shows it, on a desk and on a telephone; where there is no browser, the test says so.

use std::path::Path;
use std::process::Command;

use super::tests::{evaluate, whole};

const BROWSERS: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];

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

/// The name of a browser that can be called, if there is one.
fn browser() -> Option<&'static str> {
    let works =
        |name: &&str| Command::new(name).arg("--version").output().is_ok_and(|it| it.status.success());
    BROWSERS.into_iter().find(works)
}

/// What [`FRAME`] finds in a page that is shown `width_px` wide, and what the browser complained of.
fn look(browser: &str, report: &Path, width_px: u32) -> (Vec<i64>, String) {
    let frame = report.join(format!("frame-{width_px}.html"));
    std::fs::write(&frame, FRAME.replace("WIDTH", &width_px.to_string())).expect("a file");
    let output = Command::new(browser)
        .args(["--headless=new", "--no-sandbox", "--disable-gpu", "--allow-file-access-from-files"])
        .args(["--virtual-time-budget=10000", "--enable-logging=stderr", "--dump-dom"])
        .arg(format!("--user-data-dir={}", report.join("profile").display()))
        .arg(format!("file://{}", frame.display()))
        .output()
        .expect("the browser runs");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let title = text.split("<title>seen ").nth(1).and_then(|rest| rest.split('<').next());
    let title = title.unwrap_or_else(|| panic!("the page was not seen: {text}"));
    let numbers = title.split(' ').map(|number| number.parse().expect("a number")).collect();
    let complaints = String::from_utf8_lossy(&output.stderr).into_owned();
    (numbers, complaints.lines().filter(|line| line.contains("CONSOLE")).collect())
}

#[test]
fn a_browser_draws_every_figure_on_a_desk_and_on_a_telephone() {
    let Some(browser) = browser() else {
        eprintln!("skipped: none of {BROWSERS:?} can be called");
        return;
    };
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
