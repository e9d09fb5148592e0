//! Speed limits from a mask, by the rule of Nav2's speed filter.

use sharp_drive::{SpeedLimits, SpeedLimitsError};
use sharp_maps::ValueMask;
use thiserror::Error;

/// How the values of a mask become limits: `base + multiplier x value`, as in a `CostmapFilterInfo` message.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedRule {
    /// The limit of a value of 0, if that were no "no limit".
    pub base: f64,
    /// What is added for each unit of the value.
    pub multiplier: f64,
    /// Whether limits are metres per second (type 2 of Nav2) and not percent of the robot's top speed (type 1).
    pub is_absolute: bool,
}

impl Default for SpeedRule {
    /// The rule of Nav2's tutorial: a value of 30 takes 30 % off the top speed.
    fn default() -> Self {
        Self { base: 100.0, multiplier: -1.0, is_absolute: false }
    }
}

/// Why a mask gives no limits.
#[derive(Debug, Error)]
pub enum SpeedMaskError {
    /// A value stands for no speed.
    #[error("the value {value} at ({x:.2}, {y:.2}) means {limit}, expected {expected}")]
    Value {
        /// The value of the mask.
        value: i8,
        /// Where the first such cell is, metres.
        x: f64,
        /// Likewise.
        y: f64,
        /// What the rule makes of it.
        limit: String,
        /// What would be right.
        expected: &'static str,
    },
    /// The limits are refused.
    #[error(transparent)]
    Limits(#[from] SpeedLimitsError),
}

/// The limits of `mask` for a robot with a top speed of `max_speed_mps`. As in Nav2 the value 0, unknown cells and places
/// outside the mask have none. Stricter than Nav2, which takes such a limit for none, is the refusal of limits that are
/// not positive or above 100 %.
///
/// # Errors
/// Names the first cell whose value stands for no speed, or for one too slow to drive at.
pub fn speed_limits(
    mask: &ValueMask,
    rule: SpeedRule,
    max_speed_mps: f64,
) -> Result<SpeedLimits, SpeedMaskError> {
    let at = |value: i8| {
        let index = mask.values.iter().position(|&other| other == value).unwrap_or_default();
        mask.frame.center(mask.frame.cell(index))
    };
    let refused = |value: i8, limit: String, expected| {
        let place = at(value);
        SpeedMaskError::Value { value, x: place.x, y: place.y, limit, expected }
    };
    let mut table = [0.0_f32; 101];
    for (value, limit) in
        table.iter_mut().enumerate().skip(1).filter(|(value, _)| mask.values.contains(&(*value as i8)))
    {
        let number = rule.base + rule.multiplier * value as f64;
        let value = value as i8;
        let (limit_mps, unit) =
            if rule.is_absolute { (number, "m/s") } else { (max_speed_mps * number / 100.0, "%") };
        if !rule.is_absolute && number > 100.0 {
            return Err(refused(value, format!("{number} %"), "at most 100 %"));
        }
        let is_speed = limit_mps >= sharp_drive::SPEED_LIMIT_MIN_MPS;
        if !is_speed {
            let expected = "at least 0.05 m/s; a place to keep out of belongs into --keepout";
            return Err(refused(value, format!("{number} {unit}"), expected));
        }
        *limit = limit_mps as f32;
    }
    let limit = |&value: &i8| if value > 0 { table[value as usize] } else { 0.0 };
    Ok(SpeedLimits::new(mask.frame, mask.values.iter().map(limit).collect())?)
}

#[cfg(test)]
mod tests {
    use sharp_space::{Cell, GridFrame, Pose};

    use super::*;

    /// The limits at the four cells of a mask with `values` for a robot that reaches 2 m/s.
    fn limits(values: [i8; 4], rule: SpeedRule) -> Result<Vec<f64>, String> {
        let frame = GridFrame { origin: Pose::new(0.0, 0.0, 0.0), resolution_m: 1.0, width: 4, height: 1 };
        let mask = ValueMask { frame, values: values.to_vec(), warnings: vec![] };
        let limits = speed_limits(&mask, rule, 2.0).map_err(|error| error.to_string())?;
        Ok((0..4).map(|col| limits.at(frame.center(Cell::new(col, 0)))).collect())
    }

    #[test]
    fn values_become_limits_as_in_nav2() {
        let none = f64::INFINITY;
        assert_eq!(limits([0, -1, 50, 75], SpeedRule::default()), Ok(vec![none, none, 1.0, 0.5]));
        let absolute = SpeedRule { base: 0.0, multiplier: 0.25, is_absolute: true };
        assert_eq!(limits([0, -1, 1, 8], absolute), Ok(vec![none, none, 0.25, 2.0]));
    }

    #[test]
    fn what_is_no_speed_is_refused_with_its_place() {
        let error = limits([0, 0, 100, 0], SpeedRule::default()).expect_err("no speed");
        assert!(
            error.starts_with("the value 100 at (2.50, 0.50) means 0 %, expected at least 0.05 m/s"),
            "{error}"
        );
        let fast = SpeedRule { multiplier: 1.0, ..SpeedRule::default() };
        assert!(limits([0, 0, 0, 5], fast).expect_err("too fast").contains("means 105 %"));
        assert!(limits([0, 0, 0, 5], SpeedRule { base: f64::NAN, ..fast }).is_err());
    }
}
