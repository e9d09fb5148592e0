//! What a page knows, as an object that serialises to JSON.

use std::collections::BTreeMap;

use serde::Serialize;
use sharp_draw::{cells_per_pixel, known_cells, regions_outline, states_png, walls_png};
use sharp_drive::EpisodeEnd;
use sharp_guide::{GuidePath, LegId};
use sharp_plan::{Moment, OptionLibrary, Plan, Recording};
use sharp_space::{Point, Pose};

use super::PlanPage;
use super::weak::{ShownPlace, Tight, tightest, weak_places};
use crate::data_uri::data_uri;
use crate::error::BenchError;
use crate::reports::OptionReport;

/// Drives that are shown whatever became of them, and the most that are shown besides because they failed.
const DRIVES: usize = 20;
/// Moments that are kept of one drive at most.
const MOMENTS_MAX: usize = 400;

/// `sharp.show/1`.
#[derive(Debug, Serialize)]
pub(super) struct ShownData {
    schema: &'static str,
    pub(super) map: ShownMap,
    pub(super) robot: ShownOutline,
    /// Where the robot begins: x, y, yaw.
    start: [f64; 3],
    /// Where it is to go, in order.
    goals: Vec<[f64; 2]>,
    predicted: ShownPrediction,
    states: Vec<ShownState>,
    options: Vec<ShownOption>,
    /// Whether there was a library to ask what is known of the options.
    library: bool,
    legs: Vec<ShownLeg>,
    runs: ShownRuns,
    drives: Vec<ShownDrive>,
    weak: Vec<ShownPlace>,
}

/// The map. Its layers lie over each other, line 0 at the top.
#[derive(Debug, Serialize)]
pub(super) struct ShownMap {
    pub(super) name: String,
    /// The pose of the lower left corner.
    origin: [f64; 3],
    resolution_m: f64,
    /// Size in cells.
    width: usize,
    height: usize,
    /// The part that is known, with a margin: left, top, width and height in cells.
    known: [f64; 4],
    /// Side of a pixel of the two pictures, cells.
    pixel_cells: usize,
    /// Walls opaque, unknown land a little, as a PNG.
    walls: String,
    /// Cells in the colour of their state, as a PNG.
    cells: String,
    /// The outline of the critical regions as the data of an SVG path, in cells.
    regions: String,
}

/// The robot.
#[derive(Debug, Serialize)]
pub(super) struct ShownOutline {
    pub(super) name: String,
    /// Its outline around its reference point, looking along x.
    outline: Vec<[f64; 2]>,
    goal_tolerance_m: f64,
}

/// Where it is known from how often a plan holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Basis {
    /// From runs of the whole.
    Runs,
    /// From what its parts are known to hold: nobody ran it.
    Composed,
}

impl Basis {
    pub(super) const fn of(plan: &Plan) -> Self {
        if plan.solution.composed.is_some() { Self::Composed } else { Self::Runs }
    }
}

#[derive(Debug, Serialize)]
struct ShownPrediction {
    /// Composed, `episodes` are as many runs as would tell as much.
    basis: Basis,
    episodes: u32,
    success: f64,
    lower95: f64,
    sim_time_s: f64,
}

#[derive(Debug, Serialize)]
struct ShownState {
    state: u32,
    /// A place of its critical region.
    at: [f64; 2],
}

/// An option that the map has, with its numbers where it was learnt.
#[derive(Debug, Serialize)]
struct ShownOption {
    option: String,
    from: [f64; 2],
    to: [f64; 2],
    #[serde(skip_serializing_if = "Option::is_none")]
    learnt: Option<ShownLearnt>,
}

#[derive(Debug, Serialize)]
struct ShownLearnt {
    length_m: f64,
    /// Mean simulated time of a success, seconds.
    #[serde(skip_serializing_if = "Option::is_none")]
    time_s: Option<f64>,
    cost_s: f64,
    successes: u32,
    episodes: u32,
    policy: &'static str,
}

/// A leg of the plan: what `sharp solve` reports of it, and where it lies.
#[derive(Debug, Serialize)]
struct ShownLeg {
    #[serde(flatten)]
    report: OptionReport,
    /// Where the report's counts are from.
    basis: Basis,
    /// The goal that it leads to, from 0.
    goal: usize,
    /// Its guide.
    guide: Vec<[f64; 2]>,
    tightest: Tight,
}

/// How the drives ended.
#[derive(Debug, Serialize)]
struct ShownRuns {
    episodes: usize,
    reached: usize,
    collided: usize,
    timed_out: usize,
    lost: usize,
}

#[derive(Debug, Serialize)]
struct ShownDrive {
    /// The number of its episode, from 1.
    episode: usize,
    /// `reached`, `collided`, `timed_out` or `lost`.
    end: &'static str,
    time_s: f64,
    path_m: f64,
    /// New plans on the way.
    recoveries: u32,
    /// Time, x, y, yaw, and the leg of the plan, -1 on a way that was planned anew.
    moments: Vec<[f64; 5]>,
}

impl ShownData {
    pub(super) fn new(shown: &PlanPage<'_>) -> Result<Self, BenchError> {
        let PlanPage { tour, recordings, .. } = *shown;
        let (first, last) = (&tour.plans[0], &tour.plans[tour.plans.len() - 1]);
        let robot = &first.world.robot;
        let at_origin = Pose::new(0.0, 0.0, 0.0);
        let ends = |end: EpisodeEnd| recordings.iter().filter(|it| it.execution.end == end).count();
        let legs = Legs::new(shown);
        Ok(Self {
            schema: "sharp.show/1",
            map: map(shown, first)?,
            robot: ShownOutline {
                name: robot.name.clone(),
                outline: robot.footprint.outline(&at_origin).into_iter().map(place).collect(),
                goal_tolerance_m: last.world.robot.goal_tolerance_m,
            },
            start: pose(&first.solution.query.start),
            goals: tour.plans.iter().map(|plan| place(plan.solution.query.goal.position)).collect(),
            predicted: ShownPrediction {
                // A tour was run whatever its plans are made of.
                basis: if tour.plans.len() == 1 { Basis::of(first) } else { Basis::Runs },
                episodes: tour.predicted.episodes,
                success: tour.predicted_success(),
                lower95: tour.predicted_lower95(),
                sim_time_s: tour.predicted_time_s,
            },
            states: states(first),
            options: options(first, shown.library),
            library: shown.library.is_some(),
            runs: ShownRuns {
                episodes: recordings.len(),
                reached: ends(EpisodeEnd::Reached),
                collided: ends(EpisodeEnd::Collided),
                timed_out: ends(EpisodeEnd::TimedOut),
                lost: ends(EpisodeEnd::Lost),
            },
            drives: drives(recordings, &legs),
            weak: weak_places(shown, &legs),
            legs: shown_legs(shown),
        })
    }
}

/// The number of each leg in the plans in a row.
#[derive(Debug)]
pub(super) struct Legs(BTreeMap<(usize, LegId), usize>);

impl Legs {
    fn new(shown: &PlanPage<'_>) -> Self {
        let plans = shown.tour.plans.iter().enumerate();
        let steps =
            plans.flat_map(|(plan, it)| it.solution.steps.iter().map(move |step| (plan, step.option.id)));
        Self(steps.enumerate().map(|(leg, key)| (key, leg)).collect())
    }

    /// The leg that runs at `moment`, unless the way was planned anew and leads elsewhere.
    pub(super) fn at(&self, moment: &Moment) -> Option<usize> {
        self.0.get(&(moment.plan, moment.option)).copied()
    }
}

fn map(shown: &PlanPage<'_>, plan: &Plan) -> Result<ShownMap, BenchError> {
    let (grid, states) = (&plan.world.grid, &*plan.abstraction.states);
    let frame = grid.frame();
    Ok(ShownMap {
        name: shown.map.to_owned(),
        // As it stands in the map's file: a page must put every place where the map has it.
        origin: [frame.origin.position.x, frame.origin.position.y, frame.origin.heading.radians()],
        resolution_m: frame.resolution_m,
        width: frame.width,
        height: frame.height,
        known: known_cells(grid),
        pixel_cells: cells_per_pixel(frame),
        walls: data_uri("image/png", &walls_png(grid)?),
        cells: data_uri("image/png", &states_png(grid, &|cell| states.state_of(cell).map(|state| state.0))?),
        regions: regions_outline(frame, states.regions()),
    })
}

fn states(plan: &Plan) -> Vec<ShownState> {
    let (states, frame) = (&plan.abstraction.states, plan.world.grid.frame());
    let places = states.states().zip(states.regions());
    places.map(|(state, region)| ShownState { state: state.0, at: place(region.center(frame)) }).collect()
}

fn options(plan: &Plan, library: Option<&OptionLibrary>) -> Vec<ShownOption> {
    let set = &plan.abstraction.options;
    let failure_cost_s = plan.method.failure_cost_s;
    let learnt = |id| library.and_then(|library| library.get(id));
    let all = set.options().iter().map(|spec| ShownOption {
        option: spec.id.to_string(),
        from: place(set.endpoint(spec.initiation).center),
        to: place(set.endpoint(spec.termination).center),
        learnt: learnt(spec.id).map(|stored| {
            let estimate = &stored.learnt.estimate;
            ShownLearnt {
                length_m: centimetres(stored.guide.length_m()),
                time_s: estimate.mean_time_s.is_finite().then(|| centimetres(estimate.mean_time_s)),
                cost_s: centimetres(stored.learnt.cost_s(failure_cost_s)),
                successes: estimate.count.successes,
                episodes: estimate.count.episodes,
                policy: stored.learnt.policy.kind(),
            }
        }),
    });
    all.collect()
}

fn shown_legs(shown: &PlanPage<'_>) -> Vec<ShownLeg> {
    let plans = shown.tour.plans.iter().enumerate();
    let legs = plans.flat_map(|(goal, plan)| {
        let reports = OptionReport::all(plan).into_iter().zip(&plan.solution.steps);
        reports.map(move |(report, step)| ShownLeg {
            report,
            basis: Basis::of(plan),
            goal,
            guide: points(&step.option.guide),
            tightest: tightest(&plan.world, &step.option.guide),
        })
    });
    legs.collect()
}

fn points(guide: &GuidePath) -> Vec<[f64; 2]> {
    guide.poses().iter().map(|pose| place(pose.position)).collect()
}

/// The first drives, and those after them that failed.
fn drives(recordings: &[Recording], legs: &Legs) -> Vec<ShownDrive> {
    let has_failed = |recording: &Recording| recording.execution.end != EpisodeEnd::Reached;
    let (first, others) = recordings.split_at(recordings.len().min(DRIVES));
    let numbered = first.iter().enumerate();
    let failed = others.iter().enumerate().map(|(i, it)| (i + DRIVES, it)).filter(|(_, it)| has_failed(it));
    numbered.chain(failed.take(DRIVES)).map(|(index, it)| drive(index + 1, it, legs)).collect()
}

fn drive(episode: usize, Recording { execution, moments }: &Recording, legs: &Legs) -> ShownDrive {
    let every = moments.len().div_ceil(MOMENTS_MAX);
    let kept = moments.iter().enumerate().filter(|(i, _)| i % every == 0 || i + 1 == moments.len());
    ShownDrive {
        episode,
        end: end_name(execution.end),
        time_s: centimetres(execution.record.time_s),
        path_m: centimetres(execution.record.path_m),
        recoveries: execution.events.recoveries,
        moments: kept.map(|(_, it)| moment(it, legs.at(it))).collect(),
    }
}

fn moment(moment: &Moment, leg: Option<usize>) -> [f64; 5] {
    let [x, y, yaw] = pose(&moment.state.pose);
    [centimetres(moment.time_s), x, y, yaw, leg.map_or(-1.0, |leg| leg as f64)]
}

const fn end_name(end: EpisodeEnd) -> &'static str {
    match end {
        EpisodeEnd::Reached => "reached",
        EpisodeEnd::Collided => "collided",
        EpisodeEnd::TimedOut => "timed_out",
        EpisodeEnd::Lost => "lost",
        EpisodeEnd::Stopped => "stopped",
    }
}

/// A pose to the centimetre and to a hundredth of a radian: finer than a screen shows.
fn pose(pose: &Pose) -> [f64; 3] {
    let [x, y] = place(pose.position);
    [x, y, centimetres(pose.heading.radians())]
}

pub(super) fn place(point: Point) -> [f64; 2] {
    [centimetres(point.x), centimetres(point.y)]
}

/// `value` to two decimals; never -0.
pub(super) fn centimetres(value: f64) -> f64 {
    (value * 100.0).round() / 100.0 + 0.0
}
