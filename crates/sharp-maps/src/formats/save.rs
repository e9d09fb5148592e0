//! Writing ROS maps as the ROS map saver writes them.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use sharp_space::{Occupancy, OccupancyGrid};

use super::error::MapError;
use super::ros::{FREE_THRESHOLD, OCCUPIED_THRESHOLD};

/// Writes `grid` as a trinary ROS map: the YAML file `path` and a PGM image of the same stem beside
/// it. Loading it gives an equal grid.
///
/// Each file appears under its name only when it is complete, the image before the YAML that
/// names it.
///
/// # Errors
/// Returns an error if `path` has no plain file name that YAML can hold, does not end as ROS maps
/// do (`.yaml` or `.yml`), which is how a reader knows one, or the files cannot be written.
pub fn save_ros(grid: &OccupancyGrid, path: &Path) -> Result<(), MapError> {
    let file = path.display().to_string();
    let stem = path.file_stem().and_then(|stem| stem.to_str());
    let stem = stem.filter(|stem| !stem.chars().any(char::is_control)).ok_or_else(|| {
        let expected = "a path that ends in a printable file name";
        MapError::field(&file, "path", format!("{file:?}"), expected)
    })?;
    let ending = path.extension().map(|ending| ending.to_string_lossy());
    if !ending.as_deref().is_some_and(super::ros::is_ending) {
        let found = ending.map_or("missing".to_owned(), |ending| format!("{ending:?}"));
        return Err(MapError::field(&file, "ending", found, ".yaml or .yml"));
    }
    let image = path.with_file_name(format!("{stem}.pgm"));
    let yaml = yaml(grid, &format!("{stem}.pgm"));
    replace(&image, &pgm(grid))?;
    replace(path, yaml.as_bytes())
}

fn pgm(grid: &OccupancyGrid) -> Vec<u8> {
    let frame = grid.frame();
    let mut bytes = format!("P5\n{} {}\n255\n", frame.width, frame.height).into_bytes();
    for row in grid.cells().chunks_exact(frame.width).rev() {
        bytes.extend(row.iter().map(|cell| match cell {
            Occupancy::Free => 254,
            Occupancy::Occupied => 0,
            Occupancy::Unknown => super::ros::UNKNOWN_GREY,
        }));
    }
    bytes
}

fn yaml(grid: &OccupancyGrid, image: &str) -> String {
    let frame = grid.frame();
    let [x, y, yaw]: [f64; 3] = frame.origin.into();
    // Single quotes: the only character that needs care inside is the quote itself.
    let image = image.replace('\'', "''");
    format!(
        "image: '{image}'\nmode: trinary\nresolution: {}\norigin: [{x}, {y}, {yaw}]\nnegate: 0\n\
         occupied_thresh: {OCCUPIED_THRESHOLD}\nfree_thresh: {FREE_THRESHOLD}\n",
        frame.resolution_m
    )
}

/// Writes a file beside `path` and moves it there, so that no reader ever sees an incomplete file.
fn replace(path: &Path, bytes: &[u8]) -> Result<(), MapError> {
    let failed = |source| MapError::Write { file: path.display().to_string(), source };
    let (temporary, mut file) = create_beside(path).map_err(failed)?;
    let written = file.write_all(bytes).and_then(|()| file.sync_all());
    let moved = written.and_then(|()| fs::rename(&temporary, path));
    moved.map_err(|error| {
        // The first failure is the one to report. A leftover file does no harm.
        let _ = fs::remove_file(&temporary);
        failed(error)
    })
}

/// Creates a file that did not exist before: two writers never share one.
fn create_beside(path: &Path) -> io::Result<(PathBuf, File)> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let mut number = 0;
    loop {
        let temporary = path.with_file_name(format!(".{name}.{number}.tmp"));
        match OpenOptions::new().write(true).create_new(true).open(&temporary) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists && number < 1000 => number += 1,
            opened => return Ok((temporary, opened?)),
        }
    }
}
