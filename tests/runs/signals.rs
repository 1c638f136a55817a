//! External requests to stop: the state is saved, and the continued run has the results of an uninterrupted one.
//!
//! Open MPI's `mpirun` passes SIGUSR1 on and ends as its ranks do. On SIGTERM and SIGINT it sends its ranks SIGTERM,
//! kills them after a while (one second by default), and ends with a code of its own.

use crate::{
    case::Case,
    launch::{Outcome, Target},
    results::Results,
};

/// More steps than any test waits for.
fn endless() -> Case {
    Case::square(6)
        .set("time.step", "0.0009765625")
        .set("time.end", "8")
        .set("output.fields", "{every = 1000000}")
}

/// Sends a signal after some steps.
fn stop(case: &Case, ranks: usize, signal: &str, target: Target) -> Outcome {
    let mut running = case.start_with(ranks, &["--verbose"]);
    running.wait_for("step   27/");
    running.signal(signal, target);
    running.wait()
}

#[track_caller]
fn assert_saved(results: &Results, reason: &str) -> u64 {
    let summary = results.summary();
    assert_eq!(summary["status"], "stopped");
    let steps = summary["steps"].as_u64().expect("a count");
    assert!((27..8192).contains(&steps), "{steps}");
    assert_eq!(results.checkpoints(), [steps]);
    assert_eq!(results.table("history.csv").rows.len() as u64, steps);
    assert!(results.text("run.log").contains(&format!("stopping on {reason}; continue with --restart")));
    steps
}

/// Continues for a few steps and compares the result with an uninterrupted run.
fn assert_continues(case: &Case, ranks: usize, steps: u64) {
    let end = format!("time.end={}", (steps + 8) as f64 / 1024.0);
    case.run_with(ranks, &["--restart", "--set", &end]).expect(0);
    case.run_with(ranks, &["--set", "output.folder='straight'", "--set", &end]).expect(0);
    let straight = Results::of(case.folder().join("straight"));
    for name in ["probes.csv", "history.csv"] {
        assert_eq!(straight.text(name), case.results().text(name), "{name}");
    }
    assert_eq!(case.results().summary()["status"], "completed");
}

fn stop_and_continue(ranks: usize, signal: &str, target: Target) {
    let case = endless();
    stop(&case, ranks, signal, target).expect(3);
    let steps = assert_saved(&case.results(), &format!("SIG{signal}"));
    assert_continues(&case, ranks, steps);
}

#[test]
fn a_run_that_a_batch_system_warns_saves_its_state_and_continues() {
    stop_and_continue(2, "USR1", Target::Launcher);
}

#[test]
fn a_signal_to_one_rank_stops_all_of_them() {
    stop_and_continue(3, "TERM", Target::OneRank);
    stop_and_continue(1, "INT", Target::OneRank);
}

/// A beam that lies down on an obstacle node by node: its first step takes hundreds of iterations.
#[test]
fn a_signal_ends_a_step_of_many_iterations() {
    let case = Case::written_as(
        "
        mesh.rectangle = {size = [100.0, 0.5], cells = [1600, 2]}
        material = {hypothesis = 'plane_strain', elasticity = {youngs_modulus = 1e9, poisson_ratio = 0.3}}
        support = [{on = ['left'], fix = 'all'}]
        traction = [{on = ['top'], value = [0.0, '-1e4 * x']}]
        contact = [{on = ['bottom'], normal.unilateral.gap = 0.5, friction.coulomb.coefficient = 0.3}]
        time = {end = 1.0, step = 0.5, scheme = 'implicit_euler'}",
    );
    for ranks in [1, 2] {
        let mut running = case.start_with(ranks, &["--force"]);
        running.wait_for("output ");
        std::thread::sleep(std::time::Duration::from_millis(500));
        running.signal("USR1", Target::OneRank);
        running.wait().expect(3).says("stopping on SIGUSR1; continue with --restart");
        let results = case.results();
        assert_eq!(results.summary()["steps"], 0, "within the first step");
        assert_eq!(results.checkpoints(), [0]);
    }
}

#[test]
fn a_run_that_is_killed_continues_from_its_last_checkpoint() {
    for (signal, target) in [("TERM", Target::Launcher), ("INT", Target::Launcher), ("KILL", Target::OneRank)]
    {
        let case = endless().set("checkpoint.every", "8");
        let outcome = stop(&case, 2, signal, target);
        assert_ne!(outcome.code, 0);
        let steps = case.results().checkpoints()[0];
        assert!((24..8192).contains(&steps), "{steps}");
        assert_continues(&case, 2, steps);
    }
}

#[test]
fn a_run_stops_before_its_wall_time_is_over_and_continues() {
    let case = endless().set("time.end", "256").set("checkpoint.wall_limit", "1.5");
    case.run_with(2, &[]).expect(3).says("stopping on the wall-time limit of 1.5 s; continue with --restart");
    let steps = case.results().checkpoints()[0];
    assert!(steps < 256 * 1024);
    case.run_with(2, &["--restart", "--set", "checkpoint.wall_limit=1000", "--set", "time.end=0.001"])
        .expect(0);
}
