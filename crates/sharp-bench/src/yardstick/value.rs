//! Value iteration: the least expected cost from every state near a guide.
//!
//! V(s) = min over actions a of c(a) + mean over draws of V(s'), where c is the time of the action, and a contact or a way off the
//! grid costs what a failure costs. Places are swept from the end of the guide to its start, so that a few sweeps are enough.

use rayon::prelude::*;
use sharp_drive::{FAILURE_COST_S, World};
use sharp_guide::GuidedOption;
use sharp_sim::{ActionSettings, EpisodeBias, NoiseModel, RobotState};
use sharp_space::{Pose, Seed, trig};

use super::grid::{Fit, HEADINGS, PoseGrid, angle};
use super::motions::{ActionMotion, ActionSet, GAITS, Gait, GaitScale, MotionTable};

/// How values are computed.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ValueSettings {
    /// Draws of the noise of each action.
    pub draws: usize,
    /// Sweeps over all states, at most. The first compares all actions on half of the draws, the others those next to the best on
    /// all of them.
    pub sweeps: u32,
    /// Mean change of a sweep, seconds, below which it is the last.
    pub tolerance_s: f32,
}

impl Default for ValueSettings {
    fn default() -> Self {
        Self { draws: 16, sweeps: 6, tolerance_s: 0.02 }
    }
}

/// What an action costs that leads nearer to an obstacle than grid and draws can tell, seconds: it may be a failure.
pub(super) const CLOSE_COST_S: f32 = 30.0;
/// Speed at which values begin, as a share of the top speed.
const FIRST_SPEED: f64 = 0.7;
/// Places whose way to the end differs by less are updated side by side, metres.
const BAND_M: f64 = 0.15;

/// The least expected costs of driving an option with one slip and pull.
#[derive(Clone, Debug)]
pub struct ValueTable {
    grid: PoseGrid,
    scale: GaitScale,
    /// By place, heading and gait, seconds.
    values: Vec<f32>,
}

impl ValueTable {
    /// The costs of driving `option` under the action noise of `noise`, with this slip and pull.
    #[must_use]
    pub fn new(
        world: &World,
        option: &GuidedOption,
        (noise, bias): (&NoiseModel, EpisodeBias),
        settings: &ValueSettings,
        seed: Seed,
    ) -> Self {
        let motions = MotionTable::new(&world.robot, noise, bias, settings.draws, seed);
        let grid = PoseGrid::new(world, option, motions.reach_m);
        let first = |place: &super::grid::GridPlace| {
            [(place.remaining_m / (FIRST_SPEED * world.robot.max_speed_mps)) as f32; HEADINGS * GAITS]
        };
        let values = grid.places.iter().flat_map(first).collect();
        let mut table = Self { grid, scale: GaitScale::of(&world.robot), values };
        table.iterate(option, &motions, &ActionSet::of(&world.robot), settings);
        table
    }

    /// The expected cost from `state`, seconds.
    #[must_use]
    pub fn cost_s(&self, option: &GuidedOption, state: &RobotState) -> f64 {
        let pose = [state.pose.position.x, state.pose.position.y, state.pose.heading.radians()];
        f64::from(self.value(option, pose, self.scale.gait(state)))
    }

    /// Whether a robot at `pose` is nearer to an obstacle than the values can tell.
    pub(super) fn is_close(&self, pose: &Pose) -> bool {
        self.grid.fit([pose.position.x, pose.position.y, pose.heading.radians()]) != Fit::Free
    }

    fn iterate(
        &mut self,
        option: &GuidedOption,
        motions: &MotionTable,
        actions: &ActionSet,
        settings: &ValueSettings,
    ) {
        let mut best = vec![u8::MAX; self.values.len()];
        let bands = self.bands();
        for _ in 0..settings.sweeps {
            let (mut change, mut count) = (0.0_f64, 0_u32);
            for band in &bands {
                let updates: Vec<Vec<(usize, f32, u8)>> = band
                    .clone()
                    .into_par_iter()
                    .map(|place| self.updated(option, motions, (place, actions.commands().len()), &best))
                    .collect();
                for (state, value, action) in updates.into_iter().flatten() {
                    change += f64::from((self.values[state] - value).abs());
                    count += 1;
                    self.values[state] = value;
                    best[state] = action;
                }
            }
            if change < f64::from(settings.tolerance_s) * f64::from(count) {
                break;
            }
        }
    }

    /// Places that are updated side by side, from the end of the guide on.
    fn bands(&self) -> Vec<std::ops::Range<usize>> {
        let mut bands = Vec::new();
        let mut begin = 0;
        for place in 1..=self.grid.places.len() {
            let is_next = self
                .grid
                .places
                .get(place)
                .is_none_or(|next| next.remaining_m >= self.grid.places[begin].remaining_m + BAND_M);
            if is_next {
                bands.push(begin..place);
                begin = place;
            }
        }
        bands
    }

    /// New values of the states at place number `place`, with the best of the actions.
    fn updated(
        &self,
        option: &GuidedOption,
        motions: &MotionTable,
        (place, actions): (usize, usize),
        best: &[u8],
    ) -> Vec<(usize, f32, u8)> {
        let mut updates = Vec::new();
        let position = self.grid.places[place].position;
        for heading in 0..HEADINGS {
            if !self.grid.is_state(place as u32, heading as u32) {
                continue;
            }
            let pose = Pose::new(position.x, position.y, angle(heading, HEADINGS));
            if option.is_done(&pose) {
                for gait in 0..GAITS {
                    updates.push(((place * HEADINGS + heading) * GAITS + gait, 0.0, 0));
                }
                continue;
            }
            let from = From::new(&pose, self.grid.places[place].is_open);
            for gait in 0..GAITS {
                let state = (place * HEADINGS + heading) * GAITS + gait;
                let is_first = best[state] == u8::MAX;
                let mut found = (f32::INFINITY, 0);
                let mut compare = |action: usize| {
                    let draws = motions.draws(gait, action);
                    let draws = if is_first { &draws[..draws.len().div_ceil(2)] } else { draws };
                    let cost = self.action_cost(option, &from, draws, found.0);
                    if cost < found.0 {
                        found = (cost, action as u8);
                    }
                };
                match best[state] {
                    u8::MAX => (0..actions).for_each(&mut compare),
                    before => ActionSet::near(before.into()).for_each(&mut compare),
                }
                updates.push((state, found.0, found.1));
            }
        }
        updates
    }

    /// The mean cost of an action over `draws`, seconds; more than `bound` as soon as that is clear.
    fn action_cost(&self, option: &GuidedOption, from: &From, draws: &[ActionMotion], bound: f32) -> f32 {
        let action_s = ActionSettings::default().action_s as f32;
        let mut total = action_s * draws.len() as f32;
        let bound = bound * draws.len() as f32;
        for motion in draws {
            total += self.outcome(option, from, motion);
            if total >= bound {
                return f32::INFINITY;
            }
        }
        total / draws.len() as f32
    }

    /// The cost after `motion`, seconds.
    fn outcome(&self, option: &GuidedOption, from: &From, motion: &ActionMotion) -> f32 {
        let mut risk_s = 0.0;
        if !from.is_open {
            let worst = motion.via.iter().map(|&via| self.grid.fit(from.world(via))).max();
            match worst.unwrap_or(Fit::Free) {
                Fit::Free => {}
                Fit::Close => risk_s = CLOSE_COST_S,
                Fit::Blocked => return FAILURE_COST_S as f32,
            }
        }
        risk_s + self.value(option, from.world(motion.via[motion.via.len() - 1]), motion.gait)
    }

    fn value(&self, option: &GuidedOption, [x, y, heading]: [f64; 3], gait: Gait) -> f32 {
        let Some(around) = self.grid.corners(x, y, heading) else { return FAILURE_COST_S as f32 };
        if around.is_near_end && option.is_done(&Pose::new(x, y, heading)) {
            return 0.0;
        }
        let gaits = gait.corners();
        let mut value = 0.0;
        for (place, heading, weight) in around.corners {
            if weight > 0.0 {
                let values = &self.values[(place as usize * HEADINGS + heading as usize) * GAITS..][..GAITS];
                value += weight * gaits.iter().map(|&(gait, share)| share * values[gait]).sum::<f32>();
            }
        }
        value
    }
}

/// Where an action begins.
struct From {
    x: f64,
    y: f64,
    heading: f64,
    sin: f64,
    cos: f64,
    is_open: bool,
}

impl From {
    fn new(pose: &Pose, is_open: bool) -> Self {
        let heading = pose.heading.radians();
        let (sin, cos) = trig::sin_cos(heading);
        Self { x: pose.position.x, y: pose.position.y, heading, sin, cos, is_open }
    }

    /// A pose of the robot's frame in the world.
    fn world(&self, [ahead, left, turn]: [f32; 3]) -> [f64; 3] {
        let (ahead, left) = (f64::from(ahead), f64::from(left));
        [
            self.x + self.cos * ahead - self.sin * left,
            self.y + self.sin * ahead + self.cos * left,
            self.heading + f64::from(turn),
        ]
    }
}

#[cfg(test)]
mod tests {
    use sharp_plan::TrainingRoute;
    use sharp_sim::RobotModel;

    use super::*;
    use crate::prior::PriorCourses;

    /// A route whose last option is short.
    fn route() -> TrainingRoute {
        let routes = PriorCourses::held_out(&RobotModel::husky(), Seed(1)).routes(2, &|| ());
        let is_short = |route: &TrainingRoute| {
            route.options().last().is_some_and(|(option, _)| (1.5..4.0).contains(&option.guide.length_m()))
        };
        routes.into_iter().find(is_short).expect("some route ends in a short option")
    }

    #[test]
    fn the_way_that_is_left_costs_its_time_and_a_wall_a_failure() {
        let route = route();
        let (world, (option, _)) = (route.world(), route.options().last().expect("it has options"));
        let bias = EpisodeBias { speed_slip: 0.1, yaw_slip: 0.1, drift_radps: 0.1 };
        let settings = ValueSettings { draws: 4, sweeps: 2, ..ValueSettings::default() };
        let table = || ValueTable::new(world, option, (&NoiseModel::nominal(), bias), &settings, Seed(1));
        let values = table();
        let guide = &option.guide;
        let cost_s = |arc_m: f64| values.cost_s(option, &RobotState::rolling(guide.pose_at(arc_m), 0.5));
        let (begin_s, middle_s) = (cost_s(0.0), cost_s(0.5 * guide.length_m()));
        let fastest_s = (guide.length_m() - world.robot.goal_tolerance_m) / world.robot.max_speed_mps;
        assert!((fastest_s..4.0 * fastest_s).contains(&begin_s), "{begin_s} s, at top speed {fastest_s} s");
        assert!(middle_s < begin_s, "half of the way costs {middle_s} s, all of it {begin_s} s");
        assert_eq!(cost_s(guide.length_m()), 0.0, "it is done");
        let far = Pose::new(guide.start().position.x + 50.0, 0.0, 0.0);
        assert_eq!(
            values.cost_s(option, &RobotState::at_rest(far)),
            FAILURE_COST_S,
            "nothing is known there"
        );
        assert!(table().values == values.values, "equal seeds, equal values");
    }
}
