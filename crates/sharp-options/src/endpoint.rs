//! Centroid regions (Definition 3) and interface regions (Definition 5): sets in which options
//! start and end.
//!
//! Both are balls of radius t cut down to one or two states, so one type serves for both. Headings
//! do not matter: a set of positions is what the paper's definitions give.

use serde::{Deserialize, Serialize};
use sharp_rbvd::{Portal, PortalId, Rbvd, StateId};
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
}

/// A set of positions { x | α(x) ∈ states ∧ d(x, center) < radius }.
#[derive(Clone, Debug, PartialEq)]
pub struct Endpoint {
    /// What it lies around.
    pub site: EndpointSite,
    /// The middle of the ball: the region's representative, or the portal's point.
    pub center: Point,
    /// Radius of the ball, metres: t of the definitions, or less where obstacles are near.
    pub radius_m: f64,
    /// The states whose cells belong: one at a centroid, two at an interface, sorted.
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
    pub fn at_centroid(rbvd: &Rbvd, state: StateId, settings: &OptionSettings) -> Self {
        let center = rbvd.region(state).center(rbvd.frame());
        Self {
            site: EndpointSite::Centroid(state),
            center,
            radius_m: radius_m(rbvd, center, settings),
            states: vec![state],
            normal: None,
        }
    }

    /// The interface region of one portal (Definition 5). A pair of states has one for each of its
    /// portals: the definition's point p is any point of the border, ours is the roomiest.
    #[must_use]
    pub fn at_interface(rbvd: &Rbvd, portal: &Portal, settings: &OptionSettings) -> Self {
        Self {
            site: EndpointSite::Interface(portal.id),
            center: portal.point,
            radius_m: radius_m(rbvd, portal.point, settings),
            states: vec![portal.between.0, portal.between.1],
            normal: Some(portal.normal),
        }
    }

    /// Returns true if `point` belongs to the set.
    #[must_use]
    pub fn contains(&self, point: Point, rbvd: &Rbvd) -> bool {
        (point - self.center).norm() < self.radius_m
            && rbvd.state_at(point).is_some_and(|state| self.states.contains(&state))
    }
}

/// t, reduced to the room around `center` so that no ball reaches through a wall, but not below
/// the least radius.
fn radius_m(rbvd: &Rbvd, center: Point, settings: &OptionSettings) -> f64 {
    let frame = rbvd.frame();
    let reach = (settings.endpoint_radius_m / frame.resolution_m).ceil() as usize;
    let Some(middle) = frame.cell_at(center) else { return settings.endpoint_radius_min_m };
    let around = |at: usize, len: usize| at.saturating_sub(reach)..(at + reach + 1).min(len);
    let (cols, rows) = (around(middle.col, frame.width), around(middle.row, frame.height));
    let cells = rows.flat_map(|row| cols.clone().map(move |col| Cell::new(col, row)));
    let without_state = cells.filter(|&cell| rbvd.state_of(cell).is_none());
    let nearest_m = without_state.map(|cell| (frame.center(cell) - center).norm());
    // A cell without state lies about the fringe's clearance away from what blocks the robot.
    let room_m = nearest_m.fold(f64::INFINITY, f64::min) + rbvd.settings().fringe_clearance_m;
    settings.endpoint_radius_m.min(room_m).max(settings.endpoint_radius_min_m)
}
