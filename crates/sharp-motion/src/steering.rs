//! Local planners: what a forward-only robot can drive between two poses in free space.

use sharp_space::{Heading, Pose};

use crate::dubins;
use crate::maneuver::{Maneuver, Primitive};

/// How a robot gets from one pose to another where no obstacle is in the way. It drives forward only, so
/// connections are directed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Steering {
    /// Turn in place, drive straight, turn in place: a differential drive.
    RotateTranslate,
    /// The shortest curve of bounded curvature (Dubins 1957): a car.
    Dubins {
        /// Smallest turning radius, metres, positive.
        radius_m: f64,
    },
}

impl Steering {
    /// The steering of a robot with the given smallest turning radius, metres; 0 if it turns in place.
    #[must_use]
    pub fn of(radius_m: f64) -> Self {
        if radius_m > 0.0 { Self::Dubins { radius_m } } else { Self::RotateTranslate }
    }

    /// The connection of `from` to `to`.
    #[must_use]
    pub fn maneuver(&self, from: Pose, to: Pose) -> Maneuver {
        match *self {
            Self::RotateTranslate => Maneuver::new(from, to, rotate_translate(from, to)),
            Self::Dubins { radius_m } => Maneuver::new(from, to, dubins::shortest(from, to, radius_m)),
        }
    }

    /// Poses at most `step_m` metres (in a turn in place, radians) apart, both ends included.
    #[must_use]
    pub fn connect(&self, from: Pose, to: Pose, step_m: f64) -> Vec<Pose> {
        self.maneuver(from, to).poses(step_m)
    }

    /// Metres driven plus what turns in place are worth: at least the straight distance, not symmetric.
    #[must_use]
    pub fn distance_m(&self, from: Pose, to: Pose) -> f64 {
        self.maneuver(from, to).cost_m()
    }

    /// The smallest turning radius, metres; 0 for a robot that turns in place.
    #[must_use]
    pub const fn radius_m(&self) -> f64 {
        match *self {
            Self::RotateTranslate => 0.0,
            Self::Dubins { radius_m } => radius_m,
        }
    }
}

fn rotate_translate(from: Pose, to: Pose) -> [Primitive; 3] {
    let offset = to.position - from.position;
    let travel_m = offset.norm();
    // Below a micrometre the bearing is noise.
    let bearing = if travel_m > 1e-6 { Heading::of(offset) } else { from.heading };
    [
        Primitive { travel_m: 0.0, turn_rad: from.heading.turn_to(bearing) },
        Primitive { travel_m, turn_rad: 0.0 },
        Primitive { travel_m: 0.0, turn_rad: bearing.turn_to(to.heading) },
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEERINGS: [Steering; 2] = [Steering::RotateTranslate, Steering::Dubins { radius_m: 0.4 }];

    fn pose(u: &mut arbtest::arbitrary::Unstructured<'_>) -> arbtest::arbitrary::Result<Pose> {
        let mut real = |max: i32| u.int_in_range(-max..=max).map(|i| f64::from(i) / 1000.0);
        Ok(Pose::new(real(3000)?, real(3000)?, real(3142)?))
    }

    #[test]
    fn pieces_lead_from_start_to_end() {
        arbtest::arbtest(|u| {
            let (from, to) = (pose(u)?, pose(u)?);
            for steering in STEERINGS {
                let maneuver = steering.maneuver(from, to);
                let poses = maneuver.poses(0.05);
                assert_eq!((poses[0], poses[poses.len() - 1]), (from, to), "{steering:?} ends");
                for pair in poses.windows(2) {
                    let step = pair[0].distance_m(&pair[1]);
                    let turn = pair[0].heading.turn_to(pair[1].heading).abs();
                    assert!(step < 0.051 && turn < 0.14, "{steering:?} {from:?} {to:?}: jump {pair:?}");
                }
                let straight = from.distance_m(&to);
                assert!(steering.distance_m(from, to) >= straight - 1e-9, "{steering:?} beats the straight");
            }
            Ok(())
        });
    }

    #[test]
    fn prefix_and_suffix_cut_by_travel() {
        arbtest::arbtest(|u| {
            let (from, to) = (pose(u)?, pose(u)?);
            for steering in STEERINGS {
                let maneuver = steering.maneuver(from, to);
                let cut = maneuver.travel_m() * 0.4;
                let (head, tail) = (maneuver.prefix(cut), maneuver.suffix(maneuver.travel_m() - cut));
                assert!((head.travel_m() - cut).abs() < 1e-9, "{steering:?} prefix of {cut}");
                assert!(head.to().distance_m(&tail.from()) < 1e-6, "{steering:?} the parts do not meet");
                assert_eq!((head.from(), tail.to()), (from, to), "{steering:?} outer ends");
            }
            Ok(())
        });
    }

    #[test]
    fn distance_is_directed() {
        let car = Steering::Dubins { radius_m: 0.4 };
        let (behind, ahead) = (Pose::new(0.0, 0.0, 0.0), Pose::new(1.0, 0.0, 0.0));
        assert!((car.distance_m(behind, ahead) - 1.0).abs() < 1e-9, "straight ahead");
        assert!(car.distance_m(ahead, behind) > 2.0, "a forward-only car needs a loop to go back");
    }
}
