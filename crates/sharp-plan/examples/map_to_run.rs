//! From a map to a run: regions by geometry, the prior as policy, twenty drives.

use std::sync::Arc;

use sharp_drive::World;
use sharp_plan::{Answer, Method, Query, RunSettings, Sharp, run, success};
use sharp_regions::GeometricDetector;
use sharp_sim::RobotModel;
use sharp_space::{OccupancyGrid, Pose, Seed};

fn main() {
    let rooms = "
        ###################################
        #................#................#
        #................#................#
        #.................................#
        #.................................#
        #.................................#
        #.................................#
        #................#................#
        #................#................#
        ###################################";
    let grid = OccupancyGrid::from_ascii(0.4, rooms).expect("a sound drawing");
    let world = World::new(grid, RobotModel::husky());
    let mut sharp = Sharp::new(world, GeometricDetector::default()).with_method(Method::prior());
    let query = Query { start: Pose::new(1.4, 2.0, 0.0), goal: Pose::new(12.4, 2.4, 0.0) };
    let Ok(Answer::Solved(plan)) = sharp.solve(query, &()) else { panic!("there is a way") };
    let plan = Arc::new(*plan);
    let executions = run(&plan, &RunSettings::new(&plan, 20, Seed(2)), &|| 0.0);
    println!("predicted {:.3}, {:?} drives", plan.solution.predicted.rate(), success(&executions));
    assert!(success(&executions).successes >= 17, "an easy door");
}
