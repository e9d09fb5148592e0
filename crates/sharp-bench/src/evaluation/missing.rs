//! What a whole report has and these results have not, each with the command that measures it.

use std::collections::BTreeSet;
use std::path::Path;

use super::ablations::ABLATIONS;
use super::cases::{Results, Setting, method};
use super::noise;
use crate::result::ResultLine;
use crate::shell::shell_word;

/// Levels of noise that a sweep needs, times nominal, and their names.
const SWEEP: [(f64, &str); 4] = [(0.0, "none"), (1.0, "nominal"), (2.0, "nominal*2"), (4.0, "nominal*4")];
/// Seed, executions of each plan and problems of each environment, where `sharp eval` is not told otherwise.
const SEED: u64 = 1;
const EPISODES: u32 = 20;
const PROBLEMS: [usize; 5] = [1, 2, 3, 4, 5];
/// A flag of `sharp eval`, all names that a whole report has of it, and the name of a result.
type Dimension = (&'static str, &'static [&'static str], fn(&ResultLine) -> &str);
const DIMENSIONS: [Dimension; 4] = [
    ("envs", &["a", "b", "c", "d", "e", "f", "g"], |line| &line.env),
    ("robots", &["husky", "limo"], |line| &line.robot),
    ("options", &["centroid", "interface"], |line| &line.options),
    ("methods", &["rrt", "rrt-contact", "track", "mppi", "sac"], method),
];

/// Something that is not there.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Missing {
    pub(super) what: String,
    /// The command that adds it to the same folder.
    pub(super) command: String,
}

/// Everything that `results` in the folder `out` lack.
pub(super) fn missing(results: &Results<'_>, out: &Path) -> Vec<Missing> {
    let main = results.main;
    let compared = results.compared();
    let call = call(&compared, out);
    let lack = |what: &str, flags: &str, setting: Setting<'_>| Missing {
        what: what.to_owned(),
        command: format!("{call}{flags}{}", setting.flags()),
    };
    if compared.is_empty() {
        return vec![lack("everything", "", main)];
    }
    let mut all = Vec::new();
    for (flag, names, of) in DIMENSIONS {
        let there: BTreeSet<&str> = compared.iter().map(|line| of(line)).collect();
        let gone: Vec<&str> = names.iter().copied().filter(|name| !there.contains(name)).collect();
        if !gone.is_empty() {
            let gone = gone.join(",");
            all.push(lack(&format!("{flag} {gone}"), &format!(" --{flag} {gone}"), main));
        }
    }
    if results.lines.iter().all(|line| line.trial == 0) {
        all.push(lack("spread over trials", " --trials 5", main));
    }
    let factors: Vec<f64> = results
        .lines
        .iter()
        .filter(|line| line.is_of_sharp())
        .filter_map(|line| noise::factor(&line.noise))
        .collect();
    if SWEEP.iter().any(|(factor, _)| !factors.contains(factor)) {
        let names = SWEEP.map(|(_, name)| name).join(",");
        all.push(lack("noise sweep", "", Setting { noise: &names, ..main }));
    }
    for ablation in ABLATIONS {
        if let Some(setting) = ablation.setting(main).filter(|_| ablation.lines(results).is_empty()) {
            all.push(lack(ablation.name, " --methods sharp", setting));
        }
    }
    all
}

/// The call that measures into the folder `out` with the seed, the executions and the problems of `compared`.
fn call(compared: &[&ResultLine], out: &Path) -> String {
    // The seeds of later trials are made of the first one's; a baseline may have had no time for all executions.
    let first = compared.iter().find(|line| line.is_of_sharp() && line.trial == 0);
    let mut text = "sharp".to_owned();
    if let Some(line) = first.filter(|line| line.seed != SEED) {
        text += &format!(" --seed {}", line.seed);
    }
    text += &format!(" eval quick --out {}", shell_word(&out.display().to_string()));
    if let Some(line) = first.filter(|line| line.episodes != EPISODES) {
        text += &format!(" --episodes {}", line.episodes);
    }
    let problems: BTreeSet<usize> = compared.iter().map(|line| line.problem).collect();
    if !problems.is_empty() && problems != BTreeSet::from(PROBLEMS) {
        let problems: Vec<String> = problems.iter().map(ToString::to_string).collect();
        text += &format!(" --problems {}", problems.join(","));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_there_is_not_missing() {
        let line = ResultLine::example("a", "limo", "centroid", 1);
        let lines = [
            ResultLine { system: "rrt".into(), ..line.clone() },
            ResultLine { trial: 4, ..line.clone() },
            ResultLine { noise: "none".into(), ..line.clone() },
            ResultLine { regions: "grid".into(), ..line.clone() },
        ];
        let lines: Vec<&ResultLine> = lines.iter().collect();
        let missing = missing(&Results::new(&lines), Path::new("out"));
        let what: Vec<&str> = missing.iter().map(|missing| &*missing.what).collect();
        assert_eq!(
            what,
            [
                "envs b,c,d,e,f,g",
                "robots husky",
                "options interface",
                "methods rrt-contact,track,mppi,sac",
                "noise sweep",
                "regions by geometry",
                "regions at random",
                "no cost update",
                "no recovery",
                "prior only",
                "the paper's learning"
            ]
        );
        assert_eq!(missing[0].command, "sharp eval quick --out out --problems 1 --envs b,c,d,e,f,g");
        assert_eq!(
            missing[4].command,
            "sharp eval quick --out out --problems 1 --noise 'none,nominal,nominal*2,nominal*4'"
        );
    }

    // The commands once measured with another seed and other executions, and of a page about the grid the grid was missing.
    #[test]
    fn what_is_missing_is_measured_as_the_rest_was() {
        let line = |problem| ResultLine {
            seed: 7,
            episodes: 50,
            regions: "grid".into(),
            variant: "no_recovery".into(),
            ..ResultLine::example("a", "limo", "centroid", problem)
        };
        let lines = [1, 2, 3, 4, 5].map(line);
        let lines: Vec<&ResultLine> = lines.iter().collect();
        let missing = missing(&Results::new(&lines), Path::new("my out"));
        let command = |what: &str| {
            let found = missing.iter().find(|missing| missing.what == what);
            found.map(|missing| &*missing.command)
        };
        let call = "sharp --seed 7 eval quick --out 'my out' --episodes 50";
        assert_eq!(
            command("robots husky"),
            Some(&*format!("{call} --robots husky --regions grid --recovery off"))
        );
        assert_eq!(
            command("regions at random"),
            Some(&*format!("{call} --methods sharp --regions random --recovery off"))
        );
        assert_eq!((command("regions on a grid"), command("no recovery")), (None, None), "the page has them");
    }
}
