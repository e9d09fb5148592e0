//! The section of the results: totals, one row a group, one row a problem, what did not learn, and what is missing.

use std::collections::BTreeMap;
use std::fmt::Write;

use sharp_draw::numbers::percent;
use sharp_drive::SuccessCount;
use sharp_rl::StopReason;

use super::super::reuse;
use super::{PROTOCOLS, PaperLeg, PaperLine, PaperRow, Protocol, TIME_LIMIT_S, paper_rows};

/// Everything between the marks.
pub(super) fn text(lines: &[&PaperLine]) -> String {
    let rows = paper_rows();
    let mut text = format!(
        "{} of {} rows are there; their lines, with commands, are in [paper-protocol.jsonl](data/paper-protocol.jsonl). \
         `cargo xtask paper-table --minutes N` measures what is missing and writes this section.\n",
        lines.len(),
        rows.len()
    );
    text += &machines(lines);
    let of = |method: &str| -> Vec<&PaperLine> {
        lines.iter().copied().filter(|line| line.row.method == method).collect()
    };
    let fast = of("fast");
    for protocol in &PROTOCOLS {
        let lines = of(protocol.method);
        if !lines.is_empty() {
            text += &of_protocol(protocol, &lines, &fast);
        }
    }
    text += &baselines(&of("rrt"), &of("sac"));
    text += &missing(lines, &rows);
    text
}

/// On what how many of `lines` were measured.
fn machines(lines: &[&PaperLine]) -> String {
    let mut counts: BTreeMap<(&str, usize), usize> = BTreeMap::new();
    for PaperLine { machine, .. } in lines {
        *counts.entry((&machine.cpu, machine.cores)).or_default() += 1;
    }
    let one = |(&(cpu, cores), rows): (&(&str, usize), &usize)| {
        format!("{rows} rows on {cores} core{} ({cpu})", if cores == 1 { "" } else { "s" })
    };
    let all: Vec<String> = counts.iter().map(one).collect();
    if all.is_empty() {
        return String::new();
    }
    format!("{}; shared with other work at times. Seed 1, one trial.\n", all.join(", "))
}

/// What was measured of the paper's protocol, or of the one with a tuned learner.
fn of_protocol(protocol: &Protocol, lines: &[&PaperLine], fast: &[&PaperLine]) -> String {
    let Protocol { method, titles, names } = protocol;
    let mut text = format!("\n### `--learning {method}`\n");
    text += &totals(lines);
    for (title, name) in titles.iter().zip(names) {
        _ = write!(text, "\n![{title}](images/{name}.svg)\n");
    }
    text += &groups(lines, fast);
    text += &problems(lines, fast);
    text += &unlearnt(lines);
    text
}

/// What the paper's line is held against.
fn totals(lines: &[&PaperLine]) -> String {
    let mut text = String::new();
    for (name, envs) in [("`a`", &["a"][..]), ("`a` to `d`", &["a", "b", "c", "d"])] {
        let here: Vec<_> = lines.iter().filter(|line| envs.contains(&&*line.row.env)).collect();
        if here.is_empty() {
            continue;
        }
        let solved: Vec<&PaperLine> =
            here.iter().filter(|line| line.status == "solved").map(|line| **line).collect();
        _ = writeln!(
            text,
            "\nOf {name} {} problems were measured and {} ended with a plan within {TIME_LIMIT_S:.0} s. Those plans \
             arrive in {} of executions with contact allowed, and in {} where a contact is a failure.",
            here.len(),
            solved.len(),
            share(&solved, |line| line.with_contact),
            share(&solved, |line| line.without_contact),
        );
    }
    text
}

/// A share of all executions of `lines`.
fn share(lines: &[&PaperLine], of: impl Fn(&PaperLine) -> Option<SuccessCount>) -> String {
    let counts: Vec<SuccessCount> = lines.iter().filter_map(|line| of(line)).collect();
    let sum = |of: fn(&SuccessCount) -> u32| counts.iter().map(of).sum::<u32>();
    let whole =
        SuccessCount { episodes: sum(|count| count.episodes), successes: sum(|count| count.successes) };
    if whole.episodes == 0 { "-".to_owned() } else { format!("{:.0} %", 100.0 * whole.rate()) }
}

/// Lines of one environment, robot and kind of option.
type Groups<'a> = BTreeMap<(&'a str, &'a str, &'a str), Vec<&'a PaperLine>>;

fn grouped<'a>(lines: &[&'a PaperLine]) -> Groups<'a> {
    let mut groups = Groups::new();
    for &line in lines {
        let PaperRow { env, robot, options, .. } = &line.row;
        groups.entry((env, robot, options)).or_default().push(line);
    }
    groups
}

fn groups(paper: &[&PaperLine], fast: &[&PaperLine]) -> String {
    let mut text = String::from(
        "\nEach environment, robot and kind of option; in brackets the default mode on the same problems. *Reused* are \
         uses of options whose policy existed before, of all uses, with the paper's share (appendix C; both robots together):\n\n\
         | env | robot | options | plans | mean wall s | arrives, contact allowed | without contact | reused | paper |\n\
         |---|---|---|---|---|---|---|---|---|\n",
    );
    let fast = grouped(fast);
    for ((env, robot, options), lines) in grouped(paper) {
        let beside = fast.get(&(env, robot, options)).map_or(&[][..], Vec::as_slice);
        let solved = lines.iter().filter(|line| line.status == "solved").count();
        let (uses, reused) =
            lines.iter().fold((0, 0), |(a, b), line| (a + line.reuse.uses, b + line.reuse.reused));
        let in_paper = reuse::paper(env, options).map_or("-".to_owned(), percent);
        _ = writeln!(
            text,
            "| {env} | {robot} | {options} | {solved} of {} | {} ({}) | {} ({}) | {} ({}) | {reused}/{uses} | {in_paper} |",
            lines.len(),
            mean_wall(&lines, 0),
            mean_wall(beside, 1),
            share(&lines, |line| line.with_contact),
            share(beside, |line| line.with_contact),
            share(&lines, |line| line.without_contact),
            share(beside, |line| line.without_contact),
        );
    }
    text
}

/// Mean wall time, seconds with so many `decimals`.
fn mean_wall(lines: &[&PaperLine], decimals: usize) -> String {
    if lines.is_empty() {
        return "-".to_owned();
    }
    format!("{:.decimals$}", lines.iter().map(|line| line.wall_s).sum::<f64>() / lines.len() as f64)
}

fn problems(paper: &[&PaperLine], fast: &[&PaperLine]) -> String {
    let mut text = String::from(
        "\nEach problem. *Steps* are those of its trainings, the median and the most; *no stop* are trainings that used up \
         their steps before they met the stop:\n\n\
         | problem | status | wall s | cpu s | trained | reused | steps | no stop | contact allowed | without | default: s | without |\n\
         |---|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for line in paper {
        let PaperRow { env, robot, options, problem, .. } = &line.row;
        let mut steps: Vec<u64> = line.trained().map(|leg| leg.env_steps).collect();
        steps.sort_unstable();
        let thousands = |steps: &u64| format!("{:.0} k", *steps as f64 / 1000.0);
        let steps = match (steps.get(steps.len() / 2), steps.last()) {
            (Some(median), Some(most)) => format!("{}, {}", thousands(median), thousands(most)),
            _ => "-".to_owned(),
        };
        let no_stop = line.trained().filter(|leg| leg.stop == Some(StopReason::Steps)).count();
        let same = |other: &&&PaperLine| {
            let PaperRow { method: _, env: a, robot: b, options: c, problem: d } = &other.row;
            (a, b, c, d) == (env, robot, options, problem)
        };
        let beside = fast.iter().find(same);
        _ = writeln!(
            text,
            "| {env} P{problem} {robot} {options} | {} | {:.0} | {:.0} | {} | {}/{} | {steps} | {no_stop} | {} | {} | {} | {} |",
            line.status,
            line.wall_s,
            line.cpu_s,
            line.trained().count(),
            line.reuse.reused,
            line.reuse.uses,
            count(line.with_contact),
            count(line.without_contact),
            beside.map_or("-".to_owned(), |line| format!("{:.1}", line.wall_s)),
            beside.map_or("-".to_owned(), |line| count(line.without_contact)),
        );
    }
    text
}

fn count(count: Option<SuccessCount>) -> String {
    count.map_or("-".to_owned(), |count| format!("{}/{}", count.successes, count.episodes))
}

fn baselines(rrt: &[&PaperLine], sac: &[&PaperLine]) -> String {
    if rrt.is_empty() && sac.is_empty() {
        return String::new();
    }
    let mut text = String::from(
        "\nThe paper's baselines. RRT plans anew from where it ended, and its time is the planning of one execution; flat \
         soft actor-critic learns problem 1 for as long as a problem may take:\n\n\
         | system | env | robot | problems | wall s | steps | arrives, contact allowed | without contact |\n\
         |---|---|---|---|---|---|---|---|\n",
    );
    for (system, lines) in [("RRT", rrt), ("flat SAC", sac)] {
        for ((env, robot, _), lines) in grouped(lines) {
            let steps = lines.iter().map(|line| line.env_steps).sum::<u64>();
            _ = writeln!(
                text,
                "| {system} | {env} | {robot} | {} | {} | {} | {} | {} |",
                lines.len(),
                mean_wall(&lines, 2),
                if steps == 0 { "-".to_owned() } else { steps.to_string() },
                share(&lines, |line| line.with_contact),
                share(&lines, |line| line.without_contact),
            );
        }
    }
    text
}

/// The trainings that ended without their stop, or did not end.
fn unlearnt(lines: &[&PaperLine]) -> String {
    let is_short = |leg: &&PaperLeg| leg.stop != Some(StopReason::Rule);
    let mut text = String::new();
    for line in lines {
        let PaperRow { env, robot, options, problem, .. } = &line.row;
        for leg in line.trained().filter(is_short) {
            let best = leg.curve.iter().max_by(|a, b| a.1.total_cmp(&b.1));
            let [with, without] = best.map_or([0.0; 2], |&(_, _, with, without)| [with, without]);
            _ = writeln!(
                text,
                "| {env} P{problem} {robot} {options} | {} | {:.1} | {} | {} | {} | {:.0}, {:.0} % |",
                leg.option,
                leg.length_m,
                leg.env_steps,
                if leg.stop.is_none() { "time was up" } else { "steps" },
                best.map_or_else(|| "-".to_owned(), |(_, value, ..)| format!("{value:.0}")),
                100.0 * with,
                100.0 * without,
            );
        }
    }
    if text.is_empty() {
        return text;
    }
    "\nTrainings that did not meet their stop, with the evaluation of the best return: success with and without contact:\n\n\
     | problem | option | m | steps | ended by | best return | success |\n|---|---|---|---|---|---|---|\n"
        .to_owned()
        + &text
}

/// What was not measured: environments of which nothing was, and single rows of the others.
fn missing(lines: &[&PaperLine], rows: &[PaperRow]) -> String {
    let mut words: Vec<String> = Vec::new();
    for rows in rows.chunk_by(|a, b| (&a.method, &a.env) == (&b.method, &b.env)) {
        let absent: Vec<&PaperRow> =
            rows.iter().filter(|row| !lines.iter().any(|line| line.row == **row)).collect();
        if absent.len() == rows.len() {
            words.push(format!("{} {}", rows[0].method, rows[0].env));
            continue;
        }
        for group in absent.chunk_by(|a, b| (&a.robot, &a.options) == (&b.robot, &b.options)) {
            let PaperRow { method, env, robot, options, .. } = group[0];
            let options = if options == "none" { String::new() } else { format!(" {options}") };
            let problems: Vec<String> = group.iter().map(|row| format!("P{}", row.problem)).collect();
            words.push(format!("{method} {env} {robot}{options} {}", problems.join(" ")));
        }
    }
    if words.is_empty() { String::new() } else { format!("\nNot measured yet: {}.\n", words.join("; ")) }
}
