//! A restarted run has the results of an uninterrupted one.

use crate::{
    case::Case,
    hdf5_file::NumberFile,
    launch::Outcome,
    results::{Results, assert_same_answer, relative_difference},
};
use std::path::Path;

/// Saves checkpoints after 4, 8 and 12 of 16 steps.
fn saving() -> Case {
    Case::square(8).set("checkpoint.every", "4")
}

/// Runs half of the way.
#[track_caller]
fn interrupt(case: &Case, ranks: usize) {
    case.run_with(ranks, &["--set", "time.end=0.5"]).expect(0);
    assert_eq!(case.results().checkpoints(), [8, 4]);
}

#[track_caller]
fn continue_run(case: &Case, ranks: usize) -> Results {
    case.run_with(ranks, &["--restart"])
        .expect(0)
        .says("continuing from")
        .says("checkpoint-8.h5 (step 8, t = 0.5 s)");
    let results = case.results();
    let from = results.summary()["restarted_from"].as_str().map(str::to_owned);
    assert!(from.is_some_and(|file| file.ends_with("out/checkpoint-8.h5")));
    results
}

/// Tables, fields and the next checkpoint must be bitwise equal.
#[track_caller]
fn assert_identical(straight: &Results, results: &Results, what: &str) {
    for name in ["probes.csv", "history.csv", "resultants.csv", "profiles.csv"] {
        assert_eq!(straight.text(name), results.text(name), "{what}: {name}");
    }
    let open = |name: &str| [straight, results].map(|r| NumberFile::open(&r.path(name)));
    for name in ["checkpoint-12.h5", "checkpoint-16.h5"] {
        let [one, other] = open(name).map(|file| file.checkpoint_tables());
        assert!(one.len() >= 3);
        assert!(one == other, "{what}: {name}");
    }
    let [one, other] = open("fields.vtkhdf");
    assert_eq!(one.times(), [0.0, 0.5, 1.0]);
    assert_eq!(other.times(), [0.0, 0.5, 1.0]);
    assert_eq!(one.names("Fields"), other.names("Fields"));
    for name in one.names("Fields") {
        assert!(
            (0..3).all(|step| one.field(&name, step) == other.field(&name, step)),
            "{what}: field {name}"
        );
    }
    assert_same_summary(&straight.summary(), &results.summary(), what);
}

/// Members of the summary that belong to a process.
const OF_PROCESS: [&str; 5] =
    ["wall_seconds", "traffic_bytes", "peak_memory_bytes", "restarted_from", "set_ups"];

/// All members must be equal but those of a process.
#[track_caller]
fn assert_same_summary(one: &serde_json::Value, other: &serde_json::Value, what: &str) {
    let [one, other] = [one, other].map(|summary| {
        let members = summary.as_object().expect("members").iter();
        members.filter(|(name, _)| !OF_PROCESS.contains(&name.as_str())).collect::<Vec<_>>()
    });
    assert!(one.len() > 20);
    // Those about damaged files are of the process.
    let warnings = |value: &serde_json::Value| {
        let is_of_run = |warning: &&serde_json::Value| !warning.to_string().contains("it is damaged");
        value.as_array().expect("a list").iter().filter(is_of_run).cloned().collect::<Vec<_>>()
    };
    for ((name, one), (of_other, other)) in one.iter().zip(&other) {
        assert_eq!(name, of_other, "{what}");
        match name.as_str() {
            "warnings" => assert_eq!(warnings(one), warnings(other), "{what}"),
            _ => assert_eq!(one, other, "{what}: {name}"),
        }
    }
    assert_eq!(one.len(), other.len(), "{what}");
}

/// Runs a job, then again from this of its checkpoints, and compares the summaries.
#[track_caller]
fn compare_summaries(case: &Case, ranks: usize, step: u64, what: &str) {
    case.run(ranks);
    let straight = case.results().summary();
    let from = case.results().path(&format!("checkpoint-{step}.h5"));
    case.run_with(ranks, &["--restart", from.to_str().expect("a path")]).expect(0);
    assert_same_summary(&straight, &case.results().summary(), what);
}

#[test]
fn all_members_of_a_summary_outlast_a_restart() {
    // The disc leaps away in the first step, and rests after the second one.
    let driven = Case::of("pressing_disc")
        .set("contact.0.obstacle.sphere.centre", "[1.0, 1.2]")
        .set(
            "contact.0.obstacle_load",
            "{ direction = [0, 1], force = 'if(t < 1.5e-3, 1e9, if(t < 2.5e-3, -1e9, 0))', mass = 0.1 }",
        )
        .set("time.end", "4e-3")
        .set("time.step", "1e-3")
        .set("checkpoint", "{ every = 1, keep = 100 }");
    compare_summaries(&driven, 2, 2, "an obstacle that a force moves");
    assert!(driven.results().summary()["warnings"].to_string().contains("leapt by"));
    let adaptive = Case::square(4)
        .set("time.scheme", "'bdf2'")
        .set("time.end", "0.25")
        .set("time.adaptive", "{ tolerance = 1e-2, smallest_step = 1e-4, largest_step = 0.0625 }")
        .set("contact.0.friction", "{ coulomb = { coefficient = 0.3 } }")
        .set("checkpoint", "{ every = 1, keep = 1000 }");
    compare_summaries(&adaptive, 2, 6, "flow and friction with adaptive steps");
    let several = Case::of("three_blocks").set("checkpoint", "{ every = 4, keep = 100 }");
    compare_summaries(&several, 1, 8, "three bodies");
}

fn compare_with_straight(make: impl Fn() -> Case, ranks: usize, what: &str) {
    let what = format!("{what} on {ranks} ranks");
    let (straight, stopped) = (make(), make());
    straight.run(ranks);
    interrupt(&stopped, ranks);
    assert_identical(&straight.results(), &continue_run(&stopped, ranks), &what);
}

#[test]
fn a_restarted_run_is_the_straight_run_to_the_last_bit() {
    for ranks in [1, 2, 3, 4] {
        compare_with_straight(|| saving().set("solver.preconditioner", "'cholesky'"), ranks, "cholesky");
    }
}

#[test]
fn a_restarted_run_with_profiles_at_times_of_their_own_is_the_straight_run_to_the_last_bit() {
    for every in ["{every = 1}", "{every = 8}", "{interval = 0.25}"] {
        compare_with_straight(|| saving().set("output.profiles", every), 2, every);
    }
}

#[test]
fn a_restarted_run_under_gamg_is_the_straight_run_to_the_last_bit() {
    for ranks in [1, 2, 3, 4] {
        let gamg = || saving().set("solver.preconditioner", "'gamg'");
        compare_with_straight(gamg, ranks, "gamg");
        compare_with_straight(|| gamg().set("mesh.order", "2"), ranks, "gamg with quadratic cells");
    }
}

#[test]
fn a_restarted_run_with_fewer_effects_is_the_straight_run_to_the_last_bit() {
    for preconditioner in ["'cholesky'", "'gamg'"] {
        let make = || saving().set("solver.preconditioner", preconditioner);
        let elastic = || make().without("material.viscoplasticity");
        compare_with_straight(elastic, 2, "without viscoplasticity");
        compare_with_straight(|| make().without("material.density"), 2, "without density");
        compare_with_straight(|| elastic().without("material.density"), 3, "without both");
        compare_with_straight(|| make().without("contact"), 2, "without contact");
    }
}

#[test]
fn a_restarted_run_with_each_contact_law_is_the_straight_run_to_the_last_bit() {
    for law in [
        "unilateral = { gap = '0.004 - 0.01*t' }",
        "unilateral = { bound = 'velocity' }",
        "compliance = { stiffness = 1000, exponent = 1.5, damping = 30, gap = 0.004 }",
        "graph = { points = [[0, -2], [0, 2]] }",
    ] {
        let make = || saving().set("contact.0.normal", &format!("{{ {law} }}"));
        compare_with_straight(make, 1, law);
        compare_with_straight(make, 3, law);
    }
}

/// A square with damage whose bonds break during the run.
fn weakened() -> Case {
    saving()
        .set("material.damage", "{ threshold = 0.05, viscosity = 0.5, exponent = 1 }")
        .set(
            "contact.0.adhesion",
            "{ stiffness = 20, tangential_stiffness = 20, energy = 1e-4, viscosity = 1e-4 }",
        )
        .set("traction.0.value", "[0, 10]")
}

#[test]
fn a_restarted_run_with_damage_and_adhesion_is_the_straight_run_to_the_last_bit() {
    for ranks in [1, 2, 3] {
        compare_with_straight(weakened, ranks, "damage and adhesion");
    }
    let history = weakened().run(1).table("history.csv");
    for column in ["damage_dissipation", "adhesion_dissipation"] {
        let values = history.numbers(column);
        assert!(0.0 < values[7] && values[7] < values[15], "{column} goes on behind the restart: {values:?}");
    }
}

#[test]
fn a_run_with_damage_and_adhesion_continues_on_any_number_of_ranks() {
    for writers in [1, 3] {
        continue_on_other_ranks(weakened(), writers, &["damage", "bonding"]);
    }
}

/// A square that sinks into a foundation with memory.
fn remembering() -> Case {
    saving().set("contact.0.memory", "{ stiffness_rate = 200, decay_time = 0.3 }")
}

#[test]
fn a_run_with_contact_memory_continues_to_the_last_bit_and_on_any_number_of_ranks() {
    for ranks in [1, 2] {
        compare_with_straight(remembering, ranks, "contact memory");
    }
    continue_on_other_ranks(remembering(), 2, &["memory_pressure"]);
}

/// A square with heat, through two of its boundaries.
fn heated() -> Case {
    let boundaries = "[{ on = ['left'], temperature = '300 + 5*sin(t)' }, \
                      { on = ['top'], convection = { coefficient = '5 + t', ambient = 280 } }]";
    saving()
        .set("material.heat", "{ conductivity = 2, capacity = 3, expansion = 1e-4, reference = 290 }")
        .set("initial.temperature", "'290 + x*y'")
        .set("heat", boundaries)
        .set("output.probe_also", "['temperature']")
}

#[test]
fn a_run_with_heat_continues_to_the_last_bit_and_on_any_number_of_ranks() {
    for ranks in [1, 2, 3] {
        compare_with_straight(heated, ranks, "heat");
    }
    let implicit = || heated().set("mesh.order", "2").set("time.scheme", "'implicit_euler'");
    compare_with_straight(implicit, 2, "heat of quadratic cells");
    continue_on_other_ranks(heated(), 2, &["temperature"]);
}

#[test]
fn a_restarted_run_with_an_obstacle_that_a_force_moves_is_the_straight_run_to_the_last_bit() {
    for scheme in ["'implicit_euler'", "'bdf2'", "'lagged_euler'", "'midpoint'"] {
        let make = || {
            let is_massless = if scheme == "'midpoint'" { "true" } else { "false" };
            saving()
                .set("time.scheme", scheme)
                .set("contact.0.redistribute_mass", is_massless)
                .set("contact.0.normal", "{ unilateral = {} }")
                .set("contact.0.friction", "{ coulomb = { coefficient = 0.3 } }")
                .set("contact.0.obstacle", "{ plane = { point = [0, -0.002], normal = [0, 1] } }")
                .set(
                    "contact.0.obstacle_load",
                    "{ direction = [1, 4], force = '3 + t', mass = 0.5, velocity = 0.1 }",
                )
        };
        compare_with_straight(make, 1, scheme);
        compare_with_straight(make, 2, scheme);
        let case = make().run_and_keep(1);
        let results = case.results();
        let path =
            results.table("resultants.csv").only("source", "contact bottom").numbers("obstacle_velocity");
        assert!(path.windows(2).all(|pair| pair[0] != pair[1]), "{path:?}");
    }
}

#[test]
fn a_restarted_run_with_rate_and_state_friction_is_the_straight_run_to_the_last_bit() {
    let law = "reference = 0.4, velocity = 1e-3, direct = 0.02, evolution = 0.03, distance = 0.01";
    for evolution in ["ageing", "slip"] {
        let friction = format!("{{ rate_and_state = {{ {law}, law = '{evolution}' }} }}");
        let make = || {
            saving()
                .set("contact.0.friction", &friction)
                .set("contact.0.normal", "{ unilateral = { bound = 'velocity' } }")
        };
        compare_with_straight(make, 1, evolution);
        compare_with_straight(make, 3, evolution);
    }
}

#[test]
fn a_restarted_run_with_wear_is_the_straight_run_to_the_last_bit() {
    for scheme in ["lagged_euler", "implicit_euler", "bdf2"] {
        let make = || {
            saving()
                .set("time.scheme", &format!("'{scheme}'"))
                .set("contact.0.friction", "{ coulomb = { coefficient = 0.3 } }")
                .set("contact.0.normal", "{ compliance = { stiffness = 100.0 } }")
                .set("contact.0.wear", "{ coefficient = 0.1 }")
        };
        compare_with_straight(make, 1, scheme);
        compare_with_straight(make, 3, scheme);
        let case = make();
        let results = case.run(2);
        assert!(results.number("max_energy_imbalance") < 1e-9, "{scheme}");
        let fields = NumberFile::open(&results.path("fields.vtkhdf"));
        let worn = fields.field("wear", fields.times().len() - 1).into_iter().fold(0.0, f64::max);
        assert!(worn > 1e-4, "{scheme}: {worn} m are worn off");
    }
}

#[test]
fn a_restarted_run_with_boundaries_that_wear_and_meet_at_an_edge_is_the_straight_run_to_the_last_bit() {
    let side = "normal = { compliance = { stiffness = 1000.0 } }, wear = { coefficient = 0.01 }";
    let make = |order: &str, law: &str| {
        let on = |side_of: &str| format!("{{ on = ['{side_of}'], {side}, friction = {{ {law} }} }}");
        Case::cube(2)
            .set("checkpoint.every", "4")
            .set("output.profile", "[{on = 'bottom'}]")
            .set("mesh.order", order)
            .set("time.scheme", "'bdf2'")
            .set("support", "[{ on = ['top'], fix = 'all', velocity = [-0.02, 0.3, -0.02] }]")
            .without("traction")
            .set("contact", &format!("[{}, {}]", on("bottom"), on("left")))
    };
    for (order, law) in [
        ("1", "coulomb = { coefficient = 0.3 }"),
        ("1", "distance_weakening = { static = 0.4, dynamic = 0.3, distance = 0.2 }"),
        ("2", "coulomb = { coefficient = 0.3 }"),
    ] {
        let what = format!("cells of order {order}, {law}");
        compare_with_straight(|| make(order, law), 1, &what);
        compare_with_straight(|| make(order, law), 3, &what);
    }
    // One contact on both boundaries.
    let both = || {
        make("1", "coulomb = { coefficient = 0.3 }").set(
            "contact",
            &format!(
                "[{{ on = ['bottom', 'left'], {side}, friction = {{ coulomb = {{ coefficient = 0.3 }} }} }}]"
            ),
        )
    };
    compare_with_straight(both, 2, "one contact");
}

#[test]
fn a_restarted_run_with_each_friction_law_is_the_straight_run_to_the_last_bit() {
    for law in [
        "tresca = { bound = 0.2 }",
        "coulomb = { coefficient = 0.4 }",
        "velocity_weakening = { static = 0.4, dynamic = 0.3, decay_velocity = 0.1 }",
        "distance_weakening = { static = 0.4, dynamic = 0.3, distance = 0.01, decay = 'exponential' }",
        "expression = { coefficient = '0.3 + 0.1*exp(-l/0.01) + 0.02*exp(-p)' }",
    ] {
        let make = || {
            saving()
                .set("contact.0.friction", &format!("{{ {law} }}"))
                .set("contact.0.normal", "{ unilateral = { bound = 'velocity' } }")
        };
        compare_with_straight(make, 1, law);
        compare_with_straight(make, 3, law);
        let fixed = || make().set("solver.friction", "'fixed_point'");
        compare_with_straight(fixed, 1, law);
        let log = make().run_and_keep(1).results().text("run.log");
        let sticks = |line: &str| line.contains(" stick, ") && !line.contains(" 0 stick, ");
        assert!(log.lines().any(sticks), "some points stick: {log}");
    }
}

#[test]
fn a_restarted_run_under_each_scheme_is_the_straight_run_to_the_last_bit() {
    let flow = "{ perzyna = { relaxation = 100, yield_stress = 9, hardening_modulus = 300, kinematic_modulus = 200 } }";
    let law = "{ compliance = { stiffness = 1000, exponent = 1.5, damping = 30, gap = '0.004 - 0.01*t' } }";
    for scheme in ["'implicit_euler'", "'bdf2'"] {
        let make = || {
            saving()
                .set("time.scheme", scheme)
                .set("material.viscoplasticity", flow)
                .set("contact.0.normal", law)
        };
        compare_with_straight(make, 1, scheme);
        compare_with_straight(make, 3, scheme);
        let elastic = || make().without("material.viscoplasticity").without("contact");
        compare_with_straight(elastic, 2, scheme);
    }
}

#[test]
fn a_restarted_run_under_the_midpoint_rule_is_the_straight_run_to_the_last_bit() {
    let flow = "{ perzyna = { relaxation = 100, yield_stress = 9, hardening_modulus = 300 } }";
    for (friction, order) in [("coulomb = { coefficient = 0.3 }", "1"), ("tresca = { bound = 0.2 }", "2")] {
        let make = || {
            saving()
                .set("time.scheme", "'midpoint'")
                .set("mesh.order", order)
                .set("material.viscoplasticity", flow)
                .set("contact.0.redistribute_mass", "true")
                .set("contact.0.normal", "{ unilateral = { gap = '0.004 - 0.01*t' } }")
                .set("contact.0.friction", &format!("{{ {friction} }}"))
        };
        compare_with_straight(make, 1, friction);
        compare_with_straight(make, 3, friction);
    }
}

#[test]
fn a_restarted_cube_is_the_straight_cube_to_the_last_bit() {
    let make = || Case::cube(4).set("checkpoint.every", "4").set("output.profile", "[{on = 'bottom'}]");
    compare_with_straight(make, 3, "cube");
}

/// Saves on some number of ranks and continues on 1, 2, 3 and 4; the last state must be that of an uninterrupted run.
fn continue_on_other_ranks(case: Case, writers: usize, histories: &[&str]) {
    // With a tighter tolerance than the default, so that the residual does not hide errors of the restart.
    let case = case.set("solver.tolerance", "1e-13");
    case.run_with(1, &["--set", "output.folder='straight'"]).expect(0);
    let straight = Results::of(case.folder().join("straight"));
    interrupt(&case, writers);
    let saved = case.folder().join("out");
    for readers in [1, 2, 3, 4] {
        let what = format!("saved on {writers} ranks, gone on on {readers}");
        copy_folder(&saved, &case.folder().join(&what));
        let to_copy = format!("output.folder='{what}'");
        case.run_with(readers, &["--set", &to_copy, "--restart"]).expect(0);
        assert_same_answer(&straight, &Results::of(case.folder().join(&what)), 1e-9, &what);
    }
    assert_restored(&case, &saved, 5 - writers, histories);
}

#[test]
fn a_run_saved_on_one_rank_continues_on_any_number() {
    continue_on_other_ranks(saving(), 1, &[]);
}

#[test]
fn a_run_saved_on_two_ranks_continues_on_any_number() {
    continue_on_other_ranks(saving(), 2, &[]);
}

#[test]
fn a_run_saved_on_three_ranks_continues_on_any_number() {
    continue_on_other_ranks(saving(), 3, &[]);
}

#[test]
fn a_run_of_each_scheme_saved_on_three_ranks_continues_on_any_number() {
    for scheme in ["'implicit_euler'", "'bdf2'"] {
        continue_on_other_ranks(saving().set("time.scheme", scheme), 3, &[]);
    }
}

#[test]
fn a_run_saved_on_four_ranks_continues_on_any_number() {
    continue_on_other_ranks(saving(), 4, &[]);
}

/// Continues from a checkpoint without taking a step, so that the restored state is written to the field file.
fn assert_restored(case: &Case, saved: &Path, readers: usize, histories: &[&str]) {
    let file = saved.join("checkpoint-8.h5").display().to_string();
    let options = ["--set", "time.end=0.5", "--set", "output.folder='restored'", "--restart", &file];
    case.run_with(readers, &options).expect(0);
    let what = format!("restored on {readers} ranks");
    let restored = NumberFile::open(&case.folder().join("restored/fields.vtkhdf"));
    let written = NumberFile::open(&saved.join("fields.vtkhdf"));
    assert_eq!((written.times()[1], restored.times()), (0.5, vec![0.5]), "{what}");
    for name in ["displacement", "velocity", "viscoplastic_history"].iter().chain(histories) {
        assert!(written.field(name, 1) == restored.field(name, 0), "{what}: {name}");
    }
    for name in ["stress", "von_mises"] {
        let difference = relative_difference(&written.field(name, 1), &restored.field(name, 0));
        assert!(difference < 1e-9, "{what}: {name} differs by {difference:e}");
    }
}

fn copy_folder(from: &Path, to: &Path) {
    std::fs::create_dir(to).expect("folder");
    for name in crate::results::names(from) {
        std::fs::copy(from.join(&name), to.join(&name)).expect("copied");
    }
}

fn truncate(file: &Path) {
    let bytes = std::fs::read(file).expect("checkpoint");
    std::fs::write(file, &bytes[..bytes.len() * 2 / 3]).expect("written");
}

fn flip_a_bit(file: &Path) {
    let mut bytes = std::fs::read(file).expect("checkpoint");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 0x10;
    std::fs::write(file, bytes).expect("written");
}

#[test]
fn a_damaged_checkpoint_is_skipped_with_a_warning() {
    let straight = saving();
    let straight = (straight.run(2), straight);
    for damage in [truncate, flip_a_bit] {
        let case = saving();
        case.run(2);
        assert_eq!(case.results().checkpoints(), [16, 12]);
        damage(&case.results().path("checkpoint-16.h5"));
        let outcome = case.run_with(2, &["--restart"]).expect(0);
        outcome
            .says("warning: ")
            .says("checkpoint-16.h5")
            .says("continuing from")
            .says("(step 12, t = 0.75 s)");
        assert_identical(&straight.0, &case.results(), "behind a damaged checkpoint");
    }
}

#[test]
fn a_run_is_refused_where_every_checkpoint_is_damaged() {
    let case = saving();
    case.run(2);
    truncate(&case.results().path("checkpoint-16.h5"));
    flip_a_bit(&case.results().path("checkpoint-12.h5"));
    let outcome = case.run_with(2, &["--restart"]).expect(2);
    outcome.says("no intact checkpoint").says("checkpoint-16.h5").says("checkpoint-12.h5");
}

#[test]
fn a_run_is_refused_where_there_is_no_checkpoint() {
    let case = Case::square(4);
    case.run_with(1, &["--restart"]).expect(2).says("no checkpoint to continue from");
    let outcome = case.run_with(2, &["--restart", "nowhere.h5"]).expect(2);
    outcome.says("nowhere.h5");
}

/// Interrupts the run and continues with another value of a key.
fn continue_with(change: &str) -> (Outcome, Case) {
    let case = saving();
    interrupt(&case, 1);
    (case.run_with(2, &["--restart", "--set", change]), case)
}

#[test]
fn a_checkpoint_of_another_problem_is_refused_and_the_key_is_named() {
    for (change, key) in [
        ("material.viscosity.shear=51", "material.viscosity.shear: checkpoint 50.0, job 51.0"),
        ("time.step=0.03125", "time.step: checkpoint 0.0625, job 0.03125"),
        ("contact.0.quadrature=gauss", "contact.0.quadrature"),
        ("mesh.rectangle.diagonal=left", "mesh.rectangle.diagonal"),
        ("traction.0.value=[0, '-10*t']", "traction.0.value"),
    ] {
        continue_with(change).0.expect(2).says("belongs to another problem").says(key);
    }
}

#[test]
fn a_changed_parameter_is_refused_by_the_names_of_its_keys_and_numbers_may_take_its_place() {
    let case = saving()
        .set("parameters", "{ load = 10.0, T = 1, n = 4 }")
        .set("traction.0.value", "[0, '-load*t']")
        .set("material.density", "'load/10'")
        .set("time.end", "'T'")
        .set("checkpoint.every", "'n'");
    interrupt(&case, 1);
    let refused = case.run_with(1, &["--restart", "--set", "parameters.load=11"]).expect(2);
    refused.says("belongs to another problem").says("traction.0.value").says("material.density");
    let plain =
        ["--restart", "--set", "parameters={}", "--set", "material.density=1", "--set", "checkpoint.every=4"];
    let plain =
        [&plain[..], &["--set", "time.end=1", "--set", "traction.0.value=[0, \"-(10.0)*t\"]"]].concat();
    case.run_with(1, &plain).expect(0).says("checkpoint-8.h5 (step 8, t = 0.5 s)");
    // The effective job of a run runs again.
    let (kept, rest) =
        (saving().set("parameters", "{ load = 2.0 }").set("material.density", "'load/2'"), ["--restart"]);
    interrupt(&kept, 2);
    let written = std::fs::read_to_string(kept.results().path("job.toml")).expect("job.toml");
    assert!(written.contains("load = 2.0") && written.contains("density = \"load/2\""), "{written}");
    let effective = kept.results().path("job.toml").display().to_string();
    crate::launch::run(2, &[&["run", &effective, "--set", "time.end=1.0"][..], &rest].concat()).expect(0);
}

#[test]
fn what_is_written_and_how_it_is_solved_may_change_on_the_way() {
    for change in [
        "output.fields={interval=0.25}",
        "output.probe=[{name='other', point=[0.5, 0.5]}]",
        "output.profile=[{on='top'}]",
        "checkpoint.keep=1",
        "solver.preconditioner=gamg",
        "about.title=another",
    ] {
        let (outcome, case) = continue_with(change);
        outcome.expect(0);
        assert_eq!(case.results().number("steps"), 16.0, "{change}");
        assert_eq!(case.results().table("history.csv").rows.len(), 16, "{change}");
    }
}

#[test]
fn a_completed_run_that_is_restarted_has_nothing_left_to_do() {
    let case = saving();
    let first = case.run(2);
    let before =
        ["probes.csv", "history.csv", "profiles.csv", "fields.xdmf"].map(|name| (name, first.text(name)));
    case.run_with(2, &["--restart"]).expect(0).says("(step 16, t = 1 s)").says("completed");
    for (name, text) in before {
        assert_eq!(case.results().text(name), text, "{name}");
    }
    assert_eq!(case.results().summary()["status"], "completed");
}

#[test]
fn a_completed_run_continues_to_a_later_end() {
    let longer = saving().set("time.end", "1.5");
    let longer = (longer.run(2), longer);
    let case = saving();
    case.run(2);
    case.run_with(2, &["--restart", "--set", "time.end=1.5"]).expect(0);
    assert_eq!(longer.0.text("probes.csv"), case.results().text("probes.csv"));
    assert_eq!(longer.0.text("history.csv"), case.results().text("history.csv"));
}

#[test]
fn only_the_newest_checkpoints_are_kept() {
    for (keep, left) in [("1", vec![16]), ("2", vec![16, 15]), ("4", vec![16, 15, 14, 13])] {
        let case = Case::square(4).set("checkpoint.every", "1").set("checkpoint.keep", keep);
        assert_eq!(case.run(1).checkpoints(), left);
    }
}

#[test]
fn a_new_start_removes_the_checkpoints_of_an_earlier_run() {
    let case = saving();
    case.run(1);
    let outcome = case.run_with(1, &["--set", "time.end=0.3"]).expect(0);
    outcome.says("checkpoint-12.h5 of an earlier run");
    assert_eq!(case.results().checkpoints(), [5, 4]);
}

#[test]
fn a_restarted_run_across_jumps_of_a_crack_is_the_straight_run_to_the_last_bit() {
    let make = || {
        Case::of("verification/double_cantilever")
            .set("mesh.rectangle.cells", "[50, 1]")
            .set("time.step", "0.0625")
            .set("checkpoint.every", "4")
            .set("output.fields", "{ every = 8 }")
            .set("output.probe", "[{ name = 'middle', point = [0.05, 0.001] }]")
            .set("output.profile", "[{ on = 'bottom' }]")
    };
    for ranks in [1, 2] {
        compare_with_straight(make, ranks, "a crack that jumps");
    }
}
