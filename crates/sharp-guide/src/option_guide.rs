//! Option guides (Definition 7): everything that teaches an option its policy.

use sharp_motion::Steering;
use sharp_options::{AllowedRule, Endpoint, OptionSet, OptionSpec};
use sharp_rbvd::{Rbvd, StateId};
use sharp_space::{FootprintChecker, Heading, Pose, Stream};

use crate::path::GuidePath;
use crate::plan::{GuideEnd, GuideRequest, NoGuide, plan_guide};
use crate::reward::{Place, PseudoReward};
use crate::settings::GuideSettings;

/// States, options and where an option may go: what a guide is made for.
#[derive(Clone, Copy, Debug)]
pub struct Abstraction<'a> {
    /// The diagram Ψ, hence α.
    pub rbvd: &'a Rbvd,
    /// The options O.
    pub options: &'a OptionSet,
    /// Which cells an option may use besides its endpoints.
    pub rule: AllowedRule,
}

/// Outline and kinematics: whom a guide is made for.
#[derive(Clone, Copy, Debug)]
pub struct Robot<'a> {
    /// Where the outline fits.
    pub checker: &'a FootprintChecker,
    /// What it can drive.
    pub steering: &'a Steering,
}

/// G = ⟨I, β, 𝒢, R⟩.
#[derive(Clone, Debug, PartialEq)]
pub struct OptionGuide {
    /// The option that is guided.
    pub option: OptionSpec,
    /// I.
    pub initiation: Endpoint,
    /// β.
    pub termination: Endpoint,
    /// 𝒢, from the centre of I to the centre of β.
    pub path: GuidePath,
    /// R.
    pub reward: PseudoReward,
}

impl OptionGuide {
    /// Plans the guide of `option`; at interfaces it crosses the border at right angles where it can.
    ///
    /// # Errors
    /// Says why there is no path.
    pub fn new(
        option: &OptionSpec,
        abstraction: &Abstraction<'_>,
        robot: &Robot<'_>,
        settings: &GuideSettings,
        rng: &mut Stream,
    ) -> Result<Self, NoGuide> {
        let Abstraction { rbvd, options, rule } = *abstraction;
        let initiation = options.endpoint(option.initiation);
        let termination = options.endpoint(option.termination);
        let through = option.id.through();
        let request = GuideRequest {
            start: GuideEnd {
                position: initiation.center,
                heading: crossing(initiation, through.unwrap_or_else(|| option.id.to())),
            },
            goal: GuideEnd { position: termination.center, heading: crossing(termination, option.id.to()) },
            allowed: &|cell| options.is_allowed(option, rule, rbvd.frame().center(cell), rbvd),
        };
        let path = plan_guide(&request, robot.checker, robot.steering, settings, rng)?;
        let (initiation, termination) = (initiation.clone(), termination.clone());
        Ok(Self { option: *option, initiation, termination, path, reward: PseudoReward::default() })
    }

    /// Which case of Definition 9 holds at `pose`.
    #[must_use]
    pub fn place(&self, pose: &Pose, abstraction: &Abstraction<'_>) -> Place {
        let Abstraction { rbvd, options, rule } = *abstraction;
        if self.termination.contains(pose.position, rbvd) {
            Place::Termination
        } else if options.is_allowed(&self.option, rule, pose.position, rbvd) {
            Place::Allowed
        } else {
            Place::Astray
        }
    }

    /// R(x).
    #[must_use]
    pub fn value(&self, pose: &Pose, abstraction: &Abstraction<'_>) -> f64 {
        self.reward.value(&self.path, pose, self.place(pose, abstraction))
    }
}

/// The direction in which an interface is crossed into `into`; a centroid has none.
fn crossing(endpoint: &Endpoint, into: StateId) -> Option<Heading> {
    let normal = endpoint.normal?;
    let upwards = endpoint.states.last() == Some(&into);
    Some(if upwards { normal } else { Heading::new(normal.radians() + std::f64::consts::PI) })
}
