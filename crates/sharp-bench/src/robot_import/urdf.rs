//! URDF: collision shapes, wheels, steering, masses and limits.
//!
//! All joints stand at zero. The footprint is the convex hull of all collision shapes seen from above, around the
//! middle between the wheels.

use std::collections::BTreeMap;

use roxmltree::{Document, Node};
use sharp_space::{Footprint, Vector, trig};

use super::facts::{Facts, Quantity};

/// The source of a footprint that is known around the middle between the wheels.
pub(super) const URDF_OUTLINE: &str = "collision shapes, seen from above";
/// Corners of the polygon around a round shape.
const ROUND_CORNERS: usize = 16;
/// Deeper chains of links are a loop.
const DEPTH_MAX: usize = 100;
/// Wheels nearer than this along the robot belong to one axle, metres.
const AXLE_WITHIN_M: f64 = 0.02;

/// Where a link is: a rotation and a shift in space.
#[derive(Clone, Copy, Debug)]
struct Frame {
    rows: [[f64; 3]; 3],
    at: [f64; 3],
}

/// A joint, as far as it matters here.
struct Joint<'a> {
    name: &'a str,
    kind: &'a str,
    parent: &'a str,
    child: &'a str,
    origin: Frame,
    axis: [f64; 3],
    /// Lower and upper limit, and velocity.
    limit: [Option<f64>; 3],
}

/// A wheel: where it is, how large, and how fast its joint turns.
#[derive(Clone, Copy, Debug)]
struct Wheel {
    at: [f64; 3],
    radius_m: Option<f64>,
    velocity_radps: Option<f64>,
    /// How far it steers to either side, radians, and how fast, radians per second.
    steers: Option<[Option<f64>; 2]>,
}

/// Adds what the robot description in `text` says to `facts`.
pub(super) fn read(text: &str, facts: &mut Facts) -> Result<(), String> {
    let document = Document::parse(text).map_err(|error| format!("is no valid XML: {error}"))?;
    let robot = document.root_element();
    if !robot.has_tag_name("robot") {
        let name = robot.tag_name().name();
        return Err(format!("begins with <{name}>, a robot description begins with <robot>"));
    }
    let is_xacro = |node: Node<'_, '_>| {
        node.tag_name().namespace().is_some_and(|space| space.contains("xacro"))
            || node.attributes().any(|attribute| attribute.value().contains("${"))
    };
    if robot.descendants().any(is_xacro) {
        return Err("is a xacro file: make a URDF of it first, with `xacro FILE > robot.urdf`".to_owned());
    }
    if facts.name.is_none() {
        facts.name = robot.attribute("name").map(str::to_owned);
    }
    let joints = joints(robot)?;
    let frames = frames(robot, &joints)?;
    let wheels = wheels(robot, &joints, &frames)?;
    let middle = drive(&wheels, facts);
    outline(robot, &frames, middle, facts)?;
    masses(robot, &frames, middle, facts)
}

fn joints<'a>(robot: Node<'a, '_>) -> Result<Vec<Joint<'a>>, String> {
    let of = |node: Node<'a, '_>| -> Result<Joint<'a>, String> {
        let name = node.attribute("name").unwrap_or_default();
        let link = |end: &str| {
            let link = child(node, end).and_then(|end| end.attribute("link"));
            link.ok_or_else(|| format!("joint {name:?} has no {end}"))
        };
        let limit = child(node, "limit");
        let of_limit = |key: &str| {
            limit.and_then(|limit| limit.attribute(key)).map(|text| number(key, text)).transpose()
        };
        Ok(Joint {
            name,
            kind: node.attribute("type").unwrap_or_default(),
            parent: link("parent")?,
            child: link("child")?,
            origin: origin(node)?,
            axis: match child(node, "axis").and_then(|axis| axis.attribute("xyz")) {
                Some(text) => triple("axis xyz", text)?,
                None => [1.0, 0.0, 0.0],
            },
            limit: [of_limit("lower")?, of_limit("upper")?, of_limit("velocity")?],
        })
    };
    robot.children().filter(|node| node.has_tag_name("joint")).map(of).collect()
}

/// Where each link is, as seen from `base_link`, or from the first link of all if there is none of that name.
fn frames<'a>(robot: Node<'a, '_>, joints: &[Joint<'a>]) -> Result<BTreeMap<&'a str, Frame>, String> {
    let names: Vec<&str> =
        robot.children().filter(|n| n.has_tag_name("link")).filter_map(|n| n.attribute("name")).collect();
    let from_root = |link: &'a str| -> Result<Frame, String> {
        let (mut link, mut chain) = (link, Vec::new());
        while let Some(joint) = joints.iter().find(|joint| joint.child == link) {
            chain.push(joint.origin);
            link = joint.parent;
            if chain.len() > DEPTH_MAX {
                return Err(format!("the chain of joints above link {link:?} has no end"));
            }
        }
        Ok(chain.iter().rev().fold(Frame::IDENTITY, |frame, origin| frame.then(origin)))
    };
    let base = names.iter().find(|&&name| name == "base_link").copied();
    let base = base.map(from_root).transpose()?.unwrap_or(Frame::IDENTITY).inverse();
    names.into_iter().map(|name| Ok((name, base.then(&from_root(name)?)))).collect()
}

fn wheels<'a>(
    robot: Node<'a, '_>,
    joints: &[Joint<'a>],
    frames: &BTreeMap<&'a str, Frame>,
) -> Result<Vec<Wheel>, String> {
    let is_wheel = |joint: &&Joint<'_>| {
        let named = |name: &str| name.to_ascii_lowercase().contains("wheel");
        let is_caster = |name: &str| name.to_ascii_lowercase().contains("caster");
        joint.kind == "continuous"
            && (named(joint.name) || named(joint.child))
            && !is_caster(joint.name)
            && !is_caster(joint.child)
    };
    let of = |joint: &Joint<'a>| -> Result<Wheel, String> {
        let frame = frames.get(joint.child).copied().unwrap_or(Frame::IDENTITY);
        // A hinge above the wheel that turns around the vertical.
        let upright = |hinge: &&Joint<'_>| {
            let axis = frames.get(hinge.child).copied().unwrap_or(Frame::IDENTITY).turn(hinge.axis);
            hinge.child == joint.parent && hinge.kind == "revolute" && axis[2].abs() > 0.9
        };
        let steers = joints.iter().find(upright).map(|hinge| {
            let furthest = hinge.limit[0].zip(hinge.limit[1]).map(|(low, high)| low.abs().min(high.abs()));
            [furthest, hinge.limit[2]]
        });
        Ok(Wheel {
            at: frame.at,
            radius_m: radius_of(robot, joint.child)?,
            velocity_radps: joint.limit[2],
            steers,
        })
    };
    joints.iter().filter(is_wheel).map(of).collect()
}

/// The radius of a link that is a cylinder or a ball.
fn radius_of(robot: Node<'_, '_>, link: &str) -> Result<Option<f64>, String> {
    let link =
        robot.children().find(|node| node.has_tag_name("link") && node.attribute("name") == Some(link));
    let shapes = link.into_iter().flat_map(|link| link.descendants());
    let radius = shapes
        .filter(|node| node.has_tag_name("cylinder") || node.has_tag_name("sphere"))
        .find_map(|node| node.attribute("radius"));
    radius.map(|text| number("radius", text)).transpose()
}

/// Says how the robot drives, and returns the middle between its wheels.
fn drive(wheels: &[Wheel], facts: &mut Facts) -> [f64; 2] {
    let furthest = |of: fn(&Wheel) -> f64| {
        let values = wheels.iter().map(of);
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), at| (low.min(at), high.max(at)))
    };
    let ((rear_m, front_m), (right_m, left_m)) =
        (furthest(|wheel| wheel.at[0]), furthest(|wheel| wheel.at[1]));
    if wheels.len() < 2 || left_m - right_m < 1e-3 {
        facts.warnings.push(
            "the robot description has no pair of wheels (continuous joints called wheel): its origin is taken as \
             the middle between them"
                .to_owned(),
        );
        return [0.0, 0.0];
    }
    let source = format!("{} wheel joints", wheels.len());
    facts.add(Quantity::Track, rounded(left_m - right_m), source.clone());
    let length_m = if front_m - rear_m < AXLE_WITHIN_M { 0.0 } else { rounded(front_m - rear_m) };
    facts.add(Quantity::Wheelbase, length_m, source.clone());
    let steering: Vec<[Option<f64>; 2]> = wheels.iter().filter_map(|wheel| wheel.steers).collect();
    let is_car = !steering.is_empty();
    facts.say_drive(is_car, if is_car { "joints that steer wheels".to_owned() } else { source });
    let least = |index: usize| {
        steering.iter().filter_map(|limits| limits[index]).filter(|&value| value > 0.0).reduce(f64::min)
    };
    if let Some(steer_rad) = least(0) {
        facts.add(Quantity::MaxSteer, steer_rad, "limit of the steering joints");
    }
    if let Some(rate_radps) = least(1) {
        facts.add(Quantity::SteerRate, rate_radps, "velocity of the steering joints");
    }
    let speeds = wheels.iter().filter_map(|wheel| Some(wheel.radius_m? * wheel.velocity_radps?));
    if let Some(speed_mps) = speeds.filter(|&speed| speed > 0.0 && speed < 20.0).reduce(f64::min) {
        facts.add(
            Quantity::MaxSpeed,
            rounded(speed_mps),
            "velocity of the wheel joints and radius of the wheels",
        );
    }
    [0.5 * (rear_m + front_m), 0.5 * (right_m + left_m)]
}

fn outline(
    robot: Node<'_, '_>,
    frames: &BTreeMap<&str, Frame>,
    middle: [f64; 2],
    facts: &mut Facts,
) -> Result<(), String> {
    let (mut points, mut meshes) = (Vec::new(), 0);
    for link in robot.children().filter(|node| node.has_tag_name("link")) {
        let name = link.attribute("name").unwrap_or_default();
        let frame = frames.get(name).copied().unwrap_or(Frame::IDENTITY);
        for collision in link.children().filter(|node| node.has_tag_name("collision")) {
            let place = frame.then(&origin(collision)?);
            match child(collision, "geometry").map(shape).transpose()?.flatten() {
                Some(shape) => points.extend(shape.into_iter().map(|point| place.place(point))),
                None => meshes += 1,
            }
        }
    }
    if meshes > 0 {
        facts.warnings.push(format!(
            "{meshes} collision shapes are meshes or unknown and are not in the footprint: compare it with the robot"
        ));
    }
    if points.is_empty() {
        return Ok(());
    }
    let seen: Vec<Vector> =
        points.iter().map(|point| Vector::new(point[0] - middle[0], point[1] - middle[1])).collect();
    let seen: Vec<Vector> =
        seen.iter().map(|corner| Vector::new(rounded(corner.x), rounded(corner.y))).collect();
    let outline = Footprint::polygon(&seen).or_else(|_| Footprint::polygon(&bounding(&seen)));
    let outline = outline.map_err(|error| format!("collision shapes: {error}"))?;
    facts.say_footprint(outline, URDF_OUTLINE);
    if middle.iter().any(|value| value.abs() > 1e-3) {
        facts.warnings.push(format!(
            "poses of this robot are those of the middle between its wheels, {:.3} m ahead and {:.3} m to the left of \
             base_link",
            middle[0], middle[1]
        ));
    }
    Ok(())
}

/// The corners of the rectangle along the axes around `points`.
fn bounding(points: &[Vector]) -> [Vector; 4] {
    let extent = |of: fn(&Vector) -> f64| {
        let values = points.iter().map(of);
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), at| (low.min(at), high.max(at)))
    };
    let ((x0, x1), (y0, y1)) = (extent(|point| point.x), extent(|point| point.y));
    [(x0, y0), (x1, y0), (x1, y1), (x0, y1)].map(|(x, y)| Vector::new(x, y))
}

/// Points whose hull is the shape; `None` for a mesh.
fn shape(geometry: Node<'_, '_>) -> Result<Option<Vec<[f64; 3]>>, String> {
    let attribute = |node: Node<'_, '_>, key: &str| {
        let text = node.attribute(key).ok_or_else(|| format!("a {} has no {key}", node.tag_name().name()))?;
        Ok::<String, String>(text.to_owned())
    };
    let round = |radius: f64, height: f64| {
        (0..2 * ROUND_CORNERS).map(move |index| {
            let (sin, cos) = trig::sin_cos(std::f64::consts::TAU * index as f64 / ROUND_CORNERS as f64);
            [radius * cos, radius * sin, if index < ROUND_CORNERS { height } else { -height }]
        })
    };
    let Some(node) = geometry.children().find(Node::is_element) else { return Ok(None) };
    Ok(Some(match node.tag_name().name() {
        "box" => {
            let [x, y, z] = triple("size", &attribute(node, "size")?)?.map(|side| 0.5 * side);
            let signs = [-1.0, 1.0];
            let corners = signs.iter().flat_map(|sx| signs.iter().map(move |sy| (sx, sy)));
            corners.flat_map(|(sx, sy)| signs.iter().map(move |sz| [sx * x, sy * y, sz * z])).collect()
        }
        "cylinder" => {
            let radius = number("radius", &attribute(node, "radius")?)?;
            round(radius, 0.5 * number("length", &attribute(node, "length")?)?).collect()
        }
        // Rings from pole to pole, so that it is as wide in every frame.
        "sphere" => {
            let radius = number("radius", &attribute(node, "radius")?)?;
            let ring = |index: usize| {
                let (sin, cos) = trig::sin_cos(std::f64::consts::PI * index as f64 / ROUND_CORNERS as f64);
                round(radius * sin, radius * cos).take(ROUND_CORNERS)
            };
            (0..=ROUND_CORNERS).flat_map(ring).collect()
        }
        _ => return Ok(None),
    }))
}

/// The mass of all links and their moment of inertia around the middle.
fn masses(
    robot: Node<'_, '_>,
    frames: &BTreeMap<&str, Frame>,
    middle: [f64; 2],
    facts: &mut Facts,
) -> Result<(), String> {
    let (mut mass_kg, mut inertia_kgm2) = (0.0, 0.0);
    for link in robot.children().filter(|node| node.has_tag_name("link")) {
        let Some(inertial) = child(link, "inertial") else { continue };
        let value = |tag: &str, key: &str| {
            child(inertial, tag)
                .and_then(|node| node.attribute(key))
                .map(|text| number(key, text))
                .transpose()
        };
        let link_kg = value("mass", "value")?.unwrap_or(0.0);
        let frame =
            frames.get(link.attribute("name").unwrap_or_default()).copied().unwrap_or(Frame::IDENTITY);
        let at = frame.then(&origin(inertial)?).at;
        let (x, y) = (at[0] - middle[0], at[1] - middle[1]);
        mass_kg += link_kg;
        inertia_kgm2 += value("inertia", "izz")?.unwrap_or(0.0) + link_kg * (x * x + y * y);
    }
    if mass_kg > 0.0 {
        facts.add(Quantity::Mass, rounded(mass_kg), "masses of the links");
        facts.add(Quantity::YawInertia, rounded(inertia_kgm2), "masses and inertias of the links");
    }
    Ok(())
}

fn child<'a, 'b>(node: Node<'a, 'b>, name: &str) -> Option<Node<'a, 'b>> {
    node.children().find(|child| child.has_tag_name(name))
}

fn origin(node: Node<'_, '_>) -> Result<Frame, String> {
    let Some(origin) = child(node, "origin") else { return Ok(Frame::IDENTITY) };
    let of = |key: &str| origin.attribute(key).map_or(Ok([0.0; 3]), |text| triple(key, text));
    Ok(Frame::new(of("xyz")?, of("rpy")?))
}

fn number(key: &str, text: &str) -> Result<f64, String> {
    let value = text.trim().parse().ok().filter(|value: &f64| value.is_finite());
    value.ok_or_else(|| format!("{key} is {text:?}, must be a finite number"))
}

fn triple(key: &str, text: &str) -> Result<[f64; 3], String> {
    let numbers = text.split_whitespace().map(|part| number(key, part)).collect::<Result<Vec<_>, _>>()?;
    numbers.try_into().map_err(|_| format!("{key} is {text:?}, must be three numbers"))
}

/// To a tenth of a millimetre, a gram: what robot descriptions know.
fn rounded(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}

impl Frame {
    const IDENTITY: Self = Self { rows: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], at: [0.0; 3] };

    /// Roll, pitch and yaw around fixed axes, as URDF has them.
    fn new(at: [f64; 3], [roll, pitch, yaw]: [f64; 3]) -> Self {
        let ((sr, cr), (sp, cp), (sy, cy)) = (trig::sin_cos(roll), trig::sin_cos(pitch), trig::sin_cos(yaw));
        let rows = [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ];
        Self { rows, at }
    }

    fn turn(&self, point: [f64; 3]) -> [f64; 3] {
        self.rows.map(|row| row[0] * point[0] + row[1] * point[1] + row[2] * point[2])
    }

    fn place(&self, point: [f64; 3]) -> [f64; 3] {
        let turned = self.turn(point);
        [turned[0] + self.at[0], turned[1] + self.at[1], turned[2] + self.at[2]]
    }

    fn then(&self, next: &Self) -> Self {
        let column =
            |index: usize| self.turn([next.rows[0][index], next.rows[1][index], next.rows[2][index]]);
        let columns = [column(0), column(1), column(2)];
        let rows = [0, 1, 2].map(|row| [columns[0][row], columns[1][row], columns[2][row]]);
        Self { rows, at: self.place(next.at) }
    }

    fn inverse(&self) -> Self {
        let rows = [0, 1, 2].map(|row| [self.rows[0][row], self.rows[1][row], self.rows[2][row]]);
        let turned = Self { rows, at: [0.0; 3] }.turn(self.at);
        Self { rows, at: turned.map(|value| -value) }
    }
}
