//! Whole runs against the memory bandwidth of the same machine:
//! `cargo bench --bench whole_runs -- [--quick] [--peer "COMMAND"] [--write]`.
//!
//! Runs the solver on the problem of Wang and Cheng (2022) in the plane and in space, on one process, and takes seconds and bytes
//! by phase from `summary.json`. The bytes are those that have to be moved at the least if nothing stays in cache; a triad before
//! and after each run tells what the memory gives. Their ratio is how near to the memory bound a run is. Steps are solved to a
//! residual of 1e-8 of the forces.
//!
//! A peer is another program for the same problem: its command is given the dimension, the cells along an edge, the number of steps
//! and the preconditioner (cholesky or gamg), and prints the seconds that a step took as its last word. Its whole run is timed and its largest resident memory read
//! from outside.
//!
//! `--write` puts the tables into docs/speed.md.

mod table;
mod triad;

use serde_json::Value;
use std::{
    fmt::Write,
    path::Path,
    process::{Command, Stdio},
    thread::sleep,
    time::{Duration, Instant},
};
use triad::{BYTES, Triad, fastest};

/// Steps a second.
const RATE: u32 = 64;
/// Residual of a step's solution over the forces.
const TOLERANCE: f64 = 1e-8;
/// Phases of a step.
const PHASES: [&str; 3] = ["history", "solve", "balance"];

/// Where the tables stand.
const PAGE: &str = "docs/speed.md";
/// The head of the table that holds runs against those of another program.
const PEERS: &str = "| problem, unknowns, preconditioner, steps | ms a step: other, this | ratio | whole run, s: other, this | ratio | peak memory, MB: other, this | ratio |
|---|---|---|---|---|---|---|";

/// A run.
struct Case {
    dimension: usize,
    /// Along an edge.
    cells: usize,
    steps: u32,
    preconditioner: &'static str,
    quick: bool,
}

const fn case(dimension: usize, cells: usize, steps: u32, preconditioner: &'static str, quick: bool) -> Case {
    Case { dimension, cells, steps, preconditioner, quick }
}

const CASES: [Case; 9] = [
    case(2, 128, 64, "auto", true),
    case(2, 256, 32, "auto", true),
    case(2, 512, 16, "auto", false),
    case(3, 16, 16, "auto", true),
    case(3, 32, 16, "auto", false),
    case(2, 256, 32, "gamg", true),
    case(2, 512, 16, "gamg", false),
    case(2, 1024, 4, "gamg", false),
    case(3, 32, 16, "gamg", false),
];

/// What the command line asks for.
#[derive(Default)]
struct Wanted {
    quick: bool,
    peer: Option<String>,
    write: bool,
}

fn wanted() -> Wanted {
    let mut wanted = Wanted::default();
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        match word.as_str() {
            // Given by cargo.
            "--bench" => {}
            "--quick" => wanted.quick = true,
            "--write" => wanted.write = true,
            "--peer" => wanted.peer = Some(words.next().expect("a command behind --peer")),
            other => panic!("{other}: known are --quick, --write and --peer \"COMMAND\""),
        }
    }
    wanted
}

/// Runs the solver; gives its `summary.json`.
fn run(case: &Case) -> Value {
    let (job, cells) = match case.dimension {
        2 => ("wang_cheng_2022.toml", format!("mesh.rectangle.cells=[{0},{0}]", case.cells)),
        _ => ("wang_cheng_cube.toml", format!("mesh.box.cells=[{0},{0},{0}]", case.cells)),
    };
    let folder = tempfile::tempdir().expect("a folder");
    let settings = [
        cells,
        format!("time.step={}", 1.0 / f64::from(RATE)),
        format!("time.end={}", f64::from(case.steps) / f64::from(RATE)),
        format!("solver.preconditioner={:?}", case.preconditioner),
        format!("solver.tolerance={TOLERANCE:e}"),
        format!("output.folder={:?}", folder.path().join("out")),
        "output.fields={every=1000000}".into(),
        "checkpoint.every=1000000".into(),
    ];
    let output = Command::new(env!("CARGO_BIN_EXE_solver"))
        .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("jobs/papers").join(job))
        .args(settings.iter().flat_map(|setting| ["--set", setting]))
        .output()
        .expect("the solver");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = std::fs::read_to_string(folder.path().join("out/summary.json")).expect("a summary");
    serde_json::from_str(&text).expect("an object")
}

/// Seconds of a step and of the whole run, and bytes of the largest resident memory.
#[derive(Clone, Copy)]
struct Cost {
    step: f64,
    run: f64,
    memory: f64,
}

/// What another program costs.
fn peer(command: &str, case: &Case, preconditioner: &str) -> Cost {
    let words = format!("exec {command} {} {} {} {preconditioner}", case.dimension, case.cells, case.steps);
    let start = Instant::now();
    let mut child = Command::new("sh").args(["-c", &words]).stdout(Stdio::piped()).spawn().expect("sh");
    let status = format!("/proc/{}/status", child.id());
    let mut memory = 0.0;
    while child.try_wait().expect("a child").is_none() {
        let facts = std::fs::read_to_string(&status).unwrap_or_default();
        let peak = facts.lines().find_map(|line| line.strip_prefix("VmHWM:")?.split_whitespace().next());
        memory = peak.and_then(|kilobytes| kilobytes.parse().ok()).map_or(memory, |k: f64| 1024.0 * k);
        sleep(Duration::from_millis(20));
    }
    let run = start.elapsed().as_secs_f64();
    let text = String::from_utf8(child.wait_with_output().expect("output").stdout).expect("text");
    let last = text.split_whitespace().last().and_then(|word| word.parse().ok());
    let step = last.unwrap_or_else(|| panic!("{words}: the last word is no number of seconds:\n{text}"));
    Cost { step, run, memory }
}

/// A row that holds a run against that of another program.
fn against(head: &str, other: Cost, this: Cost) -> String {
    let pair = |other: f64, this: f64, digits: usize| {
        format!("{other:.digits$}, {this:.digits$} | {:.2}", this / other)
    };
    format!(
        "| {head} | {} | {} | {} |",
        pair(1e3 * other.step, 1e3 * this.step, 1),
        pair(other.run, this.run, 2),
        pair(other.memory / 1e6, this.memory / 1e6, 0)
    )
}

/// A row of the table: a phase with its seconds and bytes, beside what the memory gives in bytes a second.
fn row(head: &str, phase: &str, steps: f64, seconds: f64, bytes: Option<f64>, memory: f64) -> String {
    let time = 1e3 * seconds / steps;
    let counted = bytes.map_or_else(
        || format!("{:>9} {:>7} {:>8}", "-", "-", "-"),
        |bytes| {
            let rate = bytes / seconds;
            format!("{:>9.2} {:>7.2} {:>8.2}", bytes / steps / 1e6, rate / 1e9, rate / memory)
        },
    );
    format!("{head:<50} {phase:<8} {time:>9.2} {counted}")
}

fn main() {
    let wanted = wanted();
    let mut triad = Triad::new();
    let mut memory = || BYTES as f64 / fastest(&mut || triad.run());
    let (mut phases, mut peers, mut bandwidth) = (String::new(), String::new(), 0.0_f64);
    let mut tell = |line: String| {
        println!("{line}");
        writeln!(phases, "{line}").expect("text");
    };
    tell(format!(
        "{:<50} {:<8} {:>9} {:>9} {:>7} {:>8}",
        "problem, unknowns, preconditioner, steps", "phase", "ms a step", "MB a step", "GB/s", "of triad"
    ));
    for case in CASES.iter().filter(|case| case.quick || !wanted.quick) {
        let before = memory();
        let summary = run(case);
        let memory = before.max(memory());
        bandwidth = bandwidth.max(memory);
        let steps = f64::from(case.steps);
        let shape = if case.dimension == 2 { "square" } else { "cube" };
        let preconditioner = summary["preconditioner"].as_str().unwrap_or("?");
        let single = if summary["factor_precision"] == "single" { " single" } else { "" };
        let head =
            format!("{shape} {}, {}, {preconditioner}{single}, {steps}", case.cells, summary["unknowns"]);
        let (mut seconds, mut bytes) = (0.0, Some(0.0));
        for (at, phase) in PHASES.iter().enumerate() {
            let spent = summary["wall_seconds"][phase].as_f64().expect("seconds");
            let moved = summary["traffic_bytes"][phase].as_f64();
            seconds += spent;
            bytes = bytes.zip(moved).map(|(sum, more)| sum + more);
            tell(row(if at == 0 { &head } else { "" }, phase, steps, spent, moved, memory));
        }
        let triad = format!("  triad {:.1} GB/s", memory / 1e9);
        tell(row(&triad, "step", steps, seconds, bytes, memory));
        if let Some(command) = &wanted.peer {
            let number = |value: &Value| value.as_f64().expect("a number");
            let this = Cost {
                step: seconds / steps,
                run: number(&summary["wall_seconds"]["total"]),
                memory: number(&summary["peak_memory_bytes"]),
            };
            let line = against(&head, peer(command, case, preconditioner), this);
            println!("{line}");
            writeln!(peers, "{line}").expect("text");
        }
    }
    if wanted.write {
        let command = "make bench-runs ARGS=--write";
        table::write(PAGE, "phases", command, bandwidth, &format!("```\n{phases}```"));
        if wanted.peer.is_some() {
            let command = "make bench-runs ARGS='--write --peer \"COMMAND\"'";
            table::write(PAGE, "peer", command, bandwidth, &format!("{PEERS}\n{peers}"));
        }
    }
}
