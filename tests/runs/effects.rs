//! What a job does not call for does not exist in its run.

use crate::{case::Case, hdf5_file::NumberFile, results::Results};

const ALL: [&str; 6] = ["inertia", "elasticity", "viscosity", "viscoplasticity", "traction", "contact"];
const HISTORY: &str = "viscoplastic_history";

/// The key whose absence takes an effect out of a job.
fn key(effect: &str) -> &str {
    match effect {
        "inertia" => "material.density",
        "elasticity" => "material.elasticity",
        "viscosity" => "material.viscosity",
        "viscoplasticity" => "material.viscoplasticity",
        other => other,
    }
}

/// A body that is strained and moves from the start, so that every effect has something to do.
fn moving(case: Case, displacement: &str, velocity: &str) -> Case {
    case.set("initial.displacement", displacement)
        .set("initial.velocity", velocity)
        .set("time.step", "0.0009765625")
        .set("time.end", "0.0078125")
        .set("checkpoint.every", "4")
}

fn square() -> Case {
    moving(Case::square(6), "['0.03*x', '-0.04*x']", "['0.1*x', '-0.2*x']")
}

fn cube() -> Case {
    moving(Case::cube(3), "['0.03*x', 0, '-0.04*x']", "['0.1*x', 0, '-0.2*x']")
}

/// Runs a job without some effects and looks for traces of them.
#[track_caller]
fn run_without(case: Case, lacking: &[&str], ranks: usize) {
    let case = lacking.iter().fold(case, |case, effect| case.without(key(effect)));
    let results = case.run(ranks);
    let lacks = |effect: &str| lacking.contains(&effect);
    let effects: Vec<&str> = ALL.into_iter().filter(|effect| !lacks(effect)).collect();
    let summary = results.summary();
    assert_eq!(summary["effects"], serde_json::json!(effects));
    assert!(results.number("max_energy_imbalance") < 1e-10, "without {lacking:?}: {summary}");

    let inventory = &summary["inventory"];
    let histories: Vec<&String> = inventory["history_bytes"].as_object().expect("an object").keys().collect();
    assert_eq!(histories, if lacks("viscoplasticity") { vec![] } else { vec![HISTORY] });
    assert_eq!(inventory["newton"], !lacks("contact"));
    assert_eq!(inventory["contact_points"] == 0, lacks("contact"));
    assert_eq!(inventory["load_vector"], !lacks("traction"));
    look_into_history(&results, lacks);
    look_into_files(&results, lacks);
}

#[track_caller]
fn look_into_history(results: &Results, lacks: impl Fn(&str) -> bool) {
    let history = results.table("history.csv");
    for (effect, column) in [
        ("inertia", "kinetic_energy"),
        ("elasticity", "elastic_energy"),
        ("viscosity", "viscous_dissipation"),
        ("viscoplasticity", "viscoplastic_dissipation"),
        ("traction", "external_work"),
        ("contact", "contact_dissipation"),
        ("contact", "newton_iterations"),
    ] {
        let nothing = history.numbers(column).iter().all(|value| *value == 0.0);
        assert_eq!(nothing, lacks(effect), "{column}");
    }
}

#[track_caller]
fn look_into_files(results: &Results, lacks: impl Fn(&str) -> bool) {
    let expected = |names: &[&'static str]| -> Vec<&'static str> {
        let there = |name: &&str| match *name {
            HISTORY => !lacks("viscoplasticity"),
            "contact_traction" => !lacks("contact"),
            _ => true,
        };
        names.iter().copied().filter(there).collect()
    };
    let fields = NumberFile::open(&results.path("fields.vtkhdf"));
    let names = fields.names("Fields");
    assert_eq!(
        names,
        expected(&["contact_traction", "displacement", "stress", "velocity", HISTORY, "von_mises"])
    );
    let checkpoint = NumberFile::open(&results.path("checkpoint-4.h5"));
    let names: Vec<String> = checkpoint.checkpoint_tables().into_iter().map(|(name, _)| name).collect();
    assert_eq!(
        names,
        expected(&[HISTORY, "contact_traction", "displacement", "previous_velocity", "velocity"])
    );
}

#[test]
fn with_all_effects_all_are_there() {
    run_without(square(), &[], 2);
    run_without(cube(), &[], 2);
}

#[test]
fn an_effect_that_is_not_called_for_leaves_no_trace() {
    for lacking in ["inertia", "viscosity", "viscoplasticity", "traction", "contact"] {
        run_without(square(), &[lacking], 2);
    }
}

#[test]
fn a_body_may_lack_most_effects() {
    run_without(square(), &["elasticity", "viscoplasticity"], 1);
    run_without(square(), &["viscoplasticity", "contact", "inertia"], 2);
    run_without(square(), &["elasticity", "viscoplasticity", "viscosity", "contact"], 2);
    run_without(square(), &["viscoplasticity", "viscosity", "traction", "contact"], 1);
    run_without(cube(), &["viscoplasticity", "traction"], 2);
    run_without(cube(), &["inertia", "contact"], 2);
}

#[test]
fn a_run_without_contact_solves_one_linear_system_a_step() {
    let case = square().without("contact").set("solver.preconditioner", "'cholesky'");
    let results = case.run(2);
    let iterations = results.table("history.csv").numbers("linear_iterations");
    assert!(iterations.iter().all(|count| *count <= 2.0), "{iterations:?}");
}
