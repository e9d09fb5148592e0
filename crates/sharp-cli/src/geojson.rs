//! The abstraction as a route graph for Nav2's Route Server.
//!
//! A feature collection of points with an `id` and directed lines with `id`, `startid` and `endid`:
//! endpoints of options are nodes, options are edges, their lengths and times are metadata.

use serde_json::{Value, json};
use sharp_plan::Abstraction;

/// The GeoJSON text of `abstraction`; `speed_mps` turns straight lengths into times.
pub(crate) fn route(abstraction: &Abstraction, speed_mps: f64) -> String {
    let options = &abstraction.options;
    let mut features: Vec<Value> = Vec::new();
    for (id, endpoint) in options.endpoints().iter().enumerate() {
        features.push(json!({
            "type": "Feature",
            "properties": { "id": id, "frame": "map" },
            "geometry": { "type": "Point", "coordinates": [endpoint.center.x, endpoint.center.y] },
        }));
    }
    let nodes = features.len();
    for (index, spec) in options.options().iter().enumerate() {
        let (from, to) =
            (options.endpoint(spec.initiation).center, options.endpoint(spec.termination).center);
        let length_m = (to - from).norm();
        features.push(json!({
            "type": "Feature",
            "properties": {
                "id": nodes + index,
                "startid": spec.initiation.0,
                "endid": spec.termination.0,
                "cost": length_m / speed_mps,
                "metadata": { "option": spec.id.to_string(), "length_m": length_m },
            },
            "geometry": { "type": "MultiLineString", "coordinates": [[[from.x, from.y], [to.x, to.y]]] },
        }));
    }
    json!({ "type": "FeatureCollection", "name": "graph", "features": features }).to_string() + "\n"
}
