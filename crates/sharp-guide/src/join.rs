//! One path for a whole plan: guides that join smoothly.
//!
//! The guide of an option is planned for the option alone, through the centres of its sets. In a plan the robot
//! comes from somewhere and goes on to somewhere. So the guides of the plan are smoothed together and cut where
//! they come nearest to those centres. Where the joined path fails at a place, the options around it alone are smoothed
//! again with other weights, first with the same margin and then with smaller ones. Where that fails too, the options
//! there keep their own guides, and those before and behind are joined. The library keeps the guides as they were planned.
//!
//! A robot that follows a joined path under noise may pass beside a set that it was to enter, and has no reason to come
//! back. So the options of the plan end there as well.

use std::cell::Cell as Memory;
use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::Arc;

use sharp_options::Endpoint;
use sharp_rbvd::StateId;
use sharp_space::{Cell, Heading, Point, Pose};

use crate::context::{GuideContext, tight_bends, touches};
use crate::gap::narrowest_gap_m;
use crate::guided_option::GuidedOption;
use crate::inflate::GuideRobot;
use crate::path::GuidePath;
use crate::plan::{ATTEMPTS, Drafts, attempts};
use crate::request::{GuideEnd, GuideRequest};
use crate::settings::GuideSettings;

/// A cut is looked for this far before and behind the place where the guides met, metres.
const SEARCH_M: f64 = 2.0;
/// The distance between two places of which one may become a cut, metres.
const SEARCH_STEP_M: f64 = 0.05;
/// The path meets a smaller disc within each set, by this factor.
const DISC_FACTOR: f64 = 0.6;
/// An option keeps at least this much way, metres.
const OPTION_MIN_M: f64 = 0.3;
/// Around a place where the joined path fails so much of it is smoothed again, metres to both sides.
const AROUND_M: f64 = 2.0;
/// There the path may turn by so much where it joins the rest, radians.
pub(crate) const JOINT_TURN_MAX_RAD: f64 = 0.15;

/// `options`, which follow one another from `start`, with guides that join smoothly where that is possible.
#[must_use]
pub fn join_guides(
    options: Vec<Arc<GuidedOption>>,
    start: Pose,
    robot: &GuideRobot<'_>,
    settings: &GuideSettings,
) -> Vec<Arc<GuidedOption>> {
    let Some(first) = options.first() else { return options };
    // The beginning of a guide that is driven with care must stay as it is.
    let is_careful = first.departure.careful_m > 0.0;
    let start = if is_careful { first.guide.end() } else { first.departure.after_back_off(start) };
    let last = &options[options.len() - 1];
    let ends = RunEnds {
        start,
        goal: GuideEnd { position: last.guide.end().position, heading: goal_heading(last) },
    };
    let mut guides: Vec<Option<GuidePath>> = vec![None; options.len()];
    LegChain::new(&options, robot, settings).join(usize::from(is_careful)..options.len(), ends, &mut guides);
    let with = |(option, guide): (Arc<GuidedOption>, Option<GuidePath>)| match guide {
        Some(guide) => Arc::new(GuidedOption { guide, ..GuidedOption::clone(&option) }),
        None => option,
    };
    let mut joined: Vec<_> = options.into_iter().zip(guides).map(with).collect();
    end_in_passing(&mut joined);
    joined
}

/// Lets all of `options`, which follow one another, but the last end as well where the robot passes their sets.
pub fn end_in_passing(options: &mut [Arc<GuidedOption>]) {
    let Some((_, before)) = options.split_last_mut() else { return };
    for option in before {
        Arc::make_mut(option).ends_in_passing = true;
    }
}

/// Where a run of options begins and ends.
#[derive(Clone, Copy)]
struct RunEnds {
    start: Pose,
    goal: GuideEnd,
}

/// Options that follow one another.
struct LegChain<'a> {
    options: &'a [Arc<GuidedOption>],
    robot: &'a GuideRobot<'a>,
    settings: &'a GuideSettings,
    allowed: BTreeSet<StateId>,
    sources: Vec<&'a Endpoint>,
    /// What was found out about cells: smoothing looks at the same ones hundreds of times.
    seen: Vec<Memory<Option<bool>>>,
}

/// A joined path, and what is wrong with it.
struct JoinedPath {
    path: GuidePath,
    /// Where it passes from one option to the next, metres, with both of its ends.
    cuts_m: Vec<f64>,
    /// The piece of each option; `None` where it is too short.
    pieces: Vec<Option<GuidePath>>,
    /// Where it fails, metres along the path.
    faults_m: Vec<f64>,
}

impl<'a> LegChain<'a> {
    fn new(options: &'a [Arc<GuidedOption>], robot: &'a GuideRobot<'a>, settings: &'a GuideSettings) -> Self {
        let allowed = options.iter().flat_map(|option| option.allowed.iter().copied()).collect();
        let sources = options.iter().filter_map(|option| option.source.as_ref()).collect();
        let seen = vec![Memory::new(None); robot.geometry.clearance().frame().len()];
        Self { options, robot, settings, allowed, sources, seen }
    }

    /// Whether one of the options may use `cell`.
    fn is_allowed(&self, cell: Cell) -> bool {
        let states = &*self.options[0].states;
        let frame = states.frame();
        let memory = &self.seen[frame.index(cell)];
        memory.get().unwrap_or_else(|| {
            let contains = |source: &&Endpoint| source.contains(frame.center(cell), states);
            let is_allowed = states
                .state_of(cell)
                .is_some_and(|state| self.allowed.contains(&state) || self.sources.iter().any(contains));
            memory.set(Some(is_allowed));
            is_allowed
        })
    }

    /// Joins the options of `run` where that is possible, into `guides`.
    fn join(&self, run: Range<usize>, ends: RunEnds, guides: &mut [Option<GuidePath>]) {
        if run.len() < 2 {
            return;
        }
        // A cramped end takes the margin from the options around it alone.
        let mut robots = self.robot.inflated_at(None);
        let smoothed = |widest| self.draft(&run, ends, &widest, 0, &mut Drafts::default());
        let Some(draft) = robots.next().and_then(smoothed) else { return };
        let mut alone = Vec::new();
        let mut pieces = draft.pieces.clone();
        for legs in draft.around_faults() {
            let part = run.start + legs.start..run.start + legs.end;
            match self.repaired(&part, draft.ends(&legs, ends), &run) {
                Some(repaired) => pieces[legs].clone_from_slice(&repaired),
                None => alone.extend(draft.faulty_legs().filter(|leg| legs.contains(leg))),
            }
        }
        if alone.is_empty() {
            guides[run].clone_from_slice(&pieces);
            return;
        }
        // They keep their own guides, and the others are joined up to the ends of those.
        let own = |leg: usize| &self.options[run.start + leg].guide;
        let count = run.len();
        let bounds = alone.iter().copied().chain([count]);
        let mut begin = 0;
        for bound in bounds {
            let start = if begin == 0 { ends.start } else { own(begin - 1).end() };
            let goal = if bound == count {
                ends.goal
            } else {
                let Pose { position, heading } = own(bound).start();
                GuideEnd { position, heading: Some(heading) }
            };
            if begin < bound {
                self.join(run.start + begin..run.start + bound, RunEnds { start, goal }, guides);
            }
            begin = bound + 1;
        }
    }

    /// The pieces of `part` of a `run`, smoothed with the largest margin for which that gives a sound path.
    fn repaired(
        &self,
        part: &Range<usize>,
        ends: RunEnds,
        run: &Range<usize>,
    ) -> Option<Vec<Option<GuidePath>>> {
        let fits = |robot: &GuideRobot<'_>, gap_m: f64| {
            2.0 * robot.geometry.footprint().inscribed_radius_m() <= gap_m
        };
        // A margin that a door on the way has no room for need not be tried.
        let robots: Vec<GuideRobot<'_>> = self.robot.inflated_at(Some(ends.start)).collect();
        let widest_m = robots.first()?.geometry.footprint().inscribed_radius_m();
        let gap_m = narrowest_gap_m(self.robot.geometry.clearance(), &self.way(part, ends), widest_m);
        let is_straight = |path: &GuidePath| {
            let turn_rad = ends.start.heading.turn_to(path.start().heading).abs();
            part.start == run.start || turn_rad <= JOINT_TURN_MAX_RAD
        };
        let mut drafts = Drafts::default();
        let sound = |robot: &GuideRobot<'a>| {
            let mut paths =
                (0..ATTEMPTS).filter_map(|number| self.draft(part, ends, robot, number, &mut drafts));
            paths.find(|draft| draft.faults_m.is_empty() && is_straight(&draft.path))
        };
        let mut fitting = robots.iter().filter(|robot| fits(robot, gap_m));
        fitting.find_map(sound).map(|draft| draft.pieces)
    }

    /// The guides of the options of `run` behind one another, from one end to the other.
    fn way(&self, run: &Range<usize>, ends: RunEnds) -> Vec<Point> {
        let poses = self.options[run.clone()].iter().flat_map(|option| option.guide.poses());
        let mut way: Vec<Point> = poses.map(|pose| pose.position).collect();
        let last = way.len() - 1;
        (way[0], way[last]) = (ends.start.position, ends.goal.position);
        way
    }

    /// One path for the options of `run`, smoothed by the attempt of this number; `None` if it has no room for all of them.
    /// `drafts` belong to this run and its ends.
    fn draft(
        &self,
        run: &Range<usize>,
        ends: RunEnds,
        robot: &GuideRobot<'a>,
        attempt: usize,
        drafts: &mut Drafts<'a>,
    ) -> Option<JoinedPath> {
        let options = &self.options[run.clone()];
        let RunEnds { start, goal } = ends;
        let start = GuideEnd { position: start.position, heading: Some(start.heading) };
        let allowed = |cell| self.is_allowed(cell);
        let request = GuideRequest { start, goal, allowed: &allowed };
        let context = GuideContext::new(&request, robot, self.settings);
        context.has_length().ok()?;
        let frame = robot.geometry.clearance().frame();
        let smooth = || {
            let points: Vec<_> = self.way(run, ends).into_iter().map(|point| frame.to_grid(point)).collect();
            let disc = |option: &Arc<GuidedOption>| {
                option.target.endpoint().map(|set| (set.center, DISC_FACTOR * set.radius_m))
            };
            let discs: Vec<(Point, f64)> = options[..options.len() - 1].iter().filter_map(disc).collect();
            let attempts = attempts(self.settings, frame.resolution_m);
            Ok(context.draft((&points, &discs), &attempts[attempt]))
        };
        let path = context.through(drafts.of(robot.geometry, attempt, smooth).ok()?).ok()?;
        let (path, cannot_begin) = match context.lead_in(path.clone()) {
            Ok(led) => (led, None),
            Err(_) => (path, Some(0.0)),
        };
        let mut faults_m = context.faults_m(&path);
        faults_m.extend(cannot_begin);
        if self.turns_too_far_before(run.start, start.heading, &path) {
            faults_m.push(0.0);
        }
        let wanted = goal.heading.filter(|_| run.end < self.options.len());
        if wanted.is_some_and(|wanted| path.end().heading.turn_to(wanted).abs() > JOINT_TURN_MAX_RAD) {
            faults_m.push(path.length_m());
        }
        let cuts_m = cuts_m(options, &path)?;
        let between = options.iter().zip(&cuts_m[1..]).take(options.len() - 1);
        let missed = between.filter(|&(option, &cut_m)| !option.is_done(&path.pose_at(cut_m)));
        faults_m.extend(missed.flat_map(|(_, cut_m)| [cut_m - SEARCH_STEP_M, cut_m + SEARCH_STEP_M]));
        let pieces = cuts_m.windows(2).map(|ends| piece(&path, ends[0], ends[1], self.settings.spacing_m));
        let pieces: Vec<Option<GuidePath>> = pieces.collect();
        for (piece, begin_m) in pieces.iter().zip(&cuts_m) {
            // The chords of a piece lie between those of the whole path: they cut its corners.
            let faults = piece.as_ref().map_or_else(|| vec![0.0], |piece| self.faults_of_piece_m(piece));
            faults_m.extend(faults.into_iter().map(|arc_m| begin_m + arc_m));
        }
        faults_m.sort_by(f64::total_cmp);
        Some(JoinedPath { path, cuts_m, pieces, faults_m })
    }

    /// Whether `path` begins further off `heading`, in which the option before number `first` ends, than their own guides do.
    fn turns_too_far_before(&self, first: usize, heading: Option<Heading>, path: &GuidePath) -> bool {
        let (Some(before), Some(heading)) = (first.checked_sub(1), heading) else { return false };
        let own = self.options[before].guide.end().heading.turn_to(self.options[first].guide.start().heading);
        heading.turn_to(path.start().heading).abs() > own.abs().max(JOINT_TURN_MAX_RAD)
    }

    /// Where the robot itself cannot drive `piece`, metres along it.
    fn faults_of_piece_m(&self, piece: &GuidePath) -> Vec<f64> {
        let bends = tight_bends(piece, self.robot.steering.radius_m());
        bends.chain(touches(piece, self.robot.geometry)).map(|index| piece.arc_m(index)).collect()
    }
}

impl JoinedPath {
    /// The leg in which the place `arc_m` along the path lies.
    fn leg_at(&self, arc_m: f64) -> usize {
        let behind = self.cuts_m[1..self.cuts_m.len() - 1].iter();
        behind.take_while(|&&cut_m| cut_m <= arc_m).count()
    }

    /// The legs in which the path fails, in order.
    fn faulty_legs(&self) -> impl Iterator<Item = usize> + use<> {
        let legs: BTreeSet<usize> = self.faults_m.iter().map(|&arc_m| self.leg_at(arc_m)).collect();
        legs.into_iter()
    }

    /// The legs around the places where the path fails, in order.
    fn around_faults(&self) -> Vec<Range<usize>> {
        let mut parts: Vec<Range<usize>> = Vec::new();
        for &arc_m in &self.faults_m {
            let legs = self.leg_at(arc_m - AROUND_M)..self.leg_at(arc_m + AROUND_M) + 1;
            match parts.last_mut() {
                Some(before) if legs.start < before.end => before.end = before.end.max(legs.end),
                _ => parts.push(legs),
            }
        }
        parts
    }

    /// Where `legs` begin and end on this path, which begins and ends at `ends`.
    fn ends(&self, legs: &Range<usize>, ends: RunEnds) -> RunEnds {
        let at = |cut: usize| self.path.pose_at(self.cuts_m[cut]);
        let start = if legs.start == 0 { ends.start } else { at(legs.start) };
        let Pose { position, heading } = at(legs.end);
        let is_last = legs.end + 1 == self.cuts_m.len();
        let goal = if is_last { ends.goal } else { GuideEnd { position, heading: Some(heading) } };
        RunEnds { start, goal }
    }
}

/// The direction in which `option` should arrive, where it ends at a goal that asks for one.
fn goal_heading(option: &GuidedOption) -> Option<Heading> {
    option.target.goal()?.heading.map(|(heading, _)| heading)
}

/// Where `path` passes from one option to the next, as near as it comes to the sets between them, metres, with both of its
/// ends; `None` if it has no room for all of them.
fn cuts_m(options: &[Arc<GuidedOption>], path: &GuidePath) -> Option<Vec<f64>> {
    let total_m: f64 = options.iter().map(|option| option.guide.length_m()).sum();
    let mut cuts = vec![0.0];
    let mut before_m = 0.0;
    for option in &options[..options.len() - 1] {
        before_m += option.guide.length_m();
        let expected_m = before_m / total_m * path.length_m();
        let from_m = (expected_m - SEARCH_M).max(cuts[cuts.len() - 1] + OPTION_MIN_M);
        let until_m = (expected_m + SEARCH_M).min(path.length_m() - OPTION_MIN_M);
        let count = ((until_m - from_m) / SEARCH_STEP_M).floor();
        let places = (0..=count.max(-1.0) as i64).map(|i| from_m + i as f64 * SEARCH_STEP_M);
        let off_m = |arc_m: f64| (path.pose_at(arc_m).position - option.target.center()).norm();
        cuts.push(places.min_by(|&a, &b| off_m(a).total_cmp(&off_m(b)))?);
    }
    cuts.push(path.length_m());
    Some(cuts)
}

/// The piece of `path` between two arc lengths.
fn piece(path: &GuidePath, from_m: f64, to_m: f64, spacing_m: f64) -> Option<GuidePath> {
    // One segment more than fits, so that every gap stays under the threshold.
    let count = ((to_m - from_m) / spacing_m).floor() + 1.0;
    let pose = |i: usize| path.pose_at(from_m + (to_m - from_m) * i as f64 / count);
    GuidePath::new((0..=count as usize).map(pose).collect(), spacing_m).ok()
}
