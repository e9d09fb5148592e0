//! `sharp robot` as a user meets it.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

fn sharp(folder: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_sharp"))
        .args(args)
        .current_dir(folder)
        .output()
        .expect("the binary runs")
}

fn json(output: &Output) -> Value {
    let text = String::from_utf8_lossy(&output.stdout);
    serde_json::from_str(&text)
        .unwrap_or_else(|e| panic!("{e} in {text:?}, {}", String::from_utf8_lossy(&output.stderr)))
}

const PARAMETERS: &str = "
controller_server:
  ros__parameters:
    FollowPath:
      plugin: dwb_core::DWBLocalPlanner
      max_vel_x: 0.4
      max_vel_theta: 1.2
local_costmap:
  local_costmap:
    ros__parameters:
      footprint: \"[[0.3, 0.2], [0.3, -0.2], [-0.1, -0.2], [-0.1, 0.2]]\"
";

#[test]
fn a_robot_is_imported_shown_and_used() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("nav2.yaml"), PARAMETERS).expect("a file");
    let imported = json(&sharp(folder.path(), &["robot", "import", "nav2.yaml", "--json"]));
    assert_eq!(imported["schema"], "sharp.robot.import/1");
    assert_eq!((&imported["name"], &imported["file"]), (&"nav2".into(), &"nav2.ron".into()));
    assert!(imported["found"].as_array().is_some_and(|found| found.len() == 4), "{imported}");
    let shown = json(&sharp(folder.path(), &["robot", "show", "nav2.ron", "--json"]));
    assert_eq!(shown["robot"]["max_speed_mps"], 0.4, "{shown}");
    assert_eq!(shown["robot"]["footprint"]["corners"].as_array().map(Vec::len), Some(4), "{shown}");
    let again = sharp(folder.path(), &["robot", "import", "nav2.yaml"]);
    let message = String::from_utf8_lossy(&again.stderr).into_owned();
    assert!(again.status.code() == Some(2) && message.contains("exists already"), "{message}");
    let other = sharp(folder.path(), &["robot", "import", "nav2.yaml", "--out", "b.ron", "--name", "b"]);
    let text = String::from_utf8_lossy(&other.stdout).into_owned();
    assert!(other.status.success() && text.contains("next: sharp solve MAP --robot b.ron"), "{text}");
    let check = json(&sharp(folder.path(), &["map", "check", "a", "--robot", "b.ron", "--json"]));
    assert_eq!((&check["robot"], &check["passable"]), (&"b".into(), &true.into()), "{check}");
}

// The parameters were replaced by the robot, and were blamed for flags that no robot could have.
#[test]
fn an_import_spares_its_input_and_names_the_flag_that_is_wrong() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("nav2.yaml"), PARAMETERS).expect("a file");
    for (flag, value, says) in [
        ("--out", "./nav2.yaml", "--out would overwrite nav2.yaml"),
        ("--max-speed", "nan", "--max-speed is NaN, must be above 0"),
        ("--max-speed", "0", "--max-speed is 0.0, must be above 0"),
        ("--max-speed", "-1", "--max-speed is -1.0, must be above 0"),
        ("--name", "a/b", "--name: robot name is \"a/b\""),
    ] {
        let refused = sharp(folder.path(), &["robot", "import", "nav2.yaml", flag, value]);
        let said = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert_eq!(refused.status.code(), Some(2), "{flag} {value}: {said}");
        assert!(said.contains(says), "{flag} {value}: {said}");
    }
    let kept = fs::read_to_string(folder.path().join("nav2.yaml")).expect("still there");
    assert_eq!(kept, PARAMETERS, "the input is as it was");
}

#[test]
fn built_in_robots_are_listed_and_known_in_any_case() {
    let folder = tempfile::tempdir().expect("a folder");
    let list = json(&sharp(folder.path(), &["robot", "list", "--json"]));
    let names: Vec<&str> = list["robots"]
        .as_array()
        .expect("a list")
        .iter()
        .filter_map(|robot| robot["name"].as_str())
        .collect();
    assert_eq!(names, ["husky", "limo", "turtlebot3", "jackal", "car"]);
    for name in ["Husky", "TURTLEBOT3"] {
        let check = json(&sharp(folder.path(), &["map", "check", "a", "--robot", name, "--json"]));
        assert_eq!(check["robot"], name.to_lowercase(), "{check}");
    }
    let unknown = sharp(folder.path(), &["robot", "show", "tank", "--json"]);
    assert_eq!(
        (unknown.status.code(), &json(&unknown)["error"]["code"]),
        (Some(2), &"FILE_UNREADABLE".into())
    );
}

#[test]
fn the_robot_files_of_the_documents_are_read() {
    let folder = tempfile::tempdir().expect("a folder");
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/robots.md");
    let page = fs::read_to_string(page).expect("the page");
    let files: Vec<&str> =
        page.split("```ron\n").skip(1).filter_map(|rest| rest.split("```").next()).collect();
    assert_eq!(files.len(), 2, "examples of the page");
    for text in files {
        fs::write(folder.path().join("mine.ron"), text).expect("a file");
        let shown = json(&sharp(folder.path(), &["robot", "show", "mine.ron", "--json"]));
        assert_eq!(shown["robot"]["name"], "mine", "{text}");
    }
}
