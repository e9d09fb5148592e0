//! Search and guides together: legs get their guide only when a plan wants them.
//!
//! Costs begin as lower bounds. Whenever A* returns a plan, its legs without a guide are guided and
//! their costs become exact, or infinite where no guide exists; then A* runs again, until a plan
//! consists of guided legs only. That plan is as cheap as if every leg had been guided beforehand,
//! and a leg that cannot be guided has lost its edge: the repair that downward refinability needs.

use std::collections::BTreeMap;
use std::sync::Arc;

use rayon::prelude::*;
use sharp_guide::{GuideEnd, GuidePath, GuideRequest, GuideSettings, NoGuide, plan_guide};
use sharp_motion::Steering;
use sharp_options::{Endpoint, OptionId, OptionSet};
use sharp_rbvd::{Rbvd, StateId};
use sharp_space::{Cell, Heading, Point, Pose, Seed, Stream};

use crate::leg::{Leg, LegId, allowed_states, endpoints};
use crate::percept::Workspace;
use crate::search::{Candidate, OptionGraph};
use crate::sharp::{Monitor, Phase};

/// Legs whose ends are further apart than this cross their interfaces at right angles, metres.
const CROSSING_M: f64 = 1.2;

/// Looks before and behind an interface that tell in which direction it has most room: 0.8 m.
const CROSSING_LOOKS: i32 = 8;
/// Turns from the normal that are tried to either side, and the step between them: 60 degrees in all.
const CROSSING_TURNS: i32 = 12;
const CROSSING_TURN_RAD: f64 = std::f64::consts::PI / 36.0;
/// Room beyond the outline's circle that is as good as any, metres.
const ROOM_ENOUGH_M: f64 = 0.25;
/// Room that keeping to the normal is worth, metres a radian.
const NORMAL_M_PER_RAD: f64 = 0.1;

/// What a join costs that the robot should not be able to make, where no plan does without one, seconds.
const HARD_JOIN_S: f64 = 120.0;

/// A car turns no further than this in its stride, however much room it has: 120 degrees.
const CAR_TURN_MAX_RAD: f64 = 2.0 * std::f64::consts::FRAC_PI_3;

/// The abstraction of one map for one robot: Φ, Ψ and O.
#[derive(Clone, Debug)]
pub struct Abstraction {
    /// The region-based Voronoi diagram.
    pub rbvd: Arc<Rbvd>,
    /// The options synthesised from it.
    pub options: Arc<OptionSet>,
}

/// What the search may assume and must respect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SearchSettings {
    /// Speed that turns lengths into seconds before anything was measured, metres per second.
    pub nominal_speed_mps: f64,
    /// Seconds added to a leg without a policy: what training is worth; 0 is the paper's rule.
    pub untrained_surcharge_s: f64,
    /// Seconds added to a leg that passes a centroid by: no later problem can reuse it if it is a first or
    /// last one, few can if it is an option, and the paper knows no such leg.
    pub shortcut_surcharge_s: f64,
    /// Options may pass a centroid by; false keeps to the paper's.
    pub passing: bool,
    /// Learnt legs cost what was measured of them (line 18 of Algorithm 1); false keeps the first costs.
    pub cost_update: bool,
    /// Largest turn between two guides that a robot which turns in place takes in its stride, radians.
    pub smooth_turn_rad: f64,
    /// Guides keep as much room and as wide bends as they can; false asks for no more than the robot needs.
    pub spares: bool,
    /// How guides are planned.
    pub guide: GuideSettings,
}

impl SearchSettings {
    /// Settings for the robot of `workspace`.
    #[must_use]
    pub fn new(workspace: &Workspace) -> Self {
        Self {
            nominal_speed_mps: 0.5 * workspace.robot.max_speed_mps,
            untrained_surcharge_s: 8.0,
            shortcut_surcharge_s: 14.0,
            passing: true,
            cost_update: true,
            // The footprint swings out in a turn: beyond 75 degrees it needs room or a smaller circle.
            smooth_turn_rad: 75.0_f64.to_radians(),
            spares: true,
            guide: GuideSettings::default(),
        }
    }
}

/// Where a plan begins and ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Query {
    /// The initial configuration `x_i`.
    pub start: Pose,
    /// The goal configuration `x_g`.
    pub goal: Pose,
}

/// The guided legs of one problem and the searches among them.
#[derive(Debug)]
pub struct Planner<'a> {
    workspace: &'a Workspace,
    abstraction: &'a Abstraction,
    settings: SearchSettings,
    query: Query,
    graph: OptionGraph,
    guided: BTreeMap<LegId, Result<Arc<Leg>, NoGuide>>,
    /// Seconds that hand-overs cost beyond their turn, because they were seen to fail.
    charges: BTreeMap<(LegId, LegId), f64>,
    seed: Seed,
}

/// Why there is no planner for a query: no abstract state at one of its ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unplaced {
    /// No state near the start.
    Start,
    /// No state near the goal.
    Goal,
}

impl<'a> Planner<'a> {
    /// A planner for `query`; `known` are guides from earlier problems.
    ///
    /// # Errors
    /// Names the end of the query that lies in no abstract state (Algorithm 1, line 8).
    pub fn new(
        workspace: &'a Workspace,
        abstraction: &'a Abstraction,
        settings: SearchSettings,
        query: Query,
        known: impl IntoIterator<Item = (LegId, GuidePath)>,
        seed: Seed,
    ) -> Result<Self, Unplaced> {
        let start = state_near(&abstraction.rbvd, query.start.position).ok_or(Unplaced::Start)?;
        let goal = state_near(&abstraction.rbvd, query.goal.position).ok_or(Unplaced::Goal)?;
        let graph = OptionGraph::new(
            &abstraction.rbvd,
            &abstraction.options,
            (query.start, start),
            (query.goal, goal),
        );
        let guided = BTreeMap::new();
        let mut this =
            Self { workspace, abstraction, settings, query, graph, guided, charges: BTreeMap::new(), seed };
        for (id, guide) in known {
            if let Some(candidate) = this.graph.candidate(id).cloned() {
                this.guided.insert(id, Ok(Arc::new(this.leg(&candidate, guide))));
            }
        }
        Ok(this)
    }

    /// Makes all plans in which `after` follows `before` cost `seconds` more: a hand-over that was seen to fail.
    pub fn charge(&mut self, before: LegId, after: LegId, seconds: f64) {
        self.charges.insert((before, after), seconds);
    }

    /// The cheapest plan of guided legs, or `None`. `measured` knows what learnt legs cost, seconds.
    pub fn plan(
        &mut self,
        measured: &dyn Fn(LegId) -> Option<f64>,
        monitor: &dyn Monitor,
    ) -> Option<Vec<Arc<Leg>>> {
        loop {
            monitor.phase(Phase::Search);
            let top_speed = self.workspace.robot.max_speed_mps;
            let cost = |leg: &Candidate| self.cost(leg, measured(leg.id));
            let charge = |before: &Candidate, after: &Candidate| {
                self.charges.get(&(before.id, after.id)).copied().unwrap_or(0.0)
            };
            let strict =
                |before: &Candidate, after: &Candidate| self.join(before, after) + charge(before, after);
            // A hand-over that may fail is better than no plan: what it is worth will be measured.
            let lenient = |before: &Candidate, after: &Candidate| {
                self.join(before, after).min(HARD_JOIN_S) + charge(before, after)
            };
            let found = self.graph.search(top_speed, cost, strict);
            let (_, ids) = found.or_else(|| self.graph.search(top_speed, cost, lenient))?;
            let missing: Vec<LegId> =
                ids.iter().copied().filter(|id| !self.guided.contains_key(id)).collect();
            if missing.is_empty() {
                return ids.iter().map(|id| self.guided[id].clone().ok()).collect();
            }
            monitor.phase(Phase::Guide);
            let guided: Vec<_> = missing.par_iter().map(|&id| (id, self.guide(id))).collect();
            self.guided.extend(guided);
        }
    }

    /// The leg called `id`, as it is without others, if it was guided.
    pub(crate) fn leg_called(&self, id: LegId) -> Option<&Leg> {
        self.guided.get(&id).and_then(|leg| leg.as_deref().ok())
    }

    /// The legs that could not be guided, with the reason.
    pub fn unguided(&self) -> impl Iterator<Item = (LegId, &NoGuide)> {
        self.guided.iter().filter_map(|(&id, leg)| leg.as_ref().err().map(|reason| (id, reason)))
    }

    fn cost(&self, leg: &Candidate, measured: Option<f64>) -> f64 {
        if !self.settings.passing && matches!(leg.id, LegId::Option(OptionId::Bypass { .. })) {
            return f64::INFINITY;
        }
        let straight_m = (leg.end - leg.start).norm();
        let length_m = match self.guided.get(&leg.id) {
            Some(Ok(guided)) => guided.guide.length_m().max(straight_m),
            Some(Err(_)) => return f64::INFINITY,
            None => straight_m,
        };
        let least_s = straight_m / self.workspace.robot.max_speed_mps;
        let estimated = length_m / self.settings.nominal_speed_mps + self.settings.untrained_surcharge_s;
        let shortcut_s = if leg.is_shortcut { self.settings.shortcut_surcharge_s } else { 0.0 };
        let measured = measured.filter(|_| self.settings.cost_update);
        measured.map_or(estimated, |seconds| seconds.max(least_s)) + shortcut_s
    }

    /// Seconds lost where one guide ends and the next begins; infinite where the robot should not turn so.
    fn join(&self, before: &Candidate, after: &Candidate) -> f64 {
        let (Some(Ok(first)), Some(Ok(second))) = (self.guided.get(&before.id), self.guided.get(&after.id))
        else {
            return 0.0;
        };
        let turn = first.guide.end().heading.turn_to(second.guide.start().heading).abs();
        let robot = &self.workspace.robot;
        let turn_s = turn / (robot.max_yaw_rate_radps * robot.yaw_gain());
        let room_m = self.workspace.checker.field().sample(after.start);
        if turn <= self.in_stride_rad(room_m) {
            return turn_s;
        }
        // Room for the whole circle, or for a car's loop, and for arriving off the centre.
        let radius_m = robot.min_turning_radius_m();
        let circle_m = 2.0 * radius_m + robot.footprint.circumscribed_radius_m() + 0.3;
        let loop_s = 2.0 + std::f64::consts::TAU * radius_m / self.settings.nominal_speed_mps;
        if room_m > circle_m { turn_s + loop_s } else { f64::INFINITY }
    }

    /// The largest turn between two guides that the robot takes in its stride with `room_m` around it.
    ///
    /// A car rounds the corner of two lines on a circle that touches them radius x tan(turn / 2)
    /// before and behind it; the outline of a robot that turns in place swings out instead.
    fn in_stride_rad(&self, room_m: f64) -> f64 {
        let robot = &self.workspace.robot;
        if robot.can_turn_in_place() {
            return self.settings.smooth_turn_rad;
        }
        let run_up_m = (room_m - robot.footprint.inscribed_radius_m()).max(0.0);
        (2.0 * (run_up_m / robot.min_turning_radius_m()).atan()).min(CAR_TURN_MAX_RAD)
    }

    fn guide(&self, id: LegId) -> Result<Arc<Leg>, NoGuide> {
        let candidate = self.graph.candidate(id).expect("the search returns its own legs");
        let frame = self.abstraction.rbvd.frame();
        let options = &self.abstraction.options;
        let (source, target) = endpoints(options, id);
        let (source, target) = (source.map(|id| options.endpoint(id)), target.map(|id| options.endpoint(id)));
        let states = allowed_states(id, candidate.from, candidate.to);
        let near = |endpoint: Option<&Endpoint>, cell: Cell| {
            endpoint.is_some_and(|endpoint| endpoint.contains(frame.center(cell), &self.abstraction.rbvd))
        };
        let allowed = |cell: Cell| {
            self.abstraction.rbvd.state_of(cell).is_some_and(|state| states.contains(&state))
                || near(source, cell)
                || near(target, cell)
        };
        // On a short leg two crossing directions would leave no room for the way between them.
        let crosses = (candidate.end - candidate.start).norm() > CROSSING_M;
        let crossing = |endpoint: Option<&Endpoint>, to| {
            endpoint.filter(|_| crosses).and_then(|end| approach(self.workspace, end, to))
        };
        let start_heading = match id {
            LegId::First(_) | LegId::Direct => Some(self.query.start.heading),
            LegId::Option(option) => crossing(source, option.through().unwrap_or(option.to())),
            LegId::Last(_, state) => crossing(source, state),
        };
        let request = GuideRequest {
            start: GuideEnd { position: candidate.start, heading: start_heading },
            goal: GuideEnd { position: candidate.end, heading: crossing(target, candidate.to) },
            allowed: &allowed,
        };
        let mut rng = self.seed.stream(&format!("guide {id}"), 0);
        let spared = self.settings.spares.then(|| self.spared(&request, &mut rng)).flatten();
        let guide = match spared {
            Some(guide) => guide,
            None => {
                let steering = Steering::of(self.workspace.robot.min_turning_radius_m());
                plan_guide(&request, &self.workspace.checker, &steering, &self.settings.guide, &mut rng)?
            }
        };
        Ok(Arc::new(self.leg(candidate, guide)))
    }

    /// A guide for the largest robot for which there is one.
    fn spared(&self, request: &GuideRequest<'_>, rng: &mut Stream) -> Option<GuidePath> {
        let settings = self.settings.guide.unsampled();
        let start = request.start.heading.map(|heading| Pose::at(request.start.position, heading));
        let mut spares = self.workspace.spares_at(start);
        spares.find_map(|spare| plan_guide(request, &spare.checker, &spare.steering, &settings, rng).ok())
    }

    fn leg(&self, candidate: &Candidate, guide: GuidePath) -> Leg {
        let Abstraction { rbvd, options } = self.abstraction;
        let goal = (self.query.goal.position, self.workspace.robot.goal_tolerance_m);
        Leg::new((rbvd, options), candidate.id, (candidate.from, candidate.to), guide, goal)
    }
}

/// The direction in which an interface is crossed towards `to`: the one with most room before and behind,
/// the border's normal where room does not tell.
fn approach(workspace: &Workspace, endpoint: &Endpoint, to: StateId) -> Option<Heading> {
    let normal_rad = endpoint.normal?.radians();
    let towards = if endpoint.states.last() == Some(&to) { 0.0 } else { std::f64::consts::PI };
    let field = workspace.checker.field();
    let enough_m = workspace.robot.footprint.circumscribed_radius_m() + ROOM_ENOUGH_M;
    let worth = |turn_rad: f64| {
        let unit = Heading::new(normal_rad + turn_rad).unit();
        let along = (-CROSSING_LOOKS..=CROSSING_LOOKS).map(|look| 0.1 * f64::from(look));
        let room_m = along.map(|ahead_m| field.sample(endpoint.center + unit * ahead_m));
        room_m.fold(enough_m, f64::min) - NORMAL_M_PER_RAD * turn_rad.abs()
    };
    let turns_rad = (0..=2 * CROSSING_TURNS).map(|i| f64::from(i - CROSSING_TURNS) * CROSSING_TURN_RAD);
    let best_rad = turns_rad.max_by(|&a, &b| worth(a).total_cmp(&worth(b)))?;
    Some(Heading::new(normal_rad + best_rad + towards))
}

/// α(x), or the state of the nearest cell that has one within half a metre: a robot may stand where
/// the diagram's margin has no state.
fn state_near(rbvd: &Rbvd, point: Point) -> Option<StateId> {
    if let Some(state) = rbvd.state_at(point) {
        return Some(state);
    }
    let frame = rbvd.frame();
    let center = frame.cell_at(point)?;
    let reach = (0.5 / frame.resolution_m).ceil() as usize;
    let rows = center.row.saturating_sub(reach)..=(center.row + reach).min(frame.height - 1);
    rows.flat_map(|row| {
        let cols = center.col.saturating_sub(reach)..=(center.col + reach).min(frame.width - 1);
        cols.map(move |col| Cell::new(col, row))
    })
    .filter_map(|cell| rbvd.state_of(cell).map(|state| ((frame.center(cell) - point).norm(), cell, state)))
    .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))
    .map(|(_, _, state)| state)
}

#[cfg(test)]
mod tests {
    use sharp_options::OptionKind;

    use super::*;
    use crate::drawn::{HALL, RING, SEALED, along, world};

    fn names(legs: &[Arc<Leg>]) -> String {
        legs.iter().map(|leg| leg.id.to_string()).collect::<Vec<_>>().join(" ")
    }

    fn planner<'a>((workspace, abstraction): &'a (Workspace, Abstraction), query: Query) -> Planner<'a> {
        let settings = SearchSettings::new(workspace);
        Planner::new(workspace, abstraction, settings, query, [], Seed(1)).expect("both ends have a state")
    }

    #[test]
    fn a_hand_over_that_was_seen_to_fail_sends_the_plan_the_other_way_round() {
        let world = world(RING, OptionKind::Interface);
        let mut planner =
            planner(&world, Query { start: Pose::new(1.4, 4.2, 0.0), goal: Pose::new(8.6, 1.4, 0.0) });
        let first = planner.plan(&|_| None, &()).expect("two ways lead round");
        let ids = |legs: &[Arc<Leg>]| legs.iter().map(|leg| leg.id).collect::<Vec<_>>();
        for pair in ids(&first).windows(2) {
            planner.charge(pair[0], pair[1], 1000.0);
        }
        let second = planner.plan(&|_| None, &()).expect("the other way");
        let before = ids(&first);
        let kept = ids(&second).windows(2).any(|pair| before.windows(2).any(|joined| joined == pair));
        assert!(!kept, "{} keeps a hand-over of {}", names(&second), names(&first));
    }

    #[test]
    fn measured_costs_make_a_plan_change_its_way() {
        let world = world(RING, OptionKind::Interface);
        let query = Query { start: Pose::new(1.4, 4.2, 0.0), goal: Pose::new(8.6, 1.4, 0.0) };
        let first = planner(&world, query).plan(&|_| None, &()).expect("two ways lead round");
        let option = first.iter().find(|leg| matches!(leg.id, LegId::Option(_))).expect("an option").id;
        let slow = |id| (id == option).then_some(500.0);
        let second = planner(&world, query).plan(&slow, &()).expect("the other way");
        assert!(second.iter().all(|leg| leg.id != option), "{} uses the slow {option}", names(&second));
        let settings = SearchSettings { cost_update: false, ..SearchSettings::new(&world.0) };
        let planner = Planner::new(&world.0, &world.1, settings, query, [], Seed(1));
        let third = planner.expect("both ends have a state").plan(&slow, &()).expect("the first way");
        assert_eq!(names(&third), names(&first), "without the update nothing flows back");
    }

    /// A corridor of 1.6 m with a corner, and regions on both sides of it.
    const CORNER: &str = "
        ###############
        #.............#
        #.............#
        #..0..1.......#
        #.............#
        #########.....#
        #########.....#
        #########.....#
        #########..2..#
        #########.....#
        #########.....#
        ###############";

    #[test]
    fn a_turn_that_is_too_sharp_is_better_than_no_plan() {
        let world = world(CORNER, OptionKind::Centroid);
        let query = Query { start: Pose::new(1.2, 3.2, 0.0), goal: Pose::new(4.6, 1.2, 0.0) };
        for smooth_turn_rad in [75.0_f64.to_radians(), 0.01] {
            let settings = SearchSettings { smooth_turn_rad, ..SearchSettings::new(&world.0) };
            let planner = Planner::new(&world.0, &world.1, settings, query, [], Seed(1));
            let legs = planner.expect("both ends have a state").plan(&|_| None, &());
            assert!(legs.is_some(), "no plan where turns of {smooth_turn_rad} rad are smooth");
        }
    }

    /// A corridor of 2 m with a dead end off it, in which the region of the middle state lies.
    const ALCOVE: &str = "
        ###########################
        ###########.....###########
        ###########.....###########
        ###########..1..###########
        ###########.....###########
        ###########.....###########
        #.........................#
        #.........................#
        #...0.................2...#
        #.........................#
        #.........................#
        ###########################";

    #[test]
    fn a_centroid_from_which_nobody_gets_on_is_passed_by() {
        let world = world(ALCOVE, OptionKind::Centroid);
        let query = Query { start: Pose::new(1.0, 1.4, 0.0), goal: Pose::new(9.8, 1.4, 0.0) };
        let names = |passing| {
            let settings = SearchSettings { passing, ..SearchSettings::new(&world.0) };
            let planner = Planner::new(&world.0, &world.1, settings, query, [], Seed(1));
            names(&planner.expect("both ends have a state").plan(&|_| None, &()).expect("a way"))
        };
        assert_eq!(names(true), "first:0 c:0-1-2 last:2");
        assert_eq!(
            names(false),
            "first:0 c:0-1 c:1-2 last:2",
            "the paper's options turn round in the dead end"
        );
    }

    #[test]
    fn guides_from_earlier_problems_are_kept() {
        let (workspace, abstraction) = world(HALL, OptionKind::Centroid);
        let settings = SearchSettings::new(&workspace);
        let option = abstraction.options.options()[0].id;
        let ends = |id| abstraction.options.endpoint(id).center;
        let spec = abstraction.options.get(option).expect("its own");
        let (from, to) = (ends(spec.initiation), ends(spec.termination));
        let known = crate::drawn::straight((from.x, from.y), (to.x, to.y));
        let guides = [(LegId::Option(option), known.clone())];
        let planner = Planner::new(&workspace, &abstraction, settings, along(), guides, Seed(1));
        let mut planner = planner.expect("both ends have a state");
        let legs = planner.plan(&|_| None, &()).expect("a way");
        let leg = legs.iter().find(|leg| leg.id == LegId::Option(option)).expect("c:0-1 lies on the way");
        assert_eq!(leg.guide, known, "planned again");
    }

    #[test]
    fn sealed_rooms_have_no_plan_and_walls_have_no_state() {
        for kind in [OptionKind::Centroid, OptionKind::Interface] {
            let world = world(SEALED, kind);
            let through = Query { start: Pose::new(2.0, 1.4, 0.0), goal: Pose::new(6.0, 1.4, 0.0) };
            assert!(planner(&world, through).plan(&|_| None, &()).is_none(), "{kind:?}: through a wall");
            let outside = Pose::new(-5.0, 1.0, 0.0);
            let placed = |query| {
                let settings = SearchSettings::new(&world.0);
                Planner::new(&world.0, &world.1, settings, query, [], Seed(1)).map(|_| ())
            };
            assert_eq!(placed(Query { start: outside, ..through }), Err(Unplaced::Start), "{kind:?}");
            assert_eq!(placed(Query { goal: outside, ..through }), Err(Unplaced::Goal), "{kind:?}");
        }
    }
}
