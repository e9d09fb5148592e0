//! How outlines are written in files: `(half_length_m: 0.5, half_width_m: 0.3)`, `(radius_m: 0.2)`,
//! `(corners: [(x, y), ...])`, or Nav2's text `"[[x, y], ...]"`.

use std::fmt;

use serde::de::{self, Deserialize, Deserializer, MapAccess, Visitor};
use serde::ser::{Serialize, SerializeStruct, Serializer};

use crate::footprint::{Footprint, FootprintShape};
use crate::pose::Vector;

const FIELDS: [&str; 4] = ["half_length_m", "half_width_m", "radius_m", "corners"];

impl Serialize for Footprint {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let count = if matches!(self.shape(), FootprintShape::Rectangle { .. }) { 2 } else { 1 };
        let mut fields = serializer.serialize_struct("Footprint", count)?;
        match self.shape() {
            FootprintShape::Rectangle { half_length_m, half_width_m } => {
                fields.serialize_field("half_length_m", &half_length_m)?;
                fields.serialize_field("half_width_m", &half_width_m)?;
            }
            FootprintShape::Disc { radius_m } => fields.serialize_field("radius_m", &radius_m)?,
            FootprintShape::Polygon { corners } => {
                let pairs: Vec<(f64, f64)> = corners.iter().map(|corner| (corner.x, corner.y)).collect();
                fields.serialize_field("corners", &pairs)?;
            }
        }
        fields.end()
    }
}

impl<'de> Deserialize<'de> for Footprint {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(OutlineVisitor)
    }
}

struct OutlineVisitor;

impl<'de> Visitor<'de> for OutlineVisitor {
    type Value = Footprint;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(
            "a footprint: half_length_m and half_width_m, or radius_m, or corners, or Nav2's text \"[[x, y], ...]\"",
        )
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<Footprint, E> {
        Footprint::from_nav2(text).map_err(E::custom)
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Footprint, A::Error> {
        let (mut lengths, mut corners) = ([None; 3], None);
        while let Some(key) = map.next_key::<String>()? {
            match FIELDS.iter().position(|&field| field == key) {
                Some(3) => corners = Some(map.next_value::<Vec<(f64, f64)>>()?),
                Some(index) => lengths[index] = Some(map.next_value::<f64>()?),
                None => return Err(de::Error::unknown_field(&key, &FIELDS)),
            }
        }
        let outline = match (lengths, corners) {
            ([Some(half_length_m), Some(half_width_m), None], None) => {
                Footprint::rectangle(half_length_m, half_width_m)
            }
            ([None, None, Some(radius_m)], None) => Footprint::disc(radius_m),
            ([None, None, None], Some(corners)) => {
                let corners: Vec<Vector> = corners.iter().map(|&(x, y)| Vector::new(x, y)).collect();
                Footprint::polygon(&corners)
            }
            _ => {
                return Err(de::Error::custom(
                    "footprint needs either half_length_m and half_width_m, or radius_m, or corners",
                ));
            }
        };
        outline.map_err(de::Error::custom)
    }
}
