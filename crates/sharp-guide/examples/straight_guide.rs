//! A guide planner of one's own: it tries the straight line and nothing else.
//!
//! `cargo run --release -p sharp-guide --example straight_guide`

use sharp_guide::conformance::check_guide_planner;
use sharp_guide::{GuideEnd, GuidePath, GuidePlanner, GuideRequest, GuideRobot, NoGuide, Steering};
use sharp_space::{Footprint, FootprintChecker, Heading, OccupancyGrid, Point, Pose, Seed, Stream, trig};

/// Largest gap between two poses, metres.
const SPACING_M: f64 = 0.1;

/// Drives straight from start to goal, after a turn in place where that is needed.
#[derive(Debug)]
struct StraightGuide;

impl GuidePlanner for StraightGuide {
    fn plan(
        &self,
        request: &GuideRequest<'_>,
        robot: &GuideRobot<'_>,
        _rng: &mut Stream,
    ) -> Result<GuidePath, NoGuide> {
        let (from, to) = (request.start.position, request.goal.position);
        let way = to - from;
        if request.start.heading.is_some() && robot.steering != Steering::RotateTranslate {
            return Err(NoGuide::LeadIn(from));
        }
        let heading = Heading::new(trig::atan2(way.y, way.x));
        let steps = (way.norm() / (0.9 * SPACING_M)).ceil().max(1.0) as u32;
        let pose = |i| Pose::at(from + way * (f64::from(i) / f64::from(steps)), heading);
        let poses: Vec<Pose> = (0..=steps).map(pose).collect();
        let frame = robot.geometry.clearance().frame();
        for pose in &poses {
            if !robot.geometry.is_free(*pose) {
                return Err(NoGuide::Footprint(pose.position));
            }
            if !frame.cell_at(pose.position).is_some_and(request.allowed) {
                return Err(NoGuide::Astray(pose.position));
            }
        }
        GuidePath::new(poses, SPACING_M).map_err(|_| NoGuide::NoLength(from))
    }
}

fn main() {
    assert_eq!(check_guide_planner(&StraightGuide), Ok(()));
    let grid = OccupancyGrid::from_ascii(0.5, &["....................."; 6].join("\n")).expect("a drawing");
    let checker = FootprintChecker::new(&grid, Footprint::rectangle(0.5, 0.335).expect("a sound outline"));
    let end = |x| GuideEnd { position: Point::new(x, 1.5), heading: None };
    let request = GuideRequest { start: end(1.5), goal: end(8.5), allowed: &|_| true };
    let robot = GuideRobot::new(&checker, Steering::RotateTranslate);
    let guide = StraightGuide.plan(&request, &robot, &mut Seed(1).stream("guide", 0)).expect("an empty hall");
    assert!((guide.length_m() - 7.0).abs() < 1e-9, "{} m", guide.length_m());
}
