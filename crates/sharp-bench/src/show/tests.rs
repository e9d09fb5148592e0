//! The page as data: what its JSON says of the plan and its drives.

use std::sync::Arc;

use serde_json::Value;
use sharp_drive::{EpisodeEnd, SuccessCount, World};
use sharp_plan::{Answer, Method, Query, Recording, Sharp, Tour};
use sharp_regions::GeometricDetector;
use sharp_sim::RobotModel;
use sharp_space::{GridFrame, OccupancyGrid, Point, Pose, Seed};

use super::*;

/// A plan through two rooms on a map that is turned and shifted.
pub(super) fn tour() -> Tour {
    let rooms = "
        ###################################
        #................#................#
        #................#................#
        #.................................#
        #.................................#
        #.................................#
        #.................................#
        #................#................#
        #................#...............?#
        ###################################";
    let drawn = OccupancyGrid::from_ascii(0.4, rooms).expect("a sound drawing");
    let frame = GridFrame { origin: Pose::new(-3.0, 2.0, 0.5), ..*drawn.frame() };
    let grid = OccupancyGrid::new(frame, drawn.cells().to_vec()).expect("the same cells");
    let world = World::new(grid, RobotModel::husky());
    let method = Method::prior().with_episodes(50, 50, 50);
    let mut sharp = Sharp::new(world, GeometricDetector::default()).with_method(method);
    let at = |x: f64, y: f64| {
        Pose::at(frame.origin.to_world(sharp_space::Vector::new(x, y)), frame.origin.heading)
    };
    let query = Query { start: at(1.4, 2.0), goal: at(12.4, 2.4) };
    let Ok(Answer::Solved(plan)) = sharp.solve(query, &()) else { panic!("there is a way") };
    Arc::new(*plan).into()
}

/// Thirty drives that may last `time_limit_s`.
pub(super) fn recorded(tour: &Tour, time_limit_s: f64) -> Vec<Recording> {
    let mut settings = tour.run_settings(30, Seed(1));
    settings.time_limit_s = time_limit_s;
    tour.record(&settings, &|| 0.0)
}

pub(super) fn page(tour: &Tour, recordings: &[Recording]) -> String {
    let shown = PlanPage { map: "two </script> rooms", tour, recordings, library: None };
    shown.to_html().expect("a page")
}

/// The numbers in `page`.
fn data(page: &str) -> Value {
    let data = page.split("id=\"data\">").nth(1).expect("an element with data");
    serde_json::from_str(data.split("</script>").next().expect("its end")).expect("JSON")
}

fn is_near(place: &Value, point: Point) -> bool {
    let coordinate = |index: usize| place[index].as_f64().expect("a number");
    (coordinate(0) - point.x).abs() < 0.006 && (coordinate(1) - point.y).abs() < 0.006
}

#[test]
fn the_page_holds_the_plan_and_its_drives() {
    let tour = tour();
    let recordings = recorded(&tour, 60.0);
    let data = data(&page(&tour, &recordings));
    let plan = &tour.plans[0];
    assert_eq!(data["schema"], "sharp.show/1");
    assert_eq!(data["map"]["name"], "two </script> rooms");
    assert_eq!((&data["map"]["width"], &data["map"]["height"]), (&35.into(), &10.into()));
    assert!(is_near(&data["map"]["origin"], Point::new(-3.0, 2.0)), "{}", data["map"]["origin"]);
    assert!(is_near(&data["goals"][0], plan.solution.query.goal.position), "{}", data["goals"]);
    assert_eq!(data["predicted"]["success"], plan.solution.predicted.rate());
    let (options, states) = (plan.abstraction.options.options(), &plan.abstraction.states);
    assert_eq!(data["options"].as_array().map(Vec::len), Some(options.len()), "all options");
    assert_eq!(data["states"].as_array().map(Vec::len), Some(states.regions().len()), "all states");
    let legs = data["legs"].as_array().expect("legs");
    assert_eq!(legs.len(), plan.solution.steps.len(), "all legs");
    for (leg, step) in legs.iter().zip(&plan.solution.steps) {
        assert_eq!(leg["option"], step.option.id.to_string());
        assert_eq!(leg["on_arrival"]["successes"], step.on_arrival.successes);
        let guide = leg["guide"].as_array().expect("a guide");
        assert_eq!(guide.len(), step.option.guide.poses().len(), "every pose");
        let poses = step.option.guide.poses();
        assert!(guide.iter().zip(poses).all(|(place, pose)| is_near(place, pose.position)), "{leg}");
        let room = leg["tightest"]["beside_m"].as_f64().expect("a room");
        assert!(room < 1.0 && leg["tightest"]["at"][0].is_number(), "{leg}");
    }
    let drives = data["drives"].as_array().expect("drives");
    assert!(drives.len() >= 20, "{} drives", drives.len());
    for (drive, recording) in drives.iter().zip(&recordings).take(20) {
        let moments = drive["moments"].as_array().expect("moments");
        assert_eq!(moments.len(), recording.moments.len(), "short drives are whole");
        let last = recording.moments.last().expect("at least one");
        let shown = &moments[moments.len() - 1];
        let place = Value::from(vec![shown[1].clone(), shown[2].clone()]);
        assert!(is_near(&place, last.state.pose.position), "{shown}");
        let is_reached = recording.execution.end == EpisodeEnd::Reached;
        assert_eq!(drive["end"] == "reached", is_reached, "{}", drive["end"]);
    }
}

#[test]
fn failures_are_told_with_their_place_and_leg() {
    let tour = tour();
    let recordings = recorded(&tour, 4.0);
    let data = data(&page(&tour, &recordings));
    assert_eq!((&data["runs"]["episodes"], &data["runs"]["timed_out"]), (&30.into(), &30.into()));
    assert_eq!(data["drives"].as_array().map(Vec::len), Some(30), "the first and those that failed");
    let weak = data["weak"].as_array().expect("weak places");
    let words: Vec<&str> = weak.iter().filter_map(|place| place["words"].as_str()).collect();
    let first = tour.plans[0].solution.steps[0].option.id.to_string();
    assert!(
        words[0].starts_with(&format!("{first}: "))
            && words[0].contains("of 30 drives ran out of time near ("),
        "{words:?}"
    );
    assert_eq!((&weak[0]["leg"], &weak[0]["failed"]), (&0.into(), &true.into()));
    let end = recordings[0].moments.last().expect("a moment").state.pose.position;
    let place = &weak[0]["at"];
    let at = Point::new(place[0].as_f64().expect("x"), place[1].as_f64().expect("y"));
    let off_m = (at - end).norm();
    assert!(off_m < 2.0, "{off_m} m from where the first drive ended");
    assert!(words[words.len() - 1].starts_with("Tightest place: "), "{words:?}");
    let counts = words.iter().filter(|words| words.contains("runs of the verification")).count();
    assert!(counts <= tour.plans[0].solution.steps.len(), "once for each leg: {words:?}");
}

#[test]
fn where_nothing_fails_the_page_says_so() {
    let mut tour = tour();
    let mut plan = (*tour.plans[0]).clone();
    plan.solution.steps.iter_mut().for_each(|step| step.on_arrival.successes = step.on_arrival.episodes);
    tour.plans = vec![Arc::new(plan)];
    let data = data(&page(&tour, &[]));
    let words = data["weak"][0]["words"].as_str().expect("words");
    assert_eq!(words, "No leg failed, neither in the runs of the verification nor in 0 drives.");
}

// Odds that were composed were told as runs of a verification that never was.
#[test]
fn composed_odds_are_told_as_such_and_without_counts() {
    let mut tour = tour();
    let mut plan = (*tour.plans[0]).clone();
    plan.solution.composed = Some(plan.solution.odds());
    plan.solution.steps[0].on_arrival = SuccessCount { episodes: 100, successes: 98 };
    tour.plans = vec![Arc::new(plan)];
    let recordings = recorded(&tour, 60.0);
    let data = data(&page(&tour, &recordings));
    assert_eq!(
        (&data["predicted"]["basis"], &data["legs"][0]["basis"]),
        (&"composed".into(), &"composed".into())
    );
    assert_eq!(data["library"], false, "there is none to ask");
    let weak = data["weak"].as_array().expect("weak places");
    let words: Vec<&str> = weak.iter().filter_map(|place| place["words"].as_str()).collect();
    assert!(words.iter().any(|words| words.contains("fails in 2.0 %, composed")), "{words:?}");
    assert!(words.iter().all(|words| !words.contains("verification")), "{words:?}");
}

#[test]
fn the_page_is_whole_and_small_and_equal_input_gives_equal_bytes() {
    let tour = tour();
    let recordings = recorded(&tour, 60.0);
    let html = page(&tour, &recordings);
    for foreign in ["{{", "src=\"", "http:", "https:", "url(", "@import", "fetch(", "two </script>"] {
        assert!(!html.contains(foreign), "the page has {foreign}");
    }
    assert!(html.contains("<title>husky on two &lt;/script&gt; rooms</title>"), "the title is escaped");
    assert!(html.len() < 200_000, "{} bytes", html.len());
    assert_eq!(html, page(&tour, &recordings));
}
