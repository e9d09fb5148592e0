//! The policy that knows slip and pull: one action ahead in the simulator, then the values.

use std::sync::Arc;

use sharp_drive::{Command, Episode, EpisodeRules, FAILURE_COST_S, Policy, Situation, World};
use sharp_guide::GuidedOption;
use sharp_sim::{ActionSettings, EpisodeBias, NoiseModel, RobotState, SimulatorKind};
use sharp_space::Seed;

use super::motions::ActionSet;
use super::value::{CLOSE_COST_S, ValueSettings, ValueTable};

/// Pulls whose values are computed, in standard deviations of the noise's; between them values are interpolated.
const PULLS: [f64; 3] = [-1.2, 0.0, 1.2];
/// Draws of the noise for each action that is looked at.
const DRAWS: u64 = 16;

/// The values of one option for several pulls.
#[derive(Clone, Debug)]
struct Values {
    option: Arc<GuidedOption>,
    actions: ActionSet,
    /// By pull, rising.
    tables: Vec<(f64, ValueTable)>,
}

/// What a policy knows of slip and pull.
#[derive(Clone, Copy, Debug)]
enum Knowledge {
    /// It is told.
    Told(EpisodeBias),
    /// It believes what the robot's slip estimate says.
    Estimated,
}

/// Drives an option as well as somebody can who knows the slip and the pull of the episode, or estimates them.
///
/// With estimates it takes the mean over what they hold possible of the cost for somebody who knew: the rule QMDP (Littman,
/// Cassandra and Kaelbling 1995), which is exact but for what would be done in order to find out more.
#[derive(Clone, Debug)]
pub struct InformedPolicy {
    values: Arc<Values>,
    /// Where actions are tried.
    episode: Episode,
    knowledge: Knowledge,
    seed: Seed,
    decisions: u64,
}

impl InformedPolicy {
    /// The policy for `option` under `noise`; it takes a minute or two to compute.
    #[must_use]
    pub fn new(
        world: &World,
        option: &Arc<GuidedOption>,
        noise: &NoiseModel,
        settings: &ValueSettings,
        seed: Seed,
    ) -> Self {
        let mean_slip = 0.5 * noise.slip_max;
        let size_radps = noise.drift_sd_radps + noise.drift_bias_radps;
        let table = |pull: f64| {
            let drift_radps = pull * size_radps;
            let bias = EpisodeBias { speed_slip: mean_slip, yaw_slip: mean_slip, drift_radps };
            (drift_radps, ValueTable::new(world, option, (noise, bias), settings, seed))
        };
        let tables = if size_radps > 0.0 { PULLS.map(table).into() } else { vec![table(0.0)] };
        let values = Values { option: Arc::clone(option), actions: ActionSet::of(&world.robot), tables };
        let simulator = world.simulator(SimulatorKind::Kinematic);
        Self {
            values: Arc::new(values),
            episode: Episode::new(world.vehicle(&*simulator, noise, true), EpisodeRules::default()),
            knowledge: Knowledge::Estimated,
            seed,
            decisions: 0,
        }
    }

    /// The same policy at the beginning of an episode with this slip and pull; it draws what may happen from `seed`.
    #[must_use]
    pub fn told(&self, bias: EpisodeBias, seed: Seed) -> Self {
        Self { knowledge: Knowledge::Told(bias), seed, decisions: 0, ..self.clone() }
    }

    /// The same policy at the beginning of an episode in which the robot estimates its slip and pull.
    #[must_use]
    pub fn estimating(&self, seed: Seed) -> Self {
        Self { knowledge: Knowledge::Estimated, seed, decisions: 0, ..self.clone() }
    }

    /// The expected cost from `state` of somebody who knows slip and pull, seconds.
    #[must_use]
    pub fn expected_cost_s(&self, state: &RobotState, bias: EpisodeBias) -> f64 {
        self.values.cost_s(state, bias)
    }

    /// The expected cost of `command` from `state`, where `biases` are as probable as each other, seconds.
    fn cost_s(&mut self, state: RobotState, command: Command, biases: &[EpisodeBias]) -> f64 {
        let action_s = ActionSettings::default().action_s;
        let mut total = 0.0;
        for (draw, &bias) in biases.iter().enumerate() {
            self.episode.begin_with_bias(state, (self.seed, self.decisions * DRAWS + draw as u64), bias);
            let motion = self.episode.act(command);
            let is_close = self.values.tables[0].1.is_close(&motion.after.pose);
            let risk_s = if is_close { f64::from(CLOSE_COST_S) } else { 0.0 };
            total += if motion.contact {
                FAILURE_COST_S
            } else {
                action_s + risk_s + self.values.cost_s(&motion.after, bias)
            };
        }
        total / biases.len() as f64
    }
}

impl Values {
    fn cost_s(&self, state: &RobotState, bias: EpisodeBias) -> f64 {
        let cost = |index: usize| self.tables[index].1.cost_s(&self.option, state);
        let above = self.tables.partition_point(|table| table.0 < bias.drift_radps);
        if above == 0 || above == self.tables.len() {
            return cost(above.min(self.tables.len() - 1));
        }
        let (low, high) = (self.tables[above - 1].0, self.tables[above].0);
        let share = (bias.drift_radps - low) / (high - low);
        (1.0 - share) * cost(above - 1) + share * cost(above)
    }
}

impl Policy for InformedPolicy {
    fn decide(&mut self, situation: &Situation<'_>) -> Command {
        let values = Arc::clone(&self.values);
        let rng = &mut self.seed.stream("belief", self.decisions);
        let draw = |_| match self.knowledge {
            Knowledge::Told(bias) => bias,
            Knowledge::Estimated => situation.observation.draw_bias(rng).unwrap_or_default(),
        };
        let biases: Vec<EpisodeBias> = (0..DRAWS).map(draw).collect();
        let mut best = (f64::INFINITY, Command::default());
        for &command in values.actions.commands() {
            let cost_s = self.cost_s(situation.observation.state, command, &biases);
            if cost_s < best.0 {
                best = (cost_s, command);
            }
        }
        self.decisions += 1;
        best.1
    }

    fn uses_slip_estimate(&self) -> bool {
        matches!(self.knowledge, Knowledge::Estimated)
    }
}
