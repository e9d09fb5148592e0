//! Interface options `O_i = { o_ijk | V(s_i, s_j) = V(s_j, s_k) = 1 }` with endpoints as in
//! Definition 6.
//!
//! The paper's set contains `o_iji`, which ends where it starts; here i ≠ k. Two states may share
//! several portals, so there is one option for each pair of portals.

use sharp_rbvd::{Portal, Rbvd, StateId};

use crate::endpoint::{Endpoint, EndpointId};
use crate::id::OptionId;
use crate::set::{OptionSettings, OptionSpec};

/// One endpoint for each portal, in order, and one option for each way from a portal across one of
/// its states to a portal of a third state.
pub(crate) fn synthesize(rbvd: &Rbvd, settings: &OptionSettings) -> (Vec<Endpoint>, Vec<OptionSpec>) {
    let endpoints = rbvd.portals().iter().map(|portal| Endpoint::at_interface(rbvd, portal, settings));
    let mut portals_of = vec![Vec::new(); rbvd.len()];
    for portal in rbvd.portals() {
        portals_of[portal.between.0.0 as usize].push(portal);
        portals_of[portal.between.1.0 as usize].push(portal);
    }
    let mut options = Vec::new();
    for entry in rbvd.portals() {
        let (low, high) = entry.between;
        for (from, through) in [(low, high), (high, low)] {
            for exit in &portals_of[through.0 as usize] {
                let to = other_side(exit, through);
                if to != from {
                    options.push(OptionSpec {
                        id: name(rbvd, [from, through, to], (entry, exit)),
                        initiation: EndpointId(entry.id.0),
                        termination: EndpointId(exit.id.0),
                    });
                }
            }
        }
    }
    (endpoints.collect(), options)
}

fn other_side(portal: &Portal, state: StateId) -> StateId {
    if portal.between.0 == state { portal.between.1 } else { portal.between.0 }
}

fn name(rbvd: &Rbvd, [from, through, to]: [StateId; 3], (entry, exit): (&Portal, &Portal)) -> OptionId {
    let position = |portal: &Portal| {
        let mut siblings = rbvd.portals_between(portal.between.0, portal.between.1);
        let count = siblings.len();
        let position = siblings.position(|sibling| sibling.id == portal.id).unwrap_or(0);
        (position as u32, count)
    };
    let ((entry, entries), (exit, exits)) = (position(entry), position(exit));
    let portals = (entries > 1 || exits > 1).then_some((entry, exit));
    OptionId::Interface { from, through, to, portals }
}
