//! Whole runs against the memory bandwidth of the same machine:
//! `cargo bench --bench whole_runs -- [--quick] [--ranks N] [--orders] [--pairs] [--peer "COMMAND"] [--write]`.
//!
//! Runs the solver on the problem of Wang and Cheng (2022) in the plane and in space, on one process, and takes seconds and bytes
//! by phase from `summary.json`. The bytes are those that have to be moved at the least if nothing stays in cache; a triad before
//! and after each run tells what the memory gives. Their ratio is how near to the memory bound a run is. Steps are solved to a
//! residual of 1e-8 of the forces.
//!
//! With `--ranks N` the same problems are run on one process and on N instead, in turn, three times, and the medians compared.
//!
//! With `--orders` they are run with quadratic cells and with linear cells of half the size instead, in turn, three times: with equal
//! unknowns.
//!
//! With `--pairs` a block pressed and sheared on another one is compared with one block of as many unknowns on a rigid plane, in turn, three
//! times; with itself without contact, with `sliding = "finite"`, and on two processes; and its set-up on two meshes.
//!
//! A peer is another program for the same problem: its command is given the dimension, the cells along an edge, the number of steps,
//! the preconditioner (cholesky or gamg) and the number of processes, and prints the seconds that a step took as its last word. Its
//! whole run is timed and its largest resident memory read from outside.
//!
//! `--write` puts the tables into docs/speed.md, those of ranks into docs/scaling.md.

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
    order: usize,
    steps: u32,
    preconditioner: &'static str,
    quick: bool,
}

const fn case(dimension: usize, cells: usize, steps: u32, preconditioner: &'static str, quick: bool) -> Case {
    Case { dimension, cells, order: 1, steps, preconditioner, quick }
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

/// A problem that is compared on one process and on several besides those of the table by phases.
const LARGE_CUBE: Case = case(3, 48, 16, "auto", false);
/// Problems that are compared with linear cells and with quadratic ones of twice the size.
const ORDERS: [Case; 6] = [
    case(2, 128, 64, "cholesky", true),
    case(2, 256, 32, "cholesky", false),
    case(2, 256, 32, "gamg", true),
    case(3, 16, 16, "cholesky", true),
    case(3, 32, 16, "cholesky", false),
    case(3, 32, 16, "gamg", true),
];
/// How often each is run.
const REPETITIONS: usize = 3;
/// Where the table of ranks stands.
const RANKS_PAGE: &str = "docs/scaling.md";

/// What the command line asks for.
#[derive(Default)]
struct Wanted {
    quick: bool,
    ranks: Option<u32>,
    orders: bool,
    pairs: bool,
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
            "--orders" => wanted.orders = true,
            "--pairs" => wanted.pairs = true,
            "--ranks" => {
                let count = words.next().and_then(|word| word.parse().ok()).filter(|count| *count > 1);
                wanted.ranks = Some(count.expect("a number above 1 behind --ranks"));
            }
            "--peer" => wanted.peer = Some(words.next().expect("a command behind --peer")),
            other => {
                panic!(
                    "{other}: known are --quick, --write, --orders, --pairs, --ranks N and --peer \"COMMAND\""
                )
            }
        }
    }
    wanted
}

/// Runs the problem of Wang and Cheng on this many processes; gives its `summary.json`.
fn run(case: &Case, ranks: u32) -> Value {
    let (job, cells) = match case.dimension {
        2 => ("wang_cheng_2022.toml", format!("mesh.rectangle.cells=[{0},{0}]", case.cells)),
        _ => ("wang_cheng_cube.toml", format!("mesh.box.cells=[{0},{0},{0}]", case.cells)),
    };
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("jobs/papers").join(job);
    solve(&file, case, ranks, vec![cells, format!("mesh.order={}", case.order)])
}

/// Runs a job on this many processes, with these settings and those of the case; gives its `summary.json`.
fn solve(job: &Path, case: &Case, ranks: u32, mut settings: Vec<String>) -> Value {
    let folder = tempfile::tempdir().expect("a folder");
    settings.extend([
        format!("time.step={}", 1.0 / f64::from(RATE)),
        format!("time.end={}", f64::from(case.steps) / f64::from(RATE)),
        format!("solver.preconditioner={:?}", case.preconditioner),
        format!("solver.tolerance={TOLERANCE:e}"),
        format!("output.folder={:?}", folder.path().join("out")),
        "output.fields={every=1000000}".into(),
        "checkpoint.every=1000000".into(),
    ]);
    let solver = env!("CARGO_BIN_EXE_solver");
    let mut command = Command::new(if ranks == 1 { solver } else { "mpirun" });
    if ranks > 1 {
        command.args(["-n", &ranks.to_string(), solver]);
    }
    let output = command
        .arg(job)
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
fn peer(command: &str, case: &Case, preconditioner: &str, ranks: u32) -> Cost {
    let Case { dimension, cells, steps, .. } = case;
    let words = format!("exec {command} {dimension} {cells} {steps} {preconditioner} {ranks}");
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

/// What a run of the solver has cost.
fn cost(case: &Case, summary: &Value) -> Cost {
    let number = |value: &Value| value.as_f64().expect("a number");
    let step: f64 = PHASES.iter().map(|phase| number(&summary["wall_seconds"][phase])).sum();
    Cost {
        step: step / f64::from(case.steps),
        run: number(&summary["wall_seconds"]["total"]),
        memory: number(&summary["peak_memory_bytes"]),
    }
}

/// The problem of a run, in words.
fn head(case: &Case, summary: &Value) -> String {
    let shape = if case.dimension == 2 { "square" } else { "cube" };
    let preconditioner = summary["preconditioner"].as_str().unwrap_or("?");
    let single = if summary["factor_precision"] == "single" { " single" } else { "" };
    format!("{shape} {}, {}, {preconditioner}{single}, {}", case.cells, summary["unknowns"], case.steps)
}

/// The median of each of these costs.
fn median(costs: &[Cost]) -> Cost {
    let of = |pick: fn(&Cost) -> f64| {
        let mut values: Vec<f64> = costs.iter().map(pick).collect();
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };
    Cost { step: of(|cost| cost.step), run: of(|cost| cost.run), memory: of(|cost| cost.memory) }
}

/// Compares runs on one process and on several, and on several with those of another program.
fn on_ranks(wanted: &Wanted, ranks: u32) {
    let mut triad = Triad::new();
    let bandwidth = BYTES as f64 / fastest(&mut || triad.run());
    let peer_head = if wanted.peer.is_some() {
        format!(" ms a step of the other on {ranks} | ratio |")
    } else {
        String::new()
    };
    let mut table = format!(
        "| problem, unknowns, preconditioner, steps | ms a step: 1, {ranks} | ratio | whole run, s: 1, {ranks} | ratio | memory of \
         all ranks, MB: 1, {ranks} | ratio |{peer_head}\n|---|---|---|---|---|---|---|{}\n",
        if wanted.peer.is_some() { "---|---|" } else { "" }
    );
    print!("{table}");
    let cases = CASES.iter().filter(|case| case.preconditioner == "auto").chain([&LARGE_CUBE]);
    for case in cases.filter(|case| case.quick || !wanted.quick) {
        let mut costs = [Vec::new(), Vec::new(), Vec::new()];
        let mut words = String::new();
        for _ in 0..REPETITIONS {
            for (count, costs) in [1, ranks].into_iter().zip(&mut costs) {
                let summary = run(case, count);
                costs.push(cost(case, &summary));
                words = head(case, &summary);
            }
            if let Some(command) = &wanted.peer {
                costs[2].push(peer(command, case, "cholesky", ranks));
            }
        }
        let [one, several] = [&costs[0], &costs[1]].map(|costs| median(costs));
        let mut line = against(&words, one, several);
        if wanted.peer.is_some() {
            let other = median(&costs[2]).step;
            write!(line, " {:.1} | {:.2} |", 1e3 * other, several.step / other).expect("text");
        }
        println!("{line}");
        writeln!(table, "{line}").expect("text");
    }
    if wanted.write {
        let command = format!("make bench-runs ARGS='--ranks {ranks} --write'");
        table::write(RANKS_PAGE, "ranks", &command, bandwidth, &table);
    }
}

/// Compares linear cells with quadratic ones of twice the size.
fn orders(wanted: &Wanted) {
    let mut triad = Triad::new();
    let bandwidth = BYTES as f64 / fastest(&mut || triad.run());
    let mut table = "| problem with linear cells, unknowns, preconditioner, steps | ms a step: linear, quadratic | ratio | whole run, s: linear, \
                     quadratic | ratio | peak memory, MB: linear, quadratic | ratio |\n|---|---|---|---|---|---|---|\n"
        .to_owned();
    print!("{table}");
    for linear in ORDERS.iter().filter(|case| case.quick || !wanted.quick) {
        let quadratic = Case { cells: linear.cells / 2, order: 2, ..*linear };
        let mut costs = [Vec::new(), Vec::new()];
        let mut words = String::new();
        for _ in 0..REPETITIONS {
            for (case, costs) in [&quadratic, linear].into_iter().zip(&mut costs) {
                let summary = run(case, 1);
                costs.push(cost(case, &summary));
                words = head(case, &summary);
            }
        }
        let [quadratic, linear] = costs.map(|costs| median(&costs));
        let line = against(&words, linear, quadratic);
        println!("{line}");
        writeln!(table, "{line}").expect("text");
    }
    if wanted.write {
        table::write(PAGE, "orders of cells", "make bench-runs ARGS='--orders --write'", bandwidth, &table);
    }
}

/// What is pressed and sheared.
#[derive(Clone, Copy, PartialEq)]
enum Scene {
    /// One block on a rigid plane.
    OneBody,
    /// A block on another one, both of half the height; the columns of the lower one are graded, so that no nodes meet.
    TwoBodies,
    /// They pass through each other.
    WithoutContact,
    /// What nodes face is found anew.
    Finite,
}

/// A job of blocks of this many layers of cells, on which a shear traction acts that grows by this much in a second, up to 4 Pa.
fn blocks(case: &Case, layers: usize, scene: Scene, shear: f64) -> String {
    let Case { dimension, cells, .. } = case;
    let (shape, zero, hypothesis) = match dimension {
        2 => ("rectangle", "", "hypothesis = \"plane_strain\""),
        _ => ("box", "0.0, ", ""),
    };
    let block = |name: &str, (low, high): (usize, usize)| {
        let (height, thickness) = (low as f64 / *cells as f64, (high - low) as f64 / *cells as f64);
        let [side, columns] = if *dimension == 2 {
            [String::new(), String::new()]
        } else {
            ["1.0, ".into(), format!("{cells}, ")]
        };
        let graded = if name == "lower" { "grading = { x = 1.2, toward = [\"left\"] }" } else { "" };
        format!(
            "[[mesh.{shape}]]\nname = {name:?}\ncorner = [0.0, {zero}{height}]\nsize = [1.0, {side}{thickness}]\n\
             cells = [{cells}, {columns}{}]\n{graded}\n",
            high - low
        )
    };
    let pair = scene != Scene::OneBody;
    let mut text = block("upper", (if pair { layers / 2 } else { 0 }, layers));
    if pair {
        text += &block("lower", (0, layers / 2));
        text += "[[support]]\non = [\"lower.bottom\"]\nfix = \"all\"\n";
    }
    text += &format!(
        "[material]\n{hypothesis}\ndensity = 1.0\n[material.elasticity]\nyoungs_modulus = 1000.0\npoisson_ratio = 0.3\n\
         [[traction]]\non = [\"upper.top\"]\nvalue = [\"min({shear}*t, 4)\", {zero}-10.0]\n[time]\nscheme = \"bdf2\"\nend = 1.0\nstep = 1.0\n"
    );
    if scene != Scene::WithoutContact {
        text += "[[contact]]\non = [\"upper.bottom\"]\nnormal.unilateral = {}\nfriction.coulomb.coefficient = 0.3\n";
        text += if pair { "against = [\"lower.top\"]\nside = \"on\"\n" } else { "" };
        text += if scene == Scene::Finite { "sliding = \"finite\"\n" } else { "" };
    }
    text
}

/// A run of blocks on this many processes.
fn press(case: &Case, layers: usize, (scene, shear): (Scene, f64), ranks: u32) -> Value {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("blocks.toml");
    std::fs::write(&file, blocks(case, layers, scene, shear)).expect("written");
    solve(&file, case, ranks, Vec::new())
}

/// Growth of the shear traction, in Pa/s, on blocks that stick.
const STUCK: f64 = 2.0;
/// That on blocks that slide after 75 ms, by a facet a step in the end.
const SLIDING: f64 = 40.0;
/// Blocks, with and without a factor.
const BLOCKS: [Case; 6] = [
    case(2, 128, 32, "cholesky", true),
    case(2, 256, 32, "cholesky", true),
    case(3, 16, 32, "cholesky", true),
    case(3, 32, 8, "cholesky", false),
    case(2, 128, 8, "gamg", false),
    case(3, 16, 8, "gamg", false),
];
/// Cells along the edges of two plates of which the set-up is measured.
const PLATES: [usize; 2] = [56, 112];

/// What pairs of bodies cost.
fn pairs(wanted: &Wanted) {
    let mut triad = Triad::new();
    let bandwidth = BYTES as f64 / fastest(&mut || triad.run());
    let number = |value: &Value| value.as_f64().expect("a number");
    let corrections = |summary: &Value| {
        let [newton, linear] = ["newton_iterations", "linear_iterations"].map(|key| number(&summary[key]));
        // Linear steps are solved without a correction.
        let (steps, solves) = (number(&summary["steps"]), newton.max(number(&summary["steps"])));
        format!("{:.1} x {:.1}", solves / steps, linear / solves)
    };
    // What is compared: words, scenes with their shear tractions, and the processes of the second.
    let one = ("one body, two bodies", [(Scene::OneBody, SLIDING), (Scene::TwoBodies, SLIDING)], 1);
    let without =
        ("without contact, with it", [(Scene::WithoutContact, SLIDING), (Scene::TwoBodies, SLIDING)], 1);
    let sticks = ("`small`, `finite`, no slip", [(Scene::TwoBodies, STUCK), (Scene::Finite, STUCK)], 1);
    let slides = ("`small`, `finite`, slip", [(Scene::TwoBodies, SLIDING), (Scene::Finite, SLIDING)], 1);
    let ranks = ("1 rank, 2 ranks", [(Scene::TwoBodies, SLIDING); 2], 2);
    let head = "| compared | problem, unknowns, preconditioner, steps | solves a step x iterations each | ms a step | ratio | \
                whole run, s | ratio | peak memory, MB | ratio |\n|---|---|---|---|---|---|---|---|---|\n";
    let mut tables = [head.to_owned(), head.to_owned()];
    print!("{head}");
    for case in BLOCKS.iter().filter(|case| case.quick || !wanted.quick) {
        let multigrid = case.preconditioner == "gamg";
        let rows = if multigrid { vec![without, ranks] } else { vec![one, sticks, slides, ranks] };
        for (name, scenes, processes) in rows {
            let mut costs = [Vec::new(), Vec::new()];
            let mut words = [String::new(), String::new()];
            let mut problem = String::new();
            for _ in 0..REPETITIONS {
                for (at, (scene, count)) in scenes.into_iter().zip([1, processes]).enumerate() {
                    let summary = press(case, case.cells, scene, count);
                    costs[at].push(cost(case, &summary));
                    words[at] = corrections(&summary);
                    problem = self::head(case, &summary);
                }
            }
            let [first, second] = costs.map(|costs| median(&costs));
            let line = against(&format!("{name} | {problem} | {}", words.join(", ")), first, second);
            println!("{line}");
            writeln!(tables[usize::from(processes > 1)], "{line}").expect("text");
        }
    }
    let mut plates = "| facets of each plate, unknowns | set-up and assembly without contact, with it, s | difference, µs a facet |\n|---|---|---|\n".to_owned();
    for cells in PLATES {
        let case = case(3, cells, 1, "gamg", true);
        let mut seconds = [Vec::new(), Vec::new()];
        let mut unknowns = 0.0;
        for _ in 0..REPETITIONS {
            for (scene, seconds) in [Scene::WithoutContact, Scene::TwoBodies].into_iter().zip(&mut seconds) {
                let summary = press(&case, 2, (scene, STUCK), 1);
                seconds.push(
                    ["setup", "assembly"]
                        .map(|phase| number(&summary["wall_seconds"][phase]))
                        .iter()
                        .sum::<f64>(),
                );
                unknowns = number(&summary["unknowns"]);
            }
        }
        let [without, with] = seconds.map(|mut seconds| {
            seconds.sort_by(f64::total_cmp);
            seconds[seconds.len() / 2]
        });
        let facets = 2 * cells * cells;
        writeln!(
            plates,
            "| {facets}, {unknowns} | {without:.2}, {with:.2} | {:.1} |",
            1e6 * (with - without) / facets as f64
        )
        .expect("text");
    }
    print!("{plates}");
    if wanted.write {
        let command = "make bench-runs ARGS='--pairs --write'";
        let [speed, ranks] = tables;
        table::write(PAGE, "pairs", command, bandwidth, &speed);
        table::write(PAGE, "set-up of pairs", command, bandwidth, &plates);
        table::write(RANKS_PAGE, "pairs", command, bandwidth, &ranks);
    }
}

fn main() {
    let wanted = wanted();
    if wanted.pairs {
        pairs(&wanted);
        return;
    }
    if wanted.orders {
        orders(&wanted);
        return;
    }
    if let Some(ranks) = wanted.ranks {
        on_ranks(&wanted, ranks);
        return;
    }
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
        let summary = run(case, 1);
        let memory = before.max(memory());
        bandwidth = bandwidth.max(memory);
        let steps = f64::from(case.steps);
        let preconditioner = summary["preconditioner"].as_str().unwrap_or("?");
        let head = head(case, &summary);
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
            let line = against(&head, peer(command, case, preconditioner, 1), cost(case, &summary));
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
