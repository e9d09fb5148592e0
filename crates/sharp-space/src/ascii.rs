//! Maps drawn as text: `#` occupied, `.` free, `?` unknown; the first row is the top.

use std::fmt;

use crate::grid::{Cell, GridError, GridFrame, Occupancy, OccupancyGrid};
use crate::pose::Pose;

impl OccupancyGrid {
    /// Reads a drawn map whose lower-left corner lies at the world's origin.
    ///
    /// Blank lines and blanks around a row are ignored, so that maps can be drawn inside tests.
    ///
    /// # Errors
    /// Returns an error that names the first row that is too short, too long or unreadable.
    pub fn from_ascii(resolution_m: f64, drawing: &str) -> Result<Self, GridError> {
        let rows: Vec<&str> = drawing.lines().map(str::trim).filter(|row| !row.is_empty()).collect();
        let width = rows.first().map_or(0, |row| row.chars().count());
        let mut cells = Vec::with_capacity(width * rows.len());
        for (row, line) in rows.iter().enumerate().rev() {
            let found = line.chars().count();
            if found != width {
                return Err(GridError::RowLength { row, found, expected: width });
            }
            for (col, found) in line.chars().enumerate() {
                cells.push(match found {
                    '#' => Occupancy::Occupied,
                    '.' => Occupancy::Free,
                    '?' => Occupancy::Unknown,
                    _ => return Err(GridError::Character { row, col, found }),
                });
            }
        }
        let origin = Pose::new(0.0, 0.0, 0.0);
        Self::new(GridFrame { origin, resolution_m, width, height: rows.len() }, cells)
    }
}

impl fmt::Display for OccupancyGrid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for row in (0..self.frame().height).rev() {
            for col in 0..self.frame().width {
                f.write_str(match self.get(Cell::new(col, row)) {
                    Occupancy::Free => ".",
                    Occupancy::Occupied => "#",
                    Occupancy::Unknown => "?",
                })?;
            }
            f.write_str("\n")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drawing_survives_a_round_trip() {
        let drawing = "####\n#.?#\n####\n";
        let grid = OccupancyGrid::from_ascii(0.1, drawing).unwrap();
        assert_eq!(grid.to_string(), drawing);
        assert_eq!(grid.get(Cell::new(2, 1)), Occupancy::Unknown, "column 2 of the middle row");
    }

    #[test]
    fn broken_drawings_name_the_row() {
        assert_eq!(
            OccupancyGrid::from_ascii(1.0, "###\n##"),
            Err(GridError::RowLength { row: 1, found: 2, expected: 3 })
        );
        assert_eq!(
            OccupancyGrid::from_ascii(1.0, "#x#"),
            Err(GridError::Character { row: 0, col: 1, found: 'x' })
        );
    }
}
