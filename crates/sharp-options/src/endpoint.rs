//! Centroid regions (Definition 3) and interface regions (Definition 5): sets in which options
//! start and end.
//!
//! Both are balls of radius t cut down to one or two states, so one type serves for both. Headings
//! do not matter: the paper's definitions give sets of positions.

use serde::{Deserialize, Serialize};
use sharp_rbvd::{Portal, PortalId, StateAbstraction, StateId};
use sharp_space::{Cell, Heading, Point};

use crate::set::OptionSettings;

/// Names an endpoint; equal to its position in [`OptionSet::endpoints`](crate::OptionSet::endpoints).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct EndpointId(pub u32);

/// What an endpoint lies around.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum EndpointSite {
    /// The centroid of the critical region of a state.
    Centroid(StateId),
    /// A portal between two states.
    Interface(PortalId),
    /// A place that a family from outside this library chose; the family numbers its places.
    Custom(u32),
}

/// A set of positions { x | α(x) ∈ states ∧ d(x, center) < radius }.
#[derive(Clone, Debug, PartialEq)]
pub struct Endpoint {
    /// What it lies around.
    pub site: EndpointSite,
    /// The middle of the ball: for ours the region's representative or the portal's point.
    pub center: Point,
    /// Radius of the ball, metres: t of the definitions, or less where obstacles are near.
    pub radius_m: f64,
    /// The states whose cells belong to the set, sorted: one at a centroid, two at an interface.
    pub states: Vec<StateId>,
    /// The direction across an interface, from the lower state to the higher one.
    pub normal: Option<Heading>,
}

impl Endpoint {
    /// The centroid region of `state` (Definition 3).
    ///
    /// # Panics
    /// If there is no such state.
    #[must_use]
    pub fn at_centroid(states: &dyn StateAbstraction, state: StateId, settings: &OptionSettings) -> Self {
        let center = states.center(state);
        Self {
            site: EndpointSite::Centroid(state),
            center,
            radius_m: radius_m(states, center, settings),
            states: vec![state],
            normal: None,
        }
    }

    /// The interface region of one portal (Definition 5). A pair of states has one for each of its
    /// portals. The definition's p is any point of the border; ours is the one with the most clearance.
    #[must_use]
    pub fn at_interface(states: &dyn StateAbstraction, portal: &Portal, settings: &OptionSettings) -> Self {
        Self {
            site: EndpointSite::Interface(portal.id),
            center: portal.point,
            radius_m: radius_m(states, portal.point, settings),
            states: vec![portal.between.0, portal.between.1],
            normal: Some(portal.normal),
        }
    }

    /// The positions around `center` in its state, for a family from outside that calls the place
    /// `number`; `None` if `center` has no state.
    #[must_use]
    pub fn at_point(
        states: &dyn StateAbstraction,
        number: u32,
        center: Point,
        settings: &OptionSettings,
    ) -> Option<Self> {
        states.state_at(center).map(|state| Self {
            site: EndpointSite::Custom(number),
            center,
            radius_m: radius_m(states, center, settings),
            states: vec![state],
            normal: None,
        })
    }

    /// Returns true if `point` belongs to the set.
    #[must_use]
    pub fn contains(&self, point: Point, states: &dyn StateAbstraction) -> bool {
        (point - self.center).norm() < self.radius_m
            && states.state_at(point).is_some_and(|state| self.states.contains(&state))
    }
}

/// t, reduced to the distance between `center` and the next obstacle so that no ball reaches through a
/// wall, but not below the least radius.
fn radius_m(states: &dyn StateAbstraction, center: Point, settings: &OptionSettings) -> f64 {
    let frame = states.frame();
    let reach = (settings.endpoint_radius_m / frame.resolution_m).ceil() as usize;
    let Some(middle) = frame.cell_at(center) else { return settings.endpoint_radius_min_m };
    let around = |at: usize, len: usize| at.saturating_sub(reach)..(at + reach + 1).min(len);
    let (cols, rows) = (around(middle.col, frame.width), around(middle.row, frame.height));
    let cells = rows.flat_map(|row| cols.clone().map(move |col| Cell::new(col, row)));
    let without_state = cells.filter(|&cell| states.state_of(cell).is_none());
    let nearest_m = without_state.map(|cell| (frame.center(cell) - center).norm());
    // Cells without a state end about the fringe's clearance away from what blocks the robot.
    let clear_m = nearest_m.fold(f64::INFINITY, f64::min) + states.cells().fringe_clearance_m();
    settings.endpoint_radius_m.min(clear_m).max(settings.endpoint_radius_min_m)
}
