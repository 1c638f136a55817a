//! Estimated errors against known ones.

use crate::{case::Case, results::Results};

/// Stress relaxes in a block that is held, as `exp(-t / 0.5 s)`, with these steps.
fn relaxing(scheme: &str, step: f64) -> Case {
    Case::of("stress_relaxation")
        .set("time.scheme", &format!("{scheme:?}"))
        .set("time.step", &step.to_string())
        .set("output.error_estimate", "true")
        .without("check")
}

/// The estimated error of the steps holds the true one and is at most three times as large.
#[track_caller]
fn assert_holds(results: &Results) {
    // After 100 steps of lagged_euler the stress has the share 0.98^100, and this norm.
    let reached = results.number("final_von_mises") / 1.8376304711 * 0.98f64.powi(100);
    let (estimated, actual) = (results.number("error_of_steps"), (1.0 - (-2f64).exp() / reached).abs());
    assert!(estimated >= actual && estimated <= 3.0 * actual, "{estimated} for {actual}");
    assert!(results.number("error_of_mesh") < 1.1e-10, "the stress is uniform");
}

#[test]
fn steps_twice_and_four_times_as_long_show_the_error_of_the_steps() {
    let case = relaxing("lagged_euler", 0.01).set("checkpoint.at", "[0.5]");
    let outcome = case.run_with(1, &["--quiet"]);
    outcome.expect(0);
    let results = case.results();
    assert_holds(&results);
    let order = results.number("order_of_steps");
    assert!((0.9..=1.0).contains(&order), "{order}");
    let log = results.text("run.log");
    assert!(log.contains("errors     by the steps 2.") && log.contains("half of it takes 2"), "{log}");
    let straight = results.number("error_of_steps");
    case.run_with(2, &["--restart", &case.folder().join("out/checkpoint-50.h5").display().to_string()])
        .expect(0);
    let restarted = case.results().number("error_of_steps");
    assert!((restarted - straight).abs() < 1e-9 * straight, "{restarted} {straight}");
    assert_holds(&relaxing("bdf2", 0.05).run_and_keep(1).results());
}

#[test]
fn a_run_of_one_step_is_repeated_with_shorter_ones() {
    let case = relaxing("implicit_euler", 1.0).run_and_keep(1);
    assert_holds(&case.results());
    let plain = relaxing("implicit_euler", 1.0).set("output.error_estimate", "false").run_and_keep(1);
    let results = plain.results();
    assert!(results.summary()["error_of_steps"].is_null());
    assert!(
        results.number("error_of_mesh") < 1.1e-10,
        "that by the mesh is estimated at the end of every run"
    );
    let log = results.text("run.log");
    assert!(log.contains("by the steps not estimated: [output] error_estimate = true"), "{log}");
}

#[test]
fn an_error_beside_a_state_that_has_decayed_is_called_a_share_of_the_largest() {
    for (end, is_of_largest) in [("1.0", false), ("4.0", true)] {
        let case = relaxing("lagged_euler", 0.05).set("time.end", end).run_and_keep(1);
        let (results, words) = (case.results(), "a twentieth of the largest stress and velocity of the run");
        assert_eq!(results.summary()["reference_of_steps"].as_str(), is_of_largest.then_some(words));
        assert_eq!(results.text("run.log").contains(words), is_of_largest, "{end}");
    }
}

/// A pulse runs through an absorbing end within a few steps.
#[test]
fn an_error_of_states_that_do_not_approach_each_other_is_uncertain() {
    let case =
        Case::of("absorbed_pulse").set("output.error_estimate", "true").without("check").run_and_keep(1);
    let results = case.results();
    let (estimated, actual) = (results.number("error_of_steps"), 0.11);
    assert!(
        (actual / 3.0..3.0 * actual).contains(&estimated),
        "{estimated}, from steps an eighth as long {actual}"
    );
    assert!(results.summary()["order_of_steps"].is_null());
    let log = results.text("run.log");
    assert!(log.contains("uncertain: the states of"), "{log}");
}

#[test]
fn errors_by_the_mesh_are_uncertain_in_thin_bodies_and_in_those_that_vibrate() {
    let doubt = |case: Case, ranks: usize| {
        let case = case.set("time.scheme", "'implicit_euler'").run_and_keep(ranks);
        case.results().summary()["doubt_of_mesh"].as_str().map(str::to_owned)
    };
    let of_cells = |cells: &str| relaxing("implicit_euler", 0.5).set("mesh.rectangle.cells", cells);
    for ranks in [1, 2] {
        let thin = doubt(of_cells("[4, 4]"), ranks).unwrap_or_default();
        assert!(thin.contains("lie at the surface"), "{thin}");
        assert_eq!(doubt(of_cells("[6, 6]"), ranks), None);
    }
    let pulse = Case::of("absorbed_pulse").set("output.error_estimate", "true").without("check");
    let vibrates = doubt(pulse.set("time.end", "0.1"), 1).unwrap_or_default();
    assert!(vibrates.contains("vibrates"), "{vibrates}");
}
