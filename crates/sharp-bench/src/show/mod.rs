//! One page of a solved problem, to look at: the map, what was found on it, the plan, and drives that move.
//!
//! The page is one file that opens in any browser without a network. Its numbers are one JSON object, `sharp.show/1`,
//! in the element with the id `data`; the script draws them. Places are in the frame of the map, metres and radians.

mod data;
mod weak;

#[cfg(test)]
mod browser;
#[cfg(test)]
mod tests;

use sharp_draw::escape;
use sharp_plan::{OptionLibrary, Recording, Tour};

use crate::error::BenchError;
use crate::json::to_json;

use data::ShownData;

const PAGE: &str = include_str!("page.html");
const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// What a page shows.
#[derive(Clone, Copy, Debug)]
pub struct PlanPage<'a> {
    /// The name of the map.
    pub map: &'a str,
    /// The plan, or several in a row.
    pub tour: &'a Tour,
    /// Drives of it. The page shows the first twenty and those of the others that failed, and counts all.
    pub recordings: &'a [Recording],
    /// Options that are known beside those of the plan, with what was measured of them.
    pub library: Option<&'a OptionLibrary>,
}

impl PlanPage<'_> {
    /// Drives that a page is usually made of: enough to meet a failure that happens once in a hundred.
    pub const EPISODES: u32 = 200;

    /// The page as HTML. Equal input gives equal bytes.
    ///
    /// # Errors
    /// If a picture of the map cannot be made.
    pub fn to_html(&self) -> Result<String, BenchError> {
        let data = ShownData::new(self)?;
        // Inside a script element nothing may look like the end of it.
        let json = to_json(&data).replace('<', "\\u003c");
        let title = format!("{} on {}", data.robot.name, data.map.name);
        let page = PAGE.replace("{{title}}", &escape(&title));
        Ok(page.replace("{{style}}", STYLE).replace("{{script}}", SCRIPT).replace("{{data}}", &json))
    }
}
