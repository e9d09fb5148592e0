//! Robots out of small files like those of real ones.

use super::*;

fn import(files: &[(&str, &str)], wishes: &ImportWishes) -> Result<ImportedRobot, ImportError> {
    let folder = tempfile::tempdir().expect("a folder");
    let paths: Vec<PathBuf> = files.iter().map(|(name, _)| folder.path().join(name)).collect();
    for (path, (_, text)) in paths.iter().zip(files) {
        fs::write(path, text).expect("a file");
    }
    let imported = import_robot(&paths, wishes)?;
    let again = RobotModel::from_ron(&imported.text).unwrap_or_else(|e| panic!("{e} in\n{}", imported.text));
    // Fuzzing found it: numbers are rounded in the file, and the robot had more digits.
    assert_eq!(again, imported.robot, "what is written is what was made\n{}", imported.text);
    Ok(imported)
}

fn plain(files: &[(&str, &str)]) -> ImportedRobot {
    import(files, &ImportWishes::default()).unwrap_or_else(|error| panic!("{error}"))
}

const ROUND: &str = "
controller_server:
  ros__parameters:
    FollowPath:
      plugin: \"dwb_core::DWBLocalPlanner\"
      min_vel_x: 0.0
      max_vel_x: 0.26
      max_vel_theta: 1.0
      acc_lim_x: 2.5
      acc_lim_theta: 3.2
      xy_goal_tolerance: 0.25
local_costmap:
  local_costmap:
    ros__parameters:
      robot_radius: 0.22
global_costmap:
  global_costmap:
    ros__parameters:
      robot_radius: 0.3
";

const ACKERMANN: &str = "
controller_server:
  ros__parameters:
    FollowPath:
      plugin: nav2_mppi_controller::MPPIController
      motion_model: Ackermann
      vx_max: 1.5
      wz_max: 1.9
      AckermannConstraints:
        min_turning_r: 0.8
local_costmap:
  local_costmap:
    ros__parameters:
      footprint: \"[ [0.5, 0.3], [0.5, -0.3], [-0.1, -0.3], [-0.1, 0.3] ]\"
      footprint_padding: 0.02
";

const URDF: &str = r#"<robot name="pusher">
  <link name="base_footprint"/>
  <link name="base_link">
    <collision><origin xyz="0.1 0 0.1"/><geometry><box size="0.6 0.4 0.2"/></geometry></collision>
    <inertial><mass value="20"/><inertia izz="1.0"/></inertial>
  </link>
  <joint name="base" type="fixed"><parent link="base_footprint"/><child link="base_link"/>
    <origin xyz="0 0 0.05"/></joint>
  <link name="left_wheel"><collision><geometry><cylinder radius="0.1" length="0.04"/></geometry></collision></link>
  <link name="right_wheel"><collision><geometry><cylinder radius="0.1" length="0.04"/></geometry></collision></link>
  <joint name="left_wheel_joint" type="continuous"><parent link="base_link"/><child link="left_wheel"/>
    <origin xyz="0 0.22 0" rpy="-1.5707963 0 0"/><axis xyz="0 0 1"/><limit effort="1" velocity="8"/></joint>
  <joint name="right_wheel_joint" type="continuous"><parent link="base_link"/><child link="right_wheel"/>
    <origin xyz="0 -0.22 0" rpy="-1.5707963 0 0"/><axis xyz="0 0 1"/><limit effort="1" velocity="8"/></joint>
  <link name="caster_wheel"/>
  <joint name="caster_wheel_joint" type="continuous"><parent link="base_link"/><child link="caster_wheel"/>
    <origin xyz="0.35 0 0"/></joint>
</robot>"#;

#[test]
fn parameters_of_a_round_robot_with_a_dynamic_window_make_one_that_turns_in_place() {
    let imported = plain(&[("round.yaml", ROUND)]);
    let robot = &imported.robot;
    assert_eq!(robot.footprint, sharp_space::Footprint::disc(0.22).unwrap(), "the local costmap counts");
    assert!(robot.can_turn_in_place() && robot.name == "round", "{}", imported.text);
    let limits =
        [robot.max_speed_mps, robot.max_yaw_rate_radps, robot.max_accel_mps2, robot.max_yaw_accel_radps2];
    assert_eq!(limits, [0.26, 1.0, 2.5, 3.2]);
    assert_eq!(robot.goal_tolerance_m, 0.25);
    assert!(
        imported.warnings.iter().any(|warning| warning.contains("another footprint")),
        "{:?}",
        imported.warnings
    );
    assert!(imported.assumed.iter().any(|field| field.field == "mass_kg"), "the file knows no mass");
    assert!(imported.text.contains("max_speed_mps: 0.26, // controller_server."), "{}", imported.text);
}

#[test]
fn parameters_of_a_car_give_its_turning_radius() {
    let imported = plain(&[("car.yaml", ACKERMANN)]);
    let robot = &imported.robot;
    assert!((robot.min_turning_radius_m() - 0.8).abs() < 1e-3, "{robot:?}");
    // 0.64 m long with its padding, base_link 0.12 m from the stern: on the rear axle of a wheelbase of 0.384 m.
    assert_eq!(robot.wheelbase_m(), 0.384);
    assert!((robot.footprint.half_length_m() - (0.52 - 0.192)).abs() < 1e-9, "{robot:?}");
    assert_eq!(robot.footprint.half_width_m(), 0.32, "padded");
    assert!(imported.warnings.iter().any(|warning| warning.contains("rear axle")), "{:?}", imported.warnings);
    assert_eq!(robot.max_speed_mps, 1.5);
}

#[test]
fn lists_of_ros_one_and_two_files_of_one_robot_are_read_as_well() {
    let costmap =
        "footprint: [[-0.5, -0.33], [-0.5, 0.33], [0.5, 0.33], [0.5, -0.33]]\nfootprint_padding: 0.01\n";
    let planner = "DWAPlannerROS:\n  max_vel_x: 0.5\n  max_vel_rot: 1.0\n  acc_lim_x: 2.5\n";
    let robot = plain(&[("costmap.yaml", costmap), ("planner.yaml", planner)]).robot;
    assert_eq!(robot.footprint, sharp_space::Footprint::rectangle(0.51, 0.34).unwrap());
    assert_eq!((robot.max_speed_mps, robot.max_yaw_rate_radps), (0.5, 1.0));
}

#[test]
fn a_robot_description_gives_outline_wheels_and_speed() {
    let imported = plain(&[("pusher.urdf", URDF)]);
    let robot = &imported.robot;
    assert_eq!(robot.name, "pusher");
    assert_eq!(robot.drive, sharp_sim::Drive::Differential { track_m: 0.44, wheelbase_m: 0.0 });
    let sharp_space::FootprintShape::Polygon { corners } = robot.footprint.shape() else {
        panic!("the axle is not in the middle: {:?}", robot.footprint)
    };
    let reach =
        |of: fn(&sharp_space::Vector) -> f64| corners.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
    assert!((reach(|c| c.x) - 0.4).abs() < 1e-9 && (reach(|c| -c.x) - 0.2).abs() < 1e-9, "{corners:?}");
    assert!((reach(|c| c.y) - 0.24).abs() < 1e-3, "the wheels stand out: {corners:?}");
    assert_eq!((robot.max_speed_mps, robot.mass_kg), (0.8, 20.0));
}

#[test]
fn what_cannot_be_assumed_is_asked_for() {
    let none = ImportWishes::default();
    let no_speed = import(&[("a.yaml", "robot_radius: 0.2\n")], &none).expect_err("no speed").to_string();
    assert!(no_speed.contains("no top speed in") && no_speed.contains("--max-speed"), "{no_speed}");
    let wishes = ImportWishes { max_speed_mps: Some(1.0), is_car: Some(true), name: Some("kart".to_owned()) };
    let kart = import(&[("a.yaml", "robot_radius: 0.2\n")], &wishes).expect("enough").robot;
    assert_eq!((kart.name.as_str(), kart.can_turn_in_place(), kart.max_speed_mps), ("kart", false, 1.0));
    let no_outline = import(&[("a.yaml", "max_vel_x: 0.2\n")], &none).expect_err("no outline").to_string();
    assert!(no_outline.contains("no footprint in"), "{no_outline}");
    for (text, message) in [
        ("<robot xmlns:xacro=\"http://ros.org/wiki/xacro\"><xacro:arg name=\"a\"/></robot>", "xacro FILE"),
        ("<model/>", "begins with <model>"),
        ("<robot>", "is no valid XML"),
        ("a: [", "is no valid YAML"),
        ("robot_radius: 0.2\n---\nmax_vel_x: 1\n", "holds several YAML documents"),
        ("just words", "is neither URDF"),
        ("robot_radius: -1\nmax_vel_x: 1\n", "robot_radius: footprint radius_m is -1 m"),
        ("footprint: \"[[1, 2]]\"\nmax_vel_x: 1\n", "footprint: footprint has"),
        ("<robot><joint name=\"a\"><parent link=\"b\"/></joint></robot>", "joint \"a\" has no child"),
        (
            "<robot><link name=\"a\"/><joint><parent link=\"a\"/><child link=\"a\"/></joint></robot>",
            "has no end",
        ),
    ] {
        let error = import(&[("broken", text)], &none).expect_err(text).to_string();
        assert!(error.contains(message) && error.contains("broken"), "{text}: {error}");
    }
}
