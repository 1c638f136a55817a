//! Effects that a job does not request leave no trace in its run.

use crate::{case::Case, hdf5_file::NumberFile, results::Results};

const ALL: [&str; 7] =
    ["inertia", "elasticity", "viscosity", "viscoplasticity", "traction", "body_force", "contact"];
const HISTORY: &str = "viscoplastic_history";

/// The key whose absence removes an effect from a job.
fn key(effect: &str) -> &str {
    match effect {
        "inertia" => "material.density",
        "elasticity" => "material.elasticity",
        "viscosity" => "material.viscosity",
        "viscoplasticity" => "material.viscoplasticity",
        other => other,
    }
}

/// A body with strain and velocity from the start, so that every effect acts.
fn moving(case: Case, displacement: &str, velocity: &str) -> Case {
    case.set("initial.displacement", displacement)
        .set("initial.velocity", velocity)
        .set("time.step", "0.0009765625")
        .set("time.end", "0.0078125")
        .set("checkpoint.every", "4")
}

fn square() -> Case {
    moving(Case::square(6), "['0.03*x', '-0.04*x']", "['0.1*x', '-0.2*x']")
        .set("body_force", "[{ value = [0, -1] }]")
}

fn cube() -> Case {
    moving(Case::cube(3), "['0.03*x', 0, '-0.04*x']", "['0.1*x', 0, '-0.2*x']")
        .set("body_force", "[{ value = [0, 0, -1] }]")
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
    assert_eq!(inventory["load_vector"], !(lacks("traction") && lacks("body_force")));
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
        ("contact", "contact_dissipation"),
        ("contact", "newton_iterations"),
    ] {
        let nothing = history.numbers(column).iter().all(|value| *value == 0.0);
        assert_eq!(nothing, lacks(effect), "{column}");
    }
    let work = history.numbers("external_work");
    assert_eq!(work.iter().all(|work| *work == 0.0), lacks("traction") && lacks("body_force"));
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
    for lacking in ["inertia", "viscosity", "viscoplasticity", "traction", "body_force", "contact"] {
        run_without(square(), &[lacking], 2);
    }
    run_without(square(), &["traction", "body_force"], 2);
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

const DAMAGE: &str = "{ threshold = 0.1, viscosity = 0.02, largest = 0.7 }";
const ADHESION: &str = "{ stiffness = 3000, tangential_stiffness = 1000, energy = 0.1, viscosity = 0.001 }";

fn weakened() -> Case {
    let case = square().set("initial.displacement", "['0.03*x', '0.04*x']");
    case.set("material.damage", DAMAGE).set("contact.0.adhesion", ADHESION)
}

#[test]
fn damage_and_bonding_are_kept_written_and_counted_where_they_are_called_for() {
    for (ranks, keys) in
        [(1, ["material.damage", "contact.0.adhesion"]), (2, ["", ""]), (2, ["material.damage", ""])]
    {
        let case = keys.iter().filter(|key| !key.is_empty()).fold(weakened(), |case, key| case.without(key));
        let results = case.run(ranks);
        let summary = results.summary();
        let parts = [
            ("material.damage", "damage", "damage", "damage_dissipation", 6 * 6 * 2),
            ("contact.0.adhesion", "adhesion", "bonding", "adhesion_dissipation", 7),
        ];
        let history = results.table("history.csv");
        let effects = summary["effects"].as_array().expect("a list");
        let fields = NumberFile::open(&results.path("fields.vtkhdf")).names("Fields");
        let tables = NumberFile::open(&results.path("checkpoint-4.h5")).checkpoint_tables();
        for (key, effect, field, column, values) in parts {
            let there = !keys.contains(&key);
            assert_eq!(effects.iter().any(|name| name == effect), there, "{effect}");
            assert_eq!(fields.iter().any(|name| name == field), there, "{field}");
            assert_eq!(history.last(column) > 0.0, there, "{column}");
            let bytes = if there { serde_json::json!(values * 16) } else { serde_json::Value::Null };
            assert_eq!(summary["inventory"]["history_bytes"][field], bytes, "{field}");
            let saved = tables.iter().find(|(name, _)| name == field).map(|(_, values)| values);
            assert_eq!(saved.is_some(), there, "{field}");
            let within =
                |all: &Vec<f64>| all.iter().all(|x| (0.0..=1.0).contains(x)) && all.iter().any(|x| *x > 0.0);
            assert!(saved.is_none_or(within), "{field}: {saved:?}");
        }
        assert!(results.number("max_energy_imbalance") < 1e-10, "{summary}");
    }
}

#[test]
fn effects_that_do_nothing_leave_every_number_as_it_is() {
    let plain = square();
    let inert = square()
        .set("material.damage", "{ threshold = 1e30, viscosity = 1 }")
        .set("contact.0.adhesion", "{ stiffness = 0, energy = 1 }")
        .set("contact.0.memory", "{ stiffness_rate = 0, decay_time = 1 }");
    let (plain_results, inert_results) = (plain.run(2), inert.run(2));
    for name in ["probes.csv", "history.csv", "profiles.csv"] {
        assert_eq!(plain_results.text(name), inert_results.text(name), "{name}");
    }
}

#[test]
fn contact_memory_is_kept_written_and_counted_where_it_is_called_for() {
    let with = square().set("contact.0.memory", "{ stiffness_rate = 2e4, decay_time = 0.01 }");
    for (case, there) in [(with, true), (square(), false)] {
        let results = case.run(2);
        let summary = results.summary();
        let effects = summary["effects"].as_array().expect("a list");
        assert_eq!(effects.iter().any(|name| name == "contact_memory"), there, "{summary}");
        let bytes = if there { serde_json::json!(7 * 16) } else { serde_json::Value::Null };
        assert_eq!(summary["inventory"]["history_bytes"]["memory_pressure"], bytes);
        let fields = NumberFile::open(&results.path("fields.vtkhdf")).names("Fields");
        assert_eq!(fields.iter().any(|name| name == "memory_pressure"), there, "{fields:?}");
        let tables = NumberFile::open(&results.path("checkpoint-4.h5")).checkpoint_tables();
        let saved = tables.into_iter().find(|(name, _)| name == "memory_pressure");
        assert_eq!(
            saved.as_ref().is_some_and(|(_, values)| values.iter().any(|pressure| *pressure > 0.0)),
            there,
            "{saved:?}"
        );
        assert!(results.number("max_energy_imbalance") < 1e-10, "{summary}");
    }
}
