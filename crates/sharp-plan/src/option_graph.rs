//! A* over options (Algorithm 1, line 9).
//!
//! The nodes are options (with `π_0` and `π_{n+1}`), so that the hand-over from one to the next can carry a cost: a
//! guide that ends facing east cannot always be followed by one that begins to the south. Costs are seconds. The
//! heuristic is the straight distance at top speed, which never overestimates.

use std::collections::BTreeMap;

use petgraph::algo::astar;
use petgraph::graph::{DiGraph, NodeIndex};
use sharp_guide::{LegId, UnguidedOption};
use sharp_options::{Endpoint, EndpointId, EndpointSite, OptionId, OptionKind, OptionSet, OptionSpec};
use sharp_rbvd::{StateAbstraction, StateId};
use sharp_space::{Point, Pose};

/// An option that the search may choose, before it has a guide.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// The option.
    pub option: UnguidedOption,
    /// True if it passes a centroid by: that of the state that it begins, ends or, an option, is on the way in.
    pub is_bypass: bool,
    /// The endpoint it ends at; `None` at the goal configuration.
    pub endpoint: Option<EndpointId>,
}

impl Candidate {
    /// Its name.
    #[must_use]
    pub const fn id(&self) -> LegId {
        self.option.id
    }

    /// The straight distance between its ends, metres.
    #[must_use]
    pub fn straight_m(&self) -> f64 {
        (self.option.end - self.option.start).norm()
    }
}

/// All options of one problem, and which may follow which.
#[derive(Clone, Debug)]
pub struct OptionGraph {
    graph: DiGraph<Option<Candidate>, ()>,
    nodes: BTreeMap<LegId, NodeIndex>,
    root: NodeIndex,
    goal: Point,
}

impl OptionGraph {
    /// The graph for a problem from `start` to `goal`, whose states are `s_i` and `s_g`.
    #[must_use]
    pub fn new(
        states: &dyn StateAbstraction,
        options: &OptionSet,
        start: (Pose, StateId),
        goal: (Pose, StateId),
    ) -> Self {
        let mut graph = DiGraph::new();
        let root = graph.add_node(None);
        let mut this = Self { graph, nodes: BTreeMap::new(), root, goal: goal.0.position };
        let mut entering: BTreeMap<(EndpointId, StateId), Vec<NodeIndex>> = BTreeMap::new();
        for candidate in first_legs(states, options, start, goal) {
            let (endpoint, to) = (candidate.endpoint, candidate.option.to);
            let node = this.add(candidate);
            this.graph.add_edge(root, node, ());
            if let Some(endpoint) = endpoint {
                entering.entry((endpoint, to)).or_default().push(node);
            }
        }
        let all = || options.options().iter().chain(options.bypasses());
        for spec in all() {
            let node = this.add(option_candidate(options, spec));
            entering.entry((spec.termination, spec.enters())).or_default().push(node);
        }
        for candidate in last_legs(states, options, goal) {
            let (endpoint, from) = (candidate.endpoint, candidate.option.from);
            let node = this.add(Candidate { endpoint: None, ..candidate });
            for &before in endpoint.iter().flat_map(|&e| entering.get(&(e, from)).into_iter().flatten()) {
                this.graph.add_edge(before, node, ());
            }
        }
        for spec in all() {
            let node = this.nodes[&LegId::Option(spec.id)];
            for &before in entering.get(&(spec.initiation, spec.leaves())).into_iter().flatten() {
                if !goes_back(this.graph[before].as_ref(), spec) {
                    this.graph.add_edge(before, node, ());
                }
            }
        }
        this
    }

    fn add(&mut self, candidate: Candidate) -> NodeIndex {
        let id = candidate.id();
        let node = self.graph.add_node(Some(candidate));
        self.nodes.insert(id, node);
        node
    }

    /// The leg called `id`.
    #[must_use]
    pub fn candidate(&self, id: LegId) -> Option<&Candidate> {
        self.nodes.get(&id).and_then(|&node| self.graph[node].as_ref())
    }

    /// The pairs of options of which the second may follow the first, in a defined order.
    pub fn option_pairs(&self) -> impl Iterator<Item = (OptionId, OptionId)> + use<'_> {
        let id = |node: NodeIndex| match self.graph[node].as_ref().map(Candidate::id) {
            Some(LegId::Option(id)) => Some(id),
            _ => None,
        };
        self.graph.edge_indices().filter_map(move |edge| {
            let (before, after) = self.graph.edge_endpoints(edge)?;
            Some((id(before)?, id(after)?))
        })
    }

    /// The cheapest sequence of options from start to goal, or `None` if every one has an infinite cost.
    ///
    /// `cost(leg)` and `join(before, after)` are seconds, not negative, infinite where impossible;
    /// `cost` may not fall below the straight distance divided by `speed_max_mps`.
    pub fn search(
        &self,
        speed_max_mps: f64,
        cost: impl Fn(&Candidate) -> f64,
        join: impl Fn(&Candidate, &Candidate) -> f64,
    ) -> Option<(f64, Vec<LegId>)> {
        let is_goal = |node: NodeIndex| self.graph[node].as_ref().is_some_and(|leg| leg.endpoint.is_none());
        // An option is asked for from every option before it.
        let mut costs_s = vec![f64::NAN; self.graph.node_count()];
        let mut edge_cost = |before: NodeIndex, after: NodeIndex| {
            let Some(leg) = &self.graph[after] else { return 0.0 };
            let cost_s = &mut costs_s[after.index()];
            if cost_s.is_nan() {
                *cost_s = cost(leg);
            }
            debug_assert!(*cost_s >= 0.0, "costs are not negative");
            match &self.graph[before] {
                // Where no way leads on it does not matter how the robot would turn onto it.
                Some(before) if cost_s.is_finite() => *cost_s + join(before, leg),
                _ => *cost_s,
            }
        };
        let heuristic = |node: NodeIndex| {
            self.graph[node].as_ref().map_or(0.0, |leg| (leg.option.end - self.goal).norm() / speed_max_mps)
        };
        use petgraph::visit::EdgeRef;
        let found = astar(&self.graph, self.root, is_goal, |e| edge_cost(e.source(), e.target()), heuristic);
        let (seconds, nodes) = found.filter(|(seconds, _)| seconds.is_finite())?;
        Some((
            seconds,
            nodes.iter().filter_map(|&node| self.graph[node].as_ref().map(Candidate::id)).collect(),
        ))
    }
}

/// A centroid option back to where the one before came from never helps.
fn goes_back(before: Option<&Candidate>, spec: &OptionSpec) -> bool {
    let came_from =
        before.filter(|before| matches!(before.id(), LegId::Option(_))).map(|before| before.option.from);
    spec.id.kind() == OptionKind::Centroid && came_from == Some(spec.id.to())
}

fn option_candidate(options: &OptionSet, spec: &OptionSpec) -> Candidate {
    let center = |id: EndpointId| options.endpoint(id).center;
    Candidate {
        option: UnguidedOption {
            id: LegId::Option(spec.id),
            from: spec.id.from(),
            to: spec.id.to(),
            start: center(spec.initiation),
            end: center(spec.termination),
            heading: None,
            goal_heading: None,
        },
        is_bypass: matches!(spec.id, OptionId::Bypass { .. }),
        endpoint: Some(spec.termination),
    }
}

/// `π_0`: from the start to each endpoint of its own state, and to the centroids next door, so that
/// nobody has to drive back to a centroid first; and straight to the goal.
fn first_legs(
    states: &dyn StateAbstraction,
    options: &OptionSet,
    (start, from): (Pose, StateId),
    (goal, goal_state): (Pose, StateId),
) -> Vec<Candidate> {
    let heading = Some(start.heading);
    let leg = |id, to, end| UnguidedOption {
        id,
        from,
        to,
        start: start.position,
        end,
        heading,
        goal_heading: None,
    };
    let mut legs = Vec::new();
    let direct = leg(LegId::Direct, goal_state, goal.position);
    legs.push(Candidate { option: direct, is_bypass: false, endpoint: None });
    for endpoint_id in endpoints_near(states, options, from) {
        let endpoint = options.endpoint(endpoint_id);
        let to = other_state(&endpoint.states, from);
        legs.push(Candidate {
            option: leg(LegId::First(endpoint_id.0), to, endpoint.center),
            is_bypass: is_centroid_elsewhere(endpoint, from),
            endpoint: Some(endpoint_id),
        });
    }
    legs
}

/// `π_{n+1}`: from each endpoint of the goal's state, and from the centroids next door, to the goal.
fn last_legs(
    states: &dyn StateAbstraction,
    options: &OptionSet,
    (goal, to): (Pose, StateId),
) -> Vec<Candidate> {
    let leg = |endpoint_id: EndpointId| {
        let endpoint = options.endpoint(endpoint_id);
        // Entered from the other side of an interface, the robot is about to be in the goal's state.
        let from = if endpoint.states.len() > 1 { to } else { endpoint.states[0] };
        let id = LegId::Last(endpoint_id.0, from);
        let (start, end) = (endpoint.center, goal.position);
        Candidate {
            option: UnguidedOption { id, from, to, start, end, heading: None, goal_heading: None },
            is_bypass: is_centroid_elsewhere(endpoint, to),
            endpoint: Some(endpoint_id),
        }
    };
    endpoints_near(states, options, to).into_iter().map(leg).collect()
}

/// The endpoints of `state` itself, and the centroids of its neighbours.
fn endpoints_near(states: &dyn StateAbstraction, options: &OptionSet, state: StateId) -> Vec<EndpointId> {
    let neighbors = states.neighbors(state);
    let is_near = |endpoint: &Endpoint| match endpoint.site {
        EndpointSite::Centroid(other) => other == state || neighbors.contains(&other),
        EndpointSite::Interface(_) | EndpointSite::Custom(_) => endpoint.states.contains(&state),
    };
    let numbered = options.endpoints().iter().zip(0..);
    numbered.filter(|(endpoint, _)| is_near(endpoint)).map(|(_, index)| EndpointId(index)).collect()
}

fn is_centroid_elsewhere(endpoint: &Endpoint, state: StateId) -> bool {
    matches!(endpoint.site, EndpointSite::Centroid(other) if other != state)
}

/// The state on the far side of an interface, or the centroid's own.
fn other_state(states: &[StateId], near: StateId) -> StateId {
    states.iter().copied().find(|&state| state != near).unwrap_or(near)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::query::Query;
    use crate::test_worlds::{HALL, RING, SEALED, along, world};

    fn graph(drawing: &str, kind: OptionKind, query: Query) -> OptionGraph {
        let (_, abstraction) = world(drawing, kind);
        let place = |pose: Pose| (pose, abstraction.states.state_at(pose.position).expect("a state"));
        OptionGraph::new(&*abstraction.states, &abstraction.options, place(query.start), place(query.goal))
    }

    fn names(legs: &[LegId]) -> String {
        legs.iter().map(ToString::to_string).collect::<Vec<_>>().join(" ")
    }

    /// The straight length of an option; the direct way through several states is none here.
    fn cost_m(leg: &Candidate) -> f64 {
        let is_far = leg.id() == LegId::Direct && leg.option.from != leg.option.to;
        if is_far { f64::INFINITY } else { leg.straight_m() }
    }

    /// The names of the shortest plan; first and last legs past a centroid cost 10 m more.
    fn shortest(drawing: &str, kind: OptionKind, query: Query) -> Option<String> {
        let cost = |leg: &Candidate| cost_m(leg) + if leg.is_bypass { 10.0 } else { 0.0 };
        graph(drawing, kind, query).search(1.0, cost, |_, _| 0.0).map(|(_, legs)| names(&legs))
    }

    #[test]
    fn a_hall_is_crossed_from_region_to_region() {
        let centroid = shortest(HALL, OptionKind::Centroid, along());
        assert_eq!(centroid.as_deref(), Some("first:0 c:0-1 c:1-2 last:2"));
        let interface = shortest(HALL, OptionKind::Interface, along());
        assert_eq!(interface.as_deref(), Some("first:0 i:0-1-2 last:1"));
    }

    #[test]
    fn within_a_state_one_leg_is_enough() {
        let nearby = Query { start: Pose::new(1.0, 2.0, 0.0), goal: Pose::new(2.5, 2.2, 0.0) };
        for kind in [OptionKind::Centroid, OptionKind::Interface] {
            assert_eq!(shortest(HALL, kind, nearby).as_deref(), Some("first:goal"), "{kind:?}");
        }
    }

    #[test]
    fn sealed_rooms_have_no_plan() {
        let through = Query { start: Pose::new(2.0, 1.4, 0.0), goal: Pose::new(6.0, 1.4, 0.0) };
        for kind in [OptionKind::Centroid, OptionKind::Interface] {
            assert_eq!(shortest(SEALED, kind, through), None, "{kind:?}");
        }
    }

    #[test]
    fn an_impossible_leg_or_join_sends_the_plan_the_other_way_round() {
        let across = Query { start: Pose::new(1.4, 4.2, 0.0), goal: Pose::new(8.6, 1.4, 0.0) };
        let graph = graph(RING, OptionKind::Centroid, across);
        let (length_m, legs) = graph.search(1.0, cost_m, |_, _| 0.0).expect("a ring has two ways");
        let banned = |leg: &Candidate| if legs.contains(&leg.id()) { f64::INFINITY } else { cost_m(leg) };
        let (detour_m, others) = graph.search(1.0, banned, |_, _| 0.0).expect("the other way");
        assert!(detour_m > length_m, "{detour_m} m is no detour from {length_m} m");
        assert!(legs.iter().all(|leg| !others.contains(leg)), "{} keeps a banned leg", names(&others));
        let broken = |before: &Candidate, after: &Candidate| {
            let joins = legs.windows(2).any(|pair| pair == [before.id(), after.id()]);
            if joins { f64::INFINITY } else { 0.0 }
        };
        let (_, rejoined) = graph.search(1.0, cost_m, broken).expect("the other way");
        assert!(rejoined != legs, "{} keeps a join that is impossible", names(&rejoined));
        assert!(graph.search(1.0, |_| f64::INFINITY, |_, _| 0.0).is_none(), "no leg is possible");
    }

    #[test]
    fn the_cheapest_plan_agrees_with_an_uninformed_search() {
        let across = Query { start: Pose::new(1.4, 4.2, 0.0), goal: Pose::new(8.6, 1.4, 0.0) };
        for kind in [OptionKind::Centroid, OptionKind::Interface] {
            let graph = graph(RING, kind, across);
            let turn = |before: &Candidate, after: &Candidate| {
                f64::from((before.option.to.0 + after.option.to.0) % 3)
            };
            let informed = graph.search(1.0, Candidate::straight_m, turn).map(|found| found.0);
            // At an endless top speed the heuristic knows nothing.
            let blind = graph.search(f64::INFINITY, Candidate::straight_m, turn).map(|found| found.0);
            assert_eq!(informed, blind, "{kind:?}: the heuristic overestimates");
        }
    }

    #[test]
    fn costs_are_seconds_and_add_up_at_any_top_speed() {
        let graph = graph(HALL, OptionKind::Centroid, along());
        // 8 m at 4 m/s, and half a second for each of three hand-overs; a bypass is quicker to see and dearer.
        let cost = |leg: &Candidate| cost_m(leg) / 4.0 + if leg.is_bypass { 5.0 } else { 0.0 };
        let (seconds, legs) = graph.search(4.0, cost, |_, _| 0.5).expect("an open hall");
        assert_eq!(names(&legs), "first:0 c:0-1 c:1-2 last:2", "in {seconds} s");
        assert!((seconds - 3.5).abs() < 1e-9, "{seconds} s");
    }

    #[test]
    fn the_centroid_next_door_may_be_the_first_and_the_last() {
        let graph = graph(HALL, OptionKind::Centroid, along());
        let cost = |leg: &Candidate| if leg.id() == LegId::Direct { f64::INFINITY } else { 1.0 };
        let (count, legs) = graph.search(f64::INFINITY, cost, |_, _| 0.0).expect("an open hall");
        assert_eq!((names(&legs).as_str(), count), ("first:1 last:1", 2.0), "the fewest legs");
        let option = |text: &str| LegId::Option(text.parse().expect("a name"));
        let passes = |id: LegId| graph.candidate(id).map(|leg| leg.is_bypass);
        for (id, expected) in [
            (LegId::First(0), Some(false)),
            (LegId::First(1), Some(true)),
            (LegId::First(2), None),
            (LegId::Direct, Some(false)),
            (option("c:0-1"), Some(false)),
            (option("c:0-1-2"), Some(true)),
            (LegId::Last(2, StateId(2)), Some(false)),
            (LegId::Last(1, StateId(1)), Some(true)),
            (LegId::Last(0, StateId(0)), None),
        ] {
            assert_eq!(passes(id), expected, "{id}: whether it passes a centroid, if there is such a leg");
        }
    }

    #[test]
    fn no_option_leads_back_to_where_the_one_before_came_from() {
        let graph = graph(HALL, OptionKind::Centroid, along());
        let mut pairs: Vec<String> =
            graph.option_pairs().map(|(before, after)| format!("{before} {after}")).collect();
        pairs.sort();
        let expected = [
            "c:0-1 c:1-2",
            "c:0-1-2 c:2-1",
            "c:1-0 c:0-1-2",
            "c:1-2 c:2-1-0",
            "c:2-1 c:1-0",
            "c:2-1-0 c:0-1",
        ];
        assert_eq!(pairs, expected);
    }
}
