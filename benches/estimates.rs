//! The times that `solver check` estimates, against those of the runs of the project's jobs:
//! `cargo bench --bench estimates -- [--write] [words in the names of jobs]`.
//!
//! Each job is checked and then run on one process, three times in turn; the table has the estimate that is the median and the median of the
//! times, without output. `--write` puts it into docs/speed.md.

mod jobs;
mod table;

use jobs::jobs;
use serde_json::Value;
use std::{fmt::Write, path::Path, process::Command};

const PAGE: &str = "docs/speed.md";
const REPETITIONS: usize = 3;

/// What the solver prints with these arguments; `None` if it refuses the job.
fn solver(arguments: &[&str]) -> Option<String> {
    let output = Command::new(env!("CARGO_BIN_EXE_solver")).args(arguments).output().expect("the solver");
    output.status.success().then(|| String::from_utf8(output.stdout).expect("text"))
}

/// The estimated and the measured time of a run.
struct Times {
    tried: u64,
    steps: u64,
    /// Seconds of the run without output.
    run: [f64; 3],
}

/// Checks and runs a job; `None` if it is refused.
fn times(job: &Path) -> Option<Times> {
    let job = job.to_str().expect("text");
    let checked: Value = serde_json::from_str(&solver(&["check", "--json", job])?).expect("an object");
    let folder = tempfile::tempdir().expect("a folder");
    let output = format!("output.folder={:?}", folder.path().join("out"));
    solver(&["run", "--quiet", job, "--set", &output])?;
    let text = std::fs::read_to_string(folder.path().join("out/summary.json")).expect("a summary");
    let summary: Value = serde_json::from_str(&text).expect("an object");
    let number = |value: &Value| value.as_f64().expect("a number");
    let phase = |name: &str| number(&summary["wall_seconds"][name]);
    let run = phase("total") - phase("output");
    let steps = summary["steps"].as_u64().expect("steps");
    let seconds = &checked["estimate"]["seconds"];
    let range = |name: &str, measured: f64| [number(&seconds[name][0]), number(&seconds[name][1]), measured];
    Some(Times { tried: seconds["tried_steps"].as_u64().expect("steps"), steps, run: range("run", run) })
}

/// The median of the estimates and the median of the measured times.
fn median(mut all: Vec<Times>) -> Times {
    all.sort_by(|a, b| a.run[1].total_cmp(&b.run[1]));
    let middle = all.len() / 2;
    let mut measured: Vec<f64> = all.iter().map(|times| times.run[2]).collect();
    measured.sort_by(f64::total_cmp);
    let run = measured[middle];
    let Times { tried, steps, run: [shortest, longest, _] } = all.remove(middle);
    Times { tried, steps, run: [shortest, longest, run] }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|word| word != "--bench").collect();
    let (options, words): (Vec<String>, Vec<String>) =
        arguments.into_iter().partition(|word| word.starts_with("--"));
    assert!(options.iter().all(|option| option == "--write"), "known is --write");
    let mut table =
        "| job | steps: tried, all | s of the run: estimate, measured | measured over the mean of \
                     the estimate | within |\n|---|---|---|--:|---|\n"
            .to_owned();
    print!("{table}");
    let (mut within, mut count) = (0, 0);
    for job in jobs(&words) {
        let name = job.strip_prefix(env!("CARGO_MANIFEST_DIR")).unwrap_or(&job).with_extension("");
        let found: Option<Vec<Times>> = (0..REPETITIONS).map(|_| times(&job)).collect();
        let Some(found) = found.map(median) else { continue };
        let Times { tried, steps, run } = found;
        let is_within = run[0] <= run[2] && run[2] <= run[1];
        let line = format!(
            "| `{}` | {tried}, {steps} | {:.2} to {:.2}, {:.2} | {:.2} | {} |",
            name.strip_prefix("jobs").unwrap_or(&name).display(),
            run[0],
            run[1],
            run[2],
            run[2] / (run[0] * run[1]).sqrt(),
            if is_within { "yes" } else { "no" }
        );
        println!("{line}");
        writeln!(table, "{line}").expect("text");
        (within, count) = (within + usize::from(is_within), count + 1);
    }
    let sum = format!("\n{within} of {count} times of runs are within the estimated range.");
    println!("{sum}");
    writeln!(table, "{sum}").expect("text");
    if options.iter().any(|option| option == "--write") {
        let command = if cfg!(debug_assertions) {
            "cargo bench --profile dev --bench estimates -- --write"
        } else {
            "make bench-estimates ARGS=--write"
        };
        table::write(PAGE, "estimates", command, None, &table);
    }
}
