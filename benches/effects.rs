//! What effects and formulas cost: `cargo bench --bench effects -- [--write]`.
//!
//! Runs scenes of `jobs/`, most of them on finer meshes, with all their effects and without one of them at a time
//! (`solver study --ablate`), and scenes with built-in laws and with the same laws written as formulas. `--write` puts both tables into
//! docs/speed.md.

#[path = "table/mod.rs"]
mod table;
#[path = "triad/mod.rs"]
mod triad;

use serde_json::Value;
use std::{
    fmt::Write,
    fs,
    path::Path,
    process::{Command, Stdio},
};
use triad::{BYTES, Triad, fastest};

/// How often each run is repeated; the median counts.
const REPETITIONS: usize = 3;

/// A job, what is changed in it, and the effects that are left out, each with its name.
struct Scene {
    job: &'static str,
    set: &'static [&'static str],
    effects: &'static [(&'static str, &'static str)],
}

const SCENES: [Scene; 16] = [
    Scene {
        job: "conveyor_belt",
        set: &["mesh.rectangle.cells=[128,32]", "time.end=0.1"],
        effects: &[("contact.0.friction", "Coulomb friction on a moving obstacle")],
    },
    Scene {
        job: "distance_weakening_block",
        set: &["mesh.rectangle.cells=[128,32]", "time.end=0.1"],
        effects: &[("contact.0.friction", "friction that weakens with the distance")],
    },
    Scene {
        job: "rate_and_state_belt",
        set: &["mesh.rectangle.cells=[128,32]", "time.end=5.0"],
        effects: &[("contact.0.friction", "rate-and-state friction")],
    },
    Scene {
        job: "cohesive_unloading",
        set: &["mesh.rectangle.cells=[96,96]"],
        effects: &[("contact.0.adhesion", "cohesive bonds")],
    },
    Scene {
        job: "remembering_foundation",
        set: &["mesh.rectangle.cells=[96,96]", "time.end=4.0"],
        effects: &[("contact.0.memory", "contact memory")],
    },
    Scene {
        job: "rounded_punch",
        set: &["mesh.rectangle.cells=[128,128]"],
        effects: &[("contact.0.obstacle", "an obstacle given by its distance")],
    },
    Scene {
        job: "worn_pad",
        set: &["mesh.rectangle.cells=[128,32]"],
        effects: &[("contact.0.wear", "wear")],
    },
    Scene {
        job: "papers/wang_cheng_2022",
        set: &["mesh.rectangle.cells=[128,128]"],
        effects: &[("material.viscoplasticity", "viscoplastic flow, stress of the step before")],
    },
    Scene {
        job: "papers/wang_cheng_2022",
        set: &["mesh.rectangle.cells=[128,128]", "time.scheme=bdf2", "time.step=0.03125"],
        effects: &[("material.viscoplasticity", "viscoplastic flow at the end of steps")],
    },
    Scene { job: "tearing_plate", set: &[], effects: &[("material.damage", "damage")] },
    Scene {
        job: "absorbed_pulse",
        set: &["mesh.rectangle.cells=[800,16]"],
        effects: &[("support.1", "an absorbing boundary")],
    },
    Scene {
        job: "settling_column",
        set: &["mesh.rectangle.cells=[64,128]", "time.end=5.0"],
        effects: &[
            ("support.1.stiffness", "springs at a support"),
            ("support.1.damping", "dashpots at a support"),
            ("material.viscosity", "viscosity"),
        ],
    },
    Scene {
        job: "ground_at_rest",
        set: &["mesh.rectangle.cells=[128,128]", "time.end=10.0"],
        effects: &[("initial.stress", "an initial stress")],
    },
    Scene {
        job: "frictional_heating",
        set: &["mesh.rectangle.cells=[128,64]", "time.end=25.0"],
        effects: &[("material.heat", "heat")],
    },
    Scene {
        job: "damped_bar",
        set: &["mesh.rectangle.cells=[400,20]"],
        effects: &[("material.damping", "Rayleigh damping")],
    },
    Scene {
        job: "orthotropic_strip",
        set: &["mesh.rectangle.cells=[256,64]", "material.density=1600.0", "time.step=0.02"],
        effects: &[("material.orthotropic", "orthotropic elasticity")],
    },
];

/// A law, a job with it, what is changed in the job, and the law as a formula.
struct Formula {
    law: &'static str,
    job: &'static str,
    set: &'static [&'static str],
    formula: &'static str,
}

const FINE: &str = "mesh.rectangle.cells=[128,128]";
const STRIP: &str = "mesh.rectangle.cells=[128,32]";
const STABLE: &str = "solver.accept=[\"explicit_stability\"]";
const NORTON: &str =
    "material.viscoplasticity={norton={rate=0.02,reference_stress=10,exponent=3,hardening_strain=0.1}}";
const AS_NORTON: &str =
    "material.viscoplasticity={expression={rate=\"0.02*(q/10)^3/(1 + e/0.1)\",reference_stress=10}}";
const PERZYNA: &str = "material.viscoplasticity={perzyna={yield_stress=10,relaxation=100}}";
const AS_PERZYNA: &str =
    "material.viscoplasticity={expression={rate=\"max(q - 10, 0)/300\",reference_stress=10}}";

const FORMULAS: [Formula; 15] = [
    Formula {
        law: "`damped_response`",
        job: "papers/wang_cheng_2022",
        set: &[FINE],
        formula: "contact.0.normal={expression={pressure=\"if(abs(v) < 0.003, 10*abs(v), if(abs(v) < 0.005, 0.06 - 10*abs(v), \
            10*abs(v) - 0.04))\"}}",
    },
    Formula {
        law: "`graph`",
        job: "stick_on_a_jump",
        set: &["mesh.rectangle.cells=[96,48]"],
        formula: "contact.0.normal={expression={pressure=\"10*v + 5*sign(v)\"}}",
    },
    Formula {
        law: "`exponential_damper`",
        job: "sinking_block",
        set: &["mesh.rectangle.cells=[64,64]", "time.end=4.0"],
        formula: "contact.0.normal={expression={pressure=\"if(v < 0, 0, 10*(1 - exp(-v/0.02)))\"}}",
    },
    Formula {
        law: "`compliance`",
        job: "compliant_foundation",
        set: &["mesh.rectangle.cells=[64,64]", "time.end=2.0"],
        formula: "contact.0.normal={expression={pressure=\"1000*max(d, 0)\",gap=0.001}}",
    },
    Formula {
        law: "`compliance` of exponent 1.5",
        job: "compliant_foundation",
        set: &[
            "mesh.rectangle.cells=[64,64]",
            "time.end=2.0",
            "contact.0.normal={compliance={stiffness=1000,exponent=1.5,gap=0.001}}",
        ],
        formula: "contact.0.normal={expression={pressure=\"1000*max(d, 0)^1.5\",gap=0.001}}",
    },
    Formula {
        law: "`displacement_graph`",
        job: "compliant_foundation",
        set: &[
            "mesh.rectangle.cells=[64,64]",
            "time.end=2.0",
            "contact.0.normal={displacement_graph={points=[[0,0],[0.001,2],[0.002,1.5],[0.003,5]],slope_after=3500,gap=0.001}}",
        ],
        formula: "contact.0.normal={expression={pressure=\"if(d < 0, 0, if(d < 0.001, 2000*d, if(d < 0.002, 2.5 - 500*d, \
            3500*d - 5.5)))\",gap=0.001}}",
    },
    Formula {
        law: "`coulomb`",
        job: "conveyor_belt",
        set: &[STRIP, "time.end=0.1", "contact.0.friction={coulomb={coefficient=0.3}}"],
        formula: "contact.0.friction={expression={coefficient=\"0.3\"}}",
    },
    Formula {
        law: "`velocity_weakening`",
        job: "velocity_weakening_block",
        set: &[STRIP, "time.end=0.35"],
        formula: "contact.0.friction={expression={coefficient=\"0.3 + 0.2*exp(-v/0.05)\"}}",
    },
    Formula {
        law: "`distance_weakening`",
        job: "distance_weakening_block",
        set: &[STRIP, "time.end=0.35"],
        formula: "contact.0.friction={expression={coefficient=\"0.3 + 0.3*max(1 - l/0.05, 0)\"}}",
    },
    Formula {
        law: "`norton`, `lagged_euler`",
        job: "papers/wang_cheng_2022",
        set: &[FINE, STABLE, NORTON],
        formula: AS_NORTON,
    },
    Formula {
        law: "`norton`, `bdf2`",
        job: "papers/wang_cheng_2022",
        set: &[FINE, "time.scheme=bdf2", "time.step=0.03125", NORTON],
        formula: AS_NORTON,
    },
    Formula {
        law: "`perzyna`, `lagged_euler`",
        job: "papers/wang_cheng_2022",
        set: &[FINE, "material.hypothesis=plane_strain", PERZYNA],
        formula: AS_PERZYNA,
    },
    Formula {
        law: "`perzyna`, `bdf2`",
        job: "papers/wang_cheng_2022",
        set: &[FINE, "material.hypothesis=plane_strain", "time.scheme=bdf2", "time.step=0.03125", PERZYNA],
        formula: AS_PERZYNA,
    },
    Formula {
        law: "linear `viscosity`",
        job: "papers/wang_cheng_2022",
        set: &[FINE],
        formula: "material.viscosity={expression={shear=\"50\",bulk=50,reference_rate=1}}",
    },
    Formula {
        law: "linear `elasticity`, `implicit_euler`",
        job: "graded_column",
        set: &["mesh.rectangle.cells=[32,256]", "material.elasticity.youngs_modulus=1e5"],
        formula: "material.elasticity.expression={shear_factor=\"1\",reference_strain=0.01}",
    },
];

/// What a study of a job finds; `rest` is the part of the study below its base.
fn study(job: &str, set: &[&str], rest: &str, options: &[&str]) -> Value {
    let folder = tempfile::tempdir().expect("a folder");
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("jobs").join(job).with_extension("toml");
    let timing = format!("[timing]\nrepetitions = {REPETITIONS}\ntake = \"median\"");
    let text = format!("[base]\njob = {path:?}\nset = {set:?}\n{timing}\n{rest}");
    fs::write(folder.path().join("study.toml"), text).expect("a study");
    let run = Command::new(env!("CARGO_BIN_EXE_solver"))
        .args(["study", "study.toml"])
        .args(options)
        .current_dir(&folder)
        .stdout(Stdio::null())
        .status()
        .expect("started");
    assert!(run.success(), "{job}: {run}");
    let results = fs::read_to_string(folder.path().join("out/study/study.json")).expect("results");
    serde_json::from_str(&results).expect("an object")
}

/// What laws cost as formulas, and how far their answers are from those of the built-in laws: the rows of a table.
fn formulas() -> String {
    let mut rows = String::from(
        "| law | job, changed by | s of steps: built-in, formula | ratio | Newton iterations | difference of velocity, stress |\n\
         |---|---|--:|--:|--:|--:|\n",
    );
    print!("{rows}");
    for Formula { law, job, set, formula } in &FORMULAS {
        let norm =
            |of: &str, space: &str| format!("[[norm]]\nof = \"{of}\"\nin = \"{space}\"\nover = \"max\"\n");
        let rest = format!(
            "[[run]]\nname = \"built_in\"\n[[run]]\nname = \"formula\"\nset = [{formula:?}]\n[reference.run]\n{}{}",
            norm("velocity", "H"),
            norm("stress", "Q")
        );
        let set: Vec<&str> = set.iter().copied().chain(["solver.tolerance=1e-12"]).collect();
        let found = study(job, &set, &rest, &[]);
        let of = |run: usize, part: &str| {
            found["runs"][run]["seconds"][part].as_f64().unwrap_or_else(|| panic!("{law}: {found}"))
        };
        let seconds = [0, 1].map(|run| of(run, "computing"));
        let newton = [0, 1].map(|run| found["runs"][run]["newton_iterations"].to_string());
        let difference = |at: usize| {
            let relative = &found["runs"][1]["errors"][at]["relative"];
            format!("{:.0e}", relative.as_f64().unwrap_or_else(|| panic!("{law}: {found}")))
        };
        let row = format!(
            "| {law} | `{job}` {} | {:.2}, {:.2} | {:.2} | {} | {} |",
            set[..set.len() - 1].join(" ").replace('|', "\\|"),
            seconds[0],
            seconds[1],
            seconds[1] / seconds[0],
            newton.join(", "),
            [0, 1].map(difference).join(", ")
        );
        println!("{row}");
        writeln!(rows, "{row}").expect("text");
    }
    rows
}

fn main() {
    let writes = std::env::args().any(|word| word == "--write");
    let mut triad = Triad::new();
    let bandwidth = BYTES as f64 / fastest(&mut || triad.run());
    let of_formulas = formulas();
    let mut rows = String::from(
        "| effect | job, changed by | s with it | s without | ratio | change of displacement, stress |\n|---|---|--:|--:|--:|---|\n",
    );
    print!("{rows}");
    for scene in &SCENES {
        let ablation = study(scene.job, scene.set, "[[run]]\n", &["--ablate"])["ablation"].take();
        let with = ablation["seconds"].as_f64().unwrap_or_else(|| panic!("{}: {ablation}", scene.job));
        for (path, name) in scene.effects {
            let all = ablation["effects"].as_array().expect("effects");
            let effect = all.iter().find(|effect| effect["without"] == *path);
            let effect = effect.unwrap_or_else(|| panic!("{}: {path} is no effect: {ablation}", scene.job));
            let without = effect["seconds"].as_f64();
            let without = without.unwrap_or_else(|| panic!("{} without {path}: {effect}", scene.job));
            let percent = |at: usize| match effect["change"][at].as_f64() {
                None => "-".into(),
                Some(share) if share > 10.0 => "above 1000 %".into(),
                Some(share) => format!("{:.2} %", 100.0 * share),
            };
            let row = format!(
                "| {name} | `{}` {} | {with:.2} | {without:.2} | {:.2} | {} |",
                scene.job,
                scene.set.join(" "),
                with / without,
                [0, 2].map(percent).join(", ")
            );
            println!("{row}");
            writeln!(rows, "{row}").expect("text");
        }
    }
    if writes {
        for (name, rows) in [("effects", &rows), ("formulas", &of_formulas)] {
            table::write("docs/speed.md", name, "make bench-effects ARGS=--write", bandwidth, rows);
        }
    }
}
