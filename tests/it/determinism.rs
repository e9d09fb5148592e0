//! Equal seed, equal bytes: twice in a process, with one thread and with two, and through a library.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use sharp_guide::GuidePath;
use sharp_options::{OptionKind, OptionSettings};
use sharp_plan::{
    AbstractionFile, DecisionScratch, GuideView, LearnSettings, LearningMode, LegId, OptionLibrary,
    OptionPolicy, Outcome, Percept, Plan, Query, Solution, SolveSettings, StoredOption, Tracker, map_hash,
    solve,
};
use sharp_rl::{StopRule, TrainSettings};
use sharp_sim::{NoiseModel, RobotModel, RobotState};
use sharp_space::{Pose, Seed, Vector};
use tempfile::TempDir;

use crate::worlds::{ROOMS, World};

/// From the left room to the right one.
fn across() -> Query {
    Query { start: Pose::new(1.2, 1.0, 0.0), goal: Pose::new(7.0, 2.8, 0.0) }
}

/// The paper's protocol with a budget that only shows that it runs: nothing good is learnt.
fn tiny_paper(world: &World, seed: u64) -> SolveSettings {
    let train = TrainSettings::default().with(|train| {
        train.sac.hidden = vec![16, 16];
        train.sac.batch = 32;
        train.max_env_steps = 600;
        train.evaluate_every = 300;
        train.evaluation_episodes = 2;
        train.stop = StopRule::Never;
    });
    let learn = LearnSettings {
        screening_episodes: 4,
        certify_episodes: 20,
        train,
        ..LearnSettings::new(LearningMode::Paper)
    };
    let noise = NoiseModel::by_name("nominal").expect("a built-in noise");
    SolveSettings {
        learn,
        verify_episodes: 20,
        ..SolveSettings::new(&world.workspace, LearningMode::Paper, noise, Seed(seed))
    }
}

/// The default protocol with fewer episodes.
fn quick_fast(world: &World, seed: u64) -> SolveSettings {
    let noise = NoiseModel::by_name("nominal").expect("a built-in noise");
    let settings = SolveSettings::new(&world.workspace, LearningMode::Fast, noise, Seed(seed));
    let learn = LearnSettings { screening_episodes: 50, certify_episodes: 200, ..settings.learn };
    SolveSettings { learn, repair_episodes: 100, verify_episodes: 100, repair_rounds: 1, ..settings }
}

fn solved(world: &World, settings: &SolveSettings, library: &mut OptionLibrary) -> Solution {
    match solve(&world.workspace, &world.abstraction, across(), settings, library, &()) {
        Ok(Outcome::Solved(solution)) => *solution,
        other => panic!("no solution but {other:?}"),
    }
}

/// Solves from nothing with `threads` threads and writes the plan to a folder.
fn plan_folder(world: &World, settings: &SolveSettings, threads: usize) -> TempDir {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
    let solution = pool.install(|| solved(world, settings, &mut OptionLibrary::in_memory()));
    let rbvd = (*world.abstraction.rbvd).clone();
    let kind = world.abstraction.options.kind();
    let map = map_hash(&world.workspace.grid);
    let abstraction = AbstractionFile::new(map, "drawn".into(), kind, OptionSettings::default(), rbvd);
    let plan = Plan {
        workspace: world.workspace.clone(),
        abstraction: world.abstraction.clone(),
        noise: settings.noise.clone(),
        learning: settings.learn.mode,
        cost_update: settings.search.cost_update,
        failure_cost_s: settings.learn.failure_cost_s,
        seed: settings.seed,
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
fn assert_equal_bytes(
    world: &World,
    settings: impl Fn(&World, u64) -> SolveSettings,
) -> BTreeMap<String, Vec<u8>> {
    let [first, again, threads, other] = [(1, 1), (1, 1), (1, 2), (2, 1)]
        .map(|(seed, threads)| content(plan_folder(world, &settings(world, seed), threads).path()));
    assert!(first == again, "the same seed twice gives other files");
    assert!(first == threads, "two threads give other files than one");
    assert!(first["plan.ron"] != other["plan.ron"], "the seed changes nothing");
    first
}

#[test]
fn plans_have_the_same_bytes_whatever_the_threads() {
    for kind in [OptionKind::Centroid, OptionKind::Interface] {
        assert_equal_bytes(&World::drawn(ROOMS, RobotModel::husky(), kind), quick_fast);
    }
}

#[test]
fn weights_have_the_same_bytes_whatever_the_threads() {
    let world = World::drawn(ROOMS, RobotModel::husky(), OptionKind::Centroid);
    let files = assert_equal_bytes(&world, tiny_paper);
    let weights = files.keys().filter(|file| file.ends_with(".safetensors")).count();
    // Each leg has a network of its own: π_0, two options, π_{n+1}.
    assert_eq!(weights, 4, "{:?}", files.keys());
}

/// What `policy` wants at 50 places beside `guide`, to the bit.
fn decisions(world: &World, guide: &GuidePath, policy: &OptionPolicy) -> Vec<[u64; 3]> {
    let view = GuideView { guide, next: None };
    let mut scratch = DecisionScratch::default();
    let decide = |index: u32| {
        let offset = 0.01 * f64::from(index % 7) - 0.03;
        let on_guide = guide.pose_at(guide.length_m() * f64::from(index) / 50.0);
        let pose = Pose::at(on_guide.to_world(Vector::new(0.0, offset)), on_guide.heading);
        let tracker = Tracker::start(guide, &pose);
        let percept = Percept::first(RobotState::at_rest(pose), &NoiseModel::nominal());
        let wanted = policy.decide(&world.workspace, &percept, &tracker, &view, &mut scratch);
        [wanted.reach_m, wanted.bearing_rad, wanted.speed_mps].map(f64::to_bits)
    };
    (0..50).map(decide).collect()
}

#[test]
fn learnt_policies_decide_the_same_from_a_plan_and_from_a_library() {
    let world = World::drawn(ROOMS, RobotModel::husky(), OptionKind::Centroid);
    let settings = tiny_paper(&world, 5);
    let solution = solved(&world, &settings, &mut OptionLibrary::in_memory());
    let folder = plan_folder(&world, &settings, 2);
    let plan = Plan::load(folder.path(), (*world.workspace.grid).clone()).expect("a sound plan");

    let root = tempfile::tempdir().expect("a temporary folder");
    let mut library = OptionLibrary::open(root.path(), "rooms").expect("an empty library");
    for (index, planned) in solution.legs.iter().enumerate() {
        let expected = decisions(&world, &planned.leg.guide, &planned.learnt.policy);
        let from_plan = decisions(&world, &planned.leg.guide, &plan.solution.legs[index].learnt.policy);
        assert_eq!(from_plan, expected, "{} from the plan", planned.leg.id);
        let LegId::Option(id) = planned.leg.id else { continue };
        let corridor = planned.leg.corridor(&plan.workspace.grid);
        let stored =
            StoredOption { guide: planned.leg.guide.clone(), learnt: planned.learnt.clone(), corridor };
        library.insert(id, stored).expect("a folder that can be written");
        let opened = OptionLibrary::open(root.path(), "rooms").expect("a sound library");
        let stored = opened.get(id).expect("just inserted");
        assert_eq!(
            decisions(&world, &stored.guide, &stored.learnt.policy),
            expected,
            "{id} from the library"
        );
    }
    assert_eq!(library.len(), 2, "both options were learnt");
}

#[test]
fn a_library_spares_learning_and_changes_no_option() {
    let world = World::drawn(ROOMS, RobotModel::husky(), OptionKind::Centroid);
    let root = tempfile::tempdir().expect("a temporary folder");
    let settings = quick_fast(&world, 3);
    let mut library = OptionLibrary::open(root.path(), "rooms").expect("an empty library");
    let first = solved(&world, &settings, &mut library);
    let (uses, reused) = first.reuse();
    assert!(uses > 0 && reused == 0, "{reused} of {uses} options reused from nothing");
    let files = content(&root.path().join("rooms"));

    let mut library = OptionLibrary::open(root.path(), "rooms").expect("a sound library");
    let second = solved(&world, &settings, &mut library);
    let (uses, reused) = second.reuse();
    assert_eq!(uses, reused, "options reused");
    assert_eq!(content(&root.path().join("rooms")), files, "reuse rewrites no file");
    assert_eq!(second.predicted, first.predicted, "the same policies hold as often");
}
