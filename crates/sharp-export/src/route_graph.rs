//! The options of a map, or a whole plan, as a route graph for Nav2's Route Server.
//!
//! The server drives straight from node to node. So an option is a row of edges along its guide, with nodes between
//! them wherever the guide bends, and no edge meets an obstacle. Endpoints of options are nodes that options share.

use std::collections::BTreeMap;

use rayon::prelude::*;
use serde::Serialize;
use serde_json::{Value, json};
use sharp_drive::{ProfiledFollower, SuccessCount, SuccessEstimate, World};
use sharp_guide::{GuidePath, LegId, NoGuide, UnguidedOption};
use sharp_options::{EndpointId, OptionId, OptionSpec};
use sharp_plan::{Abstraction, Method, Plan};
use sharp_sim::NoiseModel;
use sharp_space::{Point, Seed};

use crate::path::FRAME;
use crate::way::{corners, has_room, is_line_free};

/// Places nearer than this are one, metres.
const SAME_PLACE_M: f64 = 1e-9;
/// A join up to this long is a small step aside on a way that the robot drives, metres.
const SHORT_M: f64 = 0.25;

/// A route graph.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RouteGraph {
    /// The places of its nodes; a node's id is its index here.
    pub nodes: Vec<Point>,
    /// Its directed edges; an edge's id is its index here plus the number of nodes.
    pub edges: Vec<RouteEdge>,
    /// Options that are not in it because they have no guide, with the reason.
    pub unguided: Vec<(OptionId, NoGuide)>,
}

/// A straight, directed edge, free of obstacles from end to end.
#[derive(Clone, Debug, PartialEq)]
pub struct RouteEdge {
    /// The index of the node where it begins.
    pub start: usize,
    /// The index of the node where it ends.
    pub end: usize,
    /// What is known of it.
    pub metadata: EdgeMetadata,
}

/// What is known of an edge and of the option that it is a part of.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EdgeMetadata {
    /// The option, or the first or last leg of a plan; `join` for an edge between the path of a plan and an endpoint.
    pub option: String,
    /// True on the path of a plan.
    pub planned: bool,
    /// Length of the edge, metres.
    pub length_m: f64,
    /// Time that the edge takes, seconds: its share of the option's time.
    pub time_s: f64,
    /// Length of the whole option, metres.
    pub option_length_m: f64,
    /// Time of the whole option, seconds: measured where the option was learnt, else by a speed profile.
    pub option_time_s: f64,
    /// Share of episodes in which the whole option succeeded; left out where it was not measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub option_success: Option<f64>,
    /// The lower end of its 95 % interval.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub option_success_lower95: Option<f64>,
}

/// The way of an option.
struct Way<'a> {
    guide: &'a GuidePath,
    name: String,
    /// Time that it takes, seconds.
    time_s: f64,
    /// How often it succeeded, if that was measured.
    count: Option<SuccessCount>,
}

impl RouteGraph {
    /// The options of `abstraction` in `world`, each along the guide that `method` plans for it. Times come from a
    /// speed profile for `noise`.
    #[must_use]
    pub fn of_options(
        world: &World,
        abstraction: &Abstraction,
        method: &Method,
        noise: &NoiseModel,
        seed: Seed,
    ) -> Self {
        let options = &abstraction.options;
        let profile = ProfiledFollower::tuned(&world.robot, noise).speed;
        let mut graph = Self::default();
        graph.nodes.extend(options.endpoints().iter().map(|endpoint| endpoint.center));
        let specs: Vec<&OptionSpec> = options.options().iter().collect();
        let guides: Vec<_> =
            specs.par_iter().map(|spec| guide(world, abstraction, method, spec, seed)).collect();
        for (spec, guide) in specs.into_iter().zip(guides) {
            let ends = (spec.initiation.0 as usize, spec.termination.0 as usize);
            match guide {
                Ok(guide) => {
                    let time_s = profile.time_s(world, &guide);
                    let way = Way { guide: &guide, name: spec.id.to_string(), time_s, count: None };
                    graph.add(world, &way, ends);
                }
                Err(reason) => graph.unguided.push((spec.id, reason)),
            }
        }
        graph
    }

    /// The options of the abstraction of `plan`, and its path from start to goal with what was measured. Where nothing
    /// stands between them, edges join the path to the endpoints that it passes.
    #[must_use]
    pub fn of_plan(plan: &Plan) -> Self {
        let mut graph =
            Self::of_options(&plan.world, &plan.abstraction, &plan.method, &plan.noise, plan.seed);
        graph.add_measured(plan);
        let Some(first) = plan.solution.steps.first() else { return graph };
        let profile = ProfiledFollower::tuned(&plan.world.robot, &plan.noise).speed;
        let mut before = graph.node(first.option.guide.start().position);
        for step in &plan.solution.steps {
            let guide = &step.option.guide;
            let (_, endpoint) = step.option.id.endpoints(&plan.abstraction.options);
            let after = graph.end_node(guide.end().position, endpoint);
            let count = Some(step.on_arrival).filter(|count| count.successes > 0);
            let time_s = match count {
                Some(_) => step.arrival_time_s,
                None => profile.time_s(&plan.world, guide),
            };
            let begun = graph.edges.len();
            let way = Way { guide, name: step.option.id.to_string(), time_s, count };
            graph.add(&plan.world, &way, (before, after));
            graph.edges[begun..].iter_mut().for_each(|edge| edge.metadata.planned = true);
            if let Some(endpoint) = endpoint {
                graph.join(&plan.world, after, endpoint.0 as usize);
            }
            before = after;
        }
        graph
    }

    /// The graph as GeoJSON.
    #[must_use]
    pub fn to_geojson(&self) -> String {
        let point = |index: usize| [self.nodes[index].x, self.nodes[index].y];
        let nodes = (0..self.nodes.len()).map(|id| {
            feature(json!({ "id": id, "frame": FRAME }), json!({ "type": "Point", "coordinates": point(id) }))
        });
        let edges = self.edges.iter().zip(self.nodes.len()..).map(|(edge, id)| {
            let properties = json!({
                "id": id,
                "startid": edge.start,
                "endid": edge.end,
                "cost": edge.metadata.time_s,
                "metadata": edge.metadata,
            });
            let line = [[point(edge.start), point(edge.end)]];
            feature(properties, json!({ "type": "MultiLineString", "coordinates": line }))
        });
        let features: Vec<Value> = nodes.chain(edges).collect();
        json!({ "type": "FeatureCollection", "name": "graph", "features": features }).to_string() + "\n"
    }

    /// The node of an endpoint if `place` is its centre, else a new one.
    fn end_node(&mut self, place: Point, endpoint: Option<EndpointId>) -> usize {
        match endpoint.map(|id| id.0 as usize) {
            Some(node) if (self.nodes[node] - place).norm() < SAME_PLACE_M => node,
            _ => self.node(place),
        }
    }

    fn node(&mut self, place: Point) -> usize {
        self.nodes.push(place);
        self.nodes.len() - 1
    }

    /// Adds a row of edges along `way`, from one of two nodes to the other.
    fn add(&mut self, world: &World, way: &Way<'_>, (start, end): (usize, usize)) {
        let points: Vec<Point> = way.guide.poses().iter().map(|pose| pose.position).collect();
        let corners = corners(world, &points);
        let lengths_m: Vec<f64> = corners.windows(2).map(|pair| (pair[1] - pair[0]).norm()).collect();
        let length_m: f64 = lengths_m.iter().sum();
        let mut before = start;
        for (i, &edge_m) in lengths_m.iter().enumerate() {
            let after = if i + 1 == lengths_m.len() { end } else { self.node(corners[i + 1]) };
            let metadata = EdgeMetadata {
                option: way.name.clone(),
                planned: false,
                length_m: edge_m,
                time_s: way.time_s * edge_m / length_m,
                option_length_m: length_m,
                option_time_s: way.time_s,
                option_success: way.count.map(|count| count.rate()),
                option_success_lower95: way.count.map(|count| count.lower95()),
            };
            self.edges.push(RouteEdge { start: before, end: after, metadata });
            before = after;
        }
    }

    /// Writes what `plan` measured of options by themselves onto their edges.
    fn add_measured(&mut self, plan: &Plan) {
        let steps = plan.solution.steps.iter().filter(|step| step.learnt.estimate.count.successes > 0);
        let measured: BTreeMap<String, &SuccessEstimate> =
            steps.map(|step| (step.option.id.to_string(), &step.learnt.estimate)).collect();
        for told in self.edges.iter_mut().map(|edge| &mut edge.metadata) {
            let Some(estimate) = measured.get(&told.option) else { continue };
            told.option_time_s = estimate.mean_time_s;
            told.time_s = estimate.mean_time_s * told.length_m / told.option_length_m;
            told.option_success = Some(estimate.count.rate());
            told.option_success_lower95 = Some(estimate.count.lower95());
        }
    }

    /// Joins two nodes in both directions, if nothing stands between them and the robot fits.
    fn join(&mut self, world: &World, a: usize, b: usize) {
        let (from, to) = (self.nodes[a], self.nodes[b]);
        let length_m = (to - from).norm();
        let fits = || length_m <= SHORT_M || (has_room(world, from, to) && has_room(world, to, from));
        if length_m < SAME_PLACE_M || !is_line_free(&world.grid, from, to) || !fits() {
            return;
        }
        let time_s = length_m / (0.5 * world.robot.max_speed_mps);
        let metadata = EdgeMetadata {
            option: "join".to_owned(),
            planned: false,
            length_m,
            time_s,
            option_length_m: length_m,
            option_time_s: time_s,
            option_success: None,
            option_success_lower95: None,
        };
        self.edges.push(RouteEdge { start: a, end: b, metadata: metadata.clone() });
        self.edges.push(RouteEdge { start: b, end: a, metadata });
    }
}

fn feature(properties: Value, geometry: Value) -> Value {
    json!({ "type": "Feature", "properties": properties, "geometry": geometry })
}

/// The guide of an option, as a search of Algorithm 1 with the same seed would plan it.
fn guide(
    world: &World,
    abstraction: &Abstraction,
    method: &Method,
    spec: &OptionSpec,
    seed: Seed,
) -> Result<GuidePath, NoGuide> {
    let center = |id| abstraction.options.endpoint(id).center;
    let id = LegId::Option(spec.id);
    let option = UnguidedOption {
        id,
        from: spec.id.from(),
        to: spec.id.to(),
        start: center(spec.initiation),
        end: center(spec.termination),
        heading: None,
        goal_heading: None,
    };
    let space = abstraction.space(method.search.allowed);
    let mut rng = seed.stream(&format!("guide {id}"), 0);
    option.plan_guide(&space, &world.guide_robot(), &*method.guides, &mut rng)
}
