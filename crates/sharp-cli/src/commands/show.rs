//! The page of `--show`: where it goes.

use std::path::{Path, PathBuf};

use sharp_bench::{PlanPage, clock_us};
use sharp_plan::{OptionLibrary, Tour, write_atomic};
use sharp_space::Seed;

use crate::outcome::Failure;
use crate::progress::spinner;

/// Drives `tour`, whose plan lies in `folder`, and writes the page to `file` or into the folder; returns its path.
pub(crate) fn solved(
    (tour, map): (&Tour, &str),
    library: Option<&OptionLibrary>,
    seed: u64,
    (folder, file): (&Path, Option<&Path>),
) -> Result<PathBuf, Failure> {
    let spinner = spinner("driving");
    let recordings = tour.record(&tour.run_settings(PlanPage::EPISODES, Seed(seed)), &clock_us());
    spinner.finish_and_clear();
    write(&PlanPage { map, tour, recordings: &recordings, library }, folder, file)
}

/// Writes the page of `shown` to `file`, or into the plan's `folder`; returns its path.
pub(crate) fn write(shown: &PlanPage<'_>, folder: &Path, file: Option<&Path>) -> Result<PathBuf, Failure> {
    let path = file.map_or_else(|| folder.join("show.html"), Path::to_owned);
    write_atomic(&path, shown.to_html()?.as_bytes())?;
    Ok(path)
}
