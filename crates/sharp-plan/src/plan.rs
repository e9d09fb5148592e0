//! A plan on disk: everything that running it takes, and nothing about when it was made.

use std::path::Path;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use sharp_guide::GuidePath;
use sharp_options::{OptionKind, OptionSet, OptionSettings};
use sharp_rbvd::{Rbvd, StateId};
use sharp_sim::{NoiseModel, RobotModel};
use sharp_space::{OccupancyGrid, Point, Pose, Seed};

use crate::certify::FAILURE_COST_S;
use crate::files::{self, FileError};
use crate::learn::{LearningMode, Learnt};
use crate::leg::{Leg, LegId};
use crate::library::{FORMAT, PolicyFile};
use crate::percept::Workspace;
use crate::planner::{Abstraction, Query};
use crate::sharp::{PlannedLeg, Solution};
use crate::stats::Tally;

const PLAN_FILE: &str = "plan.ron";
const ABSTRACTION_FILE: &str = "abstraction.ron";

/// How an abstraction was made: what a file needs beside the diagram.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AbstractionFile {
    format: u32,
    /// Hash of the map it belongs to.
    pub map: String,
    /// Where the regions came from.
    pub regions: String,
    /// The kind of its options.
    pub kind: OptionKind,
    /// How the options were made.
    pub options: OptionSettings,
    /// The diagram.
    pub rbvd: Rbvd,
}

impl AbstractionFile {
    /// A file for the map hashed as `map`, its regions made by `regions`.
    #[must_use]
    pub fn new(map: String, regions: String, kind: OptionKind, options: OptionSettings, rbvd: Rbvd) -> Self {
        Self { format: FORMAT, map, regions, kind, options, rbvd }
    }

    /// Writes it to `path`.
    ///
    /// # Errors
    /// Returns an error that names the file if it cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), FileError> {
        files::write_ron(path, self)
    }

    /// Reads it from `path`, for the map hashed as `map`.
    ///
    /// # Errors
    /// Returns an error that names the file if it is damaged, of another format or for another map.
    pub fn load(path: &Path, map: &str) -> Result<Self, FileError> {
        let file: Self = files::read_ron(path)?;
        if file.format != FORMAT {
            return Err(FileError::content(path, format!("format is {}, expected {FORMAT}", file.format)));
        }
        if file.map != map {
            return Err(FileError::content(path, "belongs to another map"));
        }
        Ok(file)
    }

    /// The abstraction, its options synthesised again.
    #[must_use]
    pub fn abstraction(&self) -> Abstraction {
        let options = OptionSet::synthesize(&self.rbvd, self.kind, &self.options);
        Abstraction { rbvd: Arc::new(self.rbvd.clone()), options: Arc::new(options) }
    }
}

/// The hash that names a map: its frame and its cells.
#[must_use]
pub fn map_hash(grid: &OccupancyGrid) -> String {
    let frame = grid.frame();
    let mut bytes = format!("{}x{} {:?} {:?}\n", frame.width, frame.height, frame.resolution_m, frame.origin)
        .into_bytes();
    bytes.extend(grid.cells().iter().map(|&cell| cell as u8));
    files::hash(&bytes)
}

/// A solution with the world it was made in.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Map and robot.
    pub workspace: Workspace,
    /// The abstraction it was searched in.
    pub abstraction: Abstraction,
    /// The noise it was verified under.
    pub noise: NoiseModel,
    /// How its policies were learnt.
    pub learning: LearningMode,
    /// Whether measured costs flowed back into its search.
    pub cost_update: bool,
    /// What a failure counted for, seconds.
    pub failure_cost_s: f64,
    /// The seed it was made with.
    pub seed: Seed,
    /// The composed policy.
    pub solution: Solution,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PlanFile {
    format: u32,
    map: String,
    robot: RobotModel,
    noise: NoiseModel,
    learning: LearningMode,
    // Plans from before there was a choice have no such line.
    #[serde(default = "usual_cost_update")]
    cost_update: bool,
    #[serde(default = "usual_failure_cost_s")]
    failure_cost_s: f64,
    seed: Seed,
    start: Pose,
    goal: Pose,
    predicted: Tally,
    predicted_time_s: f64,
    legs: Vec<LegFile>,
}

const fn usual_cost_update() -> bool {
    true
}

const fn usual_failure_cost_s() -> f64 {
    FAILURE_COST_S
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct LegFile {
    id: LegId,
    from: StateId,
    to: StateId,
    guide: GuidePath,
    policy: PolicyFile,
    verified: Tally,
    on_arrival: Tally,
    mean_time_s: f64,
    env_steps: u64,
    gradient_steps: u64,
    reused: bool,
}

impl Plan {
    /// Writes the plan into `folder`; the abstraction stands beside it as `abstraction`.
    ///
    /// # Errors
    /// Returns an error that names the file that could not be written.
    pub fn save(&self, folder: &Path, abstraction: &AbstractionFile) -> Result<(), FileError> {
        abstraction.save(&folder.join(ABSTRACTION_FILE))?;
        let legs =
            self.solution.legs.iter().map(|planned| leg_file(planned, folder)).collect::<Result<_, _>>()?;
        let file = PlanFile {
            format: FORMAT,
            map: map_hash(&self.workspace.grid),
            robot: (*self.workspace.robot).clone(),
            noise: self.noise.clone(),
            learning: self.learning,
            cost_update: self.cost_update,
            failure_cost_s: self.failure_cost_s,
            seed: self.seed,
            start: self.solution.query.start,
            goal: self.solution.query.goal,
            predicted: self.solution.predicted,
            predicted_time_s: self.solution.predicted_time_s,
            legs,
        };
        files::write_ron(&folder.join(PLAN_FILE), &file)
    }

    /// Reads the plan in `folder`, made in `grid`.
    ///
    /// # Errors
    /// Returns an error that names the file that is missing, damaged, of another format or for another map.
    pub fn load(folder: &Path, grid: OccupancyGrid) -> Result<Self, FileError> {
        let path = folder.join(PLAN_FILE);
        let file: PlanFile = files::read_ron(&path)?;
        if file.format != FORMAT {
            return Err(FileError::content(&path, format!("format is {}, expected {FORMAT}", file.format)));
        }
        let map = map_hash(&grid);
        if file.map != map {
            return Err(FileError::content(&path, "belongs to another map"));
        }
        let abstraction = AbstractionFile::load(&folder.join(ABSTRACTION_FILE), &map)?.abstraction();
        let goal = (file.goal.position, file.robot.goal_tolerance_m);
        let legs = file
            .legs
            .into_iter()
            .map(|leg| planned_leg(leg, folder, &abstraction, goal))
            .collect::<Result<Vec<_>, _>>()?;
        if legs.is_empty() {
            return Err(FileError::content(&path, "legs is empty, expected at least one"));
        }
        let query = Query { start: file.start, goal: file.goal };
        let (predicted, predicted_time_s) = (file.predicted, file.predicted_time_s);
        Ok(Self {
            workspace: Workspace::new(grid, file.robot),
            abstraction,
            noise: file.noise,
            learning: file.learning,
            cost_update: file.cost_update,
            failure_cost_s: file.failure_cost_s,
            seed: file.seed,
            solution: Solution { query, legs, predicted, predicted_time_s },
        })
    }
}

fn leg_file(planned: &PlannedLeg, folder: &Path) -> Result<LegFile, FileError> {
    let PlannedLeg { leg, learnt, reused, on_arrival } = planned;
    Ok(LegFile {
        id: leg.id,
        from: leg.from,
        to: leg.to,
        guide: leg.guide.clone(),
        policy: PolicyFile::save(&learnt.policy, folder)?,
        verified: learnt.verified,
        on_arrival: *on_arrival,
        mean_time_s: learnt.mean_time_s,
        env_steps: learnt.env_steps,
        gradient_steps: learnt.gradient_steps,
        reused: *reused,
    })
}

fn planned_leg(
    file: LegFile,
    folder: &Path,
    abstraction: &Abstraction,
    goal: (Point, f64),
) -> Result<PlannedLeg, FileError> {
    let learnt = Learnt {
        policy: file.policy.load(folder)?,
        verified: file.verified,
        mean_time_s: file.mean_time_s,
        env_steps: file.env_steps,
        gradient_steps: file.gradient_steps,
    };
    let Abstraction { rbvd, options } = abstraction;
    let leg = Leg::new((rbvd, options), file.id, (file.from, file.to), file.guide, goal);
    Ok(PlannedLeg { leg: Arc::new(leg), learnt, reused: file.reused, on_arrival: file.on_arrival })
}

#[cfg(test)]
mod tests {
    use sharp_options::OptionKind;

    use super::*;
    use crate::drawn::{self, HALL, SEALED};

    fn saved(kind: OptionKind) -> (Arc<Plan>, tempfile::TempDir) {
        let plan = drawn::plan(kind);
        let map = map_hash(&plan.workspace.grid);
        let rbvd = (*plan.abstraction.rbvd).clone();
        let file = AbstractionFile::new(map, "drawn".to_owned(), kind, OptionSettings::default(), rbvd);
        let folder = tempfile::tempdir().unwrap();
        plan.save(folder.path(), &file).unwrap();
        (plan, folder)
    }

    #[test]
    fn a_plan_survives_a_round_trip() {
        for kind in [OptionKind::Centroid, OptionKind::Interface] {
            let (plan, folder) = saved(kind);
            let read = Plan::load(folder.path(), (*plan.workspace.grid).clone()).unwrap();
            assert_eq!(read.solution.query, plan.solution.query, "{kind:?}");
            assert_eq!(*read.workspace.robot, *plan.workspace.robot, "{kind:?}");
            assert_eq!((read.learning, read.cost_update), (LearningMode::Fast, true), "{kind:?}");
            for (read, written) in read.solution.legs.iter().zip(&plan.solution.legs) {
                assert_eq!(read.leg.id, written.leg.id, "{kind:?}");
                assert_eq!(read.leg.guide, written.leg.guide, "{}", written.leg.id);
                assert_eq!(read.leg.target, written.leg.target, "{}", written.leg.id);
                assert_eq!(read.leg.source, written.leg.source, "{}", written.leg.id);
            }
            assert_eq!(read.solution.legs.len(), plan.solution.legs.len(), "{kind:?}");
        }
    }

    #[test]
    fn a_plan_for_another_map_is_refused() {
        let (_, folder) = saved(OptionKind::Centroid);
        let (other, _) = drawn::world(SEALED, OptionKind::Centroid);
        let error = Plan::load(folder.path(), (*other.grid).clone()).unwrap_err().to_string();
        assert!(error.contains("plan.ron") && error.contains("another map"), "{error}");
    }

    #[test]
    fn one_cell_or_one_metre_makes_another_map() {
        let grid = |drawing: &str, resolution_m| OccupancyGrid::from_ascii(resolution_m, drawing).unwrap();
        let hash = map_hash(&grid("##\n.#", 0.4));
        assert_eq!(hash, map_hash(&grid("##\n.#", 0.4)), "the same map");
        for other in [grid("##\n..", 0.4), grid("##\n.#", 0.5), grid("##\n?#", 0.4), grid("##.#", 0.4)] {
            assert_ne!(hash, map_hash(&other), "{other:?}");
        }
    }

    #[test]
    fn the_options_of_an_abstraction_are_made_again_the_same() {
        let (_, abstraction) = drawn::world(HALL, OptionKind::Interface);
        let rbvd = (*abstraction.rbvd).clone();
        let settings = OptionSettings::default();
        let file =
            AbstractionFile::new("m".to_owned(), "drawn".to_owned(), OptionKind::Interface, settings, rbvd);
        assert_eq!(file.abstraction().options, abstraction.options);
    }
}
