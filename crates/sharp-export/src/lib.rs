//! Plans, drives and policies in the formats that others read.
//!
//! The nouns: a [`PlannedPath`] is the path of a plan as poses in time, for tables and for JSON shaped like
//! `nav_msgs/Path`. A [`RouteGraph`] is the options of a map as a graph for Nav2's Route Server, as GeoJSON.
//! [`planned_mcap`] and [`driven_mcap`] make MCAP files of ROS 2 messages. A [`PlanNetwork`] is a network of a plan; it
//! becomes an ONNX model or a safetensors file, and [`to_onnx`] encodes any actor of `sharp-rl`.
//!
//! Equal input gives equal bytes. Everything here returns bytes or text: who calls it writes files.
//!
//! ```
//! use std::collections::BTreeMap;
//! use sharp_export::to_onnx;
//! use sharp_rl::{Actor, EnvironmentSpec};
//! use sharp_space::Seed;
//!
//! let spec = EnvironmentSpec { observation_len: 3, action_len: 2 };
//! let actor = Actor::new(spec, &[8], &mut Seed(1).stream("actor", 0));
//! let model = to_onnx(&actor, &[0.5, 1.0], &BTreeMap::new());
//! assert!(model.len() < 1024, "a small network is a small file: {} bytes", model.len());
//! ```

mod cdr;
mod legs;
mod messages;
mod networks;
mod onnx;
mod path;
mod protobuf;
mod recording;
mod route_graph;
mod way;

pub use networks::{PlanNetwork, networks};
pub use onnx::to_onnx;
pub use path::{PathPoint, PlannedPath};
pub use recording::{RecordError, driven_mcap, planned_mcap};
pub use route_graph::{EdgeMetadata, RouteEdge, RouteGraph};
pub use way::is_line_free;
