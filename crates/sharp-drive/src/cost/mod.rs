//! What driving along a guide costs, known before anybody drives: time and risk by the place.
//!
//! A small network looks at each place of a guide: the room around it, the bends behind and ahead, the noise, and how
//! careful the prior is told to be. It says how long the prior takes for the next quarter of a metre and how often it
//! fails there. The sums along a guide are its time and its risk, for guides of any length. The network is fitted to
//! drives of the prior on generated maps (`docs/algorithms/prior.md`), so that it knows the prior and nothing else.

mod drives;
mod places;

use std::collections::BTreeMap;
use std::sync::{Arc, LazyLock};

use sharp_rl::{DeployedMlp, DeployedScratch, Mlp, StoreError};
use sharp_sim::{NoiseModel, RobotModel};

use crate::estimate::expected_cost_s;
use crate::network::PolicyContext;
use crate::situation::GuideView;
use crate::world::World;

pub use drives::{DriveRow, RiskSamples, TimeSamples, drive_rows};
use places::{GuidePlace, PLACE_LEN};

/// Length of guide that a prediction speaks of, metres.
pub(crate) const BIN_M: f64 = 0.25;
/// The note in a model's file that says what its inputs and outputs mean, and the only value that is read.
const FORMAT_NOTE: (&str, &str) = ("cost-format", "1");

/// Predicts what the prior of a kind of robot needs for a guide.
#[derive(Clone, Debug, PartialEq)]
pub struct CostModel {
    network: Mlp,
    deployed: Arc<DeployedMlp>,
}

/// What lies before and after a guide.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GuideEnds {
    /// The robot stands at its beginning; otherwise it comes from another guide.
    pub from_rest: bool,
    /// It ends at the goal; otherwise another guide follows.
    pub to_goal: bool,
}

/// What driving along a guide is predicted to cost.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PredictedCost {
    /// Mean time, seconds.
    pub time_s: f64,
    /// Expected number of failures of a robot that would go on after each: the chance of success is its
    /// exponential, e^(−`risk`).
    pub risk: f64,
}

impl PredictedCost {
    /// The chance to arrive.
    #[must_use]
    pub fn success(&self) -> f64 {
        // Not the system's: prices decide plans, and must not differ from machine to machine.
        libm::exp(-self.risk)
    }

    /// The expected cost of a use, seconds: mean time per success, and `failure_cost_s` for each failure.
    #[must_use]
    pub fn cost_s(&self, failure_cost_s: f64) -> f64 {
        expected_cost_s(self.time_s, self.success(), failure_cost_s)
    }
}

impl CostModel {
    /// Numbers that the network is given for a place, the context included.
    pub const INPUTS: usize = PLACE_LEN + PolicyContext::LEN;
    /// What it says of a place: the logarithms of the time, seconds, and of the risk of the next quarter of a metre.
    pub const OUTPUTS: usize = 2;

    /// The model that `network` was fitted to be.
    ///
    /// # Errors
    /// If the network has other inputs or outputs.
    pub fn new(network: Mlp) -> Result<Self, StoreError> {
        let sizes = network.sizes();
        let (inputs, outputs) = (sizes[0], sizes[sizes.len() - 1]);
        if (inputs, outputs) != (Self::INPUTS, Self::OUTPUTS) {
            let expected = (Self::INPUTS, Self::OUTPUTS);
            return Err(StoreError::Header(format!(
                "a network of {inputs} inputs and {outputs} outputs, a cost model has {expected:?}"
            )));
        }
        let deployed = Arc::new(DeployedMlp::new(&network));
        Ok(Self { network, deployed })
    }

    /// Reads a model from the bytes of a safetensors file.
    ///
    /// # Errors
    /// If the bytes are no network, or not of a cost model's inputs and outputs.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, StoreError> {
        let (network, notes) = Mlp::from_bytes(bytes)?;
        let (name, expected) = FORMAT_NOTE;
        match notes.get(name).map(String::as_str) {
            Some(found) if found == expected => Self::new(network),
            found => Err(StoreError::Header(format!("{name} is {found:?}, expected {expected:?}"))),
        }
    }

    /// The model as bytes of a safetensors file.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let (name, format) = FORMAT_NOTE;
        self.network.to_bytes(&BTreeMap::from([(name.to_owned(), format.to_owned())]))
    }

    /// The model of the shipped prior for robots that move as `robot` does.
    #[must_use]
    pub fn shipped(robot: &RobotModel) -> &'static Self {
        let [turning, steering] = &*SHIPPED;
        if robot.can_turn_in_place() { turning } else { steering }
    }

    /// What `guide` costs under `noise` where the prior is told this `caution`, 0 to 1.
    #[must_use]
    pub fn predict(
        &self,
        world: &World,
        (guide, ends): (&GuideView<'_>, GuideEnds),
        noise: &NoiseModel,
        caution: f32,
    ) -> PredictedCost {
        let (mut scratch, mut input) = (DeployedScratch::default(), [0.0; Self::INPUTS]);
        input[PLACE_LEN..].copy_from_slice(&PolicyContext::new(noise, caution).entries());
        let mut cost = PredictedCost::default();
        let length_m = guide.current.length_m();
        let count = (length_m / BIN_M).ceil().max(1.0) as usize;
        for bin in 0..count {
            let arc_m = bin as f64 * BIN_M;
            let share = ((length_m - arc_m) / BIN_M).min(1.0);
            GuidePlace { arc_m, ends }.write(world, guide, &mut input[..PLACE_LEN]);
            let said = self.deployed.predict(&input, &mut scratch);
            cost.time_s += share * exp(said[0]);
            cost.risk += share * exp(said[1]);
        }
        cost
    }
}

/// The exponential of a logarithm that a network says, kept in a range that sums can bear.
fn exp(logarithm: f32) -> f64 {
    libm::exp(f64::from(logarithm.clamp(-20.0, 5.0)))
}

/// Of the shipped priors: for robots that turn in place, and for cars.
static SHIPPED: LazyLock<[CostModel; 2]> = LazyLock::new(|| {
    let read = |bytes| CostModel::from_bytes(bytes).expect("a test reads every shipped model");
    [
        read(include_bytes!("../../assets/cost-husky.safetensors")),
        read(include_bytes!("../../assets/cost-limo.safetensors")),
    ]
});

#[cfg(test)]
mod tests {
    use sharp_sim::{RobotState, SimulatorKind};
    use sharp_space::Seed;

    use super::*;
    use crate::automaton::Link;
    use crate::initial_states::InitialStates;
    use crate::prior::Prior;
    use crate::test_worlds::{hall, hall_options};

    const ENDS: GuideEnds = GuideEnds { from_rest: true, to_goal: true };

    #[test]
    fn every_shipped_model_can_be_read_and_written() {
        for robot in [RobotModel::husky(), RobotModel::limo()] {
            let model = CostModel::shipped(&robot);
            assert_eq!(
                &CostModel::from_bytes(&model.to_bytes()).expect("own bytes"),
                model,
                "{}",
                robot.name
            );
        }
        let other = Mlp::new(&[3, 4, 2], &mut Seed(1).stream("network", 0));
        let error = CostModel::from_bytes(&other.to_bytes(&BTreeMap::new())).expect_err("no cost model");
        assert!(error.to_string().contains("cost-format is None"), "{error}");
        assert!(CostModel::new(other).expect_err("three inputs").to_string().contains("of 3 inputs"));
    }

    /// What drives of the whole hall show beside what is predicted of it.
    #[test]
    fn the_cost_of_a_hall_is_known_beforehand() {
        let (world, options, noise) = (hall(), hall_options(), NoiseModel::nominal());
        let (prior, model) = (Prior::shipped(&world.robot), CostModel::shipped(&world.robot));
        let simulator = world.simulator(SimulatorKind::Kinematic);
        let links = Link::chain(&options);
        let start = InitialStates::exactly(RobotState::at_rest(options[0].guide.start()));
        let context = PolicyContext::new(&noise, 1.0);
        let policy = prior.at(1.0, &world.robot, &noise);
        let mut rows = Vec::new();
        let drive = (&links[..], &policy, context);
        drive_rows((&world, &*simulator, &noise), drive, (&start, true), (200, Seed(1)), &mut rows);
        let driven_s: f64 = rows.iter().map(|row| f64::from(row.time_s)).sum::<f64>() / 200.0;
        assert!((8.0..25.0).contains(&driven_s), "8 m in {driven_s} s");
        assert!(rows.iter().all(|row| row.passes <= 200.0 && row.passes > 150.0), "most arrive: {rows:?}");
        let predicted_s: f64 = links
            .iter()
            .enumerate()
            .map(|(index, link)| {
                let ends = GuideEnds { from_rest: index == 0, to_goal: link.next.is_none() };
                let cost = model.predict(&world, (&link.guide(), ends), &noise, 1.0);
                assert!(cost.success() > 0.99, "an open hall: {cost:?}");
                cost.time_s
            })
            .sum();
        assert!((predicted_s / driven_s - 1.0).abs() < 0.2, "{predicted_s} s predicted, {driven_s} s driven");
    }

    #[test]
    fn more_noise_costs_more() {
        let (world, options) = (hall(), hall_options());
        let guide = GuideView { current: &options[1].guide, next: None };
        let model = CostModel::shipped(&world.robot);
        let cost_s = |noise: &NoiseModel| {
            model.predict(&world, (&guide, ENDS), noise, 1.0).cost_s(crate::FAILURE_COST_S)
        };
        let costs_s = [NoiseModel::nominal().scaled(0.5), NoiseModel::nominal(), NoiseModel::harsh()];
        let costs_s = costs_s.map(|noise| cost_s(&noise));
        assert!(costs_s.is_sorted(), "{costs_s:?}");
    }

    #[test]
    fn a_cost_counts_time_and_failures() {
        let cost = PredictedCost { time_s: 9.0, risk: -(0.9_f64.ln()) };
        assert!((cost.success() - 0.9).abs() < 1e-12, "{cost:?}");
        assert!((cost.cost_s(1000.0) - 110.0).abs() < 1e-9, "{}", cost.cost_s(1000.0));
    }
}
