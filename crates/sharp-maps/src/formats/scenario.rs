//! Scenario files of the `MovingAI` benchmark sets: start, goal and optimal length of many problems on one map.

use std::path::Path;

use sharp_space::{GridFrame, Point, Vector};

use super::error::MapError;
use super::files::{self, FileKind};

/// One problem of a scenario file.
#[derive(Clone, Debug, PartialEq)]
pub struct MovingAiProblem {
    /// The map's file, as the scenario names it.
    pub map: String,
    /// Width and height of the map that the places are counted in, cells; 0 if the file does not say.
    pub size: (usize, usize),
    /// Column and row of the start, the upper left cell being (0, 0).
    pub start: (usize, usize),
    /// Column and row of the goal.
    pub goal: (usize, usize),
    /// Length of the shortest path over the centres of cells, diagonals without cut corners, cells.
    pub optimal_length: f64,
}

/// Reads problem `number`, from 1, of the scenario file at `path`.
///
/// # Errors
/// If the file cannot be read, has fewer problems, or that line is broken.
pub fn load_scenario(path: &Path, number: usize) -> Result<MovingAiProblem, MapError> {
    let file = path.display().to_string();
    let bytes = files::read(path, FileKind::Cells)?;
    parse(&file, files::as_text(&file, &bytes)?, number)
}

fn parse(file: &str, text: &str, number: usize) -> Result<MovingAiProblem, MapError> {
    let mut lines = text.lines();
    let first = lines.next().unwrap_or("").trim();
    if !matches!(first, "version 1" | "version 1.0") {
        return Err(MapError::field(file, "line 1", quoted(first), "`version 1`"));
    }
    let problems: Vec<(usize, &str)> = lines
        .enumerate()
        .filter(|(_, line)| !line.trim().is_empty())
        .map(|(index, line)| (index + 2, line))
        .collect();
    let Some(&(line, text)) = number.checked_sub(1).and_then(|index| problems.get(index)) else {
        return Err(MapError::field(file, "problem", number, format!("1 to {}", problems.len())));
    };
    let fields: Vec<&str> = text.split('\t').map(str::trim).collect();
    let expected =
        "nine fields with tabs between: bucket, map, width, height, start x, start y, goal x, goal y, length";
    let broken = || MapError::field(file, format!("line {line}"), quoted(text), expected);
    let &[_, map, width, height, start_x, start_y, goal_x, goal_y, length] = &fields[..] else {
        return Err(broken());
    };
    let whole = |text: &str| text.parse::<usize>().map_err(|_| broken());
    let optimal_length: f64 = length.parse().map_err(|_| broken())?;
    if !(optimal_length >= 0.0 && optimal_length.is_finite()) {
        return Err(broken());
    }
    Ok(MovingAiProblem {
        map: map.to_owned(),
        size: (whole(width)?, whole(height)?),
        start: (whole(start_x)?, whole(start_y)?),
        goal: (whole(goal_x)?, whole(goal_y)?),
        optimal_length,
    })
}

impl MovingAiProblem {
    /// Start and goal on the map `frame`, which is scaled if its size is not the scenario's.
    #[must_use]
    pub fn places(&self, frame: &GridFrame) -> [Point; 2] {
        let scale = |cells: usize, of: usize| if of == 0 { 1.0 } else { cells as f64 / of as f64 };
        let (x, y) = (scale(frame.width, self.size.0), scale(frame.height, self.size.1));
        [self.start, self.goal].map(|(col, row)| {
            let down = (row as f64 + 0.5) * y;
            frame.from_grid(Vector::new((col as f64 + 0.5) * x, frame.height as f64 - down))
        })
    }
}

fn quoted(text: &str) -> String {
    format!("{:?}", text.chars().take(60).collect::<String>())
}

#[cfg(test)]
mod tests {
    use sharp_space::Pose;

    use super::*;

    const TEXT: &str =
        "version 1\n0\tm.map\t4\t2\t0\t0\t3\t1\t3.41421356\n\n1\tm.map\t8\t4\t0\t0\t7\t3\t8\n2\tbroken\n";

    #[test]
    fn places_count_from_the_upper_left() {
        let frame = GridFrame { origin: Pose::new(10.0, 0.0, 0.0), resolution_m: 0.5, width: 4, height: 2 };
        let first = parse("s", TEXT, 1).expect("a problem");
        assert_eq!(first.places(&frame), [Point::new(10.25, 0.75), Point::new(11.75, 0.25)]);
        assert_eq!(first.optimal_length, 3.414_213_56);
        let scaled = parse("s", TEXT, 2).expect("a blank line is no problem");
        assert_eq!(
            scaled.places(&frame),
            [Point::new(10.125, 0.875), Point::new(11.875, 0.125)],
            "twice as fine"
        );
    }

    #[test]
    fn what_is_broken_is_named() {
        for (text, number, message) in [
            ("", 1, "s: line 1 is \"\", must be `version 1`"),
            (TEXT, 0, "s: problem is 0, must be 1 to 3"),
            (TEXT, 4, "s: problem is 4, must be 1 to 3"),
            (TEXT, 3, "s: line 5 is \"2\\tbroken\", must be nine fields"),
        ] {
            let error = parse("s", text, number).expect_err(message).to_string();
            assert!(error.starts_with(message), "{error}");
        }
    }
}
