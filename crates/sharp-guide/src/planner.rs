//! Who plans guide paths.

use std::fmt::Debug;
use std::sync::Arc;

use sharp_space::{Pose, Stream};

use crate::inflate::GuideRobot;
use crate::path::GuidePath;
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
        if settings.margins {
            let start = request.start.heading.map(|heading| Pose::at(request.start.position, heading));
            let unsampled = settings.unsampled();
            let of = |robot| crate::plan::plan_guide(request, &robot, &unsampled, rng).ok();
            if let Some(guide) = robot.inflated_at(start).find_map(of) {
                return Ok(guide);
            }
        }
        crate::plan::plan_guide(request, robot, &settings, rng)
    }
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
        crate::plan::plan_guide(request, robot, &settings, rng)
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
