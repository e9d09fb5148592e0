//! What a whole report has and these results have not, each with the command that measures it.

use std::collections::BTreeSet;
use std::path::Path;

use super::ablations::ABLATIONS;
use super::cases::{Results, Setting, method};
use super::noise;
use crate::result::ResultLine;

/// Levels of noise that a sweep needs, times nominal, and their names.
const SWEEP: [(f64, &str); 4] = [(0.0, "none"), (1.0, "nominal"), (2.0, "'nominal*2'"), (4.0, "'nominal*4'")];
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
    let noise = results.main.noise;
    let kept = if noise == Setting::USUAL.noise { String::new() } else { format!(" --noise '{noise}'") };
    let lack = |what: &str, flags: &str| Missing {
        what: what.to_owned(),
        command: format!("sharp eval quick --out {} {flags}", out.display()).trim_end().to_owned(),
    };
    let compared = results.compared();
    if compared.is_empty() {
        return vec![lack("everything", "")];
    }
    let mut all = Vec::new();
    for (flag, names, of) in DIMENSIONS {
        let there: BTreeSet<&str> = compared.iter().map(|line| of(line)).collect();
        let gone: Vec<&str> = names.iter().copied().filter(|name| !there.contains(name)).collect();
        if !gone.is_empty() {
            let gone = gone.join(",");
            all.push(lack(&format!("{flag} {gone}"), &format!("--{flag} {gone}{kept}")));
        }
    }
    if results.lines.iter().all(|line| line.trial == 0) {
        all.push(lack("spread over trials", &format!("--trials 5{kept}")));
    }
    let factors: Vec<f64> = results
        .lines
        .iter()
        .filter(|line| line.is_of_sharp())
        .filter_map(|line| noise::factor(&line.noise))
        .collect();
    if SWEEP.iter().any(|(factor, _)| !factors.contains(factor)) {
        let names: Vec<&str> = SWEEP.iter().map(|&(_, name)| name).collect();
        all.push(lack("noise sweep", &format!("--noise {}", names.join(","))));
    }
    let ablations = ABLATIONS.iter().filter(|ablation| ablation.lines(results).is_empty());
    all.extend(
        ablations.map(|ablation| lack(ablation.name, &format!("--methods sharp {}{kept}", ablation.flags))),
    );
    all
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
        assert_eq!(missing[0].command, "sharp eval quick --out out --envs b,c,d,e,f,g");
        assert_eq!(
            missing[4].command,
            "sharp eval quick --out out --noise none,nominal,'nominal*2','nominal*4'"
        );
    }
}
