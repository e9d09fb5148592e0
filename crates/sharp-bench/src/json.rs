//! JSON, one line a value.

use serde::Serialize;

/// `value` as one line of JSON.
///
/// # Panics
/// If a map in `value` has keys that are no strings.
pub fn to_json(value: &impl Serialize) -> String {
    serde_json::to_string(value).expect("reports have string keys and finite numbers")
}
