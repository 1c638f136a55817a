//! Accuracy in space against seconds and memory, for cells of first and second order, on uniform and graded meshes:
//! `cargo bench --bench space -- [--write]`.
//!
//! Each problem has a reference value of one quantity: a closed form, or the value on a mesh much finer than those of the table.
//! `--write` puts the tables into docs/space.md.

#[path = "../tests/checked.rs"]
mod checked;
#[path = "../tests/cores.rs"]
mod cores;
#[path = "table/mod.rs"]
mod table;
#[path = "triad/mod.rs"]
mod triad;

use clarke::postprocessing::study::quantity;
use std::{fs, path::Path, process::Command};
use triad::{BYTES, Triad, fastest};

const PAGE: &str = "docs/space.md";
const COMMAND: &str = "make bench-space ARGS=--write";
const STUDY: &str = "jobs/studies/wang_cheng_in_space.toml";
/// How often each run is repeated; the fastest counts.
const REPETITIONS: usize = 2;
/// Relative errors for which the fastest run is listed.
const TARGETS: [f64; 4] = [0.05, 0.02, 0.01, 0.003];

struct Problem {
    name: &'static str,
    /// Relative to jobs/, without extension.
    job: &'static str,
    quantity: &'static str,
    reference: f64,
    changes: &'static [&'static str],
    families: &'static [Family],
}

/// Meshes of one kind.
struct Family {
    name: &'static str,
    changes: &'static [&'static str],
    /// The key of the cells, and its values.
    key: &'static str,
    cells: &'static [&'static str],
}

const fn family(
    name: &'static str,
    key: &'static str,
    changes: &'static [&'static str],
    cells: &'static [&'static str],
) -> Family {
    Family { name, changes, key, cells }
}

const PLANE: &str = "mesh.rectangle.cells";
const BOX: &str = "mesh.box.cells";
const BARS: [&str; 4] = ["[8, 1, 2]", "[16, 1, 4]", "[32, 2, 8]", "[64, 4, 16]"];
const BAR_FAMILIES: &[Family] = &[
    family("linear", BOX, &["mesh.order=1"], &BARS),
    family("quadratic", BOX, &["mesh.order=2"], &["[4, 1, 1]", "[8, 1, 2]", "[16, 1, 4]", "[32, 2, 8]"]),
];

const PROBLEMS: &[Problem] = &[
    Problem {
        name: "Prandtl's punch: limit load",
        job: "verification/prandtl_punch",
        quantity: "resultant.contact top.force_y",
        reference: -5.141_592_653_6e6,
        changes: &[],
        families: &[
            family(
                "linear",
                PLANE,
                &["mesh.rectangle.diagonal=right"],
                &["[20, 20]", "[40, 40]", "[80, 80]"],
            ),
            family("linear, crossed", PLANE, &[], &["[10, 10]", "[20, 20]", "[40, 40]", "[80, 80]"]),
            family(
                "quadratic",
                PLANE,
                &["mesh.order=2", "mesh.rectangle.diagonal=alternating"],
                &["[10, 10]", "[20, 20]", "[40, 40]"],
            ),
            family(
                "quadratic, graded",
                PLANE,
                &[
                    "mesh.order=2",
                    "mesh.rectangle.diagonal=alternating",
                    "mesh.rectangle.grading={x = 1.5, y = 1.5, toward = ['left', 'top']}",
                ],
                &["[10, 10]", "[20, 20]", "[40, 40]"],
            ),
        ],
    },
    Problem {
        name: "Hertz, line: largest pressure",
        job: "verification/hertz_line",
        quantity: "resultant.contact bottom.largest_pressure",
        reference: 27_472_527.472_527_478,
        changes: &["solver.preconditioner=cholesky"],
        families: &[
            family(
                "linear, uniform",
                PLANE,
                &["mesh.rectangle.grading={x = 1, y = 1}"],
                &["[32, 32]", "[64, 64]", "[128, 128]", "[256, 256]"],
            ),
            family("linear, graded", PLANE, &[], &["[16, 16]", "[32, 32]", "[64, 64]", "[128, 128]"]),
            family(
                "quadratic, graded",
                PLANE,
                &["mesh.order=2"],
                &["[8, 8]", "[16, 16]", "[32, 32]", "[64, 64]"],
            ),
        ],
    },
    Problem {
        name: "Bar in space, Poisson's ratio 0.3: deflection",
        job: "nearly_incompressible_bar",
        quantity: "probe.tip.displacement_z",
        reference: BAR,
        changes: &["material.elasticity.poisson_ratio=0.3"],
        families: BAR_FAMILIES,
    },
    Problem {
        name: "Bar in space, Poisson's ratio 0.4999: deflection",
        job: "nearly_incompressible_bar",
        quantity: "probe.tip.displacement_z",
        reference: NEARLY_INCOMPRESSIBLE_BAR,
        changes: &[],
        families: BAR_FAMILIES,
    },
];

/// Of quadratic cells, 80 x 5 x 20, in m.
const BAR: f64 = -0.266_07;
/// Of quadratic cells, 80 x 5 x 20, in m.
const NEARLY_INCOMPRESSIBLE_BAR: f64 = -0.263_15;

/// What one run gave and cost.
struct Cost {
    family: &'static str,
    cells: String,
    unknowns: f64,
    error: f64,
    seconds: f64,
    bytes: f64,
}

fn measure(problem: &Problem, family: &Family, cells: &str) -> Cost {
    let job = Path::new(env!("CARGO_MANIFEST_DIR")).join("jobs").join(problem.job).with_extension("toml");
    let mesh = format!("{}={cells}", family.key);
    let mut changes = vec![mesh.as_str(), "output.fields.every=1000000"];
    changes.extend(problem.changes.iter().chain(family.changes));
    let one = |_| {
        let output = tempfile::tempdir().expect("folder");
        if let Err(words) = checked::run(&job, 1, output.path(), &changes) {
            panic!("{}, {} {cells}: {words}", problem.name, family.name);
        }
        let number = |name: &str| quantity(output.path(), name).unwrap_or_else(|| panic!("no {name}"));
        Cost {
            family: family.name,
            cells: cells.trim_matches(['[', ']']).replace(", ", " x "),
            unknowns: number("unknowns"),
            error: ((number(problem.quantity) - problem.reference) / problem.reference).abs(),
            seconds: number("wall_seconds.total") - number("wall_seconds.launch"),
            bytes: number("peak_memory_bytes"),
        }
    };
    let runs = (0..REPETITIONS).map(one);
    runs.min_by(|a, b| a.seconds.total_cmp(&b.seconds)).expect("a run")
}

/// The table of all runs of a problem, and that of the fastest ones for the target errors.
fn tables(problem: &Problem) -> (String, String) {
    let mut all = "| cells | | unknowns | error | s | MB |\n|:--|--:|--:|--:|--:|--:|\n".to_owned();
    let head: Vec<String> = TARGETS.iter().map(|target| format!("{} %", 100.0 * target)).collect();
    let mut best =
        format!("| {} | {} |\n|:--|{}\n", problem.name, head.join(" | "), "--:|".repeat(TARGETS.len()));
    for family in problem.families {
        eprintln!("{}: {}", problem.name, family.name);
        let costs: Vec<Cost> = family.cells.iter().map(|cells| measure(problem, family, cells)).collect();
        for Cost { family, cells, unknowns, error, seconds, bytes } in &costs {
            all += &format!(
                "| {family} | {cells} | {unknowns} | {:.2} % | {seconds:.2} | {:.0} |\n",
                100.0 * error,
                bytes / 1e6
            );
        }
        // An error that rises again on a finer mesh was small by chance.
        let reached = |target: f64| {
            let last = costs.iter().rposition(|cost| cost.error > target).map_or(0, |at| at + 1);
            let fastest = costs[last..].iter().min_by(|a, b| a.seconds.total_cmp(&b.seconds));
            fastest.map_or("-".into(), |cost| format!("{:.2} s, {:.0} MB", cost.seconds, cost.bytes / 1e6))
        };
        let reached: Vec<String> = TARGETS.iter().map(|target| reached(*target)).collect();
        best += &format!("| {} | {} |\n", family.name, reached.join(" | "));
    }
    (all, best)
}

/// Errors of the problem of Wang and Cheng on all meshes of its study, and seconds of computation.
fn study() -> String {
    let output = tempfile::tempdir().expect("folder");
    let run = Command::new(env!("CARGO_BIN_EXE_solver"))
        .arg("study")
        .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join(STUDY))
        .args(["--set", &format!("output.folder={:?}", output.path())])
        .status()
        .expect("started");
    assert!(run.success(), "{STUDY}: {run}");
    let text = fs::read_to_string(output.path().join("study.csv")).expect("its table");
    let mut lines = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let head = lines.next().expect("a head");
    let rows: Vec<Vec<&str>> = lines.collect();
    let at = |name: &str| head.iter().position(|column| *column == name).expect("a column");
    let columns = ["run", "relative_error", "unknowns", "seconds_computing"].map(at);
    let mut table =
        "| cells | unknowns | displacement in V | velocity in V | s |\n|:--|--:|--:|--:|--:|\n".to_owned();
    for pair in rows.chunks_exact(2) {
        let [name, error, unknowns, seconds] = columns;
        let number = |text: &str| text.parse::<f64>().expect("a number");
        let errors: Vec<String> =
            pair.iter().map(|row| format!("{:.2} %", 100.0 * number(row[error]))).collect();
        table += &format!(
            "| {} | {} | {} | {:.2} |\n",
            pair[0][name].replace('-', " "),
            pair[0][unknowns],
            errors.join(" | "),
            number(pair[0][seconds])
        );
    }
    table
}

fn main() {
    let writes = std::env::args().any(|word| word == "--write");
    let mut triad = Triad::new();
    let bandwidth = BYTES as f64 / fastest(&mut || triad.run());
    let (mut all, mut best) = (String::new(), String::new());
    for problem in PROBLEMS {
        let (runs, fastest) = tables(problem);
        all += &format!("{}\n\n{runs}\n", problem.name);
        best += &format!("{fastest}\n");
    }
    let stress = study();
    println!("{all}\n{best}\n{stress}");
    if writes {
        table::write(PAGE, "runs in space", COMMAND, bandwidth, &all);
        table::write(PAGE, "fastest in space", COMMAND, bandwidth, &best);
        table::write(PAGE, "wang and cheng in space", COMMAND, bandwidth, &stress);
    }
}
