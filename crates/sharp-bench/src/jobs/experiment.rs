//! An experiment: everything that decides the result of one job, and nothing else.

use serde::{Deserialize, Serialize};
use sharp_options::OptionKind;
use sharp_plan::{Method, hash, map_hash};
use sharp_space::OccupancyGrid;

use super::machine::version;
use crate::error::BenchError;
use crate::json::to_json;
use crate::measure::BaselineKind;
use crate::named::{self, DETECTORS};
use crate::result::{Variant, default_regions};

/// The readable part of the name of a job at most, characters: with what follows it is well below the 255 bytes of a file
/// system.
const WORDS_MAX: usize = 100;

/// A system in an environment: equal experiments give equal results but for times.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Experiment {
    /// Version and build of the program.
    pub version: String,
    /// The name of the map.
    pub env: String,
    /// The name of the robot.
    pub robot: String,
    /// What is measured.
    pub system: System,
    /// The name of the noise, or its file.
    pub noise: String,
    /// Which repetition, from 0.
    pub trial: u32,
    /// The root of all randomness of this trial.
    pub seed: u64,
    /// Executions of each plan.
    pub episodes: u32,
    /// Numbers of the map's problems, from 1, in the order in which they share a library.
    pub problems: Vec<usize>,
    /// Wall time of solving one problem, or of one baseline on it, seconds.
    pub time_limit_s: f64,
    /// What it reads.
    pub inputs: Inputs,
}

/// What an experiment measures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum System {
    /// This project.
    Sharp(SharpSettings),
    /// RRT with replanning; a contact is a failure.
    Rrt,
    /// RRT with replanning that bumps into walls and goes on, as in the paper.
    RrtContact,
    /// Tracking of a planned path.
    Track,
    /// Model-predictive path integral control.
    Mppi,
    /// One flat soft actor-critic policy.
    Sac,
}

/// How SHARP is set.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SharpSettings {
    /// The kind of option.
    pub options: OptionKind,
    /// The name of the method: see [`Method::by_name`].
    pub learning: String,
    /// Where critical regions come from: see [`named::detector`](crate::named::detector).
    pub regions: String,
    /// Whether a robot that strayed, stands still or is late gets a new plan.
    pub recovery: bool,
    /// Whether the search learns from the costs that were measured.
    pub cost_update: bool,
}

/// What an experiment reads, by hash: another map under the same name is another experiment.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Inputs {
    /// Of the map's cells.
    pub map: String,
    /// Of the robot's numbers.
    pub robot: String,
    /// Of the noise's numbers.
    pub noise: String,
    /// Of a file of regions; `None` if a detector finds them.
    pub regions: Option<String>,
}

impl System {
    /// Its name in results.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Sharp(_) => "sharp",
            Self::Rrt => "rrt",
            Self::RrtContact => "rrt-contact",
            Self::Track => "track",
            Self::Mppi => "mppi",
            Self::Sac => "sac",
        }
    }

    /// The settings of SHARP, `None` for a baseline.
    #[must_use]
    pub const fn sharp(&self) -> Option<&SharpSettings> {
        if let Self::Sharp(settings) = self { Some(settings) } else { None }
    }

    /// The baseline and whether a contact ends its executions, `None` for SHARP.
    pub(crate) const fn baseline(&self) -> Option<(BaselineKind, bool)> {
        match self {
            Self::Sharp(_) => None,
            Self::Rrt => Some((BaselineKind::Rrt, true)),
            Self::RrtContact => Some((BaselineKind::Rrt, false)),
            Self::Track => Some((BaselineKind::Track, true)),
            Self::Mppi => Some((BaselineKind::Mppi, true)),
            Self::Sac => Some((BaselineKind::Sac, true)),
        }
    }

    /// Processor time that one problem is expected to take, seconds: measured on one core, docs/scale.md.
    fn weight_s(&self, is_large: bool) -> f64 {
        let [small_s, large_s] = match self {
            Self::Sharp(settings) if settings.trains_everything() => return f64::INFINITY,
            Self::Sac => return f64::INFINITY,
            Self::Sharp(_) => [4.0, 17.0],
            Self::Rrt | Self::RrtContact => [0.7, 15.0],
            Self::Track => [0.1, 0.5],
            Self::Mppi => [1.0, 4.0],
        };
        if is_large { large_s } else { small_s }
    }
}

impl SharpSettings {
    /// The method that they name, set as they say; `None` if there is none of that name.
    #[must_use]
    pub fn method(&self) -> Option<Method> {
        let mut method = Method::by_name(&self.learning)?;
        method.search.cost_update = self.cost_update;
        Some(method)
    }

    /// Whether every option is learnt from nothing, which takes minutes a problem.
    fn trains_everything(&self) -> bool {
        self.method().is_some_and(|method| method.keeps_trainings)
    }
}

impl Inputs {
    /// What this program reads under these names.
    ///
    /// # Errors
    /// If one of them cannot be read.
    pub fn read(env: &str, robot: &str, noise: &str, regions: Option<&str>) -> Result<Self, BenchError> {
        let map = sharp_maps::load(env, &sharp_maps::LoadOptions::default())?;
        Self::of(&map.grid, robot, noise, regions)
    }

    /// The same, where the map was read already.
    ///
    /// # Errors
    /// If one of the others cannot be read.
    pub(super) fn of(
        grid: &OccupancyGrid,
        robot: &str,
        noise: &str,
        regions: Option<&str>,
    ) -> Result<Self, BenchError> {
        let short = |text: &str| hash(text.as_bytes())[..16].to_owned();
        let regions = regions.filter(|name| !DETECTORS.contains(name)).map(named::read_regions);
        Ok(Self {
            map: map_hash(grid)[..16].to_owned(),
            robot: short(&format!("{:?}", named::robot(robot)?)),
            noise: short(&format!("{:?}", named::noise(noise)?)),
            regions: regions.transpose()?.as_deref().map(short),
        })
    }
}

impl Experiment {
    /// The hash that stands for the whole experiment.
    #[must_use]
    pub fn key(&self) -> String {
        hash(to_json(self).as_bytes())[..16].to_owned()
    }

    /// A name for files: readable, and of this experiment only.
    #[must_use]
    pub fn name(&self) -> String {
        let variant = self.variant().name();
        let mut words = vec![&*self.env, &*self.robot];
        match self.system.sharp() {
            Some(sharp) => {
                words.extend([sharp.options.name(), &*sharp.learning]);
                if sharp.regions != default_regions() {
                    words.push(&sharp.regions);
                }
                if self.variant() != Variant::WHOLE {
                    words.push(&variant);
                }
            }
            None => words.push(self.system.name()),
        }
        words.push(&self.noise);
        file_name(&words, &format!("t{}-{}", self.trial, &self.key()[..8]))
    }

    /// What was switched off.
    #[must_use]
    pub fn variant(&self) -> Variant {
        self.system.sharp().map_or(Variant::WHOLE, |sharp| Variant {
            has_recovery: sharp.recovery,
            has_cost_update: sharp.cost_update,
        })
    }

    /// Verifies that this program reads what the experiment was planned for.
    ///
    /// # Errors
    /// Names the input that differs.
    pub fn check(&self) -> Result<(), BenchError> {
        if self.version != version() {
            return Err(stale("version and build of sharp".to_owned(), version(), &self.version));
        }
        let regions = self.system.sharp().map(|sharp| sharp.regions.as_str());
        let (is, planned) = (Inputs::read(&self.env, &self.robot, &self.noise, regions)?, &self.inputs);
        for (what, name, is, planned) in [
            ("map", &self.env, &is.map, &planned.map),
            ("robot", &self.robot, &is.robot, &planned.robot),
            ("noise", &self.noise, &is.noise, &planned.noise),
        ] {
            if is != planned {
                return Err(stale(format!("hash of {what} {name:?}"), is, planned));
            }
        }
        if is.regions != planned.regions {
            let text = |hash: &Option<String>| hash.clone().unwrap_or_else(|| "none".to_owned());
            return Err(stale("hash of the regions".to_owned(), &text(&is.regions), &text(&planned.regions)));
        }
        Ok(())
    }

    /// Processor time that the job is expected to take, seconds; for packing and order only.
    #[must_use]
    pub fn weight_s(&self) -> f64 {
        let is_large = ["e", "f", "g"].contains(&self.env.as_str());
        self.system.weight_s(is_large).min(self.time_limit_s) * self.problems.len() as f64
    }
}

impl Experiment {
    /// SHARP on the first two problems of environment `a`: for tests and examples.
    ///
    /// # Panics
    /// Never: what it reads is built in.
    #[must_use]
    pub fn example() -> Self {
        let sharp = SharpSettings {
            options: OptionKind::Interface,
            learning: "fast".into(),
            regions: "net".into(),
            recovery: true,
            cost_update: true,
        };
        Self {
            version: version().into(),
            env: "a".into(),
            robot: "husky".into(),
            system: System::Sharp(sharp),
            noise: "nominal".into(),
            trial: 0,
            seed: 1,
            episodes: 20,
            problems: vec![1, 2],
            time_limit_s: 2400.0,
            inputs: Inputs::read("a", "husky", "nominal", None).expect("built in"),
        }
    }
}

/// A name for files out of `words`, some of which may be paths, and `tail`, which tells it from others. It fits into every
/// file system, however long the words are.
pub(super) fn file_name(words: &[&str], tail: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
    let words: Vec<&str> = words.iter().map(|word| stem(word)).collect();
    let all = words.join("-");
    let readable: String = all.chars().map(|c| if is_plain(c) { c } else { '_' }).take(WORDS_MAX).collect();
    format!("{readable}-{tail}")
}

/// Of a robot, noise or regions that are a file, its name without folder and ending.
fn stem(word: &str) -> &str {
    let file = word.rsplit('/').next().unwrap_or(word);
    file.strip_suffix(".ron").unwrap_or(file)
}

/// `what` is now `is`, and the job was planned for `planned`.
pub(super) fn stale(what: String, is: &str, planned: &str) -> BenchError {
    BenchError::Stale { what, is: is.to_owned(), planned: planned.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_that_decides_a_result_changes_the_key() {
        let example = Experiment::example();
        let sharp = example.system.sharp().expect("one of SHARP").clone();
        let set = |settings| Experiment { system: System::Sharp(settings), ..example.clone() };
        let changed = [
            Experiment { seed: 2, ..example.clone() },
            Experiment { episodes: 21, ..example.clone() },
            Experiment { problems: vec![1, 2, 3], ..example.clone() },
            Experiment { noise: "harsh".into(), ..example.clone() },
            set(SharpSettings { recovery: false, ..sharp.clone() }),
            set(SharpSettings { regions: "grid".into(), ..sharp }),
            Experiment {
                inputs: Inputs { map: "other".into(), ..example.inputs.clone() },
                ..example.clone()
            },
        ];
        for other in changed {
            assert_ne!(other.key(), example.key(), "{other:?}");
            assert_ne!(other.name(), example.name(), "{other:?}");
        }
        assert_eq!(example.clone().key(), example.key(), "the same");
    }

    #[test]
    fn names_can_be_files() {
        let example = Experiment { noise: "../my noise*2.ron".into(), ..Experiment::example() };
        let name = example.name();
        assert!(name.starts_with("a-husky-interface-fast-my_noise_2-t0-"), "{name}");
        let factor = Experiment { noise: "nominal*0.5".into(), ..Experiment::example() };
        assert!(factor.name().starts_with("a-husky-interface-fast-nominal_0.5-t0-"), "{}", factor.name());
    }

    // A noise file far below the root once gave a name that no file system takes, which showed when the job ran.
    #[test]
    fn long_names_are_cut_and_stay_apart() {
        let [one, other] = ["1", "2"].map(|end| Experiment {
            noise: format!("/runs/{}{end}.ron", "long".repeat(60)),
            ..Experiment::example()
        });
        assert!(one.name().len() < 120, "{}", one.name());
        assert_ne!(one.name(), other.name());
    }

    #[test]
    fn an_experiment_of_another_build_or_map_is_refused() {
        let example = Experiment::example();
        assert!(example.check().is_ok(), "{example:?}");
        let old = Experiment { version: "0.0.1".into(), ..example.clone() };
        let message = old.check().expect_err("another version").to_string();
        assert!(message.ends_with("the job was planned for 0.0.1"), "{message}");
        let inputs = Inputs { map: "0".repeat(16), ..example.inputs.clone() };
        let message = Experiment { inputs, ..example }.check().expect_err("another map").to_string();
        assert!(message.contains("hash of map \"a\" is") && message.contains("0000"), "{message}");
    }
}
