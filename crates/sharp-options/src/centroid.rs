//! Centroid options `O_c = { o_ij | V(s_i, s_j) = 1 }` with endpoints as in Definition 4.

use sharp_rbvd::{StateAbstraction, StateId};

use crate::bypass;
use crate::endpoint::{Endpoint, EndpointId};
use crate::family::OptionFamily;
use crate::id::{OptionId, OptionKind};
use crate::set::{OptionSet, OptionSettings, OptionSpec};

/// Options from the centroid of each critical region to those of its neighbours (`O_c`).
///
/// The set carries the bypass options along, see [`BypassOptions`](crate::BypassOptions).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CentroidOptions;

impl OptionFamily for CentroidOptions {
    fn name(&self) -> &str {
        OptionKind::Centroid.name()
    }

    fn synthesize(&self, states: &dyn StateAbstraction, settings: &OptionSettings) -> OptionSet {
        let (endpoints, options) = (endpoints(states, settings), options(states));
        OptionSet::from_parts(OptionKind::Centroid, endpoints, options, bypass::options(states))
    }
}

/// One endpoint for each state, in order.
pub(crate) fn endpoints(states: &dyn StateAbstraction, settings: &OptionSettings) -> Vec<Endpoint> {
    states.states().map(|state| Endpoint::at_centroid(states, state, settings)).collect()
}

/// One option for each ordered pair of neighbours.
fn options(states: &dyn StateAbstraction) -> Vec<OptionSpec> {
    let leaving = |from: StateId| {
        states.neighbors(from).into_iter().map(move |to| OptionSpec {
            id: OptionId::Centroid { from, to },
            initiation: EndpointId(from.0),
            termination: EndpointId(to.0),
        })
    };
    states.states().flat_map(leaving).collect()
}
