//! Guided options of a plan (definition 7): where they begin, end and may be.

mod worlds;

use sharp_guide::{
    GuidedOption, Place, ProgressReward, PseudoReward, Reward, Role, StepEvents, Target, Transition,
};
use sharp_options::OptionKind;
use sharp_rbvd::StateId;
use sharp_space::{Heading, Pose};
use worlds::{Drawn, HALL, along};

/// The plan along the [`HALL`] for each kind of options.
const PLANS: [(OptionKind, &[&str]); 2] = [
    (OptionKind::Centroid, &["first:0", "c:0-1", "c:1-2", "last:2"]),
    (OptionKind::Interface, &["first:0", "i:0-1-2", "last:1"]),
];

#[test]
fn each_option_begins_where_the_one_before_it_ends() {
    for (kind, plan) in PLANS {
        let options = Drawn::new(HALL, kind).plan(plan, along());
        for pair in options.windows(2) {
            let name = format!("{} to {}", pair[0].id, pair[1].id);
            let source = pair[1].source.clone().map(Target::Endpoint);
            assert_eq!(source.as_ref(), Some(&pair[0].target), "{name}: β is not I");
            let arrived = Pose::at(pair[0].target.center(), Heading::default());
            assert!(pair[0].is_done(&arrived), "{name}: the centre of β is in β");
            assert!(pair[1].is_allowed(&arrived), "{name}: arriving is straying");
            assert!(!pair[1].is_done(&arrived), "{name}: over before it begins");
        }
        let last = &options[options.len() - 1];
        let goal = Pose::at(along().goal, Heading::default());
        assert!(last.source.is_some() && last.is_done(&goal), "the goal is the last target");
        assert!(!last.is_done(&Pose::new(8.5, 2.2, 0.0)), "half a metre before the goal is not there");
    }
}

#[test]
fn options_are_called_by_their_place_in_the_plan() {
    for (kind, plan) in PLANS {
        let options = Drawn::new(HALL, kind).plan(plan, along());
        let names: Vec<String> = options.iter().map(|option| option.id.to_string()).collect();
        assert_eq!(names, plan, "{kind:?}");
        let roles: Vec<Role> = options.iter().map(|option| option.id.role()).collect();
        let between = vec![Role::Option; plan.len() - 2];
        assert_eq!(roles, [vec![Role::First], between, vec![Role::Last]].concat(), "{kind:?}");
    }
}

#[test]
fn leaving_both_states_is_straying_and_standing_at_a_wall_is_not() {
    let option = &Drawn::new(HALL, OptionKind::Centroid).plan(&["c:0-1"], along())[0];
    assert_eq!(option.allowed, [StateId(0), StateId(1)], "i and j");
    for (x, y, allowed) in [(1.0, 2.0, true), (5.0, 3.0, true), (9.0, 2.0, false), (5.0, 0.1, true)] {
        assert_eq!(option.is_allowed(&Pose::new(x, y, 0.0)), allowed, "at ({x}, {y})");
    }
}

#[test]
fn the_horizon_grows_with_the_guide() {
    for (kind, plan) in PLANS {
        for option in Drawn::new(HALL, kind).plan(plan, along()) {
            let beyond = f64::from(option.horizon_actions()) - option.guide.length_m() / 0.05;
            assert!((9.99..11.01).contains(&beyond), "{}: {beyond} actions beyond three times", option.id);
        }
    }
}

/// What `reward` pays for an action from `from` to `to`.
fn paid(reward: &dyn Reward, option: &GuidedOption, (from, to): (&Pose, &Pose)) -> f64 {
    let before = option.guide.project(from.position, 0.0);
    let after = option.guide.project(to.position, before.arc_m);
    let place = option.place(to);
    let (success, stray) = (place == Place::Termination, place == Place::Astray);
    reward.reward(&Transition {
        option,
        pose: to,
        progress_m: after.arc_m - before.arc_m,
        deviation_m: after.cross_track_m.abs() - before.cross_track_m.abs(),
        events: StepEvents { success, contact: false, stray },
    })
}

#[test]
fn rewards_know_their_three_places() {
    let option = &Drawn::new(HALL, OptionKind::Centroid).plan(&["c:0-1"], along())[0];
    let (start, end) = (option.guide.start(), option.guide.end());
    let middle = option.guide.pose_at(0.5 * option.guide.length_m());
    let (paper, progress) = (PseudoReward::default(), ProgressReward::default());
    assert_eq!(paid(&paper, option, (&start, &end)), 1000.0, "r_t");
    assert_eq!(paid(&paper, option, (&start, &Pose::new(9.0, 2.0, 0.0))), -100.0, "r_p");
    let (near, far) = (paid(&paper, option, (&start, &middle)), paid(&paper, option, (&start, &start)));
    assert!(far < near && near < 0.0, "nearer the end is better: {near} against {far}");
    let (ahead, back) =
        (paid(&progress, option, (&start, &middle)), paid(&progress, option, (&middle, &start)));
    assert!(ahead > 0.0 && back < 0.0, "progress pays {ahead}, going back {back}");
    assert!(!paper.contact_ends() && progress.contact_ends(), "the paper lets the robot bump and go on");
}
