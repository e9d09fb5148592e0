//! From what was found to a robot file with comments.

use std::fmt::Write as _;
use std::path::PathBuf;

use sharp_sim::RobotModel;
use sharp_space::{Footprint, FootprintShape, Vector, trig};

use super::facts::{Fact, Facts, Quantity};
use super::urdf::URDF_OUTLINE;
use super::{ImportError, ImportedField, ImportedRobot, listed};

/// The wheelbase of a car that does not say, as a share of its length.
const WHEELBASE_SHARE: f64 = 0.6;
/// The steering angle of a car that does not say, radians: 28 degrees.
const STEER_RAD: f64 = 0.5;
/// The largest steering angle that a robot file may have, radians.
const STEER_MAX_RAD: f64 = 1.4;

/// The fields of a robot file whose value is one number, with the quantity that says it and the field's default in
/// words.
const NUMBERS: [(&str, Option<Quantity>, &str); 10] = [
    ("max_accel_mps2", Some(Quantity::MaxAccel), "the top speed in a third of a second, at most 3 m/s²"),
    ("max_yaw_rate_radps", Some(Quantity::MaxYawRate), "what the wheels allow at top speed"),
    ("max_yaw_accel_radps2", Some(Quantity::MaxYawAccel), "three times the yaw rate in a second"),
    ("goal_tolerance_m", Some(Quantity::GoalTolerance), "at least 0.3 m, more for a large robot"),
    ("mass_kg", Some(Quantity::Mass), "70 kg for a square metre of robot"),
    ("yaw_inertia_kgm2", Some(Quantity::YawInertia), "mass spread evenly over the footprint"),
    ("wheel_friction", None, "rubber on a hard floor"),
    ("min_speed_mps", None, "0, for a car a tenth of its top speed"),
    ("waypoint_reach_m", None, "half a second at top speed, at least 0.5 m"),
    ("recovery_reverse_m", None, "how far it backs off from a wall; 0 if it never reverses"),
];

/// Writes the robot file of what `files` say.
pub(super) fn robot(name: &str, files: &[PathBuf], mut facts: Facts) -> Result<ImportedRobot, ImportError> {
    let missing = |what, remedy| ImportError::Missing { what, files: listed(files), remedy };
    let Some(outline) = facts.footprint.clone() else {
        let remedy =
            "a Nav2 costmap has footprint or robot_radius, a URDF collision shapes; name that file as well";
        return Err(missing("footprint", remedy));
    };
    let Some(speed) = facts.numbers.get(&Quantity::MaxSpeed).cloned() else {
        let remedy = "a Nav2 controller has max_vel_x, vx_max or desired_linear_vel; name that file as well, or give \
                      --max-speed M/S";
        return Err(missing("top speed", remedy));
    };
    let mut parts = RobotLines::default();
    let drive = drive(&outline.value, &facts);
    let outline = around_the_middle(outline, &drive, &mut facts);
    parts.found("footprint", outline_text(&outline.value), &outline.source);
    parts.fields.push(drive.field);
    parts.found("max_speed_mps", number_text(speed.value), &speed.source);
    let mut numbers = numbers(&facts, &mut parts, &mut Vec::new());
    // An inertia that no body of that mass and those wheels has was a guess of the description's author.
    let complete = |parts: &RobotLines| RobotModel::from_ron(&parts.bare(name));
    let robot = complete(&parts).or_else(|error| {
        if facts.numbers.remove(&Quantity::YawInertia).is_none() {
            return Err(error);
        }
        facts.warnings.push(format!("the moment of inertia of the description is not used: {error}"));
        parts.fields.retain(|field| field.field != "yaw_inertia_kgm2");
        numbers.push("yaw_inertia_kgm2");
        complete(&parts)
    });
    let refused = |source| ImportError::Robot { files: listed(files), source };
    let robot = robot.map_err(refused)?;
    for (field, _, why) in NUMBERS.iter().filter(|(field, ..)| numbers.contains(field)) {
        parts.assumed(field, number_text(value_of(&robot, field)), why);
    }
    let text = parts.text(name, files);
    // As whoever reads the file gets it: numbers are rounded there.
    let robot = RobotModel::from_ron_named(&text, name).map_err(refused)?;
    let (assumed, found): (Vec<_>, Vec<_>) = parts.fields.into_iter().partition(|field| field.assumed);
    let finding =
        |field: Field| ImportedField { field: field.field, value: field.value, source: field.source };
    Ok(ImportedRobot {
        robot,
        text,
        found: found.into_iter().map(finding).collect(),
        assumed: assumed.into_iter().map(finding).collect(),
        warnings: facts.warnings,
    })
}

/// A line of the robot file.
struct Field {
    field: &'static str,
    value: String,
    source: String,
    assumed: bool,
}

#[derive(Default)]
struct RobotLines {
    fields: Vec<Field>,
}

impl RobotLines {
    fn found(&mut self, field: &'static str, value: String, source: &str) {
        self.fields.push(Field { field, value, source: source.to_owned(), assumed: false });
    }

    fn assumed(&mut self, field: &'static str, value: String, source: &str) {
        self.fields.push(Field { field, value, source: source.to_owned(), assumed: true });
    }

    /// The fields alone, for the reader of robot files.
    fn bare(&self, name: &str) -> String {
        let fields: String = self.fields.iter().map(|f| format!("{}: {},\n", f.field, f.value)).collect();
        format!("RobotModel(\nname: {name:?},\n{fields})")
    }

    fn text(&self, name: &str, files: &[PathBuf]) -> String {
        let one_line = |text: &str| text.replace(['\n', '\r'], " ");
        let names = files.iter().filter_map(|file| file.file_name());
        let names: Vec<_> = names.map(|name| name.to_string_lossy()).collect();
        let mut text = format!("// Made by `sharp robot import` of {}.\n", one_line(&names.join(", ")));
        let _ = writeln!(text, "RobotModel(\n    name: {name:?},");
        for field in self.fields.iter().filter(|field| !field.assumed) {
            let _ = writeln!(text, "    {}: {}, // {}", field.field, field.value, one_line(&field.source));
        }
        let _ = writeln!(text, "    // Assumed, because the files do not say; change what you know better.");
        for field in self.fields.iter().filter(|field| field.assumed) {
            let _ = writeln!(text, "    {}: {}, // {}", field.field, field.value, one_line(&field.source));
        }
        text + ")\n"
    }
}

/// The line of the drive.
struct DriveLine {
    field: Field,
    /// The wheelbase of a car, metres.
    car_wheelbase_m: Option<f64>,
}

/// A car whose footprint lies ahead of `base_link` has it on its rear axle, as is usual; here poses are those of the
/// middle between the axles.
fn around_the_middle(outline: Fact<Footprint>, drive: &DriveLine, facts: &mut Facts) -> Fact<Footprint> {
    let (Some(wheelbase_m), FootprintShape::Polygon { corners }) =
        (drive.car_wheelbase_m, outline.value.shape())
    else {
        return outline;
    };
    let reach_m = |sign: f64| corners.iter().map(|corner| sign * corner.x).fold(f64::NEG_INFINITY, f64::max);
    if outline.source.starts_with(URDF_OUTLINE) || reach_m(1.0) < reach_m(-1.0) + 0.5 * wheelbase_m {
        return outline;
    }
    let shift = Vector::new(0.5 * wheelbase_m, 0.0);
    let shifted: Vec<Vector> = corners.iter().map(|corner| corner - shift).collect();
    let Ok(value) = Footprint::polygon(&shifted) else { return outline };
    facts.warnings.push(format!(
        "the footprint reaches far ahead, so base_link is taken to be on the rear axle: poses of this robot are those \
         of the middle between its axles, {:.3} m ahead of base_link",
        shift.x
    ));
    Fact { value, source: format!("{}, around the middle between the axles", outline.source) }
}

/// The drive: what is known of it, completed with what is usual.
fn drive(outline: &Footprint, facts: &Facts) -> DriveLine {
    let number = |quantity| facts.number(quantity);
    let mut sources: Vec<String> = Vec::new();
    let is_car = match &facts.is_car {
        Some(car) => {
            sources.push(car.source.clone());
            car.value
        }
        None => {
            sources.push("assumed to turn in place".to_owned());
            false
        }
    };
    let mut told = |what: &str, quantity: Quantity| {
        facts.numbers.get(&quantity).map(|fact| {
            sources.push(format!("{what} from {}", fact.source));
            fact.value
        })
    };
    let track = told("track", Quantity::Track);
    let mut words: Vec<String> =
        track.iter().map(|track_m| format!("track_m: {}", number_text(*track_m))).collect();
    let mut car_wheelbase_m = None;
    if is_car {
        let wheelbase_m = told("wheelbase", Quantity::Wheelbase).filter(|&wheelbase_m| wheelbase_m > 0.0);
        let radius_m = told("turning radius", Quantity::TurningRadius);
        let wheelbase_m = wheelbase_m.unwrap_or_else(|| {
            sources.push("wheelbase assumed".to_owned());
            1e-3 * (WHEELBASE_SHARE * length_m(outline) * 1e3).round()
        });
        let steer_rad = number(Quantity::MaxSteer).unwrap_or_else(|| {
            let of_radius = radius_m.map(|radius_m| trig::atan2(wheelbase_m, radius_m));
            sources.push(
                if of_radius.is_some() { "steering angle of that radius" } else { "steering angle assumed" }
                    .to_owned(),
            );
            of_radius.unwrap_or(STEER_RAD)
        });
        car_wheelbase_m = Some(wheelbase_m);
        words.insert(0, format!("wheelbase_m: {}", number_text(wheelbase_m)));
        words.push(format!("max_steer_rad: {}", number_text(steer_rad.min(STEER_MAX_RAD))));
        if let Some(rate_radps) = number(Quantity::SteerRate).filter(|&rate_radps| rate_radps <= 100.0) {
            words.push(format!("steer_rate_radps: {}", number_text(rate_radps)));
        }
    } else if let Some(wheelbase_m) =
        told("wheelbase", Quantity::Wheelbase).filter(|&length_m| length_m > 0.0)
    {
        words.push(format!("wheelbase_m: {}", number_text(wheelbase_m)));
    }
    let kind = if is_car { "Ackermann" } else { "Differential" };
    let value = format!("{kind}({})", words.join(", "));
    let field = Field { field: "drive", value, source: sources.join("; "), assumed: facts.is_car.is_none() };
    DriveLine { field, car_wheelbase_m }
}

fn length_m(outline: &Footprint) -> f64 {
    match outline.shape() {
        FootprintShape::Polygon { corners } => {
            let ahead = corners.iter().map(|corner| corner.x).fold(f64::NEG_INFINITY, f64::max);
            let behind = corners.iter().map(|corner| corner.x).fold(f64::INFINITY, f64::min);
            ahead - behind
        }
        _ => 2.0 * outline.half_length_m(),
    }
}

/// Adds the numbers that are known and returns the fields of the others.
fn numbers(facts: &Facts, parts: &mut RobotLines, unknown: &mut Vec<&'static str>) -> Vec<&'static str> {
    for &(field, quantity, _) in &NUMBERS {
        match quantity.and_then(|quantity| facts.numbers.get(&quantity)) {
            Some(fact) => parts.found(field, number_text(fact.value), &fact.source),
            None => unknown.push(field),
        }
    }
    std::mem::take(unknown)
}

fn value_of(robot: &RobotModel, field: &str) -> f64 {
    match field {
        "max_accel_mps2" => robot.max_accel_mps2,
        "max_yaw_rate_radps" => robot.max_yaw_rate_radps,
        "max_yaw_accel_radps2" => robot.max_yaw_accel_radps2,
        "goal_tolerance_m" => robot.goal_tolerance_m,
        "mass_kg" => robot.mass_kg,
        "yaw_inertia_kgm2" => robot.yaw_inertia_kgm2,
        "wheel_friction" => robot.wheel_friction,
        "min_speed_mps" => robot.min_speed_mps,
        "waypoint_reach_m" => robot.waypoint_reach_m,
        _ => robot.recovery_reverse_m,
    }
}

/// The outline as robot files write it.
fn outline_text(outline: &Footprint) -> String {
    match outline.shape() {
        FootprintShape::Disc { radius_m } => format!("(radius_m: {})", number_text(radius_m)),
        FootprintShape::Polygon { corners } => {
            let corner = |corner: &Vector| format!("({}, {})", number_text(corner.x), number_text(corner.y));
            format!("(corners: [{}])", corners.iter().map(corner).collect::<Vec<_>>().join(", "))
        }
        _ => format!(
            "(half_length_m: {}, half_width_m: {})",
            number_text(outline.half_length_m()),
            number_text(outline.half_width_m())
        ),
    }
}

/// Six decimals, and at least one; upwards for very small numbers.
fn number_text(value: f64) -> String {
    let rounded = (value * 1e6).round() / 1e6;
    format!("{:?}", if rounded == 0.0 { value } else { rounded })
}
