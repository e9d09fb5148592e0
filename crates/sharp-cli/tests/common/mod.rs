//! What tests of several files share.

use std::fs;
use std::path::Path;

use serde_json::Value;

/// The results in `folder` without wall times.
pub(crate) fn results(folder: &Path) -> Vec<Value> {
    let text = fs::read_to_string(folder.join("results.jsonl")).expect("results");
    let untimed = |line: &str| {
        let mut line: Value = serde_json::from_str(line).expect("JSON");
        for key in ["time_s", "decision_us"] {
            line.as_object_mut().expect("an object").remove(key).expect("wall times are reported");
        }
        line
    };
    text.lines().map(untimed).collect()
}
