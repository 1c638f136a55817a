//! A run writes to its output folder only, and results of other jobs are not changed.

use crate::{case::Case, launch::Target, results::names};
use std::fs;

fn small() -> Case {
    Case::square(4).set("time.end", "0.25").set("checkpoint.every", "2")
}

/// The contents of a folder by name.
fn contents(case: &Case) -> Vec<(String, Vec<u8>)> {
    let folder = case.folder().join("out");
    names(&folder)
        .into_iter()
        .map(|name| (name.clone(), fs::read(folder.join(name)).expect("read")))
        .collect()
}

#[test]
fn results_of_another_job_are_not_overwritten_unless_forced() {
    let case = small();
    case.run(2);
    let before = contents(&case);
    for (change, key) in [
        ("material.viscosity.shear=51", "material.viscosity.shear"),
        ("mesh.rectangle.cells=[5, 4]", "mesh.rectangle.cells"),
        ("about.title='another'", "about"),
        ("time.step=0.03125", "time.step"),
    ] {
        let outcome = case.run_with(2, &["--set", change]).expect(2);
        outcome.says("the folder contains the results of another job").says(key).says("--force");
        assert_eq!(contents(&case), before, "{change}");
    }
}

#[test]
fn results_that_were_overwritten_by_force_are_those_of_the_new_job() {
    let case = small();
    let change = "material.viscosity.shear=51";
    case.run(1);
    case.run_with(1, &["--set", change, "--force"]).expect(0).says("completed");
    case.run_with(1, &["--set", change]).expect(0);
    case.run_with(1, &[]).expect(2).says("material.viscosity.shear");
}

#[test]
fn the_same_job_runs_again_in_its_folder_with_other_output_and_another_end() {
    let case = small();
    case.run(2);
    case.run(2);
    case.run_with(1, &["--set", "time.end=0.5", "--set", "output.fields={every=1}"]).expect(0);
    case.run_with(1, &["--set", "solver.preconditioner=gamg"]).expect(0);
    // The effective job in the output folder is the same job.
    let effective = case.folder().join("out/job.toml");
    crate::launch::run(2, &["run", &effective.display().to_string()]).expect(0);
}

#[test]
fn a_run_that_was_stopped_is_not_lost_by_starting_it_again() {
    for ranks in [1, 2] {
        let case = small().set("checkpoint.wall_limit", "1e-9");
        case.run_with(ranks, &[]).expect(3);
        let before = contents(&case);
        let outcome = case.run_with(ranks, &[]).expect(2);
        outcome.says("was stopped").says("checkpoint-1.h5").says("--restart").says("--force");
        assert_eq!(contents(&case), before, "nothing is touched");
        case.run_with(ranks, &["--restart", "--set", "checkpoint.wall_limit=1000"])
            .expect(0)
            .says("continuing from");
        // The run is finished, and the job may run again.
        case.run_with(ranks, &["--set", "checkpoint.wall_limit=1000"]).expect(0);
    }
}

#[test]
fn a_run_that_was_killed_or_failed_is_not_lost_by_starting_it_again() {
    let case = small();
    case.run(1);
    // The state after a second run was killed: a new run removes the summary of the previous one at its start.
    fs::remove_file(case.folder().join("out/summary.json")).expect("removed");
    let before = contents(&case);
    case.run_with(2, &[]).expect(2).says("did not finish").says("checkpoint-4.h5");
    assert_eq!(contents(&case), before);
    case.run_with(1, &["--force"]).expect(0).says("checkpoint-4.h5 of an earlier run");
    let failing = small().set("traction.0.value", "[0, '-10*sqrt(0.15 - t)']");
    failing.run_with(1, &[]).expect(1);
    failing.run_with(2, &[]).expect(2).says("a run that failed").says("--restart");
    assert!(failing.results().path("checkpoint-2.h5").exists());
}

#[test]
fn a_run_that_begins_removes_the_summary_of_the_one_before() {
    let case = small();
    case.run(1);
    assert_eq!(case.results().summary()["status"], "completed");
    let case = case.set("time.end", "1e4");
    let mut running = case.start_with(2, &["--restart"]);
    running.wait_for("checkpoint-6.h5");
    running.signal("KILL", Target::OneRank);
    running.wait();
    assert!(!case.results().path("summary.json").exists());
    case.run_with(2, &[]).expect(2).says("did not finish").says("--restart");
}

#[test]
fn a_restart_does_not_mix_its_rows_with_those_of_another_job() {
    let (case, other) = (small(), small().set("material.viscosity.shear", "51"));
    case.run(1);
    other.run(1);
    let before = contents(&other);
    let from = case.results().path("checkpoint-4.h5").display().to_string();
    let folder = format!("output.folder='{}'", other.folder().join("out").display());
    let outcome = case.run_with(1, &["--set", &folder, "--restart", &from]).expect(2);
    outcome.says("the folder contains the results of another job").says("choose another [output] folder");
    assert_eq!(contents(&other), before);
    case.run_with(1, &["--restart", "--force"]).expect(2).says("cannot be used with");
}

#[test]
fn a_job_file_written_by_hand_is_not_replaced_by_the_effective_one() {
    let case = small().set("output.folder", "'.'");
    let file = case.written();
    let text = fs::read_to_string(&file).expect("job");
    let outcome = case.run_with(1, &[]).expect(2);
    outcome.says("a job.toml that no run has written");
    assert_eq!(fs::read_to_string(&file).expect("job"), text);
    assert_eq!(names(case.folder()), ["job.toml"]);
}

#[test]
fn a_run_writes_nothing_outside_of_its_folder() {
    let case = small().set("output.folder", "'deep/down/out'").set("output.fields", "{every = 1}");
    case.run_with(2, &[]).expect(0);
    assert_eq!(names(case.folder()), ["deep", "job.toml"]);
    assert_eq!(names(&case.folder().join("deep")), ["down"]);
    assert_eq!(names(&case.folder().join("deep/down")), ["out"]);
}
