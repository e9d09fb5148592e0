//! Centroid options `O_c = { o_ij | V(s_i, s_j) = 1 }` with endpoints as in Definition 4, and those
//! that pass a centroid by.

use sharp_rbvd::{Rbvd, StateId};

use crate::endpoint::{Endpoint, EndpointId};
use crate::id::OptionId;
use crate::set::{OptionSettings, OptionSpec};

/// One endpoint for each state, in order, and one option for each ordered pair of neighbours.
pub(crate) fn synthesize(rbvd: &Rbvd, settings: &OptionSettings) -> (Vec<Endpoint>, Vec<OptionSpec>) {
    let endpoints = rbvd.states().map(|state| Endpoint::at_centroid(rbvd, state, settings)).collect();
    let leaving = |from: StateId| {
        rbvd.neighbors(from).iter().map(move |&to| OptionSpec {
            id: OptionId::Centroid { from, to },
            initiation: EndpointId(from.0),
            termination: EndpointId(to.0),
        })
    };
    (endpoints, rbvd.states().flat_map(leaving).collect())
}

/// One option for each way over a state between two that are no neighbours.
pub(crate) fn passing(rbvd: &Rbvd) -> Vec<OptionSpec> {
    let over = |from: StateId, through: StateId| {
        let far = move |to: &StateId| *to != from && !rbvd.neighbors(from).contains(to);
        rbvd.neighbors(through).iter().copied().filter(far).map(move |to| OptionSpec {
            id: OptionId::Passing { from, through, to },
            initiation: EndpointId(from.0),
            termination: EndpointId(to.0),
        })
    };
    let leaving = |from: StateId| rbvd.neighbors(from).iter().flat_map(move |&through| over(from, through));
    rbvd.states().flat_map(leaving).collect()
}
