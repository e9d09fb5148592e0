//! What a policy decides: a waypoint in the robot's own frame and the speed at which it is approached.

use serde::{Deserialize, Serialize};
use sharp_space::{Heading, Point, Pose, trig};

/// One action: drive towards a waypoint for the time that an action takes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Command {
    /// Distance of the waypoint, metres.
    pub reach_m: f64,
    /// Direction of the waypoint against the robot's heading, radians, left positive.
    pub bearing_rad: f64,
    /// Speed at which it is approached, metres per second.
    pub speed_mps: f64,
}

impl Command {
    /// The waypoint in the world of a robot at `pose`.
    #[must_use]
    pub fn to_world(self, pose: &Pose) -> Point {
        let heading = Heading::new(pose.heading.radians() + self.bearing_rad);
        pose.position + heading.unit() * self.reach_m
    }

    /// The command that sends a robot at `pose` to the world point `point` at `speed_mps`.
    #[must_use]
    pub fn of(pose: &Pose, point: Point, speed_mps: f64) -> Self {
        let local = pose.to_local(point);
        Self { reach_m: local.norm(), bearing_rad: trig::atan2(local.y, local.x), speed_mps }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_waypoint_survives_the_way_to_the_world_and_back() {
        for heading in [-3.0, -1.0, 0.0, 2.5] {
            let pose = Pose::new(1.5, -2.0, heading);
            for (x, y) in [(2.0, -2.0), (1.0, 3.0), (-4.0, -2.5)] {
                let seen = Command::of(&pose, Point::new(x, y), 0.7);
                let back = seen.to_world(&pose);
                assert!((back - Point::new(x, y)).norm() < 1e-9, "({x}, {y}) from {heading} became {back:?}");
                assert_eq!(seen.speed_mps, 0.7, "the speed is kept");
            }
        }
    }
}
