//! Search and guides together: an option gets its guide only when a plan wants it (lines 8, 9 and 15).
//!
//! Costs begin as lower bounds. Whenever A* returns a plan, its options without a guide are guided and their costs
//! become exact, or infinite where no guide exists. Then A* runs again, until a plan consists of guided options
//! only. That plan is as cheap as if every option had been guided beforehand (lazy shortest-path search), and an
//! option that cannot be guided has lost its edge: the repair that downward refinability needs. Guides that only samples
//! find are looked for where there is no plan without them.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, OnceLock};

use rayon::prelude::*;
use sharp_drive::{Driver, InitialStates, SuccessEstimate, World};
use sharp_guide::{
    Departure, Goal, GuidePath, GuidePlanner, GuidedOption, LegId, NoGuide, OptionSpace, UnguidedOption,
    arriving, departures, is_tight, joining, ridge_routes, route_beyond, routes,
};
use sharp_options::OptionId;
use sharp_rbvd::{StateAbstraction, StateId};
use sharp_sim::{NoiseModel, RobotState};
use sharp_space::{Cell, Point, Pose, Seed, trig};

use crate::abstraction::Abstraction;
use crate::conditions::Conditions;
use crate::known::KnownOptions;
use crate::method::{Method, PriceRule, SearchSettings};
use crate::option_graph::{Candidate, OptionGraph};
use crate::price::{Price, Pricer};
use crate::query::{Monitor, Phase, Query};
use crate::reason::{fits, narrowest_gap};

/// What a hand-over costs that the robot should not be able to make, where no plan does without one, seconds.
const HARD_HAND_OVER_S: f64 = 120.0;
/// A car turns no further than this without a loop, whatever the clearance: 120 degrees.
const CAR_TURN_MAX_RAD: f64 = 2.0 * std::f64::consts::FRAC_PI_3;
/// A start or goal without a state of its own belongs to the nearest one within this distance, metres, or in a cell beside it:
/// a robot may stand where the diagram's margin has no state.
const STATE_NEAR_M: f64 = 0.5;

/// Poses that the search for a direct route expands before it gives up: 0.1 to 0.3 s of one core.
const EXPANSIONS: usize = 100_000;
/// The same for each way out of a tight start.
const EXPANSIONS_DEPARTING: usize = 5_000;
/// Episodes in which each way out of a tight start is tried; the second where an answer is wanted at once.
const TRIAL_EPISODES: [u32; 2] = [200, 32];
/// There, episodes of a way that failed once.
const DOUBTFUL_EPISODES: u32 = 128;
/// There, metres of a leg that are driven after the robot has left.
const TRIAL_M: f64 = 2.5;
/// Ways out of a tight start that are tried side by side where an answer is wanted at once.
const WAYS_AT_ONCE: usize = 2;
/// What is in the way further from the start than this cannot be helped by leaving it otherwise, metres.
const DEPARTURE_REACH_M: f64 = 4.0;
/// Ways out of a tight start join one direct way where the goal is at least so far, metres.
pub(crate) const JOINED_FROM_M: f64 = 8.0;
/// The best way out for an earlier leg is enough for the next one if it succeeds at most so much less often.
const LESS: f64 = 0.1;
/// A leg from the start that succeeds less often than this, by its price and then when tried, looks for a better way to
/// begin.
const LEAVES_WELL: f64 = 0.98;

/// The guided options of one problem and the searches among them.
#[derive(Debug)]
pub struct Search<'a> {
    world: &'a World,
    guides: &'a dyn GuidePlanner,
    /// Gives up on a guide sooner than `guides`.
    hasty: Option<Box<dyn GuidePlanner>>,
    /// Whether guides are planned with all patience: once there is no plan of those that were found in haste.
    is_patient: bool,
    settings: SearchSettings,
    space: OptionSpace,
    query: Query,
    goal: Goal,
    graph: OptionGraph,
    guided: BTreeMap<LegId, Result<Arc<GuidedOption>, NoGuide>>,
    pricer: Pricer<'a>,
    /// What guided options cost before they are measured.
    prices: BTreeMap<LegId, Price>,
    /// Whether the robot fits through the narrowest place on its way; found when it is first asked for, as are the next.
    fits: OnceLock<bool>,
    /// Whether the start is a tight place.
    is_tight: OnceLock<bool>,
    /// How the robot can leave its start.
    departures: OnceLock<Vec<(Departure, Vec<Pose>)>>,
    /// Under what they are tried; by their prices alone without.
    trials: Option<&'a Conditions>,
    /// Whether an answer is wanted at once: then they are tried for the first leg that is asked for, until one does well. If
    /// none does, the best of them is tried first for the next leg.
    is_hurried: bool,
    /// Which of them it was then; `None` for driving at once.
    chosen: OnceLock<Option<usize>>,
    /// If no way did well for a leg: the best of the first such leg.
    least_bad: OnceLock<LeastBad>,
    /// Where an answer is wanted at once: how often legs came out of a tight start, where that was not often enough.
    seen_to_fail: Mutex<BTreeMap<LegId, f64>>,
    /// The direct way without its first metres, which all ways out of the start join.
    beyond: OnceLock<Result<GuidePath, NoGuide>>,
    /// Whether a plan may go from start to goal without any option though they lie in different states.
    offers_direct: bool,
    /// Options that are at hand from the beginning, the same for every search of a building.
    known: Option<Arc<KnownOptions>>,
    /// Seconds that hand-overs cost beyond their turn, because they were seen to fail.
    charges: BTreeMap<(LegId, LegId), f64>,
    seed: Seed,
}

/// A leg from the start, as it did in a few episodes.
struct TriedLeg {
    option: Arc<GuidedOption>,
    cost_s: f64,
    success: f64,
}

/// The best way out of the start for a leg for which none did well.
#[derive(Clone, Copy, Debug)]
struct LeastBad {
    /// Its number among the ways, `None` for driving at once.
    number: Option<usize>,
    /// Share of the runs that came through.
    success: f64,
}

/// Why there is no search for a query: no abstract state at one of its ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Unplaced {
    /// No state near the start.
    #[error("the start lies in no abstract state: the robot cannot leave it")]
    Start,
    /// No state near the goal.
    #[error("the goal lies in no abstract state: the robot cannot reach it")]
    Goal,
}

impl<'a> Search<'a> {
    /// A search for `query` under `noise`, as `method` says; `known` are guides from earlier problems.
    ///
    /// # Errors
    /// Names the end of the query that lies in no abstract state (Algorithm 1, line 8).
    pub fn new(
        world: &'a World,
        abstraction: &Abstraction,
        method: &'a Method,
        noise: &NoiseModel,
        query: Query,
        known: impl IntoIterator<Item = (LegId, GuidePath)>,
        seed: Seed,
    ) -> Result<Self, Unplaced> {
        let Abstraction { states, options } = abstraction;
        let start = state_near(&**states, query.start.position).ok_or(Unplaced::Start)?;
        let goal = state_near(&**states, query.goal.position).ok_or(Unplaced::Goal)?;
        let clearance = world.geometry.clearance();
        let disc = goal_of(query.goal, world, method.search.goal_heading_tolerance_rad);
        let end = disc.easiest_end(clearance, world.robot.footprint.inscribed_radius_m());
        let end = Pose::at(end, query.goal.heading);
        let graph = OptionGraph::new(&**states, options, (query.start, start), (end, goal));
        let mut this = Self {
            world,
            guides: &*method.guides,
            hasty: method.guides.hasty(),
            is_patient: false,
            settings: method.search,
            space: abstraction.space(method.search.allowed),
            query,
            goal: disc,
            graph,
            guided: BTreeMap::new(),
            pricer: Pricer::new(world, noise, method.search, method.failure_cost_s),
            prices: BTreeMap::new(),
            fits: OnceLock::new(),
            is_tight: OnceLock::new(),
            departures: OnceLock::new(),
            trials: None,
            is_hurried: false,
            chosen: OnceLock::new(),
            least_bad: OnceLock::new(),
            seen_to_fail: Mutex::default(),
            beyond: OnceLock::new(),
            offers_direct: false,
            known: None,
            charges: BTreeMap::new(),
            seed,
        };
        for (id, guide) in known {
            if let Some(candidate) = this.graph.candidate(id) {
                let option = this.guided(candidate, guide);
                this.keep(id, Ok(Arc::new(option)));
            }
        }
        Ok(this)
    }

    /// The same with the guides, prices and hand-overs of `known`, which were made for this method.
    #[must_use]
    pub(crate) fn with_known(self, known: Arc<KnownOptions>) -> Self {
        Self { known: Some(known), ..self }
    }

    /// From now on a plan may go from start to goal without any option, through all states, if the method allows it:
    /// what a motion planner would do that knows no options. Returns false if nothing changes.
    pub fn offer_direct(&mut self) -> bool {
        let is_new = self.settings.direct && !self.offers_direct;
        self.offers_direct |= is_new;
        is_new
    }

    /// Makes all plans in which `after` follows `before` cost `seconds` more: a hand-over that was seen to fail.
    pub fn charge(&mut self, before: LegId, after: LegId, seconds: f64) {
        self.charges.insert((before, after), seconds);
    }

    /// The cheapest plan of guided options with its cost in seconds, or `None`. `measured` knows how options did.
    pub fn plan(
        &mut self,
        measured: &dyn Fn(LegId) -> Option<SuccessEstimate>,
        monitor: &dyn Monitor,
    ) -> Option<(f64, Vec<Arc<GuidedOption>>)> {
        loop {
            monitor.phase(Phase::Search);
            let strict = self.cheapest(measured, f64::INFINITY);
            // Where a search finds no guide, samples seldom find one either, and take a hundred times as long.
            if strict.is_none() && self.be_patient() {
                continue;
            }
            // A hand-over that may fail is better than no plan: what it is worth will be measured.
            let (cost_s, ids) = strict.or_else(|| self.cheapest(measured, HARD_HAND_OVER_S))?;
            let missing: Vec<LegId> = ids.iter().copied().filter(|&id| self.found(id).is_none()).collect();
            if missing.is_empty() {
                let options: Option<_> = ids.iter().map(|&id| self.found(id)?.ok().cloned()).collect();
                return options.map(|options| (cost_s, options));
            }
            monitor.phase(Phase::Guide);
            if !self.guide_while(&missing, &|| !monitor.should_stop()) {
                return None;
            }
        }
    }

    /// The plan that goes from start to goal without any option, if it is offered and has a guide, with its cost in seconds.
    pub fn direct(
        &mut self,
        measured: &dyn Fn(LegId) -> Option<SuccessEstimate>,
        monitor: &dyn Monitor,
    ) -> Option<(f64, Vec<Arc<GuidedOption>>)> {
        if !self.offers_direct {
            return None;
        }
        if self.found(LegId::Direct).is_none() {
            monitor.phase(Phase::Guide);
            self.guide_while(&[LegId::Direct], &|| !monitor.should_stop());
        }
        let option = Arc::clone(self.found(LegId::Direct)?.ok()?);
        let candidate = self.graph.candidate(LegId::Direct)?;
        Some((self.cost_s(candidate, measured(LegId::Direct)), vec![option]))
    }

    /// From now on guides are planned with all patience, those too that were not found in haste. Returns false if that changes
    /// nothing: there is no hasty planner, or no robot of this width gets from start to goal.
    fn be_patient(&mut self) -> bool {
        if self.is_patient || self.hasty.is_none() || !self.fits() {
            return false;
        }
        self.is_patient = true;
        let before = self.guided.len();
        self.guided.retain(|_, option| option.is_ok());
        self.guided.len() < before
    }

    /// Whether the robot fits through the narrowest place between start and goal; where it does not, no patience helps.
    pub(crate) fn fits(&self) -> bool {
        *self.fits.get_or_init(|| fits(self.world, narrowest_gap(self.world, &self.query).as_ref()))
    }

    /// Plans the guides of all of `ids`, with all patience.
    pub(crate) fn guide_all(&mut self, ids: &[LegId]) {
        self.is_patient = true;
        self.guide_while(ids, &|| true);
    }

    /// The same, as long as it `may_go_on`; false if it had to stop.
    fn guide_while(&mut self, ids: &[LegId], may_go_on: &(dyn Fn() -> bool + Sync)) -> bool {
        let guided: Vec<_> = ids.par_iter().filter(|_| may_go_on()).map(|&id| (id, self.guide(id))).collect();
        let is_whole = guided.len() == ids.len();
        guided.into_iter().for_each(|(id, option)| self.keep(id, option));
        is_whole
    }

    /// What became of guiding the option called `id`; `None` if nobody tried.
    pub(crate) fn found(&self, id: LegId) -> Option<Result<&Arc<GuidedOption>, &NoGuide>> {
        let known = || self.known.as_ref()?.found(id);
        self.guided.get(&id).map(Result::as_ref).or_else(known)
    }

    /// The price of a guided option.
    fn price(&self, id: LegId) -> Option<&Price> {
        self.prices.get(&id).or_else(|| self.known.as_ref()?.price(id, &self.pricer))
    }

    /// Notes the guide of the option called `id`, or that it has none.
    fn keep(&mut self, id: LegId, option: Result<Arc<GuidedOption>, NoGuide>) {
        if let Ok(option) = &option {
            let price = self.pricer.price(option, None);
            self.prices.insert(id, price);
        }
        self.guided.insert(id, option);
    }

    /// The cost and the names of the cheapest plan by what is known now, in which no hand-over counts for more than `most_s`.
    fn cheapest(
        &self,
        measured: &dyn Fn(LegId) -> Option<SuccessEstimate>,
        most_s: f64,
    ) -> Option<(f64, Vec<LegId>)> {
        let top_speed = self.world.robot.max_speed_mps;
        let cost = |option: &Candidate| self.cost_s(option, measured(option.id()));
        let charge = |before: &Candidate, after: &Candidate| {
            let pair = (before.id(), after.id());
            let known = || self.known.as_ref()?.charge(pair);
            self.charges.get(&pair).copied().or_else(known).unwrap_or(0.0)
        };
        let hand_over = |before: &Candidate, after: &Candidate| {
            self.hand_over_s(before, after).min(most_s) + charge(before, after)
        };
        self.graph.search(top_speed, cost, hand_over)
    }

    /// The option called `id` with a guide of its own, if it was guided.
    pub(crate) fn option(&self, id: LegId) -> Option<&GuidedOption> {
        self.found(id).and_then(Result::ok).map(|option| &**option)
    }

    /// The options of the problem, and which may follow which.
    pub(crate) const fn graph(&self) -> &OptionGraph {
        &self.graph
    }

    /// Whether the robot can go on from the option called `before` to the one called `after` without a turn that it should
    /// not make; true where one of them has no guide.
    pub(crate) fn can_follow(&self, before: LegId, after: LegId) -> bool {
        let candidates = (self.graph.candidate(before), self.graph.candidate(after));
        matches!(candidates, (Some(before), Some(after)) if self.hand_over_s(before, after).is_finite())
    }

    /// What the guided option called `id` costs before it is measured, seconds without surcharges.
    pub(crate) fn priced_s(&self, id: LegId) -> Option<f64> {
        self.price(id).map(|price| self.pricer.cost_s(price, None))
    }

    /// The options that could not be guided, with the reason.
    pub fn unguided(&self) -> impl Iterator<Item = (LegId, &NoGuide)> {
        self.guided.iter().filter_map(|(&id, option)| option.as_ref().err().map(|reason| (id, reason)))
    }

    /// What `option` costs, seconds: what was measured, else the price of its guide, else what its straight length
    /// costs at least; infinite where it has no guide.
    fn cost_s(&self, option: &Candidate, measured: Option<SuccessEstimate>) -> f64 {
        let settings = &self.settings;
        if !settings.bypasses && matches!(option.id(), LegId::Option(OptionId::Bypass { .. })) {
            return f64::INFINITY;
        }
        let UnguidedOption { id, from, to, .. } = option.option;
        if id == LegId::Direct && from != to && !self.offers_direct && !self.is_there() {
            return f64::INFINITY;
        }
        let top_mps = self.world.robot.max_speed_mps;
        let least_s = option.straight_m() / top_mps;
        let unguided_s = match settings.price {
            PriceRule::Length => least_s / settings.nominal_speed,
            PriceRule::Profile | PriceRule::Model => least_s / settings.unguided_speed,
        };
        let bypass_s = if option.is_bypass { settings.bypass_surcharge_s } else { 0.0 };
        let measured = measured.filter(|_| settings.cost_update);
        // The direct way serves no later problem; it is there to be compared with as it is.
        let is_bare = measured.is_some() || id == LegId::Direct;
        let surcharge_s = if is_bare { 0.0 } else { settings.untrained_surcharge_s };
        let cost_s = match self.found(option.id()) {
            Some(Ok(_)) => {
                let price = self.price(option.id()).expect("a guided option is priced");
                let seen = self.seen_to_fail.lock().expect("no panic").get(&id).copied();
                let seen = seen.filter(|_| measured.is_none());
                let lost = seen.map_or(0.0, |success| (price.parts().1 - success).max(0.0));
                let cost_s = self.pricer.cost_s(price, measured.as_ref()) + lost * self.pricer.failure_cost_s;
                cost_s.max(if measured.is_some() { least_s } else { unguided_s })
            }
            Some(Err(_)) => return f64::INFINITY,
            None => unguided_s,
        };
        cost_s + surcharge_s + bypass_s
    }

    /// Seconds lost where one guide ends and the next begins; infinite where the robot should not turn so.
    fn hand_over_s(&self, before: &Candidate, after: &Candidate) -> f64 {
        let (Some(first), Some(second)) = (self.option(before.id()), self.option(after.id())) else {
            return 0.0;
        };
        let turn = first.guide.end().heading.turn_to(second.guide.start().heading).abs();
        let robot = &self.world.robot;
        let turn_s = turn / robot.max_yaw_rate_radps;
        let clearance_m = self.world.geometry.clearance().sample(after.option.start);
        if turn <= self.smooth_turn_rad(clearance_m) {
            return turn_s;
        }
        // Room for the whole circle, or for a car's loop, and for arriving off the centre.
        let radius_m = robot.min_turning_radius_m();
        let circle_m = 2.0 * radius_m + robot.footprint.circumscribed_radius_m() + 0.3;
        let nominal_mps = self.settings.nominal_speed * robot.max_speed_mps;
        let loop_s = 2.0 + std::f64::consts::TAU * radius_m / nominal_mps;
        if clearance_m > circle_m { turn_s + loop_s } else { f64::INFINITY }
    }

    /// The largest turn between two guides that the robot makes without stopping, with `clearance_m` around it.
    ///
    /// A car rounds the corner of two lines on a circle that touches them radius x tan(turn / 2)
    /// before and behind it. The outline of a robot that turns in place swings out instead.
    fn smooth_turn_rad(&self, clearance_m: f64) -> f64 {
        let robot = &self.world.robot;
        if robot.can_turn_in_place() {
            return self.settings.smooth_turn_rad;
        }
        let run_up_m = (clearance_m - robot.footprint.inscribed_radius_m()).max(0.0);
        (2.0 * trig::atan(run_up_m / robot.min_turning_radius_m())).min(CAR_TURN_MAX_RAD)
    }

    fn guide(&self, id: LegId) -> Result<Arc<GuidedOption>, NoGuide> {
        let candidate = self.graph.candidate(id).expect("the search returns its own options");
        if id == LegId::Direct && self.is_there() {
            let is_free = |pose| self.world.geometry.is_free(pose);
            let guide = guide_of_nothing(self.query.start, self.settings.guide.spacing_m, is_free);
            return guide.map(|guide| Arc::new(self.guided(candidate, guide)));
        }
        if !matches!(id, LegId::First(_) | LegId::Direct) {
            return Ok(Arc::new(self.guided(candidate, self.plan_guide(&candidate.option, self.planner())?)));
        }
        // The guides of the direct way take longest: it does as the leg before it, however well that did.
        let least_bad = || self.least_bad.get().filter(|_| id == LegId::Direct).map(|way| way.number);
        let chosen = self.chosen.get().copied().or_else(least_bad);
        let again = chosen.flatten().and_then(|way| self.departures().get(way));
        if let Some(option) = again.and_then(|way| self.departing(candidate, way)) {
            if let Some(way) = self.least_bad.get().filter(|_| self.chosen.get().is_none()) {
                self.seen_to_fail.lock().expect("no panic").insert(id, way.success);
            }
            return Ok(Arc::new(option));
        }
        let at_once = self.plan_from(candidate, self.query.start, self.planner());
        let at_once = at_once.map(|guide| self.guided(candidate, guide));
        let is_tight = *self.is_tight.get_or_init(|| is_tight(&self.world.guide_robot(), self.query.start));
        let leaves_well = |option: &GuidedOption| self.pricer.price(option, None).parts().1 >= LEAVES_WELL;
        let start = self.query.start.position;
        let is_beyond = at_once.as_ref().is_err_and(|reason| reason.is_beyond(start, DEPARTURE_REACH_M));
        let is_settled = is_beyond || (chosen.is_some() && (at_once.is_ok() || id == LegId::Direct));
        if let Some(way) =
            self.least_bad.get().filter(|_| chosen == Some(None) && self.chosen.get().is_none())
        {
            self.seen_to_fail.lock().expect("no panic").insert(id, way.success);
        }
        if !self.settings.departures || is_settled || (!is_tight && at_once.as_ref().is_ok_and(leaves_well)) {
            return at_once.map(Arc::new);
        }
        if self.is_hurried {
            return self.first_that_leaves(candidate, at_once);
        }
        let mut tried: Vec<_> = at_once.clone().into_iter().map(|option| self.tried(option)).collect();
        if !is_tight && tried.iter().any(|tried| tried.success >= LEAVES_WELL) {
            return at_once.map(Arc::new);
        }
        let others = self.departures().iter().filter_map(|way| self.departing(candidate, way));
        tried.extend(others.map(|option| self.tried(option)));
        let cheapest = tried.into_iter().min_by(|a, b| a.cost_s.total_cmp(&b.cost_s));
        cheapest.map_or_else(|| at_once.map(Arc::new), |tried| Ok(tried.option))
    }

    /// The leg `candidate` with the first way out of the start that hardly ever fails, driving `at_once` before all others;
    /// the cheapest if each fails at times. After one that does well the next legs from the start leave it likewise; if none
    /// does, the best of them is tried first for the next leg.
    fn first_that_leaves(
        &self,
        candidate: &Candidate,
        at_once: Result<GuidedOption, NoGuide>,
    ) -> Result<Arc<GuidedOption>, NoGuide> {
        let trying = |number: Option<usize>| {
            let option = match number {
                None => at_once.as_ref().ok().cloned(),
                Some(number) => self.departing(candidate, &self.departures()[number]),
            };
            let tried = self.tried(option?);
            // One failure may be chance, and the next way is slower.
            let is_doubtful =
                (1.0 - tried.success) * f64::from(TRIAL_EPISODES[1]) < 1.5 && tried.success < 1.0;
            let tried = if is_doubtful { self.tried_in(tried.option, DOUBTFUL_EPISODES) } else { tried };
            Some((tried, number))
        };
        // If no way did well for an earlier leg, the best of them is enough for this leg too, unless it does worse here.
        let least_bad = self.least_bad.get().copied();
        let before: Vec<Option<usize>> = least_bad.and_then(|way| way.number).map(Some).into_iter().collect();
        let others = (0..self.departures().len()).map(Some).filter(|way| !before.contains(way));
        let others: Vec<Option<usize>> = others.collect();
        let mut best: Option<(TriedLeg, Option<usize>)> = None;
        let mut is_settled = false;
        let side_by_side =
            |ways: &[Option<usize>]| -> Vec<_> { ways.par_iter().map(|&way| trying(way)).collect() };
        let ways = [&[None][..], &before].into_iter().chain(others.chunks(WAYS_AT_ONCE));
        for (tried, number) in ways.flat_map(side_by_side).flatten() {
            let success = tried.success;
            is_settled = success >= LEAVES_WELL;
            if is_settled || best.as_ref().is_none_or(|(best, _)| tried.cost_s < best.cost_s) {
                best = Some((tried, number));
            }
            let is_enough = |way: LeastBad| way.number == number && success >= way.success - LESS;
            if is_settled || least_bad.is_some_and(is_enough) {
                break;
            }
        }
        let Some((tried, number)) = best else { return at_once.map(Arc::new) };
        // Of a plan only one leg begins at the start, so that this is the same every time.
        if is_settled {
            let _ = self.chosen.set(number);
        } else {
            let _ = self.least_bad.set(LeastBad { number, success: tried.success });
            let mut seen = self.seen_to_fail.lock().expect("no panic");
            seen.insert(candidate.id(), tried.success);
        }
        Ok(tried.option)
    }

    /// How the leg `option` does from the start: by a few episodes where there is a simulator, for a price knows little of
    /// tight places. The prior drives, and where it fails too often the follower as well, unless an answer is wanted at once.
    fn tried(&self, option: GuidedOption) -> TriedLeg {
        self.tried_in(Arc::new(option), TRIAL_EPISODES[usize::from(self.is_hurried)])
    }

    /// The same in so many episodes.
    fn tried_in(&self, option: Arc<GuidedOption>, episodes: u32) -> TriedLeg {
        let price = self.pricer.price(&option, None);
        let cost_s = |measured: Option<&SuccessEstimate>| self.pricer.cost_s(&price, measured);
        let Some(conditions) = self.trials else {
            return TriedLeg { cost_s: cost_s(None), success: price.parts().1, option };
        };
        let states = InitialStates::exactly(RobotState::at_rest(self.query.start));
        let seed = self.seed.child(&format!("leave {}", option.id), 0);
        let trial = conditions.monte_carlo(self.world).with_episodes(episodes).with_seed(seed);
        let estimate = |policy| {
            let mut driver = Driver::new(&option, policy, None);
            if self.is_hurried {
                driver.link.until_m = option.departure.careful_m + TRIAL_M;
            }
            trial.estimate(&[driver], &states)
        };
        let [prior, follower] = &self.pricer.policies();
        let mut best = estimate(prior);
        if self.is_hurried {
            // What a part of the leg takes says nothing of the time of the whole.
            best.mean_time_s = f64::INFINITY;
        } else if best.count.rate() < LEAVES_WELL {
            let other = estimate(follower);
            if cost_s(Some(&other)) < cost_s(Some(&best)) {
                best = other;
            }
        }
        TriedLeg { cost_s: cost_s(Some(&best)), success: best.count.rate(), option }
    }

    /// From now on ways out of a tight start are tried under `conditions` before one is taken: all of them for each leg, or,
    /// in a hurry, for one leg until one does well.
    #[must_use]
    pub(crate) fn with_trials(self, conditions: &'a Conditions, is_hurried: bool) -> Self {
        Self { trials: Some(conditions), is_hurried, ..self }
    }

    /// The ways out of the start, where it is a tight place.
    fn departures(&self) -> &[(Departure, Vec<Pose>)] {
        self.departures.get_or_init(|| {
            let robot = &self.world.robot;
            let mut ways = departures(&self.world.guide_robot(), self.query.start, robot.recovery_reverse_m);
            if self.is_hurried {
                // The first that does well is taken: backing off is quick, a curve that is driven with care is not, and where
                // the robot can turn it finds onto any guide.
                let outline_m = robot.footprint.circumscribed_radius_m();
                let can_turn = |lead: &[Pose]| {
                    let end = lead.last().map_or(self.query.start, |end| *end);
                    robot.can_turn_in_place()
                        && self.world.geometry.clearance().sample(end.position) > outline_m
                };
                ways.sort_by(|(a, lead_a), (b, lead_b)| {
                    let by_turn = can_turn(lead_b).cmp(&can_turn(lead_a));
                    let by_care = a.careful_m.total_cmp(&b.careful_m);
                    by_care.then(by_turn).then(a.back_off_m.total_cmp(&b.back_off_m))
                });
            }
            ways
        })
    }

    /// The leg `candidate` with a guide that begins with `way`.
    fn departing(&self, candidate: &Candidate, way: &(Departure, Vec<Pose>)) -> Option<GuidedOption> {
        let (departure, lead) = way;
        // There are many ways out. With samples beyond each of them a start that is tight took minutes.
        let start = *lead.last()?;
        let is_direct = candidate.id() == LegId::Direct && self.settings.direct;
        let is_far = start.distance_m(&self.query.goal) >= JOINED_FROM_M;
        let rest = if self.is_hurried && is_direct && is_far {
            joining(&self.world.guide_robot(), start, self.beyond(candidate.option.end).ok()?)?
        } else {
            self.plan_from(candidate, start, self.hasty()).ok()?
        };
        let mut poses = lead.clone();
        poses.extend(&rest.poses()[1..]);
        let guide = GuidePath::new(poses, rest.spacing_m()).ok()?;
        Some(self.guided(candidate, guide).with_departure(*departure))
    }

    /// The direct way without its first metres.
    fn beyond(&self, end: Point) -> Result<&GuidePath, NoGuide> {
        let goal = (end, self.goal.heading.map(|(heading, _)| heading));
        let plan = || route_beyond(&self.world.guide_robot(), self.query.start.position, goal);
        self.beyond.get_or_init(plan).as_ref().map_err(Clone::clone)
    }

    /// A guide for the leg `candidate` for a robot at `start`.
    fn plan_from(
        &self,
        candidate: &Candidate,
        start: Pose,
        planner: &dyn GuidePlanner,
    ) -> Result<GuidePath, NoGuide> {
        if candidate.id() == LegId::Direct && self.settings.direct {
            let at_once = start == self.query.start;
            // What fails near the start need not be searched to a far goal with every margin.
            let is_far = start.distance_m(&self.query.goal) >= JOINED_FROM_M;
            if self.is_hurried && is_far {
                let beyond = self.beyond(candidate.option.end)?;
                let begins = joining(&self.world.guide_robot(), start, beyond);
                begins.ok_or(NoGuide::LeadIn(start.position))?;
            }
            let expansions = if at_once { EXPANSIONS } else { EXPANSIONS_DEPARTING };
            return self.direct_route(start, candidate.option.end, expansions);
        }
        let (start, heading) = (start.position, Some(start.heading));
        self.plan_guide(&UnguidedOption { start, heading, ..candidate.option }, planner)
    }

    fn hasty(&self) -> &dyn GuidePlanner {
        self.hasty.as_deref().unwrap_or(self.guides)
    }

    fn planner(&self) -> &dyn GuidePlanner {
        if self.is_patient { self.guides } else { self.hasty() }
    }

    fn plan_guide(&self, option: &UnguidedOption, planner: &dyn GuidePlanner) -> Result<GuidePath, NoGuide> {
        let mut rng = self.seed.stream(&format!("guide {}", option.id), 0);
        let ends_there = matches!(option.id, LegId::Last(..) | LegId::Direct);
        let goal_heading = self.goal.heading.filter(|_| ends_there).map(|(heading, _)| heading);
        let option = UnguidedOption { goal_heading, ..*option };
        option.plan_guide(&self.space, &self.world.guide_robot(), planner, &mut rng)
    }

    /// The cheapest of the routes to `end` with different safety margins, by their prices.
    fn direct_route(&self, start: Pose, end: Point, expansions: usize) -> Result<GuidePath, NoGuide> {
        let robot = self.world.guide_robot();
        let price_s =
            |guide: &GuidePath| self.pricer.cost_s(&self.pricer.of_guide(LegId::Direct, guide, None), None);
        let heading = self.goal.heading.map(|(heading, _)| heading);
        let mut reason = NoGuide::Unreachable;
        let found = ridge_routes(&robot, start, (end, heading));
        let found = found.filter_map(|route| route.map_err(|why| reason = why).ok());
        let cheapest =
            found.take(self.settings.direct_routes).min_by(|a, b| price_s(a).total_cmp(&price_s(b)));
        let may_search_lattice = self.settings.direct_routes > 1;
        let goal = (end, 0.5 * self.goal.radius_m);
        let patient = || {
            if may_search_lattice && self.fits() {
                routes(&robot, start, goal, expansions).next()
            } else {
                None
            }
        };
        cheapest.or_else(patient).ok_or(reason)
    }

    fn guided(&self, candidate: &Candidate, guide: GuidePath) -> GuidedOption {
        let (option, goal) = (&candidate.option, self.goal.clone());
        let guide = self.arriving(candidate.id(), guide);
        GuidedOption::new(&self.space, option.id, (option.from, option.to), guide, goal)
    }

    /// The guide of the leg called `id`, which for a car arrives in the direction that the goal asks for, where it can.
    fn arriving(&self, id: LegId, guide: GuidePath) -> GuidePath {
        let ends_there = matches!(id, LegId::Last(..) | LegId::Direct);
        let is_off = ends_there && self.goal.turn_left_rad(&guide.end()) != 0.0;
        match self.goal.heading {
            Some((heading, _)) if is_off && !self.world.robot.can_turn_in_place() => {
                arriving(&self.world.guide_robot(), &guide, heading).unwrap_or(guide)
            }
            _ => guide,
        }
    }

    /// Returns true if there is nothing to do: the start lies in the goal.
    fn is_there(&self) -> bool {
        // A robot that turns in place does so where it stands.
        let may_turn = self.world.robot.can_turn_in_place();
        self.goal.is_reached(&self.query.start) || (may_turn && self.goal.contains(self.query.start.position))
    }
}

/// The guide of a robot that has arrived before it begins: half a spacing ahead, or where that is not free a millimetre, which is
/// as free as the start.
fn guide_of_nothing(
    start: Pose,
    spacing_m: f64,
    is_free: impl Fn(Pose) -> bool,
) -> Result<GuidePath, NoGuide> {
    let ahead = |length_m| Pose::at(start.position + start.heading.unit() * length_m, start.heading);
    let half = ahead(0.5 * spacing_m);
    let end = if is_free(half) { half } else { ahead(0.001) };
    GuidePath::new(vec![start, end], spacing_m).map_err(|_| NoGuide::NoLength(start.position))
}

/// The goal at `pose` for the robot of `world`, which asks for the heading where there is a tolerance for it.
pub(crate) fn goal_of(pose: Pose, world: &World, heading_tolerance_rad: Option<f64>) -> Goal {
    let goal = Goal::new(pose.position, world.robot.goal_tolerance_m, world.geometry.clearance());
    match heading_tolerance_rad {
        Some(tolerance_rad) => goal.with_heading(pose.heading, tolerance_rad),
        None => goal,
    }
}

/// α(x), or the state of the nearest cell that has one nearby.
fn state_near(states: &dyn StateAbstraction, point: Point) -> Option<StateId> {
    if let Some(state) = states.state_at(point) {
        return Some(state);
    }
    let frame = states.frame();
    let center = frame.cell_at(point)?;
    let reach = (STATE_NEAR_M / frame.resolution_m).ceil() as usize;
    let rows = center.row.saturating_sub(reach)..=(center.row + reach).min(frame.height - 1);
    rows.flat_map(|row| {
        let cols = center.col.saturating_sub(reach)..=(center.col + reach).min(frame.width - 1);
        cols.map(move |col| Cell::new(col, row))
    })
    .filter_map(|cell| states.state_of(cell).map(|state| ((frame.center(cell) - point).norm(), cell, state)))
    .filter(|(distance_m, ..)| *distance_m <= STATE_NEAR_M.max(1.5 * frame.resolution_m))
    .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))
    .map(|(_, _, state)| state)
}

#[cfg(test)]
mod tests;
