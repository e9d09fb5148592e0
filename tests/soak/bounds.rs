//! Stated bounds hold as often as they say: a plan is verified again and again, and its true success is known from many
//! runs.

use std::sync::Arc;
use std::time::Instant;

use sharp_drive::{Driver, InitialStates, MonteCarlo, Prior, World};
use sharp_guide::GuidedOption;
use sharp_options::OptionKind;
use sharp_plan::{Method, Query, Search};
use sharp_sim::{NoiseModel, RobotModel, RobotState, SimulatorKind};
use sharp_space::{Pose, Seed};

use crate::worlds::{Drawing, abstraction};
use crate::{cases, told};

/// Two rooms and a door of 1.1 m between them, for a Husky of 0.67 m.
fn rooms() -> (World, Vec<Arc<GuidedOption>>) {
    let mut drawing = Drawing::room(80, 60);
    drawing.paint(39..41, 0..60, true);
    drawing.paint(39..41, 25..36, false);
    let found = abstraction(&drawing.grid(0.1), RobotModel::husky(), OptionKind::Interface);
    let (world, abstraction) = found.expect("there is room");
    let query = Query { start: Pose::new(1.5, 1.5, 0.0), goal: Pose::new(6.5, 1.5, 0.0) };
    let (method, noise) = (Method::fast(), NoiseModel::nominal());
    let search = Search::new(&world, &abstraction, &method, &noise, query, [], Seed(1));
    let (_, plan) = search.expect("both ends have room").plan(&|_| None, &()).expect("the door is wide");
    (world, plan)
}

#[test]
fn bounds_of_95_percent_hold_95_times_in_100() {
    let since = Instant::now();
    let (world, plan) = rooms();
    let simulator = world.simulator(SimulatorKind::Kinematic);
    let start = InitialStates::exactly(RobotState::at_rest(plan[0].guide.start()));
    let repeats = cases(10, 1_000);
    let (mut held, mut all, mut rates) = (0, 0, Vec::new());
    // From easy to hard: the bound of a rare failure and that of a coin.
    for factor in [1.0, 2.0, 3.0, 4.0] {
        let noise = NoiseModel::nominal().scaled(factor);
        let policy = Prior::shipped(&world.robot).at(0.5, &world.robot, &noise);
        let drivers: Vec<Driver<'_>> = plan
            .iter()
            .enumerate()
            .map(|(i, option)| Driver::new(option, &policy, plan.get(i + 1)))
            .collect();
        let trial = MonteCarlo::new(&world, &*simulator, &noise);
        let truth =
            trial.with_episodes(cases(2_000, 60_000) as u32).with_seed(Seed(99)).estimate(&drivers, &start);
        let truth = truth.count.rate();
        for repeat in 0..repeats {
            let count =
                trial.with_episodes(200).with_seed(Seed(1000 + repeat)).estimate(&drivers, &start).count;
            all += 1;
            held += u64::from((count.lower95()..=count.upper95()).contains(&truth));
        }
        rates.push(truth);
    }
    let share = held as f64 / all as f64;
    told(
        "95 % intervals hold the truth",
        all,
        &format!("{:.1} % do, at success rates {rates:.3?}", 100.0 * share),
        since,
    );
    assert!(rates[0] > rates[3] + 0.05, "the difficulties differ: {rates:?}");
    // 95 % less four standard deviations of what is counted here.
    let least = 0.95 - 4.0 * (0.95 * 0.05 / all as f64).sqrt();
    assert!(share >= least, "{held} of {all} intervals hold the truth, expected at least {least:.3}");
}
