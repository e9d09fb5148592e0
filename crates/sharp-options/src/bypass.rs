//! Bypass options: from a centroid past the next one to the one behind it.
//!
//! A centroid may lie to the side of the way through its state. A robot that cannot turn on the spot
//! reaches it with a heading from which it cannot go on, so it needs a way past it. The paper has no
//! such options: they are part of no list of its set O, but [`OptionSet::get`] knows them.

use sharp_rbvd::{StateAbstraction, StateId};

use crate::centroid;
use crate::endpoint::EndpointId;
use crate::family::OptionFamily;
use crate::id::{OptionId, OptionKind};
use crate::set::{OptionSet, OptionSettings, OptionSpec};

/// Options over one state, past its centroid, between two states that are not neighbours.
///
/// The set of [`CentroidOptions`](crate::CentroidOptions) holds the same options as
/// [`OptionSet::bypasses`]; here they are the options themselves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BypassOptions;

impl OptionFamily for BypassOptions {
    fn name(&self) -> &str {
        "bypass"
    }

    fn synthesize(&self, states: &dyn StateAbstraction, settings: &OptionSettings) -> OptionSet {
        let (endpoints, options) = (centroid::endpoints(states, settings), options(states));
        OptionSet::from_parts(OptionKind::Centroid, endpoints, options, Vec::new())
    }
}

/// One option for each way over a state between two that are not neighbours.
pub(crate) fn options(states: &dyn StateAbstraction) -> Vec<OptionSpec> {
    let neighbors: Vec<Vec<StateId>> = states.states().map(|state| states.neighbors(state)).collect();
    let of = |state: StateId| neighbors[state.0 as usize].iter().copied();
    let mut options = Vec::new();
    for from in states.states() {
        for through in of(from) {
            let is_far = |to: &StateId| *to != from && of(from).all(|neighbor| neighbor != *to);
            options.extend(of(through).filter(is_far).map(|to| OptionSpec {
                id: OptionId::Bypass { from, through, to },
                initiation: EndpointId(from.0),
                termination: EndpointId(to.0),
            }));
        }
    }
    options
}
