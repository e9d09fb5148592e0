//! The abstract states and options of a map as GeoJSON, in metres of the map's own frame.
//!
//! `geojson MAP`, for example `geojson a`. It needs no simulator, no learning and no region network.

use std::error::Error;
use std::fmt::Write;

use sharp_maps::{LoadOptions, load};
use sharp_options::{EndpointId, InterfaceOptions, OptionFamily, OptionSet, OptionSettings};
use sharp_rbvd::{Rbvd, RbvdSettings, StateId};
use sharp_regions::GeometricDetector;
use sharp_space::{Cell, DistanceField, Footprint, Point, RegionDetector};

fn main() -> Result<(), Box<dyn Error>> {
    let map = std::env::args().nth(1).ok_or("usage: geojson MAP")?;
    let grid = load(&map, &LoadOptions::default())?.grid;
    let footprint = Footprint::rectangle(0.5, 0.335)?;
    let detection = GeometricDetector::default().detect(&grid, &footprint);
    let settings = RbvdSettings::for_footprint(&footprint, 0.05, grid.frame().resolution_m);
    let states = Rbvd::build(&DistanceField::new(&grid), &detection.regions, &settings)?;
    let options = InterfaceOptions.synthesize(&states, &OptionSettings::default());
    if states.is_empty() || options.options().is_empty() {
        return Err(format!("map {map} has {} states", states.len()).into());
    }
    let features: Vec<String> =
        states.states().map(|state| state_feature(&states, state)).chain(option_features(&options)).collect();
    println!(r#"{{"type":"FeatureCollection","features":[{}]}}"#, features.join(",\n"));
    Ok(())
}

/// The cells of a state as rectangles, one for each run of cells in a row.
fn state_feature(states: &Rbvd, state: StateId) -> String {
    let frame = *states.frame();
    let mut rectangles = Vec::new();
    for row in 0..frame.height {
        let is_inside = |&col: &usize| states.state_of(Cell::new(col, row)) == Some(state);
        let mut col = 0;
        while col < frame.width {
            let run = (col..frame.width).take_while(is_inside).count();
            if run > 0 {
                rectangles.push(rectangle(
                    frame.center(Cell::new(col, row)),
                    frame.center(Cell::new(col + run - 1, row)),
                    0.5 * frame.resolution_m,
                ));
            }
            col += run + 1;
        }
    }
    let geometry = format!(r#"{{"type":"MultiPolygon","coordinates":[{}]}}"#, rectangles.join(","));
    feature(&geometry, &format!(r#""state":{}"#, state.0))
}

fn rectangle(first: Point, last: Point, half_m: f64) -> String {
    let (left, right) = (first.x - half_m, last.x + half_m);
    let (low, high) = (first.y - half_m, last.y + half_m);
    line(&[(left, low), (right, low), (right, high), (left, high), (left, low)], "[[", "]]")
}

/// Options as lines from one endpoint to the other.
fn option_features(options: &OptionSet) -> impl Iterator<Item = String> {
    options.options().iter().map(|option| {
        let center = |id: EndpointId| options.endpoint(id).center;
        let (from, to) = (center(option.initiation), center(option.termination));
        let points = line(&[(from.x, from.y), (to.x, to.y)], "[", "]");
        let geometry = format!(r#"{{"type":"LineString","coordinates":{points}}}"#);
        feature(&geometry, &format!(r#""option":"{}""#, option.id))
    })
}

fn feature(geometry: &str, properties: &str) -> String {
    format!(r#"{{"type":"Feature","properties":{{{properties}}},"geometry":{geometry}}}"#)
}

fn line(points: &[(f64, f64)], open: &str, close: &str) -> String {
    let mut text = String::from(open);
    for (i, (x, y)) in points.iter().enumerate() {
        let comma = if i == 0 { "" } else { "," };
        // Writing to a String cannot fail.
        let _ = write!(text, "{comma}[{x:.3},{y:.3}]");
    }
    text + close
}
