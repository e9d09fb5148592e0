//! `cargo xtask paper-table`: the paper's own protocol from end to end, in as many calls as it takes.
//!
//! The rows come from the example `paper_table` of `sharp-bench`, which also writes the section of the results and its
//! figures. In between each row is measured with the `sharp` command, and its line goes to a file of the repository. A call
//! measures what has no line yet.

use std::fs;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, ensure};
use serde_json::{Value, json};

use crate::paper_row::{NamedRow, PaperSite, TIME_LIMIT_S};
use crate::process::{cargo, flag};
use crate::tree::root;

const LINES: &str = "docs/data/paper-protocol.jsonl";
const PAGE: &str = "docs/results.md";
const IMAGES: &str = "docs/images";
/// Libraries, plans and trainings, from the root.
const OUT: &str = "out/paper";
/// A flat policy learns for the whole time of a problem, is driven after that, and cannot go on in another call.
const FLAT_POLICY_S: f64 = TIME_LIMIT_S + 120.0;

/// Measures for `--minutes N`, then writes the section. `--only TEXT` chooses rows, `--trial ROW` measures one for nothing.
/// Calls that choose other rows may run side by side.
///
/// # Errors
/// If a flag is unreadable, or a program cannot be built or run.
pub(crate) fn run(args: &[String]) -> anyhow::Result<u8> {
    let minutes: f64 = flag(args, "--minutes").unwrap_or("0").parse().context("--minutes")?;
    ensure!((0.0..=1e5).contains(&minutes), "--minutes is {minutes}, expected 0 or more");
    let table = PaperTable::prepare(minutes)?;
    let rows = table.rows()?;
    if let Some(name) = flag(args, "--trial") {
        return table.trial(&rows, name);
    }
    let only = flag(args, "--only").unwrap_or_default();
    let is_chosen = |row: &Value| NamedRow(row).name().contains(only);
    ensure!(rows.iter().any(is_chosen), "no row's name holds {only:?}; one is {}", NamedRow(&rows[0]).name());
    let code = table.measure_missing(&rows, &is_chosen)?;
    table.write()?;
    Ok(code)
}

/// The programs, and where rows are measured.
struct PaperTable {
    site: PaperSite,
    /// The example that knows the rows and writes the page.
    writer: PathBuf,
}

impl PaperTable {
    fn prepare(minutes: f64) -> anyhow::Result<Self> {
        let build = ["build", "--release", "--workspace", "--bins", "--example", "paper_table"];
        let output = cargo(&build)
            .args(["--message-format", "json-render-diagnostics"])
            .stderr(Stdio::inherit())
            .output()
            .context("cannot start cargo")?;
        ensure!(output.status.success(), "the programs do not build");
        let messages = String::from_utf8_lossy(&output.stdout).into_owned();
        let built = |name: &str| {
            built(&messages, name).with_context(|| format!("cargo does not say where {name} is"))
        };
        let out = PathBuf::from(OUT);
        fs::create_dir_all(root().join(&out)).context("cannot make out/paper")?;
        // A later build must not change what runs for hours, and another call may run another build.
        let fresh = fs::read(built("sharp")?).context("cannot read sharp")?;
        let mut hasher = DefaultHasher::new();
        fresh.hash(&mut hasher);
        let program = root().join(&out).join(format!("sharp-{:016x}", hasher.finish()));
        if !program.exists() {
            fs::copy(built("sharp")?, &program).context("cannot copy sharp into out/paper")?;
        }
        std::env::set_current_dir(root()).context("cannot go to the root")?;
        let site = PaperSite {
            program,
            out,
            deadline: Instant::now() + Duration::from_secs_f64(60.0 * minutes),
            version: version(),
            machine: machine(),
        };
        Ok(Self { site, writer: built("paper_table")? })
    }

    /// All rows, in the order in which they are measured.
    fn rows(&self) -> anyhow::Result<Vec<Value>> {
        let output = Command::new(&self.writer).arg("rows").output().context("cannot start paper_table")?;
        let text = String::from_utf8(output.stdout).context("paper_table prints no text")?;
        text.lines().map(|line| serde_json::from_str(line).context("paper_table prints no rows")).collect()
    }

    /// Measures the chosen ones of `rows` that have no line yet, while there is time; 3 if some are left.
    fn measure_missing(&self, rows: &[Value], is_chosen: &dyn Fn(&Value) -> bool) -> anyhow::Result<u8> {
        let known: Vec<String> = read_lines()?.iter().map(|line| NamedRow(line).name()).collect();
        let missing = missing(rows, is_chosen, &known, |row| self.site.has_learnt(row));
        let mut left = missing.len();
        for together in missing.chunk_by(|a, b| are_measured_together(a, b)) {
            let remaining_s = self.site.deadline.saturating_duration_since(Instant::now()).as_secs_f64();
            let is_flat = NamedRow(together[0]).word("method") == "sac";
            if remaining_s == 0.0 || (is_flat && remaining_s < FLAT_POLICY_S) {
                break;
            }
            let results: Vec<anyhow::Result<Option<Value>>> = std::thread::scope(|scope| {
                let begin = |row: &&Value| {
                    let row = (*row).clone();
                    eprintln!("{}, {left} rows left", NamedRow(&row).name());
                    scope.spawn(move || self.site.measure(&NamedRow(&row)))
                };
                let running: Vec<_> = together.iter().map(begin).collect();
                running.into_iter().map(|one| one.join().expect("no panic")).collect()
            });
            let mut failure = Ok(());
            for result in results {
                match result {
                    Ok(Some(line)) => {
                        keep(&line)?;
                        self.site.note(&NamedRow(&line))?;
                        eprintln!("{}", summary(&line));
                        left -= 1;
                    }
                    Ok(None) => {}
                    // The others are kept first: each may have taken forty minutes.
                    Err(error) => failure = Err(error),
                }
            }
            failure?;
            self.write()?;
        }
        Ok(if left == 0 { 0 } else { 3 })
    }

    /// Measures the row called `name` apart from all others and prints its line.
    fn trial(&self, rows: &[Value], name: &str) -> anyhow::Result<u8> {
        let row = rows.iter().find(|row| NamedRow(row).name() == name);
        let row = row
            .with_context(|| format!("no row is called {name:?}; one is {:?}", NamedRow(&rows[0]).name()))?;
        let out = self.site.out.join("trial");
        let site = PaperSite {
            out,
            program: self.site.program.clone(),
            version: self.site.version.clone(),
            machine: self.site.machine.clone(),
            ..self.site
        };
        match site.measure(&NamedRow(row))? {
            Some(line) => println!("{line}"),
            None => {
                eprintln!("time was up; the same call goes on");
                return Ok(3);
            }
        }
        // The next trial begins with nothing.
        fs::remove_dir_all(&site.out).context("cannot remove the trial")?;
        Ok(0)
    }

    /// Writes the section and the figures.
    fn write(&self) -> anyhow::Result<()> {
        read_lines()?;
        let status =
            Command::new(&self.writer).args(["write", LINES, PAGE, IMAGES]).stdout(Stdio::null()).status();
        ensure!(status.is_ok_and(|status| status.success()), "{PAGE} cannot be written");
        Ok(())
    }
}

/// The chosen ones of `rows` that are to be measured: of a chain of problems with one library that is not `known` to the end,
/// all whose policies the library has not got, in order. A problem without what those before it learnt is another one, so a
/// chain ends before a row that is not chosen, and begins anew where its library is gone.
fn missing<'a>(
    rows: &'a [Value],
    is_chosen: &dyn Fn(&Value) -> bool,
    known: &[String],
    has_learnt: impl Fn(&NamedRow<'_>) -> bool,
) -> Vec<&'a Value> {
    let is_same = |a: &Value, b: &Value| NamedRow(a).group() == NamedRow(b).group();
    let of_chain = |chain: &'a [Value]| {
        let is_known = |row: &NamedRow<'_>| known.contains(&row.name());
        let is_whole = chain.iter().all(|row| is_known(&NamedRow(row)));
        // Whoever removes a line wants it measured again.
        let left = chain.iter().skip_while(|row| is_known(&NamedRow(row)) && has_learnt(&NamedRow(row)));
        left.take_while(|row| !is_whole && is_chosen(row)).collect::<Vec<_>>()
    };
    rows.chunk_by(is_same).flat_map(of_chain).collect()
}

/// Flat policies of one environment learn on one core each.
fn are_measured_together(a: &Value, b: &Value) -> bool {
    let (a, b) = (NamedRow(a), NamedRow(b));
    let is_flat = |row: &NamedRow<'_>| row.word("method") == "sac";
    is_flat(&a) && is_flat(&b) && a.word("env") == b.word("env")
}

/// The lines so far; makes the file if there is none.
fn read_lines() -> anyhow::Result<Vec<Value>> {
    let path = root().join(LINES);
    if !path.exists() {
        fs::create_dir_all(path.parent().expect("a folder")).context("cannot make docs/data")?;
        fs::write(&path, "").with_context(|| format!("cannot write {LINES}"))?;
    }
    let text = fs::read_to_string(&path).with_context(|| format!("cannot read {LINES}"))?;
    let parse = |(index, line): (usize, &str)| {
        serde_json::from_str(line).with_context(|| format!("{LINES} line {}", index + 1))
    };
    text.lines().enumerate().map(parse).collect()
}

/// Puts `line` behind the others, in place of an older one of its row.
fn keep(line: &Value) -> anyhow::Result<()> {
    let folder = root().join(OUT);
    // Another call may do the same.
    let lock = fs::File::create(folder.join("lock")).and_then(|file| file.lock().map(|()| file));
    let _lock = lock.with_context(|| format!("cannot lock {OUT}"))?;
    let name = NamedRow(line).name();
    let others = read_lines()?.into_iter().filter(|other| NamedRow(other).name() != name);
    let text: String = others.chain([line.clone()]).map(|line| format!("{line}\n")).collect();
    // A kill must not leave half a file: the lines took hours.
    let fresh = folder.join("lines.jsonl");
    let written = fs::write(&fresh, text).and_then(|()| fs::rename(&fresh, root().join(LINES)));
    written.with_context(|| format!("cannot write {LINES}"))
}

fn summary(line: &Value) -> String {
    let count = |key: &str| format!("{} of {}", line[key]["successes"], line[key]["episodes"]);
    let name = NamedRow(line).name();
    let (status, wall_s) = (&line["status"], &line["wall_s"]);
    format!(
        "{name}: {status} after {wall_s} s, contact allowed {}, without {}",
        count("with_contact"),
        count("without_contact")
    )
}

/// The program called `name` among cargo's messages, a JSON object a line.
fn built(messages: &str, name: &str) -> Option<PathBuf> {
    messages.lines().find_map(|line| {
        let message: Value = serde_json::from_str(line).ok()?;
        let is_it = message["target"]["name"] == name;
        message["executable"].as_str().filter(|_| is_it).map(PathBuf::from)
    })
}

/// Version and commit, with a plus for changes that were not committed.
fn version() -> String {
    let git = Command::new("git").args(["describe", "--always", "--dirty=+", "--exclude=*"]).output();
    let commit = git.map(|output| String::from_utf8_lossy(&output.stdout).trim().to_owned());
    format!("{} {}", env!("CARGO_PKG_VERSION"), commit.unwrap_or_default())
}

/// The processor's name and the number of cores.
fn machine() -> Value {
    let text = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = text.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    json!({"cpu": name.map_or(std::env::consts::ARCH, |(_, name)| name.trim()), "cores": cores})
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flat_policies_of_one_environment_are_learnt_side_by_side_and_nothing_else_is() {
        let row =
            |method: &str, env: &str, robot: &str| json!({"method": method, "env": env, "robot": robot});
        let rows = [
            row("paper", "a", "husky"),
            row("paper", "a", "limo"),
            row("sac", "a", "husky"),
            row("sac", "a", "limo"),
            row("sac", "b", "husky"),
        ];
        let sizes: Vec<usize> = rows.chunk_by(are_measured_together).map(<[Value]>::len).collect();
        assert_eq!(sizes, [1, 1, 2, 1]);
    }

    #[test]
    fn a_chain_goes_on_with_its_library_and_begins_anew_without() {
        let row = |env: &str, problem: u32| json!({"method": "paper", "env": env, "robot": "limo", "options": "centroid", "problem": problem});
        let rows = [row("a", 1), row("a", 2), row("a", 3), row("b", 1), row("b", 2)];
        let known = [0, 1, 3, 4].map(|index: usize| NamedRow(&rows[index]).name());
        let left = |chosen: &str, learnt: &[u64]| -> Vec<u64> {
            let is_chosen = |row: &Value| NamedRow(row).name().contains(chosen);
            let rows = missing(&rows, &is_chosen, &known, |row| learnt.contains(&row.problem()));
            rows.iter().map(|row| NamedRow(row).problem()).collect()
        };
        assert_eq!(left("", &[1, 2]), [3], "and nothing of b, which is whole");
        assert_eq!(left("", &[]), [1, 2, 3], "the library is gone");
        assert_eq!(left("", &[1]), [2, 3], "problem 2 is known from another library");
        assert_eq!(left("p3", &[1, 2]), [3]);
        assert!(left("p3", &[]).is_empty(), "problem 3 needs what 1 and 2 learnt");
        assert_eq!(left("", &[1, 2, 3]), [3], "its line was removed");
    }

    #[test]
    fn a_program_is_found_among_others() {
        let line = |name: &str| format!(r#"{{"target":{{"name":"{name}"}},"executable":"/t/{name}"}}"#);
        let messages = [line("xtask"), r#"{"target":{"name":"sharp"}}"#.to_owned(), line("sharp")].join("\n");
        assert_eq!(built(&messages, "sharp"), Some(PathBuf::from("/t/sharp")));
        assert_eq!(built(&messages, "paper_table"), None);
    }
}
