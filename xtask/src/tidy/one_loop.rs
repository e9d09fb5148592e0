//! One loop steps a robot: prediction, learning and execution cannot drift apart (invariant 11).
//!
//! A vehicle moves by `act`, `act_at` and `back_off`, a simulator by `step`. Outside sharp-sim only the episode may
//! call these; tests, benches and examples may do what they like.

use super::Finding;
use super::code::{is_example, line_of, sources, words};
use crate::tree::Tree;

/// Where simulators and vehicles are implemented.
const OWNER: &str = "crates/sharp-sim/";
/// The one file that steps a vehicle.
const EPISODE: &str = "crates/sharp-drive/src/episode.rs";
/// The one file that makes a vehicle.
const MAKER: &str = "crates/sharp-drive/src/world.rs";

/// Checks all code outside the simulator.
pub(super) fn check(tree: &Tree) -> Vec<Finding> {
    let mut problems = Vec::new();
    let is_bound = |path: &str| path.starts_with("crates/") && !path.starts_with(OWNER) && !is_example(path);
    for (path, code) in sources(tree).filter(|(path, _)| is_bound(path)) {
        let mut report = |at: usize, message: String| {
            problems.push(Finding::new(path, line_of(&code, at), message));
        };
        if path != EPISODE {
            for (at, what) in steps(&code) {
                report(at, format!("{what} steps a robot: only {EPISODE} may, use `Episode`"));
            }
        }
        if path != MAKER {
            for at in words(&code, "Vehicle").filter(|at| code[at + "Vehicle".len()..].starts_with("::")) {
                report(at, format!("makes a vehicle: only {MAKER} may, use `World::vehicle`"));
            }
        }
    }
    problems
}

/// Where `code` steps a vehicle or a simulator, and by what.
fn steps(code: &str) -> impl Iterator<Item = (usize, &'static str)> {
    let act_at = words(code, "act_at").map(|at| (at, "act_at"));
    let is_of = |at, name: &str, owners: &[&str]| {
        is_call(code, at, name) && owners.iter().any(|owner| receiver(code, at).ends_with(owner))
    };
    let act = words(code, "act").filter(move |&at| is_of(at, "act", &["vehicle"]));
    let step = words(code, "step").filter(move |&at| is_of(at, "step", &["sim", "simulator"]));
    // An episode backs off by itself, a vehicle is told how far.
    let is_told = |at: usize| !code[at + "back_off(".len()..].trim_start().starts_with(')');
    let back_off = words(code, "back_off").filter(move |&at| is_call(code, at, "back_off") && is_told(at));
    let others = act.map(|at| (at, "act")).chain(step.map(|at| (at, "step")));
    act_at.chain(others).chain(back_off.map(|at| (at, "back_off")))
}

/// Returns true if the name at `at` is called as a method.
fn is_call(code: &str, at: usize, name: &str) -> bool {
    code[at + name.len()..].starts_with('(') && code[..at].trim_end().ends_with('.')
}

/// The name before the dot before `at`, without its arguments.
fn receiver(code: &str, at: usize) -> &str {
    let before = code[..at].trim_end().trim_end_matches('.').trim_end();
    before.trim_end_matches("()").trim_end_matches("_mut")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn problems(path: &str, code: &str) -> usize {
        check(&Tree::of(&[(path, code)])).len()
    }

    #[test]
    fn only_the_episode_steps_a_vehicle() {
        let other = "crates/sharp-plan/src/execute.rs";
        for code in [
            "self.vehicle.act_at(p, v);",
            "vehicle.act(p);",
            "episode.vehicle_mut().act(p);",
            "vehicle\n    .act(p);",
            "robot.back_off(0.3);",
            "self.simulator.step(command, dt_s);",
        ] {
            assert_eq!(problems(other, code), 1, "{code}");
            assert_eq!(problems(EPISODE, code), 0, "{code}");
            assert_eq!(problems("crates/sharp-sim/src/vehicle.rs", code), 0, "{code}");
            assert_eq!(problems("crates/sharp-drive/examples/own.rs", code), 0, "{code}");
            let test = format!("#[cfg(test)]\nmod tests {{ fn f() {{ {code} }} }}");
            assert_eq!(problems(other, &test), 0, "{code}");
        }
    }

    #[test]
    fn others_act_through_an_episode() {
        for code in [
            "self.episode.act(command)",
            "model.act(&mut state)",
            "episode.back_off()",
            "// vehicle.act(p)",
            "environment.step(a, o)",
        ] {
            assert_eq!(problems("crates/sharp-drive/src/task.rs", code), 0, "{code}");
        }
    }

    #[test]
    fn vehicles_come_from_the_world() {
        assert_eq!(problems("crates/sharp-plan/src/execute.rs", "let v = Vehicle::new(sim, robot);"), 1);
        assert_eq!(
            problems("crates/sharp-plan/src/execute.rs", "let v = world.vehicle(&sim); AnyVehicle::f()"),
            0
        );
        assert_eq!(problems(MAKER, "Vehicle::new(sim, robot)"), 0);
    }
}
