//! What one job does: everything that decides its result, and nothing else.

use std::fs;
use std::sync::OnceLock;

use serde::{Deserialize, Serialize};
use sharp_bench::{Variant, default_regions};
use sharp_plan::{hash, map_hash};

use crate::args::{Kind, Learning, MapArgs, Switch, SystemName, Unknown};
use crate::input;
use crate::outcome::{Failure, to_json};

/// One job: equal specifications give equal results but for times.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Spec {
    /// Version and build of the program.
    pub(crate) version: String,
    pub(crate) env: String,
    pub(crate) robot: String,
    #[serde(rename = "method")]
    pub(crate) system: SystemName,
    /// How SHARP is set; `None` for a baseline.
    pub(crate) sharp: Option<SharpSpec>,
    /// A name or a file.
    pub(crate) noise: String,
    pub(crate) trial: u32,
    /// The root of all randomness of this trial.
    pub(crate) seed: u64,
    /// Executions of each plan.
    pub(crate) episodes: u32,
    /// Numbers from 1, in the order in which they share a library.
    pub(crate) problems: Vec<usize>,
    /// Wall time of one problem, seconds.
    pub(crate) time_limit_s: f64,
    pub(crate) inputs: Inputs,
}

/// The settings of SHARP itself.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct SharpSpec {
    pub(crate) options: Kind,
    pub(crate) learning: Learning,
    /// Where critical regions come from.
    pub(crate) regions: String,
    pub(crate) recovery: Switch,
    pub(crate) cost_update: Switch,
}

/// What a job reads, by hash: another map under the same name is another job.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Inputs {
    pub(crate) map: String,
    pub(crate) robot: String,
    pub(crate) noise: String,
    /// Of a regions file; `None` if a detector finds them.
    pub(crate) regions: Option<String>,
}

impl Inputs {
    /// What this program reads under these names.
    ///
    /// # Errors
    /// Returns an error if one of them cannot be read.
    pub(crate) fn read(env: &str, robot: &str, noise: &str, regions: Option<&str>) -> Result<Self, Failure> {
        let short = |text: &str| hash(text.as_bytes())[..16].to_owned();
        let map = input::map(&map_args(env))?;
        let regions = regions.filter(|name| !["net", "geometric", "random", "grid"].contains(name));
        let regions = regions.map(|file| input::read_text(file, "regions", "a detector or a file"));
        Ok(Self {
            map: map_hash(&map.grid)[..16].to_owned(),
            robot: short(&format!("{:?}", input::robot(robot)?)),
            noise: short(&format!("{:?}", input::noise(noise)?)),
            regions: regions.transpose()?.as_deref().map(short),
        })
    }
}

/// A named map, read as it is.
pub(crate) fn map_args(env: &str) -> MapArgs {
    MapArgs { map: env.to_owned(), resolution: None, unknown: Unknown::Blocked, allow_outside: false }
}

impl Spec {
    /// The hash that stands for the whole specification.
    pub(crate) fn key(&self) -> String {
        hash(to_json(self).as_bytes())[..16].to_owned()
    }

    /// A name for files: readable, and of this specification only.
    pub(crate) fn name(&self) -> String {
        let mut words = vec![self.env.clone(), self.robot.clone()];
        match &self.sharp {
            Some(sharp) => {
                words.extend([word(sharp.options), word(sharp.learning)]);
                if sharp.regions != default_regions() {
                    words.push(sharp.regions.clone());
                }
                if self.variant() != "default" {
                    words.push(self.variant());
                }
            }
            None => words.push(word(self.system)),
        }
        words.extend([self.noise.clone(), format!("t{}", self.trial), self.key()[..8].to_owned()]);
        let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
        words.join("-").chars().map(|c| if is_plain(c) { c } else { '_' }).collect()
    }

    /// What was switched off.
    pub(crate) fn variant(&self) -> String {
        let on = (Switch::On, Switch::On);
        let (recovery, cost_update) =
            self.sharp.as_ref().map_or(on, |sharp| (sharp.recovery, sharp.cost_update));
        let is_on = |switch| switch == Switch::On;
        Variant { has_recovery: is_on(recovery), has_cost_update: is_on(cost_update) }.name()
    }

    /// Verifies that this program reads what the job was planned for.
    ///
    /// # Errors
    /// Returns an error that names the input that differs.
    pub(crate) fn check(&self) -> Result<(), Failure> {
        let stale = |what: &str, is: &str, expected: &str| {
            Failure::new("JOB_STALE", format!("{what} is {is}, the job was planned for {expected}"))
        };
        if self.version != version() {
            return Err(stale("version and build of sharp", version(), &self.version));
        }
        let regions = self.sharp.as_ref().map(|sharp| sharp.regions.as_str());
        let (is, planned) = (Inputs::read(&self.env, &self.robot, &self.noise, regions)?, &self.inputs);
        for (what, name, is, expected) in [
            ("map", &self.env, &is.map, &planned.map),
            ("robot", &self.robot, &is.robot, &planned.robot),
            ("noise", &self.noise, &is.noise, &planned.noise),
        ] {
            if is != expected {
                return Err(stale(&format!("hash of {what} {name:?}"), is, expected));
            }
        }
        if is.regions != planned.regions {
            let text = |hash: &Option<String>| hash.clone().unwrap_or_else(|| "none".to_owned());
            return Err(stale("hash of the regions", &text(&is.regions), &text(&planned.regions)));
        }
        Ok(())
    }

    /// Processor time that the job is expected to take, seconds; for packing and order only.
    pub(crate) fn weight_s(&self) -> f64 {
        let is_large = ["e", "f", "g"].contains(&self.env.as_str());
        // Measured on one core: docs/scale.md.
        let [small_s, large_s] = match (self.system, self.sharp.as_ref().map(|sharp| sharp.learning)) {
            (SystemName::Sharp, Some(Learning::Paper)) | (SystemName::Sac, _) => [self.time_limit_s; 2],
            (SystemName::Sharp, _) => [4.0, 17.0],
            (SystemName::Rrt | SystemName::RrtContact, _) => [0.7, 15.0],
            (SystemName::Track, _) => [0.1, 0.5],
            (SystemName::Mppi, _) => [1.0, 4.0],
        };
        let each_s: f64 = if is_large { large_s } else { small_s };
        each_s.min(self.time_limit_s) * self.problems.len() as f64
    }
}

/// Version and build of this program, as in `0.1.0+1f0c9a7e`: what two builds measure may differ.
pub(crate) fn version() -> &'static str {
    static VERSION: OnceLock<String> = OnceLock::new();
    VERSION.get_or_init(|| {
        let version = env!("CARGO_PKG_VERSION");
        // The first is there even if the file was replaced meanwhile.
        let program = fs::read("/proc/self/exe").or_else(|_| fs::read(std::env::current_exe()?));
        program.map_or(version.to_owned(), |bytes| format!("{version}+{}", &hash(&bytes)[..8]))
    })
}

/// How a setting is written in files.
pub(crate) fn word(value: impl Serialize) -> String {
    to_json(&value).trim_matches('"').to_owned()
}

#[cfg(test)]
impl Spec {
    /// A job of SHARP on the first two problems of environment a.
    pub(crate) fn example() -> Self {
        let sharp = SharpSpec {
            options: Kind::Interface,
            learning: Learning::Fast,
            regions: "net".into(),
            recovery: Switch::On,
            cost_update: Switch::On,
        };
        Self {
            version: version().into(),
            env: "a".into(),
            robot: "husky".into(),
            system: SystemName::Sharp,
            sharp: Some(sharp),
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_that_decides_a_result_changes_the_key() {
        let spec = Spec::example();
        let sharp = spec.sharp.clone().expect("a job of SHARP");
        let changed = [
            Spec { seed: 2, ..spec.clone() },
            Spec { episodes: 21, ..spec.clone() },
            Spec { problems: vec![1, 2, 3], ..spec.clone() },
            Spec { noise: "harsh".into(), ..spec.clone() },
            Spec { sharp: Some(SharpSpec { recovery: Switch::Off, ..sharp.clone() }), ..spec.clone() },
            Spec { sharp: Some(SharpSpec { regions: "grid".into(), ..sharp }), ..spec.clone() },
            Spec { inputs: Inputs { map: "other".into(), ..spec.inputs.clone() }, ..spec.clone() },
        ];
        for other in changed {
            assert_ne!(other.key(), spec.key(), "{other:?}");
            assert_ne!(other.name(), spec.name(), "{other:?}");
        }
        assert_eq!(spec.clone().key(), spec.key(), "the same");
    }

    #[test]
    fn names_can_be_files() {
        let spec = Spec { noise: "../my noise*2.ron".into(), ..Spec::example() };
        let name = spec.name();
        assert!(name.starts_with("a-husky-interface-fast-.._my_noise_2.ron-t0-"), "{name}");
    }

    #[test]
    fn a_job_of_another_world_is_refused() {
        let spec = Spec::example();
        assert!(spec.check().is_ok(), "{spec:?}");
        let old = Spec { version: "0.0.1".into(), ..spec.clone() };
        let message = old.check().expect_err("another version").to_string();
        assert!(message.ends_with("the job was planned for 0.0.1"), "{message}");
        let moved = Spec { inputs: Inputs { map: "0".repeat(16), ..spec.inputs.clone() }, ..spec };
        let message = moved.check().expect_err("another map").to_string();
        assert!(message.contains("hash of map \"a\" is") && message.contains("0000"), "{message}");
    }
}
