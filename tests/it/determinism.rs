//! Equal seed, equal bytes: twice in a process, with one thread and with two, and through a library.

use std::collections::BTreeMap;
use std::fs;
use std::panic::AssertUnwindSafe;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};

use sharp_drive::{GuideProgress, GuideView, Observation, OptionPolicy, Policy, Situation};
use sharp_guide::{GuidePath, GuidedOption, LegId};
use sharp_options::{OptionKind, OptionSettings};
use sharp_plan::{
    AbstractionFile, Conditions, LibraryKey, Method, Monitor, OptionLibrary, Outcome, PaperProtocol, Plan,
    PlanningProblem, Query, Selection, Solution, StoredOption, map_hash, solve,
};
use sharp_rl::{Progress, StopRule, TrainSettings};
use sharp_sim::{NoiseModel, RobotModel, RobotState, SimulatorKind};
use sharp_space::{Pose, Seed, Vector};
use tempfile::TempDir;

use crate::worlds::{ROOMS, TestWorld};

/// From the left room to the right one.
fn across() -> Query {
    Query { start: Pose::new(1.2, 1.0, 0.0), goal: Pose::new(7.0, 2.8, 0.0) }
}

/// The paper's protocol with a budget that only shows that it runs: nothing good is learnt.
fn tiny_paper() -> Method {
    let train = TrainSettings::default().with(|train| {
        train.sac.hidden = vec![16, 16];
        train.sac.batch = 32;
        train.max_env_steps = 600;
        train.evaluate_every = 300;
        train.evaluation_episodes = 2;
        train.stop = StopRule::Never;
    });
    let paper = Method::paper().with_episodes(20, 20, 1000);
    let name = paper.name.clone();
    paper.with_learner(&name, Arc::new(PaperProtocol::new(train)))
}

/// The default method with fewer episodes.
fn quick_fast() -> Method {
    let mut selection = Selection::default();
    selection.screening_episodes = 50;
    let mut method = Method::fast().with_episodes(200, 100, 100);
    method.learner = Arc::new(selection);
    (method.repair.rounds, method.repair.judge_episodes) = (1, 50);
    // The direct way is no option, and cheaper here.
    method.search.direct = false;
    method
}

fn solved(world: &TestWorld, method: &Method, seed: Seed, library: &mut OptionLibrary) -> Solution {
    match outcome(world, (method, seed), library, &()) {
        Outcome::Solved(solution) => *solution,
        other => panic!("no solution but {other:?}"),
    }
}

fn outcome(
    world: &TestWorld,
    (method, seed): (&Method, Seed),
    library: &mut OptionLibrary,
    monitor: &dyn Monitor,
) -> Outcome {
    let conditions = Conditions::new(&world.world, NoiseModel::nominal());
    let (world, abstraction) = (&world.world, &world.abstraction);
    let problem = PlanningProblem { world, method, conditions: &conditions, query: across(), seed, monitor };
    solve(&problem, abstraction, library).expect("folders that can be written")
}

/// Solves from nothing with `threads` threads and writes the plan to a folder.
fn plan_folder(world: &TestWorld, method: &Method, seed: Seed, threads: usize) -> TempDir {
    let solution = with_threads(threads, || solved(world, method, seed, &mut OptionLibrary::in_memory()));
    written(world, method, seed, solution)
}

fn with_threads<R: Send>(threads: usize, work: impl FnOnce() -> R + Send) -> R {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool").install(work)
}

/// Writes the plan of `solution` to a folder.
fn written(world: &TestWorld, method: &Method, seed: Seed, solution: Solution) -> TempDir {
    let kind = world.abstraction.options.kind();
    let map = map_hash(&world.world.grid);
    let (states, settings) = (&*world.abstraction.states, OptionSettings::default());
    let abstraction = AbstractionFile::new(map, "drawn".into(), kind, settings, states);
    let plan = Plan {
        world: world.world.clone(),
        abstraction: world.abstraction.clone(),
        noise: NoiseModel::nominal(),
        method: method.clone(),
        seed,
        solution,
    };
    let folder = tempfile::tempdir().expect("a temporary folder");
    plan.save(folder.path(), &abstraction).expect("a folder that can be written");
    folder
}

/// All files in `folder` by name.
fn content(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(folder).expect("a folder");
    let paths = entries.map(|entry| entry.expect("an entry").path());
    paths.map(|path| (name(&path), fs::read(&path).expect("a file"))).collect()
}

fn name(path: &Path) -> String {
    path.file_name().expect("a file").to_string_lossy().into_owned()
}

#[track_caller]
fn assert_equal_bytes(world: &TestWorld, method: &Method) -> BTreeMap<String, Vec<u8>> {
    let [first, again, threads, other] = [(1, 1), (1, 1), (1, 2), (2, 1)]
        .map(|(seed, threads)| content(plan_folder(world, method, Seed(seed), threads).path()));
    assert!(first == again, "the same seed twice gives other files");
    assert!(first == threads, "two threads give other files than one");
    assert!(first["plan.ron"] != other["plan.ron"], "the seed changes nothing");
    first
}

#[test]
fn plans_have_the_same_bytes_whatever_the_threads() {
    for kind in [OptionKind::Centroid, OptionKind::Interface] {
        assert_equal_bytes(&TestWorld::drawn(ROOMS, RobotModel::husky(), kind), &quick_fast());
    }
}

#[test]
fn weights_have_the_same_bytes_whatever_the_threads() {
    let world = TestWorld::drawn(ROOMS, RobotModel::husky(), OptionKind::Centroid);
    let files = assert_equal_bytes(&world, &tiny_paper());
    let weights = files.keys().filter(|file| file.ends_with(".safetensors")).count();
    // Each option has a network of its own: π_0, two options, π_{n+1}.
    assert_eq!(weights, 4, "{:?}", files.keys());
}

/// What ends a solve after so many steps of training, of all its options together.
struct EndAfter {
    steps: AtomicI64,
    /// Ends it as a kill does, without a word to the solver.
    kills: bool,
}

impl Monitor for EndAfter {
    fn trained(&self, _: &GuidedOption, _: &Progress<'_>) {
        let left = self.steps.fetch_sub(1, Ordering::Relaxed);
        assert!(!(self.kills && left <= 0), "killed, as the test wants it");
    }

    fn should_stop(&self) -> bool {
        !self.kills && self.steps.load(Ordering::Relaxed) <= 0
    }
}

#[test]
fn a_solve_that_is_ended_within_trainings_goes_on_and_comes_to_the_same_bytes() {
    let world = TestWorld::drawn(ROOMS, RobotModel::husky(), OptionKind::Centroid);
    let (method, seed, noise) = (tiny_paper(), Seed(5), NoiseModel::nominal());
    let whole = content(plan_folder(&world, &method, seed, 2).path());
    let folder = tempfile::tempdir().expect("a temporary folder");
    let root = folder.path().join("training");
    let key = LibraryKey {
        world: &world.world,
        noise: &noise,
        simulator: SimulatorKind::Kinematic,
        method: &method,
        states: "",
    };
    let library = || OptionLibrary::in_memory().with_trainings(&root, &key);
    // Four options take 600 steps each and are evaluated every 300.
    for (steps, kills, threads) in [(150, false, 1), (700, true, 2), (900, false, 2)] {
        let monitor = EndAfter { steps: AtomicI64::new(steps), kills };
        let ended = std::panic::catch_unwind(AssertUnwindSafe(|| {
            with_threads(threads, || outcome(&world, (&method, seed), &mut library(), &monitor))
        }));
        let is_as_wanted = if kills { ended.is_err() } else { matches!(ended, Ok(Outcome::Stopped)) };
        assert!(is_as_wanted, "after {steps} steps");
    }
    let mut library = library();
    let monitor = EndAfter { steps: AtomicI64::new(i64::MAX), kills: false };
    let Outcome::Solved(solution) = outcome(&world, (&method, seed), &mut library, &monitor) else {
        panic!("nothing stops it any more")
    };
    let repeated = i64::MAX - monitor.steps.into_inner();
    assert!(repeated < 1200, "{repeated} steps of 2400 were left, most of them had been done");
    assert!(content(written(&world, &method, seed, *solution).path()) == whole, "other bytes");
    library.save().expect("a folder that can be written");
    assert!(!root.exists(), "no training is left behind");
}

/// What `policy` wants at 50 places beside `guide`, to the bit.
fn decisions(world: &TestWorld, guide: &GuidePath, policy: &OptionPolicy) -> Vec<[u64; 3]> {
    let (world, mut policy) = (&world.world, policy.clone());
    let mut decide = |index: u32| {
        let offset = 0.01 * f64::from(index % 7) - 0.03;
        let on_guide = guide.pose_at(guide.length_m() * f64::from(index) / 50.0);
        let pose = Pose::at(on_guide.to_world(Vector::new(0.0, offset)), on_guide.heading);
        let observation = Observation::first(RobotState::at_rest(pose), &NoiseModel::nominal());
        let wanted = policy.decide(&Situation {
            world,
            observation: &observation,
            progress: &GuideProgress::start(guide, &pose),
            guide: GuideView { current: guide, next: None },
        });
        [wanted.reach_m, wanted.bearing_rad, wanted.speed_mps].map(f64::to_bits)
    };
    (0..50).map(&mut decide).collect()
}

#[test]
fn learnt_policies_decide_the_same_from_a_plan_and_from_a_library() {
    let world = TestWorld::drawn(ROOMS, RobotModel::husky(), OptionKind::Centroid);
    let (method, seed) = (tiny_paper(), Seed(5));
    let solution = solved(&world, &method, seed, &mut OptionLibrary::in_memory());
    let folder = plan_folder(&world, &method, seed, 2);
    let plan = Plan::load(folder.path(), (*world.world.grid).clone()).expect("a sound plan");

    let root = tempfile::tempdir().expect("a temporary folder");
    let mut library = OptionLibrary::open(root.path(), "rooms").expect("an empty library");
    for (step, loaded) in solution.steps.iter().zip(&plan.solution.steps) {
        let (option, learnt) = (&step.option, &step.learnt);
        let expected = decisions(&world, &option.guide, &learnt.policy);
        let from_plan = decisions(&world, &option.guide, &loaded.learnt.policy);
        assert_eq!(from_plan, expected, "{} from the plan", option.id);
        let LegId::Option(id) = option.id else { continue };
        let corridor = sharp_plan::hash(&option.corridor(&plan.world.grid));
        let stored = StoredOption { guide: option.guide.clone(), learnt: learnt.clone(), corridor };
        library.insert(id, stored).expect("a folder that can be written");
        let opened = OptionLibrary::open(root.path(), "rooms").expect("a sound library");
        let stored = opened.get(id).expect("just inserted");
        let from_library = decisions(&world, &stored.guide, &stored.learnt.policy);
        assert_eq!(from_library, expected, "{id} from the library");
    }
    assert_eq!(library.len(), 2, "both options were learnt");
}

#[test]
fn a_library_spares_learning_and_changes_no_option() {
    let world = TestWorld::drawn(ROOMS, RobotModel::husky(), OptionKind::Centroid);
    let root = tempfile::tempdir().expect("a temporary folder");
    let (method, seed) = (quick_fast(), Seed(3));
    let mut library = OptionLibrary::open(root.path(), "rooms").expect("an empty library");
    let first = solved(&world, &method, seed, &mut library);
    let (uses, reused) = first.reuse();
    assert!(uses > 0 && reused == 0, "{reused} of {uses} options reused from nothing");
    let files = content(&root.path().join("rooms"));

    let mut library = OptionLibrary::open(root.path(), "rooms").expect("a sound library");
    let second = solved(&world, &method, seed, &mut library);
    let (uses, reused) = second.reuse();
    assert_eq!(uses, reused, "options reused");
    assert_eq!(content(&root.path().join("rooms")), files, "reuse rewrites no file");
    assert_eq!(second.predicted, first.predicted, "the same policies succeed as often");
}
