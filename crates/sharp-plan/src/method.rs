//! A method is data: how options get policies, how plans are searched, checked and repaired.
//!
//! [`Method::paper`] keeps to the paper, [`Method::fast`] is the default, [`Method::prior`] takes the prior as it
//! is. Nothing outside this file asks which of them is at work.

use std::sync::Arc;

use serde::{Deserialize, Serialize};
use sharp_drive::FAILURE_COST_S;
use sharp_guide::{GuidePlanner, GuideSettings, PlannerKind, PseudoReward};
use sharp_options::AllowedRule;
use sharp_rl::TrainSettings;
use sharp_sim::SimulatorKind;

use crate::learn::{OptionLearner, PaperProtocol, PriorOnly, Selection};

/// Prices are not exact, and rather too high: a plan is tried though its price is up to 1.4 times what the best one cost.
const RETRY_ABOVE: f64 = 0.7;
/// Runs of a whole plan that its success is counted on at most.
const VERIFY_EPISODES: u32 = 1000;

/// How fast legs without a guide are thought to be driven where an answer is wanted at once, as a share of the top speed.
const UNGUIDED_SPEED: f64 = 0.6;

/// How fast the policies drive that the paper's protocol learns, as a share of the top speed: near the median, 0.72, of 21
/// legs of `a` that are longer than a metre, of both robots; the slowest had 0.61, the fastest 0.94. With a lower share unlearnt options would
/// look too expensive, and the search would reuse learnt ones without reason; with a higher one it would avoid them.
const LEARNT_SPEED: f64 = 0.7;

/// The reward of [`Method::paper_tuned`].
///
/// A step with a contact costs 1: with 3 and more, or where a contact ended the episode, robots before a narrow place may learn
/// to stay where they are. Each radian off the guide's heading in the termination set costs 300, because a car that enters the
/// next option askew cannot turn: five plans of the Limo arrive in 0.73 of executions, without this cost in 0.46
/// (docs/decisions/0025-what-the-paper-leaves-open.md).
pub const TUNED_REWARD: PseudoReward =
    PseudoReward { success: 1000.0, stray: -100.0, contact: -1.0, heading: -300.0 };

/// How a problem is solved.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Method {
    /// Its name, as plans and libraries record it.
    pub name: String,
    /// How an option gets its policy.
    pub learner: Arc<dyn OptionLearner>,
    /// Where policies are learnt and plans verified, unless another simulator is asked for.
    pub simulator: SimulatorKind,
    /// How guides are planned.
    pub guides: Arc<dyn GuidePlanner>,
    /// True where `guides` is another planner than the one that the search settings name.
    pub has_other_guides: bool,
    /// What the search may assume and must respect.
    pub search: SearchSettings,
    /// In which order the options of a plan are learnt.
    pub order: LearningOrder,
    /// Whether trainings are kept on disk while they run, because they take minutes. A solve that was killed begins anew, from
    /// the same library, and finds them.
    pub keeps_trainings: bool,
    /// Fresh episodes that estimate a policy.
    pub estimate_episodes: u32,
    /// Success wanted of an option, share of episodes.
    pub option_success: f64,
    /// What a failure costs beside the seconds of a success, seconds: the more, the safer and slower.
    pub failure_cost_s: f64,
    /// Smooths the guides of a plan together; false is the paper's rule.
    pub join_guides: bool,
    /// An option that succeeds less often than this makes the search look for a better way; 0 keeps whatever was
    /// learnt, as the paper does.
    pub usable_success: f64,
    /// A plan whose measured cost is more than this many times the price of another makes the search try that one;
    /// infinite for never.
    pub retry_above: f64,
    /// How a plan that succeeds too rarely is repaired.
    pub repair: RepairSettings,
    /// Fresh runs through the whole plan that its predicted success is counted on, at most.
    pub verify_episodes: u32,
    /// Half the width of the 95 % interval of the predicted success at which counting ends earlier; 0 for never.
    pub verify_half_width: f64,
    /// For a method that composes its odds: what [`composed`](Self::composed) found in `verify_episodes` and `search`. Where odds
    /// are poor the method is asked as it was then.
    pub unhurried: Option<(u32, SearchSettings)>,
}

/// In which order the options of a plan are learnt.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LearningOrder {
    /// One after the other, each from where the one before it arrives and with the next in view.
    Chained,
    /// Each on its own and all at once: the paper's way.
    Independent,
}

/// How a plan is repaired.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct RepairSettings {
    /// Rounds; 0 is the paper's rule.
    pub rounds: u32,
    /// Runs through the whole plan that look for weak options, each round.
    pub episodes: u32,
    /// Success wanted of the whole plan; its options share the failures that are left.
    pub wanted_success: f64,
    /// Fresh episodes that a weak option's policies are judged by.
    pub judge_episodes: u32,
}

/// What an option is taken to cost before anything was measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum PriceRule {
    /// The length of its guide at nominal speed: the paper's rule.
    Length,
    /// The time of a speed profile along its guide: slow in narrow places and before bends.
    Profile,
    /// Time and chance of failure, as the cost model of the prior says ([`CostModel`](sharp_drive::CostModel)).
    Model,
}

/// What the search may assume and must respect.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct SearchSettings {
    /// What an option is taken to cost before anything was measured.
    pub price: PriceRule,
    /// Episodes that a price of the model counts as beside measured ones.
    pub price_episodes: f64,
    /// Speed that turns lengths into seconds before anything was measured, as a share of the top speed.
    pub nominal_speed: f64,
    /// Seconds added to an option without a policy: what training is worth; 0 is the paper's rule.
    pub untrained_surcharge_s: f64,
    /// Seconds added to an option that passes a centroid by. No later problem can reuse a first or last one, few
    /// can reuse the others, and the paper has none.
    pub bypass_surcharge_s: f64,
    /// Options may pass a centroid by; false keeps to the paper's.
    pub bypasses: bool,
    /// A plan may also go from start to goal without any option, where that is cheaper; false keeps to the paper's.
    pub direct: bool,
    /// How far off the goal's heading the robot may stand at the end, radians; `None` where any heading will do.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub goal_heading_tolerance_rad: Option<f64>,
    /// A robot that stands in a tight place may back off or drive a curve before its guide begins; false keeps to the
    /// paper's.
    #[serde(default = "yes")]
    pub departures: bool,
    /// Routes with different safety margins of which the cheapest is the direct way, at most; files do not keep it.
    #[serde(skip)]
    pub direct_routes: usize,
    /// Legs without a guide are taken to be driven straight at this share of the top speed. 1 never overestimates, so that no
    /// better plan is missed; less guides fewer legs. Files do not keep it.
    #[serde(skip)]
    pub unguided_speed: f64,
    /// Learnt options cost what was measured of them (line 17 of Algorithm 1); false keeps the first costs.
    pub cost_update: bool,
    /// Largest turn between two guides that a robot which turns in place makes without stopping, radians.
    pub smooth_turn_rad: f64,
    /// Which states an option may use besides its endpoints.
    pub allowed: AllowedRule,
    /// How guides are planned, where the planner is ours.
    pub guide: GuideSettings,
}

/// What files from before there was a choice mean.
const fn yes() -> bool {
    true
}

impl Default for SearchSettings {
    fn default() -> Self {
        Self {
            price: PriceRule::Model,
            price_episodes: 100.0,
            nominal_speed: 0.5,
            untrained_surcharge_s: 5.0,
            bypass_surcharge_s: 14.0,
            bypasses: true,
            direct: true,
            goal_heading_tolerance_rad: None,
            departures: true,
            direct_routes: 7,
            unguided_speed: 1.0,
            cost_update: true,
            // The footprint swings out in a turn: beyond 75 degrees it needs clearance or a smaller circle.
            smooth_turn_rad: 75.0_f64.to_radians(),
            allowed: AllowedRule::Code,
            guide: GuideSettings::default(),
        }
    }
}

impl Default for Method {
    /// [`Method::fast`].
    fn default() -> Self {
        Self::fast()
    }
}

impl Method {
    /// The default: the cheapest policy at hand that succeeds often enough, guides with a safety margin that join
    /// smoothly, and repairs until the plan succeeds as wanted.
    #[must_use]
    pub fn fast() -> Self {
        let prior = Self::prior();
        Self {
            name: "fast".to_owned(),
            learner: Arc::new(Selection::default()),
            retry_above: RETRY_ABOVE,
            estimate_episodes: 100,
            repair: RepairSettings { rounds: 2, episodes: 256, ..prior.repair },
            ..prior
        }
    }

    /// The paper's protocol (Algorithm 1, Sec. 4 and 5): every option is trained, nothing is repaired.
    #[must_use]
    pub fn paper() -> Self {
        let guide = GuideSettings { margins: false, ..GuideSettings::default() };
        Self {
            name: "paper".to_owned(),
            learner: Arc::new(PaperProtocol::default()),
            // A robot that touches a wall slides along it, as in the paper. In the kinematic simulator it stands still, and a
            // car that cannot reverse never moves again (docs/decisions/0022-the-paper-learns-with-contact.md).
            simulator: SimulatorKind::Planar,
            search: SearchSettings {
                price: PriceRule::Length,
                nominal_speed: LEARNT_SPEED,
                untrained_surcharge_s: 0.0,
                bypasses: false,
                direct: false,
                departures: false,
                allowed: AllowedRule::Paper,
                ..SearchSettings::default()
            },
            order: LearningOrder::Independent,
            keeps_trainings: true,
            // Its cost of a learnt option is the mean number of steps (line 17).
            failure_cost_s: 0.0,
            join_guides: false,
            usable_success: 0.0,
            ..Self::prior()
        }
        .with_guides(guide)
    }

    /// The paper's protocol with a tuned learner ([`TrainSettings::absolute`], docs/algorithms/sac.md): the same guides,
    /// observations and actions, each option learnt from nothing. Options are learnt in order, each from where the one before
    /// it arrives, and arriving with another heading than the guide's costs. A contact costs a little, and an episode with one is
    /// no success. An episode ends when the robot stands still, because a robot that is wedged in learns nothing from the rest of
    /// it.
    #[must_use]
    pub fn paper_tuned() -> Self {
        let protocol = PaperProtocol::new(TrainSettings::absolute())
            .ending_at_standstill()
            .with_reward(Arc::new(TUNED_REWARD));
        Self { order: LearningOrder::Chained, ..Self::paper() }
            .with_learner("paper-tuned", Arc::new(protocol))
    }

    /// The shipped prior as it is, to compare with: nothing to choose from, no training, no repairs.
    #[must_use]
    pub fn prior() -> Self {
        let search = SearchSettings::default();
        Self {
            name: "prior".to_owned(),
            learner: Arc::new(PriorOnly),
            simulator: SimulatorKind::Kinematic,
            guides: search.guide.to_planner(),
            has_other_guides: false,
            search,
            order: LearningOrder::Chained,
            keeps_trainings: false,
            estimate_episodes: 1000,
            option_success: 0.99,
            failure_cost_s: FAILURE_COST_S,
            join_guides: true,
            usable_success: 0.9,
            retry_above: f64::INFINITY,
            repair: RepairSettings { rounds: 0, episodes: 1000, wanted_success: 0.99, judge_episodes: 500 },
            verify_episodes: VERIFY_EPISODES,
            verify_half_width: 0.01,
            unhurried: None,
        }
    }

    /// The method of a plan that is read from a file: what running it takes, and no learner of its own.
    pub(crate) fn of_plan(name: String, search: SearchSettings, failure_cost_s: f64) -> Self {
        Self { name, guides: search.guide.to_planner(), search, failure_cost_s, ..Self::prior() }
    }

    /// The method called `name`, one of `fast`, `paper`, `paper-tuned` and `prior`.
    #[must_use]
    pub fn by_name(name: &str) -> Option<Self> {
        match name {
            "fast" => Some(Self::fast()),
            "paper" => Some(Self::paper()),
            "paper-tuned" => Some(Self::paper_tuned()),
            "prior" => Some(Self::prior()),
            _ => None,
        }
    }

    /// The same with our guide planner under these settings.
    #[must_use]
    pub fn with_guides(self, guide: GuideSettings) -> Self {
        let search = SearchSettings { guide, ..self.search };
        Self { guides: guide.to_planner(), has_other_guides: false, search, ..self }
    }

    /// The same for questions to a building that was learnt: odds are composed of what the library knows, nothing is run
    /// from end to end or repaired, and few guides are planned. Only where the odds are poor is this method asked as well,
    /// without its repairs. Guide planners other than [`PlannerKind::ClearanceSearch`] stay as they are.
    #[must_use]
    pub fn composed(self) -> Self {
        let unhurried = Some((self.verify_episodes, self.search));
        let search = SearchSettings { direct_routes: 1, unguided_speed: UNGUIDED_SPEED, ..self.search };
        let this = Self { verify_episodes: 0, search, unhurried, ..self };
        let is_ours = !this.has_other_guides && this.search.guide.planner == PlannerKind::ClearanceSearch;
        if is_ours { this.with_guides(search.guide.unsampled()) } else { this }
    }

    /// The method that is asked where the odds of this one are poor: with its patience, and with runs from end to end.
    /// `None` for a method that does not compose odds.
    pub(crate) fn usual(&self) -> Option<Self> {
        let (episodes, SearchSettings { direct_routes, unguided_speed, guide, .. }) = self.unhurried?;
        let GuideSettings { sampling, seeds, .. } = guide;
        let guide = GuideSettings { sampling, seeds, ..self.search.guide };
        let search = SearchSettings { direct_routes, unguided_speed, ..self.search };
        // A repair takes ten seconds and more, and is for this plan alone.
        let repair = RepairSettings { rounds: 0, ..self.repair };
        let verify_episodes = if episodes == 0 { VERIFY_EPISODES } else { episodes };
        let usual = Self { verify_episodes, search, repair, unhurried: None, ..self.clone() };
        Some(if self.has_other_guides { usual } else { usual.with_guides(guide) })
    }

    /// Whether a plan is kept even if it rarely succeeds: the paper's rule.
    #[must_use]
    pub fn keeps_all(&self) -> bool {
        self.usable_success == 0.0
    }

    /// The same with guides by Learn and Link, as in the paper.
    #[must_use]
    pub fn with_learn_and_link(self) -> Self {
        let guide = GuideSettings { planner: PlannerKind::LearnAndLink, ..self.search.guide };
        self.with_guides(guide)
    }

    /// The same with another guide planner. A plan that is read from a file goes on with ours.
    #[must_use]
    pub fn with_guide_planner(self, guides: Arc<dyn GuidePlanner>) -> Self {
        Self { guides, has_other_guides: true, ..self }
    }

    /// The same with another learner, under a name of its own: policies of two learners never mix in a library.
    #[must_use]
    pub fn with_learner(self, name: &str, learner: Arc<dyn OptionLearner>) -> Self {
        Self { name: name.to_owned(), learner, ..self }
    }

    /// The same with fewer or more episodes: `estimate` for each policy, `verify` at most for the whole plan, `repair`
    /// for each round of repairs.
    #[must_use]
    pub fn with_episodes(self, estimate: u32, verify: u32, repair: u32) -> Self {
        let repair = RepairSettings { episodes: repair, ..self.repair };
        Self { estimate_episodes: estimate, verify_episodes: verify, repair, ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_method_is_known_by_its_name() {
        for method in [Method::fast(), Method::paper(), Method::paper_tuned(), Method::prior()] {
            let named = Method::by_name(&method.name).expect("its own name");
            assert_eq!(named.search, method.search, "{}", method.name);
        }
        assert!(Method::by_name("slow").is_none());
    }

    #[test]
    fn the_paper_keeps_to_its_rules() {
        let paper = Method::paper();
        assert_eq!(paper.search.allowed, AllowedRule::Paper);
        assert!(!paper.search.guide.margins && !paper.search.bypasses && !paper.join_guides);
        assert_eq!((paper.repair.rounds, paper.usable_success), (0, 0.0));
    }
}
