//! The set O of synthesised options, and who may follow whom.

use serde::{Deserialize, Serialize};
use sharp_rbvd::{Rbvd, StateId};
use sharp_space::Point;

use crate::endpoint::{Endpoint, EndpointId};
use crate::id::{OptionId, OptionKind};
use crate::{centroid, interface};

/// An option ⟨I, β⟩ without its policy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OptionSpec {
    /// Its name, which also tells its kind and its states.
    pub id: OptionId,
    /// The initiation set I.
    pub initiation: EndpointId,
    /// The termination set β.
    pub termination: EndpointId,
}

/// How large endpoints are.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OptionSettings {
    /// The threshold t of Definitions 3 and 5, metres.
    pub endpoint_radius_m: f64,
    /// No endpoint is smaller than this, however near the obstacles are, metres.
    pub endpoint_radius_min_m: f64,
}

impl Default for OptionSettings {
    fn default() -> Self {
        // The goal tolerance and the interface's half-width of MHARP, the nearest relative.
        Self { endpoint_radius_m: 0.4, endpoint_radius_min_m: 0.2 }
    }
}

/// Where a robot may be while it executes an option; elsewhere it has strayed.
///
/// Every rule allows both endpoints and, for a centroid option, all its states.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum AllowedRule {
    /// For `o_ijk` all of i, j and k: α(I) ∪ α(β), the paper's letter.
    Paper,
    /// For `o_ijk` all of j and k, but of i only the initiation set, as MHARP does: to go back into
    /// i is to stray.
    #[default]
    Code,
    /// For `o_ijk` all of j, but of i and k only the two endpoints: all that a guide needs.
    Tight,
}

impl AllowedRule {
    /// The states that the option `id` may use from end to end.
    pub fn states(self, id: OptionId) -> impl Iterator<Item = StateId> + use<> {
        let centroid = id.kind() == OptionKind::Centroid;
        let from = (centroid || self == Self::Paper).then(|| id.from());
        let to = (centroid || self != Self::Tight).then(|| id.to());
        [from, id.through(), to].into_iter().flatten()
    }
}

/// All options of one kind on one diagram.
#[derive(Clone, Debug, PartialEq)]
pub struct OptionSet {
    kind: OptionKind,
    endpoints: Vec<Endpoint>,
    /// Sorted by initiation, then termination.
    options: Vec<OptionSpec>,
    /// Positions in `options`, sorted by id.
    by_id: Vec<u32>,
    /// Options past a centroid, sorted by id.
    passing: Vec<OptionSpec>,
}

impl OptionSet {
    /// Makes the options of `kind` that the states and portals of `rbvd` give.
    #[must_use]
    pub fn synthesize(rbvd: &Rbvd, kind: OptionKind, settings: &OptionSettings) -> Self {
        let (endpoints, mut options) = match kind {
            OptionKind::Centroid => centroid::synthesize(rbvd, settings),
            OptionKind::Interface => interface::synthesize(rbvd, settings),
        };
        options.sort_unstable_by_key(|option| (option.initiation, option.termination));
        let mut by_id: Vec<u32> = (0..options.len() as u32).collect();
        by_id.sort_unstable_by_key(|&position| options[position as usize].id);
        let mut passing = if kind == OptionKind::Centroid { centroid::passing(rbvd) } else { Vec::new() };
        passing.sort_unstable_by_key(|option| option.id);
        Self { kind, endpoints, options, by_id, passing }
    }

    /// The family of its options.
    #[must_use]
    pub const fn kind(&self) -> OptionKind {
        self.kind
    }

    /// All endpoints, of every state or every portal of the diagram.
    #[must_use]
    pub fn endpoints(&self) -> &[Endpoint] {
        &self.endpoints
    }

    /// The endpoint called `id`.
    ///
    /// # Panics
    /// If there is no such endpoint.
    #[must_use]
    pub fn endpoint(&self, id: EndpointId) -> &Endpoint {
        &self.endpoints[id.0 as usize]
    }

    /// The endpoints that touch `state`, in order: where a robot in `state` can join an option.
    pub fn endpoints_in(&self, state: StateId) -> impl Iterator<Item = EndpointId> {
        let touching = self.endpoints.iter().zip(0..).filter(move |(e, _)| e.states.contains(&state));
        touching.map(|(_, position)| EndpointId(position))
    }

    /// All options, sorted by initiation, then termination.
    #[must_use]
    pub fn options(&self) -> &[OptionSpec] {
        &self.options
    }

    /// The options that pass a centroid by, sorted by id: none where there are interfaces. They are
    /// no part of the paper's O and so of none of the lists above and below; [`OptionSet::get`] knows them.
    #[must_use]
    pub fn passing(&self) -> &[OptionSpec] {
        &self.passing
    }

    /// The option called `id`, if it is in the set or passes a centroid of it by.
    #[must_use]
    pub fn get(&self, id: OptionId) -> Option<&OptionSpec> {
        let spec = |position: u32| &self.options[position as usize];
        if let Ok(found) = self.by_id.binary_search_by_key(&id, |&position| spec(position).id) {
            return Some(spec(self.by_id[found]));
        }
        let found = self.passing.binary_search_by_key(&id, |option| option.id).ok()?;
        Some(&self.passing[found])
    }

    /// The options that start in `endpoint`, sorted by termination.
    #[must_use]
    pub fn starting_at(&self, endpoint: EndpointId) -> &[OptionSpec] {
        let first = self.options.partition_point(|option| option.initiation < endpoint);
        let count = self.options[first..].partition_point(|option| option.initiation == endpoint);
        &self.options[first..first + count]
    }

    /// The options that can follow `option`: those whose I is its β.
    #[must_use]
    pub fn successors(&self, option: &OptionSpec) -> &[OptionSpec] {
        self.starting_at(option.termination)
    }

    /// Returns true if a robot that executes `option` may be at `point` under `rule`.
    #[must_use]
    pub fn is_allowed(&self, option: &OptionSpec, rule: AllowedRule, point: Point, rbvd: &Rbvd) -> bool {
        rbvd.state_at(point).is_some_and(|state| rule.states(option.id).any(|allowed| allowed == state))
            || self.endpoint(option.initiation).contains(point, rbvd)
            || self.endpoint(option.termination).contains(point, rbvd)
    }
}
