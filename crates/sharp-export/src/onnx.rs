//! Networks as ONNX models, encoded by hand: the schema is stable, and a policy needs seven of its messages.
//!
//! The graph holds all that stands between what a robot observes and what it does: normalisation of the observation,
//! the layers, tanh, and the scaling of actions. The batch axis is free.

use std::collections::BTreeMap;

use sharp_rl::Actor;

use crate::protobuf::Message;

/// Version of the intermediate representation that models are written for: the one that came with opset 13.
const IR_VERSION: u64 = 7;
/// Version of the operators. Gemm, Relu, Tanh, Sub, Div and Mul are the same since.
const OPSET: u64 = 13;
/// 32-bit floats, in the numbering of the format.
const FLOAT: u64 = 1;
/// Whole numbers as attributes, in the numbering of the format.
const INT: u64 = 2;

/// The model of `actor`, whose full actions stand for `action_scale`.
///
/// It has one input, `observation` (batch x observations), and two outputs (batch x actions): `action`, from −1 to 1,
/// and `scaled_action`, in the units of `action_scale`. `notes` become its metadata.
#[must_use]
pub fn to_onnx(actor: &Actor, action_scale: &[f64], notes: &BTreeMap<String, String>) -> Vec<u8> {
    let notes = notes.iter().map(|(key, value)| Message::new().text(1, key).text(2, value));
    let model = Message::new()
        .number(1, IR_VERSION)
        .text(2, "sharp")
        .text(3, env!("CARGO_PKG_VERSION"))
        .message(7, &graph(actor, action_scale))
        .message(8, &Message::new().text(1, "").number(2, OPSET));
    notes.fold(model, |model, note| model.message(14, &note)).finish()
}

/// Nodes (field 1) and initializers (field 5) of a graph.
struct Graph {
    nodes: Vec<Message>,
    tensors: Vec<Message>,
}

impl Graph {
    fn tensor(&mut self, name: &str, shape: &[usize], values: &[f32]) {
        debug_assert_eq!(shape.iter().product::<usize>(), values.len(), "{name}");
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        let tensor = shape.iter().fold(Message::new(), |tensor, &side| tensor.number(1, side as u64));
        self.tensors.push(tensor.number(2, FLOAT).text(8, name).bytes(9, &bytes));
    }

    fn node(&mut self, kind: &str, inputs: &[&str], output: &str) {
        let node = self.bare_node(kind, inputs, output);
        self.nodes.push(node);
    }

    fn bare_node(&self, kind: &str, inputs: &[&str], output: &str) -> Message {
        let node = inputs.iter().fold(Message::new(), |node, input| node.text(1, input));
        node.text(2, output).text(3, &format!("{kind}_{}", self.nodes.len())).text(4, kind)
    }

    /// `output` = `input` x weightsᵀ + bias.
    fn dense(&mut self, input: &str, layer: &str, output: &str) {
        let (weight, bias) = (format!("{layer}.weight"), format!("{layer}.bias"));
        let transposed = Message::new().text(1, "transB").number(3, 1).number(20, INT);
        let node = self.bare_node("Gemm", &[input, &weight, &bias], output).message(5, &transposed);
        self.nodes.push(node);
    }
}

fn graph(actor: &Actor, action_scale: &[f64]) -> Message {
    let (network, spec) = (actor.network(), actor.spec());
    let mut graph = Graph { nodes: Vec::new(), tensors: Vec::new() };
    graph.tensor("mean", &[spec.observation_len], actor.normaliser().mean());
    graph.tensor("std", &[spec.observation_len], actor.normaliser().std());
    graph.node("Sub", &["observation", "mean"], "centred");
    graph.node("Div", &["centred", "std"], "normalised");
    let mut input = "normalised".to_owned();
    let last = network.layer_count() - 1;
    for index in 0..=last {
        let (layer, inputs) = (network.layer(index), network.sizes()[index]);
        // Of the last layer the means; the rest are the deviations that training draws with.
        let outputs = if index == last { spec.action_len } else { network.sizes()[index + 1] };
        let (name, output) = (format!("actor.{index}"), format!("layer_{index}"));
        graph.tensor(&format!("{name}.weight"), &[outputs, inputs], &layer.weights[..outputs * inputs]);
        graph.tensor(&format!("{name}.bias"), &[outputs], &layer.bias[..outputs]);
        graph.dense(&input, &name, &output);
        input = output;
        if index < last {
            let output = format!("hidden_{index}");
            graph.node("Relu", &[&input], &output);
            input = output;
        }
    }
    graph.node("Tanh", &[&input], "action");
    let scale: Vec<f32> = action_scale.iter().map(|&scale| scale as f32).collect();
    graph.tensor("action_scale", &[spec.action_len], &scale);
    graph.node("Mul", &["action", "action_scale"], "scaled_action");
    let message = graph.nodes.iter().fold(Message::new(), |message, node| message.message(1, node));
    let message =
        graph.tensors.iter().fold(message.text(2, "policy"), |message, tensor| message.message(5, tensor));
    message
        .message(11, &value("observation", spec.observation_len))
        .message(12, &value("action", spec.action_len))
        .message(12, &value("scaled_action", spec.action_len))
}

/// A matrix of any number of rows and `columns` columns.
fn value(name: &str, columns: usize) -> Message {
    let shape = Message::new()
        .message(1, &Message::new().text(2, "batch"))
        .message(1, &Message::new().number(1, columns as u64));
    let tensor = Message::new().number(1, FLOAT).message(2, &shape);
    Message::new().text(1, name).message(2, &Message::new().message(1, &tensor))
}
