//! Interface options `O_i = { o_ijk | V(s_i, s_j) = V(s_j, s_k) = 1 }` with endpoints as in
//! Definition 6.
//!
//! The paper's set contains `o_iji`, which ends where it starts; here i ≠ k. Two states may share
//! several portals, so there is one option for each pair of portals.

use sharp_rbvd::{Portal, StateAbstraction, StateId};

use crate::endpoint::{Endpoint, EndpointId};
use crate::family::OptionFamily;
use crate::id::{OptionId, OptionKind};
use crate::set::{OptionSet, OptionSettings, OptionSpec};

/// Options from one interface of a state, across the state, to another (`O_i`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct InterfaceOptions;

impl OptionFamily for InterfaceOptions {
    fn name(&self) -> &str {
        OptionKind::Interface.name()
    }

    /// One endpoint for each portal, in order, and one option for each way from a portal across one
    /// of its states to a portal of a third state.
    fn synthesize(&self, states: &dyn StateAbstraction, settings: &OptionSettings) -> OptionSet {
        let portals = states.portals();
        let endpoints = portals.iter().map(|portal| Endpoint::at_interface(states, portal, settings));
        OptionSet::from_parts(OptionKind::Interface, endpoints.collect(), options(states), Vec::new())
    }
}

fn options(states: &dyn StateAbstraction) -> Vec<OptionSpec> {
    let mut portals_of = vec![Vec::new(); states.len()];
    for portal in states.portals() {
        portals_of[portal.between.0.0 as usize].push(portal);
        portals_of[portal.between.1.0 as usize].push(portal);
    }
    let mut options = Vec::new();
    for entry in states.portals() {
        let (low, high) = entry.between;
        for (from, through) in [(low, high), (high, low)] {
            for exit in &portals_of[through.0 as usize] {
                let to = exit.other_side(through).expect("the portal touches this state");
                if to != from {
                    options.push(OptionSpec {
                        id: name(states, [from, through, to], (entry, exit)),
                        initiation: EndpointId(entry.id.0),
                        termination: EndpointId(exit.id.0),
                    });
                }
            }
        }
    }
    options
}

fn name(
    states: &dyn StateAbstraction,
    [from, through, to]: [StateId; 3],
    (entry, exit): (&Portal, &Portal),
) -> OptionId {
    let position = |portal: &Portal| {
        let siblings = states.portals_between(portal.between.0, portal.between.1);
        let position = siblings.iter().position(|sibling| sibling.id == portal.id).unwrap_or(0);
        (position as u32, siblings.len())
    };
    let ((entry, entries), (exit, exits)) = (position(entry), position(exit));
    let portals = (entries > 1 || exits > 1).then_some((entry, exit));
    OptionId::Interface { from, through, to, portals }
}
