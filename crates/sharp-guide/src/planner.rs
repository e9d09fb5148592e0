//! Who plans guide paths.

use std::fmt::Debug;
use std::sync::Arc;

use sharp_space::{Pose, Stream};

use crate::inflate::GuideRobot;
use crate::path::GuidePath;
use crate::plan::{Drafts, or_sampled, plan_guide, searched_guide};
use crate::request::{GuideRequest, NoGuide};
use crate::settings::{GuideSettings, PlannerKind};

/// Plans the guide path of an option (definition 8). Implement [`plan`](Self::plan).
pub trait GuidePlanner: Debug + Send + Sync {
    /// A path from the request's start to its goal, through allowed cells, that the robot can drive.
    ///
    /// It begins and ends at the request's positions, gaps are smaller than its spacing, and the robot's outline
    /// is free all along it. Everything random comes from `rng`.
    ///
    /// # Errors
    /// Says why there is no path.
    fn plan(
        &self,
        request: &GuideRequest<'_>,
        robot: &GuideRobot<'_>,
        rng: &mut Stream,
    ) -> Result<GuidePath, NoGuide>;

    /// A planner that gives up sooner, for a first look at many options; `None`, the default, if there is none. Whatever it
    /// finds, `self` must find as well.
    fn hasty(&self) -> Option<Box<dyn GuidePlanner>> {
        None
    }
}

/// Search over cells that prefers clearance, then smoothing; Learn and Link where that fails.
///
/// With margins, the path is planned for the largest robot for which there is one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ClearanceSearch {
    /// How.
    pub settings: GuideSettings,
}

impl GuidePlanner for ClearanceSearch {
    fn plan(
        &self,
        request: &GuideRequest<'_>,
        robot: &GuideRobot<'_>,
        rng: &mut Stream,
    ) -> Result<GuidePath, NoGuide> {
        let settings = GuideSettings { planner: PlannerKind::ClearanceSearch, ..self.settings };
        let start = request.start.heading.map(|heading| Pose::at(request.start.position, heading));
        let mut robots = robot.inflated_at(start).filter(|_| settings.margins);
        let Some(widest) = robots.next() else { return plan_guide(request, robot, &settings, rng) };
        let searched = largest_margin(request, widest, &robots.collect::<Vec<_>>(), &settings);
        or_sampled(searched, request, robot, &settings, rng)
    }

    /// The same without samples.
    fn hasty(&self) -> Option<Box<dyn GuidePlanner>> {
        let settings = self.settings.unsampled();
        (settings != self.settings).then(|| Box::new(Self { settings }) as _)
    }
}

/// The guide of the `widest` robot, or else of the first of `others`, whose margins shrink to none, for which there is one.
pub(crate) fn largest_margin<'a>(
    request: &GuideRequest<'_>,
    widest: GuideRobot<'a>,
    others: &[GuideRobot<'a>],
    settings: &GuideSettings,
) -> Result<GuidePath, NoGuide> {
    let mut drafts = Drafts::default();
    let mut of = |robot: &GuideRobot<'a>| searched_guide(request, robot, settings, &mut drafts);
    let guide = of(&widest);
    let (Err(_), Some((bare, between))) = (&guide, others.split_last()) else { return guide };
    let bare = of(bare);
    let is_hopeless = bare.as_ref().is_err_and(NoGuide::is_hopeless);
    let with_margin = (!is_hopeless).then(|| between.iter().find_map(|robot| of(robot).ok())).flatten();
    with_margin.map_or(bare, Ok)
}

/// Learn and Link inside the option's cells: the paper's planner.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LearnAndLink {
    /// How.
    pub settings: GuideSettings,
}

impl GuidePlanner for LearnAndLink {
    fn plan(
        &self,
        request: &GuideRequest<'_>,
        robot: &GuideRobot<'_>,
        rng: &mut Stream,
    ) -> Result<GuidePath, NoGuide> {
        let settings = GuideSettings { planner: PlannerKind::LearnAndLink, ..self.settings };
        plan_guide(request, robot, &settings, rng)
    }
}

impl GuideSettings {
    /// The planner that these settings name.
    #[must_use]
    pub fn to_planner(self) -> Arc<dyn GuidePlanner> {
        match self.planner {
            PlannerKind::ClearanceSearch => Arc::new(ClearanceSearch { settings: self }),
            PlannerKind::LearnAndLink => Arc::new(LearnAndLink { settings: self }),
        }
    }
}
