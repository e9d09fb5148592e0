//! Grid maps of the `MovingAI` benchmark sets (Sturtevant, "Benchmarks for Grid-Based Pathfinding",
//! 2012).
//!
//! Terrain a wheeled robot can drive on is free: ground `.` and `G`, swamp `S`. Out of bounds
//! `@` and `O`, trees `T` and water `W` block. The file's first row is the top of the map.

use sharp_space::{GridFrame, Occupancy, OccupancyGrid, Pose};

use super::error::MapError;
use super::load::check_size;

/// Reads the text of a map whose lower-left corner shall lie at the world's origin.
pub(crate) fn parse(file: &str, text: &str, resolution_m: f64) -> Result<OccupancyGrid, MapError> {
    let mut lines = text.lines();
    let mut header = |line: usize, key: &str| {
        let found = lines.next().unwrap_or("").trim_end();
        let value = found.strip_prefix(key).map(str::trim);
        value.ok_or_else(|| {
            MapError::field(file, format!("line {line}"), quoted(found), format!("`{key}` and its value"))
        })
    };
    header(1, "type")?;
    let height = side(file, "height", header(2, "height")?)?;
    let width = side(file, "width", header(3, "width")?)?;
    header(4, "map")?;
    check_size(file, width, height)?;

    let rows: Vec<&str> = lines.map(|line| line.trim_end_matches('\r')).collect();
    let rows = without_trailing_blanks(&rows);
    if rows.len() != height {
        return Err(MapError::field(file, "number of rows", rows.len(), format!("the height, {height}")));
    }
    let mut cells = Vec::with_capacity(width * height);
    for (row, line) in rows.iter().enumerate().rev() {
        push_row(&mut cells, file, row, line)?;
        if line.len() != width {
            let expected = format!("the width, {width}");
            return Err(MapError::field(file, format!("length of map row {row}"), line.len(), expected));
        }
    }
    let frame = GridFrame { origin: Pose::new(0.0, 0.0, 0.0), resolution_m, width, height };
    OccupancyGrid::new(frame, cells).map_err(|e| MapError::grid(file, e))
}

fn push_row(cells: &mut Vec<Occupancy>, file: &str, row: usize, line: &str) -> Result<(), MapError> {
    for (col, found) in line.chars().enumerate() {
        cells.push(match found {
            '.' | 'G' | 'S' => Occupancy::Free,
            '@' | 'O' | 'T' | 'W' => Occupancy::Occupied,
            _ => {
                let field = format!("map row {row}, column {col}");
                return Err(MapError::field(file, field, format!("{found:?}"), "one of . G S W @ O T"));
            }
        });
    }
    Ok(())
}

fn side(file: &str, field: &str, value: &str) -> Result<usize, MapError> {
    value.parse().map_err(|_| MapError::field(file, field, quoted(value), "a whole number of cells"))
}

fn without_trailing_blanks<'a, 'b>(rows: &'a [&'b str]) -> &'a [&'b str] {
    let end = rows.iter().rposition(|row| !row.is_empty()).map_or(0, |last| last + 1);
    &rows[..end]
}

/// A value for a message: quoted, and cut where a broken file would flood the screen.
fn quoted(value: &str) -> String {
    format!("{:?}", value.chars().take(40).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn terrain_becomes_free_or_occupied_with_the_first_row_on_top() {
        let grid = parse("m", "type octile\r\nheight 2\r\nwidth 7\r\nmap\r\n.GSW@OT\r\n@@@@@@.\r\n\n", 2.0);
        let grid = grid.expect("the map is sound");
        assert_eq!(grid.to_string(), "...####\n######.\n");
        assert_eq!(grid.frame().resolution_m, 2.0, "metres a cell");
    }

    #[test]
    fn broken_maps_name_the_line() {
        let cases = [
            ("", "m: line 1 is \"\", must be `type` and its value"),
            ("type octile\nwidth 2\n", "m: line 2 is \"width 2\", must be `height` and its value"),
            ("type octile\nheight x\nwidth 2\nmap\n", "m: height is \"x\", must be a whole number of cells"),
            ("type octile\nheight 2\nwidth 2\nmap\n..\n", "m: number of rows is 1, must be the height, 2"),
            (
                "type octile\nheight 1\nwidth 2\nmap\n...\n",
                "m: length of map row 0 is 3, must be the width, 2",
            ),
            (
                "type octile\nheight 1\nwidth 2\nmap\n.x\n",
                "m: map row 0, column 1 is 'x', must be one of . G S W @ O T",
            ),
            (
                "type octile\nheight 0\nwidth 99999999\nmap\n",
                "m: size is 99999999 x 0, must be 1 to 32767 cells a side and at most 67108864 in all",
            ),
        ];
        for (text, expected) in cases {
            let error = parse("m", text, 1.0).expect_err(text);
            assert_eq!(error.to_string(), expected, "{text:?}");
        }
        let error = parse("m", "type octile\nheight 1\nwidth 1\nmap\n.\n", f64::NAN).expect_err("NaN");
        assert!(error.to_string().starts_with("m: resolution is NaN m"), "{error}");
    }
}
