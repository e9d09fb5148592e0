//! What every [`OptionFamily`] promises, as a check that any implementation can be run through.
//!
//! ```
//! use sharp_options::{CentroidOptions, OptionSettings, conformance::check_family};
//! use sharp_rbvd::{Rbvd, RbvdSettings};
//! use sharp_space::{DistanceField, OccupancyGrid};
//!
//! let grid = OccupancyGrid::from_ascii(0.5, "......\n......").unwrap();
//! let rbvd = Rbvd::build(&DistanceField::new(&grid), &[], &RbvdSettings::default()).unwrap();
//! assert_eq!(check_family(&CentroidOptions, &rbvd, &OptionSettings::default()), Ok(()));
//! ```

use sharp_rbvd::{StateAbstraction, StateId};
use thiserror::Error;

use crate::endpoint::{EndpointId, EndpointSite};
use crate::family::OptionFamily;
use crate::id::OptionId;
use crate::set::{AllowedRule, OptionSet, OptionSettings, OptionSpec};

/// A promise of [`OptionFamily`] that an implementation breaks.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum FamilyViolation {
    /// The family has no name, or one with other characters than lower-case letters, digits and `-`.
    #[error("family is called {0:?}, expected lower-case letters, digits and hyphens")]
    Name(String),
    /// A second synthesis from equal input gives another set.
    #[error("family {0:?} gives another set the second time")]
    Unstable(String),
    /// Two options have one name, or a name does not find its option.
    #[error("option {option} is not found by its name")]
    NotFound {
        /// The option.
        option: OptionId,
    },
    /// The name of an option changes when it is written as text and read again.
    #[error("option {option:?} does not survive as text")]
    Text {
        /// The option.
        option: OptionId,
    },
    /// An endpoint names a state that does not exist.
    #[error("endpoint {} names state {}, which does not exist", endpoint.0, state.0)]
    UnknownState {
        /// The endpoint.
        endpoint: EndpointId,
        /// The state that it names.
        state: StateId,
    },
    /// An endpoint lies at a centroid or a portal that does not exist.
    #[error("endpoint {} lies at {site:?}, which does not exist", endpoint.0)]
    UnknownSite {
        /// The endpoint.
        endpoint: EndpointId,
        /// Where it claims to lie.
        site: EndpointSite,
    },
    /// Two endpoints lie at the same place, so options that meet there do not share β and I.
    #[error("endpoints {} and {} both lie at {site:?}, so they are not shared", first.0, second.0)]
    NotShared {
        /// One endpoint.
        first: EndpointId,
        /// The other.
        second: EndpointId,
        /// Where both lie.
        site: EndpointSite,
    },
    /// The centre of I or β lies outside the set.
    #[error("endpoint {} does not contain its own center", endpoint.0)]
    CenterOutside {
        /// The endpoint.
        endpoint: EndpointId,
    },
    /// An option begins at an endpoint that does not touch the state that it leaves.
    #[error("option {option} leaves state {} but begins at endpoint {}, which does not touch it",
        option.leaves().0, endpoint.0)]
    Leaves {
        /// The option.
        option: OptionId,
        /// Its initiation set.
        endpoint: EndpointId,
    },
    /// An option ends at an endpoint that does not touch the state that it enters.
    #[error("option {option} enters state {} but ends at endpoint {}, which does not touch it",
        option.enters().0, endpoint.0)]
    Enters {
        /// The option.
        option: OptionId,
        /// Its termination set.
        endpoint: EndpointId,
    },
    /// A rule does not allow a robot to be in the centre of the option's own I or β.
    #[error("option {option} does not allow the center of endpoint {} under rule {rule:?}", endpoint.0)]
    NotAllowed {
        /// The option.
        option: OptionId,
        /// The rule under which it is not allowed.
        rule: AllowedRule,
        /// The endpoint.
        endpoint: EndpointId,
    },
    /// The options that start at an endpoint are not those of the list, sorted by termination.
    #[error("options that start at endpoint {} are not those of the set", endpoint.0)]
    StartingAt {
        /// The endpoint.
        endpoint: EndpointId,
    },
    /// An option has a successor whose I is not its β, or lacks one whose I is.
    #[error("successors of option {option} do not begin where it ends")]
    Successors {
        /// The option.
        option: OptionId,
    },
}

/// Checks all that [`OptionFamily`] promises, on one abstraction: a usable name, an equal set for equal
/// input, and everything that [`check_set`] checks.
///
/// # Errors
/// Returns the first promise that is broken.
pub fn check_family(
    family: &dyn OptionFamily,
    states: &dyn StateAbstraction,
    settings: &OptionSettings,
) -> Result<(), FamilyViolation> {
    let name = family.name();
    let is_usable = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
    if name.is_empty() || !name.chars().all(is_usable) {
        return Err(FamilyViolation::Name(name.to_owned()));
    }
    let set = family.synthesize(states, settings);
    if family.synthesize(states, settings) != set {
        return Err(FamilyViolation::Unstable(name.to_owned()));
    }
    check_set(&set, states)
}

/// Checks a set of options: endpoints exist and are shared, so that β of an option that is followed
/// is I of the next; the centre of I lies in I and that of β in β; names are unique and survive text;
/// the lists of options agree with each other.
///
/// # Errors
/// Returns the first promise that is broken.
pub fn check_set(set: &OptionSet, states: &dyn StateAbstraction) -> Result<(), FamilyViolation> {
    check_endpoints(set, states)?;
    for option in set.options().iter().chain(set.bypasses()) {
        check_name(set, option)?;
        check_ends(set, option, states)?;
    }
    check_lists(set)
}

fn check_endpoints(set: &OptionSet, states: &dyn StateAbstraction) -> Result<(), FamilyViolation> {
    let mut sites: Vec<(EndpointSite, EndpointId)> = Vec::with_capacity(set.endpoints().len());
    for (endpoint, position) in set.endpoints().iter().zip(0..) {
        let (id, site) = (EndpointId(position), endpoint.site);
        let is_known = |state: StateId| (state.0 as usize) < states.len();
        if let Some(&state) = endpoint.states.iter().find(|&&state| !is_known(state)) {
            return Err(FamilyViolation::UnknownState { endpoint: id, state });
        }
        let is_there = match site {
            EndpointSite::Centroid(state) => is_known(state),
            EndpointSite::Interface(portal) => (portal.0 as usize) < states.portals().len(),
            EndpointSite::Custom(_) => true,
        };
        if !is_there {
            return Err(FamilyViolation::UnknownSite { endpoint: id, site });
        }
        sites.push((site, id));
    }
    sites.sort_unstable();
    match sites.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        Some(&[(site, first), (_, second)]) => Err(FamilyViolation::NotShared { first, second, site }),
        _ => Ok(()),
    }
}

fn check_name(set: &OptionSet, option: &OptionSpec) -> Result<(), FamilyViolation> {
    let id = option.id;
    if set.get(id) != Some(option) {
        return Err(FamilyViolation::NotFound { option: id });
    }
    if id.to_string().parse() != Ok(id) {
        return Err(FamilyViolation::Text { option: id });
    }
    Ok(())
}

fn check_ends(
    set: &OptionSet,
    option: &OptionSpec,
    states: &dyn StateAbstraction,
) -> Result<(), FamilyViolation> {
    let id = option.id;
    for endpoint in [option.initiation, option.termination] {
        let ends = set.endpoint(endpoint);
        if !ends.contains(ends.center, states) {
            return Err(FamilyViolation::CenterOutside { endpoint });
        }
        for rule in [AllowedRule::Paper, AllowedRule::Code, AllowedRule::Tight] {
            if !set.is_allowed(option, rule, ends.center, states) {
                return Err(FamilyViolation::NotAllowed { option: id, rule, endpoint });
            }
        }
    }
    let touches = |endpoint, state| set.endpoints_in(state).any(|found| found == endpoint);
    if !touches(option.initiation, option.leaves()) {
        return Err(FamilyViolation::Leaves { option: id, endpoint: option.initiation });
    }
    if !touches(option.termination, option.enters()) {
        return Err(FamilyViolation::Enters { option: id, endpoint: option.termination });
    }
    Ok(())
}

fn check_lists(set: &OptionSet) -> Result<(), FamilyViolation> {
    for endpoint in (0..set.endpoints().len() as u32).map(EndpointId) {
        let mut listed: Vec<&OptionSpec> =
            set.options().iter().filter(|option| option.initiation == endpoint).collect();
        listed.sort_by_key(|option| (option.termination, option.id));
        if !set.starting_at(endpoint).iter().eq(listed) {
            return Err(FamilyViolation::StartingAt { endpoint });
        }
    }
    for option in set.options() {
        if set.successors(option) != set.starting_at(option.termination) {
            return Err(FamilyViolation::Successors { option: option.id });
        }
    }
    Ok(())
}
