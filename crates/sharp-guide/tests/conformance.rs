//! Our guide planners and rewards keep the promises of their traits.

mod worlds;

use sharp_guide::conformance::{check_guide_planner, check_reward};
use sharp_guide::{
    ClearanceSearch, GuidePlanner, GuideSettings, LearnAndLink, PlannerKind, ProgressReward, PseudoReward,
    Reward,
};
use sharp_options::OptionKind;
use worlds::{Drawn, HALL, along};

#[test]
fn our_guide_planners_conform() {
    let planners: [&dyn GuidePlanner; 2] = [&ClearanceSearch::default(), &LearnAndLink::default()];
    for planner in planners {
        assert_eq!(check_guide_planner(planner), Ok(()), "{planner:?}");
    }
    for planner in [PlannerKind::ClearanceSearch, PlannerKind::LearnAndLink] {
        let named = GuideSettings { planner, ..GuideSettings::default() }.to_planner();
        assert_eq!(check_guide_planner(&*named), Ok(()), "{planner:?} by name");
    }
}

#[test]
fn our_rewards_conform() {
    let option = &Drawn::new(HALL, OptionKind::Centroid).plan(&["c:0-1"], along())[0];
    let rewards: [&dyn Reward; 2] = [&PseudoReward::default(), &ProgressReward::default()];
    for reward in rewards {
        assert_eq!(check_reward(reward, option), Ok(()), "{reward:?}");
    }
}
