//! How far policies are from the least cost that an option can be driven at: what `cargo xtask bench yardstick` runs.
//!
//! ```text
//! yardstick FOLDER ROBOT NOISE OPTIONS EPISODES SEED
//! ```
//!
//! Takes so many options, the last ones of routes in the maps that scores are taken on, drives each so many episodes with every
//! policy, and appends a JSON object for each to `FOLDER/lines.jsonl`; those that are there already stay. In the end it writes a
//! table and a picture of all lines.

#![allow(
    clippy::disallowed_methods,
    clippy::print_stderr,
    reason = "an example is a command: it reads its arguments and tells its progress"
)]

use std::fs;
use std::io::Write;
use std::path::Path;

use sharp_bench::{PriorCourses, YardstickLine, YardstickOption, yardstick_picture, yardstick_table};
use sharp_draw::svg_to_png;
use sharp_guide::Role;
use sharp_plan::TrainingRoute;
use sharp_sim::{NoiseModel, RobotModel};
use sharp_space::Seed;

/// Guides that are neither too short to differ nor too long to compute, metres.
const LENGTHS_M: std::ops::Range<f64> = 2.0..7.0;

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [folder, robot, noise, options, episodes, seed] = &args[..] else {
        return Err("expected FOLDER ROBOT NOISE OPTIONS EPISODES SEED".into());
    };
    let robot = RobotModel::built_in(robot).ok_or("the robot must be husky or limo")?;
    let (wanted, episodes, seed): (usize, u32, u64) = (options.parse()?, episodes.parse()?, seed.parse()?);
    let folder = Path::new(folder);
    fs::create_dir_all(folder)?;
    let path = folder.join("lines.jsonl");
    let mut lines = read(&path)?;
    let model = NoiseModel::by_name(noise)?;
    // Two or three routes of a map end in an option of such a length.
    let routes = PriorCourses::held_out(&robot, Seed(seed)).routes(wanted as u32, &|| ());
    let last = |route: &TrainingRoute| {
        let option = route.options().last()?.0;
        let fits = option.id.role() == Role::Last && LENGTHS_M.contains(&option.guide.length_m());
        fits.then_some(())
    };
    let routes: Vec<_> = routes.iter().filter(|route| last(route).is_some()).take(wanted).collect();
    for (number, route) in routes.iter().enumerate() {
        let is_same = |line: &YardstickLine| {
            let YardstickLine { robot: a, noise: b, seed: c, episodes: d, option, .. } = line;
            (a, b, *c, *d, *option) == (&robot.name, noise, seed, episodes, number)
        };
        if lines.iter().any(is_same) {
            continue;
        }
        let Some((option, states)) = route.options().last() else { continue };
        eprintln!(
            "{}: option {} of {}, {:.1} m",
            robot.name,
            number + 1,
            routes.len(),
            option.guide.length_m()
        );
        let yardstick = YardstickOption { world: route.world(), option, next: None, states, noise: &model };
        let (expected_s, policies) = yardstick.compare((episodes, Seed(seed).child("option", number as u64)));
        let line = YardstickLine {
            schema: "sharp.yardstick/1".to_owned(),
            robot: robot.name.clone(),
            noise: noise.clone(),
            seed,
            episodes,
            option: number,
            length_m: option.guide.length_m(),
            expected_s,
            policies,
        };
        let mut file = fs::OpenOptions::new().create(true).append(true).open(&path)?;
        writeln!(file, "{}", serde_json::to_string(&line)?)?;
        lines.push(line);
    }
    lines.sort_by(|a, b| (&a.robot, &a.noise, a.option).cmp(&(&b.robot, &b.noise, b.option)));
    fs::write(folder.join("yardstick.md"), yardstick_table(&lines))?;
    let (svg, side_px) = yardstick_picture(&lines);
    fs::write(folder.join("yardstick.png"), svg_to_png(&svg, side_px)?)?;
    fs::write(folder.join("yardstick.svg"), svg)?;
    eprintln!("{} options: {}", lines.len(), folder.join("yardstick.md").display());
    Ok(())
}

fn read(path: &Path) -> Result<Vec<YardstickLine>, Failure> {
    let text = match fs::read_to_string(path) {
        Ok(text) => text,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(vec![]),
        Err(error) => return Err(format!("{}: {error}", path.display()).into()),
    };
    let parse = |(number, line): (usize, &str)| {
        serde_json::from_str(line)
            .map_err(|error| format!("{}: line {}: {error}", path.display(), number + 1).into())
    };
    text.lines().enumerate().map(parse).collect()
}
