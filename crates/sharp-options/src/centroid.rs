//! Centroid options `O_c = { o_ij | V(s_i, s_j) = 1 }` with endpoints as in Definition 4.

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
