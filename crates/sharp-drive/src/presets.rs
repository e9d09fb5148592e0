//! The followers of `assets/followers.ron`.

use std::sync::LazyLock;

use serde::Deserialize;

use crate::follower::SteeringRule;
use crate::speed_profile::ProfiledFollower;

/// Everything in the file.
pub(crate) static PRESETS: LazyLock<FollowerPresets> = LazyLock::new(|| {
    ron::from_str(include_str!("../assets/followers.ron")).expect("a test reads the embedded presets")
});

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct FollowerPresets {
    pub(crate) constant: ConstantGrid,
    pub(crate) cautious: (SteeringRule, f64),
    pub(crate) profiled: ProfiledGrid,
    pub(crate) tuned: TunedFollowers,
}

/// Rules and speeds of followers at constant speed.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ConstantGrid {
    pub(crate) rules: Vec<SteeringRule>,
    pub(crate) speeds: Vec<f64>,
}

/// Rules, and pairs of fastest and slowest speed, of profiled followers.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ProfiledGrid {
    pub(crate) rules: Vec<SteeringRule>,
    pub(crate) speeds: Vec<(f64, f64)>,
    pub(crate) drift_compensation: f64,
}

/// The best followers by kind of robot and noise.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct TunedFollowers {
    pub(crate) turning: ProfiledFollower,
    pub(crate) turning_harsh: ProfiledFollower,
    pub(crate) steering: ProfiledFollower,
    pub(crate) steering_biased: ProfiledFollower,
    pub(crate) steering_harsh: ProfiledFollower,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_embedded_presets_can_be_read() {
        assert_eq!((PRESETS.constant.rules.len(), PRESETS.constant.speeds.len()), (4, 4));
        assert_eq!((PRESETS.profiled.rules.len(), PRESETS.profiled.speeds.len()), (4, 3));
        assert!(
            PRESETS.tuned.turning.speed.cruise > PRESETS.tuned.steering_harsh.speed.cruise,
            "in its place"
        );
    }
}
