//! What `sharp export` and `sharp run --record` write, read by the official packages of each format.

#![allow(clippy::disallowed_methods, reason = "a variable says whether a test can do more")]

#[path = "common/python.rs"]
mod python;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::LazyLock;

use rand::RngExt;
use serde_json::{Value, json};
use sharp_drive::World;
use sharp_export::{PlannedPath, RouteGraph, is_line_free, networks, planned_mcap};
use sharp_maps::{LoadOptions, load};
use sharp_options::OptionKind;
use sharp_plan::{ComposedOdds, Method, Plan, PlanPiece};
use sharp_rl::ActorScratch;
use sharp_sim::{NoiseModel, RobotModel};
use sharp_space::{Cell, OccupancyGrid, Point, Seed};

/// A plan that is solved once for all tests: environment `a`, its second problem, the Husky.
static PLAN: LazyLock<(PathBuf, PathBuf)> = LazyLock::new(|| {
    // Nothing drops what is static, so that it is no temporary folder.
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("export");
    fs::create_dir_all(&folder).expect("a folder");
    let plan = folder.join("plan");
    let args = ["solve", "a", "--problem", "2", "--library", "none", "--out"];
    let output = sharp(&[&args[..], &[text(&plan)]].concat());
    assert!(output.status.success(), "{output:?}");
    (folder, plan)
});

fn sharp(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_sharp")).args(args).output().expect("the binary runs")
}

fn text(path: &Path) -> &str {
    path.to_str().expect("a printable path")
}

/// Exports the plan as `format` and returns the files.
fn export(format: &str, name: &str) -> Vec<PathBuf> {
    let (folder, plan) = &*PLAN;
    let out = folder.join(name);
    let output = sharp(&["--json", "export", text(plan), "--format", format, "--out", text(&out)]);
    assert!(output.status.success(), "{format}: {output:?}");
    let report: Value = serde_json::from_slice(&output.stdout).expect("one JSON object");
    assert_eq!((&report["schema"], &report["format"]), (&json!("sharp.export/1"), &json!(format)));
    let files = report["files"].as_array().expect("a list").iter();
    files.map(|file| PathBuf::from(file["path"].as_str().expect("text"))).collect()
}

fn plan() -> Plan {
    let (_, folder) = &*PLAN;
    let map = folder.join("map.yaml");
    Plan::load(folder, load(text(&map), &LoadOptions::default()).expect("a map").grid).expect("a plan")
}

fn examples() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../sharp-export/examples")
}

/// What the example called `name` prints about `files`; `None` where there is no Python.
fn example(name: &str, files: &[&Path]) -> Option<String> {
    let python = python::python(&examples().join("requirements.txt"))?;
    Some(python::script(&python, &examples().join(name), files))
}

#[test]
fn paths_are_tables_and_messages() {
    let solution = plan().solution;
    let (csv, json) = (export("csv", "path.csv"), export("json", "path.json"));
    let header = fs::read_to_string(&csv[0]).expect("a table");
    assert!(header.starts_with("x_m,y_m,yaw_rad,arc_m,time_s,speed_mps,option\n"), "{header}");
    let ends_s = format!("{:.2} s", solution.predicted_time_s);
    if let Some(said) = example("read_csv.py", &[&csv[0]]) {
        assert!(said.contains(&ends_s), "it ends at the predicted time, {ends_s}: {said}");
        let first = solution.steps[0].option.id.to_string();
        assert!(said.contains(&format!("legs {first}")), "{said}");
    }
    if let Some(said) = example("read_json.py", &[&json[0]]) {
        assert!(said.contains(&ends_s) && said.contains(&format!("{} legs", solution.steps.len())), "{said}");
        assert!(said.contains(&format!("success {:.3}", solution.predicted.rate())), "{said}");
    }
}

#[test]
fn recordings_decode_topic_by_topic() {
    let (folder, plan_dir) = &*PLAN;
    let planned = export("mcap", "plan.mcap");
    assert_eq!(fs::read(&planned[0]).ok(), fs::read(&export("mcap", "again.mcap")[0]).ok(), "equal bytes");
    let driven = folder.join("drives.mcap");
    let output = sharp(&["--json", "run", text(plan_dir), "--episodes", "3", "--record", text(&driven)]);
    assert!(output.status.success(), "{output:?}");
    let report: Value = serde_json::from_slice(&output.stdout).expect("one JSON object");
    for (file, outcomes, last) in [(&planned[0], 1, "planned"), (&driven, 3, "episode 3: ")] {
        let Some(said) = example("read_mcap.py", &[file]) else { return };
        for topic in [
            "/map nav_msgs/msg/OccupancyGrid 1",
            "/plan nav_msgs/msg/Path 1",
            "/goal_pose geometry_msgs/msg/PoseStamped 1",
            "/odom nav_msgs/msg/Odometry ",
            "/tf tf2_msgs/msg/TFMessage ",
            "/footprint geometry_msgs/msg/PolygonStamped ",
            "/sharp/option std_msgs/msg/String ",
            "/sharp/odds std_msgs/msg/Float64 ",
            &format!("/sharp/outcome std_msgs/msg/String {outcomes}"),
        ] {
            assert!(said.contains(topic), "{topic}: {said}");
        }
        assert!(said.contains(last), "{said}");
    }
    let mean_s = report["mean_sim_time_s"].as_f64().expect("a number");
    assert!(mean_s > 0.0, "the report of a recorded run is that of any run: {report}");
}

/// The whole runs that composed odds are worth, and the success of legs, stood in for the odds themselves.
#[test]
fn composed_odds_are_exported_as_they_are() {
    let (folder, mut plan) = (&PLAN.0, plan());
    let legs = plan.solution.steps.len() as f64;
    let piece = |until, success| PlanPiece { until, success, episodes: 50.0, time_s: 5.0, runs: 0 };
    let odds = ComposedOdds::of(vec![piece(legs - 1.0, 0.91), piece(legs, 0.83)]);
    plan.solution.predicted = odds.count();
    plan.solution.composed = Some(odds.clone());
    let told: Value = serde_json::from_str(&PlannedPath::new(&plan).to_json(&plan)).expect("JSON");
    for (key, expected) in [("success", odds.success), ("lower95", odds.lower95)] {
        let told = told["predicted"][key].as_f64().expect("a number");
        assert!((told - expected).abs() < 1e-9, "{key}: {told}, not {expected}");
    }
    let file = folder.join("composed.mcap");
    fs::write(&file, planned_mcap(&plan).expect("a recording")).expect("a file");
    if let Some(said) = example("read_mcap.py", &[&file]) {
        assert!(said.contains("odds 0.830"), "of the last leg: {said}");
    }
}

#[test]
fn networks_agree_with_onnxruntime_and_numpy() {
    let (folder, plan) = (&PLAN.0, plan());
    let (models, weights) = (export("onnx", "policy.onnx"), export("safetensors", "policy.safetensors"));
    let ours = networks(&plan);
    assert_eq!((models.len(), weights.len()), (ours.len(), ours.len()), "a file for each network");
    assert!(!ours.is_empty(), "the prior drives a leg of this plan");
    for (network, (model, weights)) in ours.iter().zip(models.iter().zip(&weights)) {
        let mut rng = Seed(1).stream("observations", 0);
        let len = network.actor.spec().observation_len;
        let draw = |_| (0..len).map(|_| rng.random_range(-1.5..1.5)).collect();
        let observations: Vec<Vec<f32>> = (0..100).map(draw).collect();
        let act = |observation: &Vec<f32>| {
            let mut action = [0.0; 2];
            network.actor.act_mean(observation, &mut ActorScratch::default(), &mut action);
            action
        };
        let actions: Vec<[f32; 2]> = observations.iter().map(act).collect();
        let scale = network.action_scale().map(|(scale, _)| scale);
        let scaled: Vec<[f64; 2]> =
            actions.iter().map(|action| [0, 1].map(|i| f64::from(action[i]) * scale[i])).collect();
        let file = folder.join("observations.json");
        let told = json!({ "observations": observations, "actions": actions, "scaled_actions": scaled });
        fs::write(&file, told.to_string()).expect("a file");
        for (script, policy, kinds) in [("run_onnx.py", model, 2), ("read_safetensors.py", weights, 1)] {
            let Some(said) = example(script, &[policy, &file]) else { return };
            let differences: Vec<f64> = said
                .lines()
                .filter_map(|line| line.split_once("differs by at most ")?.1.parse().ok())
                .collect();
            assert_eq!(differences.len(), kinds, "{script}: {said}");
            assert!(differences.iter().all(|&by| by < 1e-5), "{script}: {said}");
        }
    }
}

#[test]
fn a_plan_without_a_network_says_who_drives_it() {
    let (folder, plan_dir) = &*PLAN;
    let copy = folder.join("followed");
    fs::create_dir_all(&copy).expect("a folder");
    let mut plan = plan();
    for step in &mut plan.solution.steps {
        step.learnt.policy = sharp_drive::OptionPolicy::fallbacks(&plan.world.robot).remove(0);
    }
    let hash = sharp_plan::map_hash(&plan.world.grid);
    let file = sharp_plan::AbstractionFile::load(&plan_dir.join("abstraction.ron"), &hash).expect("a file");
    plan.save(&copy, &file).expect("a plan");
    for map in ["map.yaml", "map.pgm"] {
        fs::copy(plan_dir.join(map), copy.join(map)).expect("a copy");
    }
    let output =
        sharp(&["--json", "export", text(&copy), "--format", "onnx", "--out", text(&copy.join("x.onnx"))]);
    let said = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("NO_NETWORK") && said.contains("profiled"), "{said}");
}

#[test]
fn a_route_leads_over_the_graph_of_a_plan() {
    let files = export("geojson", "route.geojson");
    let plan = plan();
    let graph = RouteGraph::of_plan(&plan);
    assert_eq!(fs::read_to_string(&files[0]).ok(), Some(graph.to_geojson()), "what is exported");
    check_edges(&plan.world.grid, &graph, "the plan");
    let driven_s: f64 = plan.solution.steps.iter().map(|step| step.arrival_time_s).sum();
    let planned_s: f64 = graph
        .edges
        .iter()
        .map(|edge| &edge.metadata)
        .filter(|edge| edge.planned)
        .map(|edge| edge.time_s)
        .sum();
    assert!((driven_s - planned_s).abs() < 1e-6, "edges share the time of their option: {planned_s}");
    if let Some(said) = example("read_geojson.py", &[&files[0]]) {
        assert!(said.contains("route of "), "{said}");
    }
}

/// Each edge against each cell that is not free, by clipping: not the way in which edges are made.
fn check_edges(grid: &OccupancyGrid, graph: &RouteGraph, name: &str) {
    let frame = grid.frame();
    for edge in &graph.edges {
        let (from, to) = (graph.nodes[edge.start], graph.nodes[edge.end]);
        let (a, b) = (frame.to_grid(from), frame.to_grid(to));
        let low = |a: f64, b: f64| (a.min(b).floor() - 1.0).max(0.0) as usize;
        let high = |a: f64, b: f64, end: usize| ((a.max(b).ceil() + 1.0) as usize).min(end);
        for row in low(a.y, b.y)..high(a.y, b.y, frame.height) {
            for col in low(a.x, b.x)..high(a.x, b.x, frame.width) {
                let is_hit = !grid.is_free(Cell::new(col, row)) && meets(a, b, col as f64, row as f64);
                assert!(
                    !is_hit,
                    "{name}: {} from {from} to {to} meets cell {col}, {row}",
                    edge.metadata.option
                );
            }
        }
        assert!(is_line_free(grid, from, to), "{name}: the same by rows");
    }
}

/// Whether the line from `a` to `b` meets the unit square with this lower left corner.
fn meets(a: sharp_space::Vector, b: sharp_space::Vector, col: f64, row: f64) -> bool {
    let line = b - a;
    let (mut enters, mut leaves) = (0.0_f64, 1.0_f64);
    for (from, step, low) in [(a.x, line.x, col), (a.y, line.y, row)] {
        if step == 0.0 {
            if from < low || from > low + 1.0 {
                return false;
            }
            continue;
        }
        let (first, second) = ((low - from) / step, (low + 1.0 - from) / step);
        enters = enters.max(first.min(second));
        leaves = leaves.min(first.max(second));
    }
    enters <= leaves
}

/// The graph of the options on a map, and how many options have no guide.
fn options_graph(grid: OccupancyGrid, robot: RobotModel, kind: OptionKind) -> (World, RouteGraph) {
    let world = World::new(grid, robot);
    let mut sharp =
        sharp_plan::Sharp::new(world.clone(), sharp_regions::GeometricDetector::default()).with_options(kind);
    let abstraction = sharp.abstraction(&()).expect("room for the robot").clone();
    let graph =
        RouteGraph::of_options(&world, &abstraction, &Method::default(), &NoiseModel::nominal(), Seed(1));
    let planned = graph.edges.iter().map(|edge| edge.metadata.option.clone());
    let planned: std::collections::BTreeSet<String> = planned.collect();
    let all = abstraction.options.options().len();
    assert_eq!(planned.len() + graph.unguided.len(), all, "every option is in the graph or has a reason");
    (world, graph)
}

#[test]
fn no_edge_of_any_environment_meets_an_obstacle() {
    for name in ["a", "b", "c", "d", "e", "f", "g"] {
        let grid = load(name, &LoadOptions::default()).expect("a map").grid;
        let (world, graph) = options_graph(grid, RobotModel::limo(), OptionKind::Interface);
        check_edges(&world.grid, &graph, name);
        assert!(graph.edges.len() > 20, "{name}: {} edges", graph.edges.len());
    }
}

#[test]
fn no_edge_of_a_real_map_meets_an_obstacle() {
    let Some(folder) = std::env::var_os("SHARP_REAL_MAPS").map(PathBuf::from) else {
        eprintln!("SKIPPED: SHARP_REAL_MAPS names no folder of real maps");
        return;
    };
    let mut checked = 0;
    for name in ["turtlebot3/map.yaml", "aws_small_house/map.yaml", "utexas_bwi/gdc_3.yaml"] {
        let path = folder.join(name);
        if !path.exists() {
            eprintln!("SKIPPED: {} is not there", path.display());
            continue;
        }
        let options = LoadOptions { allow_outside: true, ..LoadOptions::default() };
        let grid = load(text(&path), &options).expect("a map").grid;
        let (world, graph) = options_graph(grid, RobotModel::limo(), OptionKind::Interface);
        check_edges(&world.grid, &graph, name);
        checked += 1;
    }
    assert!(checked > 0, "no map was found");
}

#[test]
fn an_edge_through_a_wall_would_be_seen() {
    let grid = OccupancyGrid::from_ascii(0.1, "...\n.#.\n...").expect("a drawing");
    let (a, b) = (grid.frame().to_grid(Point::new(0.05, 0.15)), grid.frame().to_grid(Point::new(0.25, 0.15)));
    assert!(meets(a, b, 1.0, 1.0) && !meets(a, b, 1.0, 0.0), "the test of edges sees walls");
}
