//! Shortening of paths by random short cuts (Geraerts and Overmars 2007).

use rand::RngExt;
use sharp_space::{CollisionChecker, Stream};

use crate::path::Path;
use crate::steering::Steering;

/// How hard to try.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShortcutSettings {
    /// Pairs of poses tried.
    pub iterations: usize,
    /// The distance between two collision checks, metres; also the spacing of the result.
    pub check_step_m: f64,
}

impl Default for ShortcutSettings {
    fn default() -> Self {
        Self { iterations: 100, check_step_m: 0.05 }
    }
}

/// Replaces parts of `path` by free maneuvers that cost less. Both ends stay; the cost never grows.
#[must_use]
pub fn shortcut(
    path: &Path,
    checker: &(impl CollisionChecker + ?Sized),
    steering: &Steering,
    settings: &ShortcutSettings,
    rng: &mut Stream,
) -> Path {
    let mut poses = path.poses().to_vec();
    for _ in 0..settings.iterations {
        let (a, b) = (rng.random_range(0..poses.len()), rng.random_range(0..poses.len()));
        let (first, last) = (a.min(b), a.max(b));
        if last < first + 2 {
            continue;
        }
        let direct = steering.maneuver(poses[first], poses[last]);
        let along: f64 =
            poses[first..=last].windows(2).map(|pair| steering.distance_m(pair[0], pair[1])).sum();
        // A gain below a millimetre is noise, and accepting it would waste the remaining iterations.
        let gains = direct.cost_m() < along - 1e-3;
        if gains && direct.all(settings.check_step_m, |pose| checker.is_free(pose)) {
            poses.splice(first..=last, direct.poses(settings.check_step_m));
        }
    }
    Path::new(poses).expect("both ends stay")
}
