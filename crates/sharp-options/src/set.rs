//! The set O of options, and which option may follow which.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use sharp_rbvd::{StateAbstraction, StateId};
use sharp_space::Point;
use thiserror::Error;

use crate::endpoint::{Endpoint, EndpointId};
use crate::id::{OptionId, OptionKind, is_custom_letter};

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

impl OptionSpec {
    /// The state that a robot is in, or about to enter, when it may begin the option.
    #[must_use]
    pub const fn leaves(&self) -> StateId {
        self.id.leaves()
    }

    /// The state that a robot is in, or about to enter, when the option ends.
    #[must_use]
    pub const fn enters(&self) -> StateId {
        self.id.enters()
    }
}

/// How large endpoints are.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct OptionSettings {
    /// The threshold t of Definitions 3 and 5, metres.
    pub endpoint_radius_m: f64,
    /// No endpoint is smaller than this, even near obstacles, metres.
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
/// Every rule allows both endpoints. For all options but interface options it also allows all states
/// of the option.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum AllowedRule {
    /// For `o_ijk` all of i, j and k: α(I) ∪ α(β), as the paper's text says.
    Paper,
    /// For `o_ijk` all of j and k, but of i only the initiation set, as MHARP does: a robot that goes
    /// back into i has strayed.
    #[default]
    Code,
    /// For `o_ijk` all of j, but of i and k only the two endpoints. A guide needs no more.
    Tight,
}

impl AllowedRule {
    /// The states that the option `id` may use from end to end, as far as its name tells them;
    /// [`OptionSet::allowed_states`] knows all.
    pub fn states(self, id: OptionId) -> impl Iterator<Item = StateId> + use<> {
        let is_whole = id.kind() != OptionKind::Interface;
        let from = (is_whole || self == Self::Paper).then(|| id.from());
        let to = (is_whole || self != Self::Tight).then(|| id.to());
        [from, id.through(), to].into_iter().flatten()
    }
}

/// All options of one family on one abstraction.
#[derive(Clone, Debug, PartialEq)]
pub struct OptionSet {
    kind: OptionKind,
    endpoints: Vec<Endpoint>,
    /// Sorted by initiation, then termination, then id.
    options: Vec<OptionSpec>,
    /// Positions in `options`, sorted by id.
    by_id: Vec<u32>,
    /// Options past a centroid, sorted by id.
    bypasses: Vec<OptionSpec>,
    /// The states between the ends of options whose names do not tell them.
    crossed: BTreeMap<OptionId, Vec<StateId>>,
}

impl OptionSet {
    /// Makes the options of `kind` that the states and portals of an abstraction give: those of
    /// [`OptionKind::family`], or none for [`OptionKind::Custom`].
    #[must_use]
    pub fn synthesize(states: &dyn StateAbstraction, kind: OptionKind, settings: &OptionSettings) -> Self {
        match kind.family() {
            Some(family) => family.synthesize(states, settings),
            None => Self::from_parts(kind, Vec::new(), Vec::new(), Vec::new()),
        }
    }

    /// A set of `options` that start and end in `endpoints`, which are called by their
    /// positions in the list. The order of `options` does not matter.
    ///
    /// A set of [`OptionKind::Custom`] may hold options of every kind, the others only their own.
    ///
    /// # Errors
    /// Returns an error if an endpoint has no place, radius or state, or if an option names an endpoint
    /// that does not exist, is of another kind than the set, has a family letter that cannot be written,
    /// or is called like another.
    pub fn new(
        kind: OptionKind,
        endpoints: Vec<Endpoint>,
        options: Vec<OptionSpec>,
    ) -> Result<Self, OptionSetError> {
        for (position, endpoint) in endpoints.iter().enumerate() {
            let numbers = [endpoint.center.x, endpoint.center.y, endpoint.radius_m];
            let is_number = numbers.iter().all(|number| number.is_finite());
            if !is_number || endpoint.radius_m <= 0.0 || endpoint.states.is_empty() {
                return Err(OptionSetError::Endpoint { position });
            }
        }
        for option in &options {
            let is_listed = |id: &EndpointId| (id.0 as usize) < endpoints.len();
            let unknown = [option.initiation, option.termination].into_iter().find(|id| !is_listed(id));
            if let Some(endpoint) = unknown {
                return Err(OptionSetError::UnknownEndpoint { option: option.id, endpoint });
            }
            if kind != OptionKind::Custom && option.id.kind() != kind {
                return Err(OptionSetError::Kind { option: option.id, kind });
            }
            if let OptionId::Custom { family, .. } = option.id
                && !is_custom_letter(family)
            {
                return Err(OptionSetError::Letter { family });
            }
        }
        let set = Self::from_parts(kind, endpoints, options, Vec::new());
        match set.by_id.windows(2).find(|pair| set.id_at(pair[0]) == set.id_at(pair[1])) {
            Some(pair) => Err(OptionSetError::Twice { option: set.id_at(pair[0]) }),
            None => Ok(set),
        }
    }

    /// Says which states the option called `id` crosses between the two that its name tells, so that
    /// a robot that executes it may be there: see [`OptionSet::allowed_states`].
    ///
    /// # Errors
    /// Returns an error if there is no such option.
    pub fn with_crossed(mut self, id: OptionId, states: Vec<StateId>) -> Result<Self, OptionSetError> {
        if self.get(id).is_none() {
            return Err(OptionSetError::UnknownOption { option: id });
        }
        self.crossed.insert(id, states);
        Ok(self)
    }

    /// A set of parts that are known to be sound.
    pub(crate) fn from_parts(
        kind: OptionKind,
        endpoints: Vec<Endpoint>,
        mut options: Vec<OptionSpec>,
        mut bypasses: Vec<OptionSpec>,
    ) -> Self {
        options.sort_unstable_by_key(|option| (option.initiation, option.termination, option.id));
        let mut by_id: Vec<u32> = (0..options.len() as u32).collect();
        by_id.sort_unstable_by_key(|&position| options[position as usize].id);
        bypasses.sort_unstable_by_key(|option| option.id);
        Self { kind, endpoints, options, by_id, bypasses, crossed: BTreeMap::new() }
    }

    fn id_at(&self, position: u32) -> OptionId {
        self.options[position as usize].id
    }

    /// The kind of its options.
    #[must_use]
    pub const fn kind(&self) -> OptionKind {
        self.kind
    }

    /// All endpoints; for ours those of every state or every portal of the abstraction.
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

    /// The bypass options that a centroid set carries along, sorted by id; other sets have none. The
    /// paper's O does not contain them, so they are in none of the lists above and below.
    /// [`OptionSet::get`] finds them.
    #[must_use]
    pub fn bypasses(&self) -> &[OptionSpec] {
        &self.bypasses
    }

    /// The option called `id`, if the set or its bypasses contain it.
    #[must_use]
    pub fn get(&self, id: OptionId) -> Option<&OptionSpec> {
        let spec = |position: u32| &self.options[position as usize];
        if let Ok(found) = self.by_id.binary_search_by_key(&id, |&position| spec(position).id) {
            return Some(spec(self.by_id[found]));
        }
        let found = self.bypasses.binary_search_by_key(&id, |option| option.id).ok()?;
        Some(&self.bypasses[found])
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

    /// The states that a robot may use from end to end while it executes `option`.
    pub fn allowed_states(&self, option: &OptionSpec, rule: AllowedRule) -> impl Iterator<Item = StateId> {
        let crossed = self.crossed.get(&option.id).into_iter().flatten().copied();
        rule.states(option.id).chain(crossed)
    }

    /// Returns true if a robot that executes `option` may be at `point` under `rule`.
    #[must_use]
    pub fn is_allowed(
        &self,
        option: &OptionSpec,
        rule: AllowedRule,
        point: Point,
        states: &dyn StateAbstraction,
    ) -> bool {
        states
            .state_at(point)
            .is_some_and(|state| self.allowed_states(option, rule).any(|allowed| allowed == state))
            || self.endpoint(option.initiation).contains(point, states)
            || self.endpoint(option.termination).contains(point, states)
    }
}

/// Why a set of options was refused.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum OptionSetError {
    /// An endpoint has no place, no positive radius or no state.
    #[error("endpoint {position} needs a finite center, a positive radius and at least one state")]
    Endpoint {
        /// Its position in the list, from 0.
        position: usize,
    },
    /// An option starts or ends at an endpoint that does not exist.
    #[error("option {option} names endpoint {}, which does not exist", endpoint.0)]
    UnknownEndpoint {
        /// The option.
        option: OptionId,
        /// The endpoint that it names.
        endpoint: EndpointId,
    },
    /// An option is of another kind than the set.
    #[error("option {option} is no {} option", kind.name())]
    Kind {
        /// The option.
        option: OptionId,
        /// The kind of the set.
        kind: OptionKind,
    },
    /// The letter of a family cannot be written.
    #[error("family letter is {family:?}, expected one from a to z but neither c nor i")]
    Letter {
        /// The letter.
        family: char,
    },
    /// Two options have one name.
    #[error("option {option} occurs twice")]
    Twice {
        /// The name.
        option: OptionId,
    },
    /// There is no option of this name.
    #[error("there is no option {option}")]
    UnknownOption {
        /// The name.
        option: OptionId,
    },
}
