//! Parameters of Nav2 and of `move_base`: footprint, limits and the kind of drive.
//!
//! Parameters are found by the last words of their path, because plugins have any names. Where several say the same,
//! the order of the tables below decides, and then the order of the file.

use sharp_space::Footprint;

use super::facts::{Fact, Facts, Quantity};
use super::yaml::Yaml;

/// A value with the keys that lead to it.
type Entry<'a> = (Vec<&'a str>, &'a Yaml);

/// The keys of each number, those that count most first. `*` stands for one word, a number in brackets for a place in
/// a list.
const KEYS: [(Quantity, &[&str]); 9] = [
    (
        Quantity::MaxSpeed,
        &[
            "vx_max",
            "desired_linear_vel",
            "max_vel_x",
            "max_speed_xy",
            "max_vel_trans",
            "v_linear_max",
            "max_velocity[0]",
            "linear.x.max_velocity",
        ],
    ),
    (
        Quantity::MaxAccel,
        &["ax_max", "max_linear_accel", "acc_lim_x", "max_accel[0]", "linear.x.max_acceleration"],
    ),
    (
        Quantity::MaxYawRate,
        &[
            "wz_max",
            "max_vel_theta",
            "rotate_to_heading_angular_vel",
            "max_vel_rot",
            "v_angular_max",
            "max_rotational_vel",
            "max_velocity[2]",
            "angular.z.max_velocity",
        ],
    ),
    (
        Quantity::MaxYawAccel,
        &[
            "az_max",
            "acc_lim_theta",
            "max_angular_accel",
            "acc_lim_th",
            "max_accel[2]",
            "angular.z.max_acceleration",
        ],
    ),
    (Quantity::GoalTolerance, &["xy_goal_tolerance"]),
    (Quantity::Track, &["wheel_separation", "wheel_track", "track_width"]),
    (Quantity::Wheelbase, &["wheelbase", "wheel_base"]),
    (Quantity::MaxSteer, &["max_steering_angle", "max_steer_angle"]),
    (
        Quantity::TurningRadius,
        &[
            "AckermannConstraints.min_turning_r",
            "min_turning_r",
            "minimum_turning_radius",
            "min_turning_radius",
        ],
    ),
];

/// Adds what the parameters in `text` say to `facts`.
pub(super) fn read(text: &str, facts: &mut Facts) -> Result<(), String> {
    let yaml = Yaml::parse(text)?;
    if !matches!(yaml, Yaml::Entries(_)) {
        return Err("is neither URDF nor a list of `key: value` lines, as a parameter file is".to_owned());
    }
    let mut entries = Vec::new();
    yaml.walk(&mut Vec::new(), &mut |path, value| entries.push((path.to_vec(), value)));
    let mut knows_any = footprint(&entries, facts)?;
    drive(&entries, facts);
    for (quantity, keys) in KEYS {
        // Nav2's planner has a turning radius for robots that turn in place as well.
        if quantity == Quantity::TurningRadius && facts.is_car.as_ref().is_some_and(|car| !car.value) {
            continue;
        }
        knows_any |= number(&entries, quantity, keys, facts);
    }
    if !knows_any {
        facts.warnings.push("a YAML file has no parameter that is known here".to_owned());
    }
    Ok(())
}

/// Whether `path` ends in the words of `key`.
fn ends_in(path: &[&str], key: &str) -> bool {
    let joined = path.join(".");
    joined == key || joined.ends_with(&format!(".{key}"))
}

/// Adds the number that counts most among `keys`, if it is not known yet; true if there is one.
fn number(entries: &[Entry<'_>], quantity: Quantity, keys: &[&str], facts: &mut Facts) -> bool {
    let found = keys.iter().find_map(|key| {
        let (name, place) = match key.split_once('[') {
            Some((name, place)) => (name, place.trim_end_matches(']').parse::<usize>().ok()),
            None => (*key, None),
        };
        entries.iter().filter(|(path, _)| ends_in(path, name)).find_map(|(path, value)| {
            let value = match (value, place) {
                (Yaml::List(list), Some(place)) => list.get(place)?.number()?,
                (value, None) => value.number()?,
                _ => return None,
            };
            (value > 0.0).then(|| (value, path.join(".")))
        })
    });
    let Some((value, source)) = found else { return false };
    facts.numbers.entry(quantity).or_insert(Fact { value, source });
    true
}

/// The outline of the local costmap, of the global one, or of any: a footprint counts more than a radius, as in Nav2.
/// True if there is one.
fn footprint(entries: &[Entry<'_>], facts: &mut Facts) -> Result<bool, String> {
    let is_text = |value: &Yaml| !matches!(value.text().trim(), "" | "[]");
    let outlines = in_costmaps(entries, "footprint").filter(|(_, value)| is_text(value));
    let mut outlines: Vec<(String, Footprint)> = outlines
        .map(|(path, value)| {
            let outline = Footprint::from_nav2(&value.text());
            outline
                .map(|outline| (path.join("."), outline))
                .map_err(|error| format!("{}: {error}", path.join(".")))
        })
        .collect::<Result<_, _>>()?;
    for (path, value) in in_costmaps(entries, "robot_radius") {
        let source = path.join(".");
        let radius_m =
            value.number().ok_or_else(|| format!("{source} is {:?}, must be metres", value.text()))?;
        outlines
            .push((source.clone(), Footprint::disc(radius_m).map_err(|error| format!("{source}: {error}"))?));
    }
    let Some((source, outline)) = outlines.first().cloned() else { return Ok(false) };
    let padding = in_costmaps(entries, "footprint_padding").next();
    let padding_m = padding.and_then(|(_, value)| value.number()).filter(|&padding_m| padding_m > 0.0);
    match padding_m.and_then(|padding_m| outline.grown(padding_m).ok().map(|grown| (padding_m, grown))) {
        Some((padding_m, grown)) => {
            facts.say_footprint(grown, format!("{source} with footprint_padding {padding_m}"));
        }
        None => facts.say_footprint(outline, source),
    }
    for (source, other) in &outlines[1..] {
        if *other != outlines[0].1 {
            let first = &outlines[0].0;
            facts.warnings.push(format!("{source} is another footprint than {first}, which counts"));
        }
    }
    Ok(true)
}

/// The values of `key`, those of local costmaps first.
fn in_costmaps<'a, 'b>(entries: &'b [Entry<'a>], key: &'b str) -> impl Iterator<Item = &'b Entry<'a>> {
    let is_local = |path: &[&str]| path.iter().any(|part| part.contains("local_costmap"));
    let of = move |local: bool| {
        entries.iter().filter(move |(path, _)| path.last() == Some(&key) && is_local(path) == local)
    };
    of(true).chain(of(false))
}

/// Whether it is a car, by what controllers and planners are told.
fn drive(entries: &[Entry<'_>], facts: &mut Facts) {
    for (path, value) in entries {
        let (source, value) = (path.join("."), value.text());
        let says = |is_car: bool, facts: &mut Facts| facts.say_drive(is_car, format!("{source}: {value}"));
        if ends_in(path, "motion_model") {
            match value.to_ascii_lowercase().as_str() {
                "ackermann" => says(true, facts),
                "diffdrive" | "diff" => says(false, facts),
                "omni" => {
                    says(false, facts);
                    facts
                        .warnings
                        .push(format!("{source} is Omni: here the robot only turns and drives ahead"));
                }
                _ => {}
            }
        }
        if ends_in(path, "use_rotate_to_heading") {
            says(value == "false", facts);
        }
        let is_controller = ends_in(path, "plugin") || ends_in(path, "type");
        let turns = ["DWBLocalPlanner", "RotationShimController", "DiffDriveController"];
        if is_controller && turns.iter().any(|name| value.contains(name)) {
            says(false, facts);
        }
        if is_controller && value.contains("AckermannSteeringController") {
            says(true, facts);
        }
    }
    let of_car =
        |path: &[&str]| ends_in(path, "minimum_turning_radius") || ends_in(path, "min_turning_radius");
    let radius = entries.iter().find(|(path, value)| of_car(path) && value.number().is_some_and(|r| r > 0.0));
    if let Some((path, _)) = radius {
        facts.say_drive(true, format!("{}, and nothing that turns in place", path.join(".")));
    }
    // ROS 1's planners turn in place.
    if let Some((path, _)) = entries.iter().find(|(path, _)| ends_in(path, "DWAPlannerROS.max_vel_x")) {
        facts.say_drive(false, path.join("."));
    }
}
