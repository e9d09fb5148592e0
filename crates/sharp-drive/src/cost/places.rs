//! Places of a guide as vectors.

use sharp_space::Vector;

use super::GuideEnds;
use crate::situation::GuideView;
use crate::world::World;

/// Where the room for the robot is measured, metres along the guide from the place.
const ROOM_AT_M: [f64; 7] = [-0.5, 0.0, 0.25, 0.5, 1.0, 1.5, 2.0];
/// Where the room at the robot's flanks is measured.
const FLANKS_AT_M: [f64; 4] = [-0.25, 0.0, 0.5, 1.0];
/// Up to where the guide's turn from the place is measured.
const TURN_TO_M: [f64; 5] = [-0.5, 0.5, 1.0, 1.5, 2.0];
/// Clearances beyond which more makes no difference, metres: centimetres count where it is narrow.
const ROOM_MAX_M: [f64; 2] = [0.2, 0.8];
/// Distance between the points among which the narrowest is looked for, metres, and how far that reaches ahead.
const NARROWEST_EVERY_M: f64 = 0.125;
const NARROWEST_TO_M: [f64; 2] = [0.5, 2.0];
/// Way driven, and way left, beyond which more makes no difference, metres.
const WAY_MAX_M: f64 = 2.0;

/// Length of what [`GuidePlace::write`] writes.
pub(super) const PLACE_LEN: usize =
    2 * (ROOM_AT_M.len() + 2 * FLANKS_AT_M.len() + NARROWEST_TO_M.len()) + TURN_TO_M.len() + 4;

/// A place of a guide.
#[derive(Clone, Copy, Debug)]
pub(super) struct GuidePlace {
    /// Metres from the guide's start.
    pub(super) arc_m: f64,
    /// What lies before and after the guide.
    pub(super) ends: GuideEnds,
}

impl GuidePlace {
    /// Room along the guide, the least of it ahead, room at the flanks, turns, way since the robot stood, way left of
    /// the option, whether the option is the last, and how near its end then is. The side of the first bend is always
    /// the left one: robots are as wide to either side.
    pub(super) fn write(&self, world: &World, guide: &GuideView<'_>, inputs: &mut [f32]) {
        let (field, footprint) = (world.geometry.clearance(), &world.robot.footprint);
        let length_m = guide.current.length_m();
        let ends_unknown = guide.next.is_none() && !self.ends.to_goal;
        // Where another guide follows and is not known yet: behind a door it is likely as wide as before it.
        let at = |at_m: f64| {
            let arc_m = (self.arc_m + at_m).max(0.0);
            let mirrored_m = if arc_m > length_m { (2.0 * length_m - arc_m).max(0.0) } else { arc_m };
            guide.ahead(if ends_unknown { mirrored_m } else { arc_m })
        };
        let here = at(0.0);
        let room = |clearance_m: f64| ROOM_MAX_M.map(|max_m| (clearance_m.clamp(0.0, max_m) / max_m) as f32);
        let towards = |at_m: f64| {
            let is_unknown = ends_unknown && self.arc_m + at_m > length_m;
            if is_unknown { guide.current.end().heading } else { at(at_m).heading }
        };
        let turns = TURN_TO_M.map(|to_m| (here.heading.turn_to(towards(to_m)) / std::f64::consts::PI) as f32);
        let mirror = if turns[2] < 0.0 { -1.0 } else { 1.0 };
        let mut inputs = inputs.iter_mut();
        let mut put = |value: f32| {
            if let Some(input) = inputs.next() {
                *input = value;
            }
        };
        for at_m in ROOM_AT_M {
            room(field.sample(at(at_m).position) - footprint.inscribed_radius_m())
                .into_iter()
                .for_each(&mut put);
        }
        for to_m in NARROWEST_TO_M {
            let count = (to_m / NARROWEST_EVERY_M) as usize;
            let points = (0..=count).map(|i| at(i as f64 * NARROWEST_EVERY_M).position);
            let least_m = points.map(|point| field.sample(point)).fold(f64::INFINITY, f64::min);
            room(least_m - footprint.inscribed_radius_m()).into_iter().for_each(&mut put);
        }
        for at_m in FLANKS_AT_M {
            let frame = at(at_m).frame();
            for side in [mirror, -mirror] {
                let flank = Vector::new(0.0, f64::from(side) * footprint.half_width_m());
                room(field.sample(frame.to_world(flank))).into_iter().for_each(&mut put);
            }
        }
        turns.into_iter().for_each(|turn| put(mirror * turn));
        let way = |way_m: f64| (way_m.clamp(0.0, WAY_MAX_M) / WAY_MAX_M) as f32;
        let left_m = length_m - self.arc_m;
        let is_last = self.ends.to_goal;
        put(if self.ends.from_rest { way(self.arc_m) } else { 1.0 });
        put(way(left_m));
        put(f32::from(u8::from(is_last)));
        put(if is_last { way(left_m) } else { 1.0 });
    }
}
