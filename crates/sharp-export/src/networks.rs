//! The networks of a plan: which there are, what they mean, and which options use them.

use std::collections::BTreeMap;
use std::sync::Arc;

use sharp_drive::{NetworkPolicy, OptionPolicy, PolicyInterface};
use sharp_plan::Plan;
use sharp_rl::Actor;

use crate::onnx::to_onnx;

/// A network of a plan. Options that differ only in what their network is told share one.
#[derive(Clone, Debug)]
pub struct PlanNetwork {
    /// The network with the normaliser of its observations.
    pub actor: Arc<Actor>,
    /// What its action means; the context is that of the first option that uses it.
    pub interface: PolicyInterface,
    /// The options that use it, in the order of the plan, each with what its network is told.
    pub options: Vec<(String, PolicyInterface)>,
}

/// The different networks of `plan`, in the order in which it uses them; none where followers drive all of it.
#[must_use]
pub fn networks(plan: &Plan) -> Vec<PlanNetwork> {
    let mut found: Vec<PlanNetwork> = Vec::new();
    for step in &plan.solution.steps {
        let OptionPolicy::Network(NetworkPolicy { interface, actor, .. }) = &step.learnt.policy else {
            continue;
        };
        let option = (step.option.id.to_string(), *interface);
        let scale = action_scale(interface);
        let same =
            |other: &&mut PlanNetwork| action_scale(&other.interface) == scale && *other.actor == **actor;
        match found.iter_mut().find(same) {
            Some(network) => network.options.push(option),
            None => found.push(PlanNetwork {
                actor: Arc::clone(actor),
                interface: *interface,
                options: vec![option],
            }),
        }
    }
    found
}

impl PlanNetwork {
    /// What a full action stands for, with its unit.
    #[must_use]
    pub fn action_scale(&self) -> [(f64, &'static str); PolicyInterface::ACTION_LEN] {
        action_scale(&self.interface)
    }

    /// The network as an ONNX model: [`to_onnx`] with its notes.
    #[must_use]
    pub fn to_onnx(&self, plan: &Plan) -> Vec<u8> {
        to_onnx(&self.actor, &self.action_scale().map(|(scale, _)| scale), &self.notes(plan))
    }

    /// Its weights and its normaliser as a safetensors file, with its notes.
    #[must_use]
    pub fn to_safetensors(&self, plan: &Plan) -> Vec<u8> {
        self.actor.to_bytes(&self.notes(plan))
    }

    /// What a reader needs to know beside the weights, as short texts.
    #[must_use]
    pub fn notes(&self, plan: &Plan) -> BTreeMap<String, String> {
        let spec = self.actor.spec();
        let (kind, base) = match &self.interface {
            PolicyInterface::Guide { base, .. } => ("guide", serde_json::to_string(base)),
            PolicyInterface::Absolute { .. } => ("absolute", Ok("null".to_owned())),
        };
        let contexts: BTreeMap<&str, _> =
            self.options.iter().map(|(id, to)| (id.as_str(), context(to))).collect();
        let names: Vec<&str> = self.options.iter().map(|(id, _)| id.as_str()).collect();
        BTreeMap::from([
            ("sharp.robot".to_owned(), plan.world.robot.name.clone()),
            ("sharp.options".to_owned(), json(&names)),
            ("sharp.interface".to_owned(), kind.to_owned()),
            ("sharp.base".to_owned(), base.expect("plain numbers")),
            ("sharp.contexts".to_owned(), json(&contexts)),
            ("sharp.action_scale".to_owned(), json(&self.action_scale().map(|(scale, _)| scale))),
            ("sharp.action_unit".to_owned(), json(&self.action_scale().map(|(_, unit)| unit))),
            ("sharp.observation_len".to_owned(), spec.observation_len.to_string()),
        ])
    }
}

/// Plain data as JSON text.
fn json(value: &impl serde::Serialize) -> String {
    serde_json::to_string(value).expect("plain data")
}

/// What the network is told: caution, waypoint, drift, slip, gain; empty for one that is told nothing.
fn context(interface: &PolicyInterface) -> Vec<f32> {
    match interface {
        PolicyInterface::Guide { context, .. } => {
            vec![context.caution, context.waypoint, context.drift, context.slip, context.gain]
        }
        PolicyInterface::Absolute { .. } => Vec::new(),
    }
}

const fn action_scale(interface: &PolicyInterface) -> [(f64, &'static str); PolicyInterface::ACTION_LEN] {
    match interface {
        PolicyInterface::Guide { correction, .. } => {
            [(correction.speed_mps, "m/s"), (correction.bearing_rad, "rad")]
        }
        PolicyInterface::Absolute { reach_m } => [(*reach_m, "m"), (*reach_m, "m")],
    }
}
