//! Pages as a browser shows them; where there is no browser, tests say so.

use std::path::Path;
use std::process::Command;

const BROWSERS: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];

/// The name of a browser that can be called; `None`, said on stderr, where there is none.
pub(crate) fn browser() -> Option<&'static str> {
    let works =
        |name: &&str| Command::new(name).arg("--version").output().is_ok_and(|it| it.status.success());
    let found = BROWSERS.into_iter().find(works);
    if found.is_none() {
        eprintln!("SKIPPED: none of {BROWSERS:?} can be called");
    }
    found
}

/// Opens the page `html` from `folder`; returns what it wrote behind the word `seen` into its title, and what the
/// browser complained of.
pub(crate) fn title_after(browser: &str, folder: &Path, html: &str) -> (String, String) {
    let page = folder.join("seen.html");
    std::fs::write(&page, html).expect("a file");
    let output = Command::new(browser)
        .args(["--headless=new", "--no-sandbox", "--disable-gpu", "--allow-file-access-from-files"])
        .args(["--disable-background-networking", "--virtual-time-budget=10000"])
        .args(["--enable-logging=stderr", "--dump-dom"])
        .arg(format!("--user-data-dir={}", folder.join("profile").display()))
        .arg(format!("file://{}", page.display()))
        .output()
        .expect("the browser runs");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let title = text.split("<title>seen ").nth(1).and_then(|rest| rest.split('<').next());
    let title = title.unwrap_or_else(|| panic!("the page was not seen: {text}")).to_owned();
    let complaints = String::from_utf8_lossy(&output.stderr).into_owned();
    (title, complaints.lines().filter(|line| line.contains("CONSOLE")).collect())
}
