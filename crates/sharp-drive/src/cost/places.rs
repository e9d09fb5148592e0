//! Places of a guide as vectors.

use sharp_space::Vector;

use crate::situation::GuideView;
use crate::world::World;

/// Where the room for the robot is measured, metres along the guide from the place.
const ROOM_AT_M: [f64; 7] = [-0.5, 0.0, 0.25, 0.5, 1.0, 1.5, 2.0];
/// Where the room at the robot's flanks is measured.
const FLANKS_AT_M: [f64; 4] = [-0.25, 0.0, 0.5, 1.0];
/// Up to where the guide's turn from the place is measured.
const TURN_TO_M: [f64; 5] = [-0.5, 0.5, 1.0, 1.5, 2.0];
/// Clearance beyond which more makes no difference, metres.
const ROOM_MAX_M: f64 = 0.8;
/// Way driven, and way left, beyond which more makes no difference, metres.
const WAY_MAX_M: f64 = 2.0;

/// Length of what [`Place::write`] writes.
pub(super) const PLACE_LEN: usize = ROOM_AT_M.len() + 2 * FLANKS_AT_M.len() + TURN_TO_M.len() + 4;

/// A place of a guide.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// Metres from the guide's start.
    pub(super) arc_m: f64,
    /// Whether the robot stood at the guide's start.
    pub(super) from_rest: bool,
}

impl Place {
    /// Room along the guide, room at the flanks, turns, way since the robot stood, way left of the option, whether
    /// the option is the last, and how near its end then is. The side of the first bend is always the left one:
    /// robots are as wide to either side.
    pub(super) fn write(&self, world: &World, guide: &GuideView<'_>, inputs: &mut [f32]) {
        let (field, footprint) = (world.geometry.clearance(), &world.robot.footprint);
        let here = guide.ahead(self.arc_m);
        let room = |clearance_m: f64| (clearance_m.clamp(0.0, ROOM_MAX_M) / ROOM_MAX_M) as f32;
        let turns = TURN_TO_M.map(|to_m| {
            let there = guide.ahead((self.arc_m + to_m).max(0.0));
            (here.heading.turn_to(there.heading) / std::f64::consts::PI) as f32
        });
        let mirror = if turns[2] < 0.0 { -1.0 } else { 1.0 };
        let mut inputs = inputs.iter_mut();
        let mut put = |value: f32| {
            if let Some(input) = inputs.next() {
                *input = value;
            }
        };
        for at_m in ROOM_AT_M {
            let point = guide.ahead((self.arc_m + at_m).max(0.0)).position;
            put(room(field.sample(point) - footprint.inscribed_radius_m()));
        }
        for at_m in FLANKS_AT_M {
            let frame = guide.ahead((self.arc_m + at_m).max(0.0)).frame();
            for side in [mirror, -mirror] {
                let flank = Vector::new(0.0, f64::from(side) * footprint.half_width_m());
                put(room(field.sample(frame.to_world(flank))));
            }
        }
        turns.into_iter().for_each(|turn| put(mirror * turn));
        let way = |way_m: f64| (way_m.clamp(0.0, WAY_MAX_M) / WAY_MAX_M) as f32;
        let left_m = guide.current.length_m() - self.arc_m;
        let is_last = guide.next.is_none();
        put(if self.from_rest { way(self.arc_m) } else { 1.0 });
        put(way(left_m));
        put(f32::from(u8::from(is_last)));
        put(if is_last { way(left_m) } else { 1.0 });
    }
}
