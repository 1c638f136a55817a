//! What effects cost: `cargo bench --bench effects -- [--write]`.
//!
//! Runs scenes of `jobs/`, most of them on finer meshes, with all their effects and without one of them at a time
//! (`solver study --ablate`). `--write` puts the table into docs/speed.md.

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

const SCENES: [Scene; 13] = [
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
];

/// The ablation of a scene.
fn ablation(scene: &Scene) -> Value {
    let folder = tempfile::tempdir().expect("a folder");
    let job = Path::new(env!("CARGO_MANIFEST_DIR")).join("jobs").join(scene.job).with_extension("toml");
    let text = format!(
        "[base]\njob = {job:?}\nset = {:?}\n[timing]\nrepetitions = {REPETITIONS}\ntake = \"median\"\n[[run]]\n",
        scene.set
    );
    fs::write(folder.path().join("study.toml"), text).expect("a study");
    let run = Command::new(env!("CARGO_BIN_EXE_solver"))
        .args(["study", "study.toml", "--ablate"])
        .current_dir(&folder)
        .stdout(Stdio::null())
        .status()
        .expect("started");
    assert!(run.success(), "{}: {run}", scene.job);
    let results = fs::read_to_string(folder.path().join("out/study/study.json")).expect("results");
    serde_json::from_str::<Value>(&results).expect("an object")["ablation"].take()
}

fn main() {
    let writes = std::env::args().any(|word| word == "--write");
    let mut triad = Triad::new();
    let bandwidth = BYTES as f64 / fastest(&mut || triad.run());
    let mut rows = String::from(
        "| effect | job, changed by | s with it | s without | ratio | change of displacement, stress |\n|---|---|--:|--:|--:|---|\n",
    );
    print!("{rows}");
    for scene in &SCENES {
        let ablation = ablation(scene);
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
        table::write("docs/speed.md", "effects", "make bench-effects ARGS=--write", bandwidth, &rows);
    }
}
