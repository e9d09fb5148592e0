//! The ROS 2 messages that a recording holds: their definitions and their bytes.

use sharp_sim::RobotState;
use sharp_space::{Footprint, Occupancy, OccupancyGrid, Pose};

use crate::cdr::CdrWriter;
use crate::path::{FRAME, quaternion, stamp};

/// The frame that moves with the robot.
pub(crate) const BASE_FRAME: &str = "base_link";
/// The frame of odometry; it lies on the map, because poses here are exact.
pub(crate) const ODOM_FRAME: &str = "odom";

/// A type of message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct MessageType {
    /// Its name, as in `nav_msgs/msg/Path`.
    pub(crate) name: &'static str,
    /// The types that it is made of, itself first.
    parts: &'static [(&'static str, &'static str)],
}

const TIME: (&str, &str) = ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec");
const HEADER: (&str, &str) = ("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id");
const POINT: (&str, &str) = ("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z");
const POINT32: (&str, &str) = ("geometry_msgs/Point32", "float32 x\nfloat32 y\nfloat32 z");
const QUATERNION: (&str, &str) =
    ("geometry_msgs/Quaternion", "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1");
const POSE: (&str, &str) =
    ("geometry_msgs/Pose", "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation");
const POSE_STAMPED: (&str, &str) =
    ("geometry_msgs/PoseStamped", "std_msgs/Header header\ngeometry_msgs/Pose pose");
const VECTOR3: (&str, &str) = ("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z");
const TWIST: (&str, &str) =
    ("geometry_msgs/Twist", "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular");

pub(crate) const OCCUPANCY_GRID: MessageType = MessageType {
    name: "nav_msgs/msg/OccupancyGrid",
    parts: &[
        ("nav_msgs/OccupancyGrid", "std_msgs/Header header\nnav_msgs/MapMetaData info\nint8[] data"),
        (
            "nav_msgs/MapMetaData",
            "builtin_interfaces/Time map_load_time\nfloat32 resolution\nuint32 width\nuint32 height\n\
             geometry_msgs/Pose origin",
        ),
        HEADER,
        TIME,
        POSE,
        POINT,
        QUATERNION,
    ],
};

pub(crate) const PATH: MessageType = MessageType {
    name: "nav_msgs/msg/Path",
    parts: &[
        ("nav_msgs/Path", "std_msgs/Header header\ngeometry_msgs/PoseStamped[] poses"),
        POSE_STAMPED,
        HEADER,
        TIME,
        POSE,
        POINT,
        QUATERNION,
    ],
};

pub(crate) const POSE_STAMPED_TYPE: MessageType = MessageType {
    name: "geometry_msgs/msg/PoseStamped",
    parts: &[POSE_STAMPED, HEADER, TIME, POSE, POINT, QUATERNION],
};

pub(crate) const ODOMETRY: MessageType = MessageType {
    name: "nav_msgs/msg/Odometry",
    parts: &[
        (
            "nav_msgs/Odometry",
            "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n\
             geometry_msgs/TwistWithCovariance twist",
        ),
        HEADER,
        TIME,
        ("geometry_msgs/PoseWithCovariance", "geometry_msgs/Pose pose\nfloat64[36] covariance"),
        POSE,
        POINT,
        QUATERNION,
        ("geometry_msgs/TwistWithCovariance", "geometry_msgs/Twist twist\nfloat64[36] covariance"),
        TWIST,
        VECTOR3,
    ],
};

pub(crate) const TF: MessageType = MessageType {
    name: "tf2_msgs/msg/TFMessage",
    parts: &[
        ("tf2_msgs/TFMessage", "geometry_msgs/TransformStamped[] transforms"),
        (
            "geometry_msgs/TransformStamped",
            "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform",
        ),
        HEADER,
        TIME,
        ("geometry_msgs/Transform", "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation"),
        VECTOR3,
        QUATERNION,
    ],
};

pub(crate) const POLYGON: MessageType = MessageType {
    name: "geometry_msgs/msg/PolygonStamped",
    parts: &[
        ("geometry_msgs/PolygonStamped", "std_msgs/Header header\ngeometry_msgs/Polygon polygon"),
        HEADER,
        TIME,
        ("geometry_msgs/Polygon", "geometry_msgs/Point32[] points"),
        POINT32,
    ],
};

pub(crate) const STRING: MessageType =
    MessageType { name: "std_msgs/msg/String", parts: &[("std_msgs/String", "string data")] };

pub(crate) const FLOAT64: MessageType =
    MessageType { name: "std_msgs/msg/Float64", parts: &[("std_msgs/Float64", "float64 data")] };

impl MessageType {
    /// The definition as MCAP files keep it: its own fields, then each type that it uses under a line of its name.
    pub(crate) fn definition(&self) -> String {
        let rule = "=".repeat(80);
        let used = self.parts[1..].iter().map(|(name, fields)| format!("\n{rule}\nMSG: {name}\n{fields}"));
        self.parts[0].1.to_owned() + &used.collect::<String>() + "\n"
    }
}

/// A message with a header: when, in seconds, and in which frame.
fn stamped(time_s: f64, frame: &str) -> CdrWriter {
    let mut writer = CdrWriter::new();
    header(&mut writer, time_s, frame);
    writer
}

fn header(writer: &mut CdrWriter, time_s: f64, frame: &str) {
    let (sec, nanosec) = stamp(time_s);
    writer.i32(sec);
    writer.u32(nanosec);
    writer.string(frame);
}

/// Where a frame lies in itself.
fn origin() -> Pose {
    Pose::new(0.0, 0.0, 0.0)
}

fn pose(writer: &mut CdrWriter, pose: &Pose) {
    writer.f64s(&[pose.position.x, pose.position.y, 0.0]);
    rotation(writer, pose);
}

fn rotation(writer: &mut CdrWriter, pose: &Pose) {
    let [z, w] = quaternion(pose);
    writer.f64s(&[0.0, 0.0, z, w]);
}

/// `nav_msgs/OccupancyGrid`: 0 free, 100 occupied, −1 unknown.
pub(crate) fn occupancy_grid(time_s: f64, grid: &OccupancyGrid) -> Vec<u8> {
    let frame = grid.frame();
    let mut writer = stamped(time_s, FRAME);
    writer.i32(0);
    writer.u32(0);
    writer.f32(frame.resolution_m as f32);
    writer.len(frame.width);
    writer.len(frame.height);
    pose(&mut writer, &frame.origin);
    let cells = grid.cells().iter().map(|cell| match cell {
        Occupancy::Free => 0,
        Occupancy::Occupied => 100,
        Occupancy::Unknown => -1,
    });
    writer.i8s(cells);
    writer.finish()
}

/// `nav_msgs/Path` through poses with the times at which the robot should be there.
pub(crate) fn path(time_s: f64, poses: &[(f64, Pose)]) -> Vec<u8> {
    let mut writer = stamped(time_s, FRAME);
    writer.len(poses.len());
    for (at_s, at) in poses {
        header(&mut writer, *at_s, FRAME);
        pose(&mut writer, at);
    }
    writer.finish()
}

/// `geometry_msgs/PoseStamped`.
pub(crate) fn pose_stamped(time_s: f64, at: &Pose) -> Vec<u8> {
    let mut writer = stamped(time_s, FRAME);
    pose(&mut writer, at);
    writer.finish()
}

/// `nav_msgs/Odometry`: pose in the frame of odometry, speeds in the robot's own; covariances unknown, hence 0.
pub(crate) fn odometry(time_s: f64, state: &RobotState) -> Vec<u8> {
    let unknown = [0.0; 36];
    let mut writer = stamped(time_s, ODOM_FRAME);
    writer.string(BASE_FRAME);
    pose(&mut writer, &state.pose);
    writer.f64s(&unknown);
    writer.f64s(&[state.velocity.x, state.velocity.y, 0.0, 0.0, 0.0, state.yaw_rate_radps]);
    writer.f64s(&unknown);
    writer.finish()
}

/// `tf2_msgs/TFMessage`: map to odometry, and odometry to the robot.
pub(crate) fn transforms(time_s: f64, at: &Pose) -> Vec<u8> {
    let mut writer = CdrWriter::new();
    writer.len(2);
    for (parent, child, at) in [(FRAME, ODOM_FRAME, &origin()), (ODOM_FRAME, BASE_FRAME, at)] {
        header(&mut writer, time_s, parent);
        writer.string(child);
        writer.f64s(&[at.position.x, at.position.y, 0.0]);
        rotation(&mut writer, at);
    }
    writer.finish()
}

/// `geometry_msgs/PolygonStamped`: the outline of the robot in its own frame.
pub(crate) fn outline(time_s: f64, footprint: &Footprint) -> Vec<u8> {
    let mut writer = stamped(time_s, BASE_FRAME);
    let corners = footprint.outline(&origin());
    writer.len(corners.len());
    for corner in corners {
        [corner.x as f32, corner.y as f32, 0.0].into_iter().for_each(|number| writer.f32(number));
    }
    writer.finish()
}

/// `std_msgs/String`.
pub(crate) fn string(text: &str) -> Vec<u8> {
    let mut writer = CdrWriter::new();
    writer.string(text);
    writer.finish()
}

/// `std_msgs/Float64`.
pub(crate) fn float64(number: f64) -> Vec<u8> {
    let mut writer = CdrWriter::new();
    writer.f64(number);
    writer.finish()
}
