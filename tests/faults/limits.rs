//! Time limits: the run saves its state before the limit, on all ranks, and can be continued.

use crate::{
    case::Case,
    launch::{Outcome, Running},
    results::Results,
};
use std::{
    process::Command,
    time::{SystemTime, UNIX_EPOCH},
};

const SLURM_END: &str = "SLURM_JOB_END_TIME";

fn now() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).expect("a time").as_secs()
}

/// The step of the newest checkpoint, and the time when it was written.
fn newest_checkpoint(results: &Results) -> (u64, u64) {
    let found = clarke::io::output::checkpoint_folder::list(&results.path("")).expect("list");
    let (step, file) = &found[0];
    let written = std::fs::metadata(file).and_then(|file| file.modified()).expect("a time");
    (*step, written.duration_since(UNIX_EPOCH).expect("a time").as_secs())
}

/// More steps than any test waits for.
fn endless() -> Case {
    Case::square(6)
        .set("time.step", "0.0009765625")
        .set("time.end", "1024")
        .set("output.fields", "{every = 1000000}")
}

/// Runs the solver on three ranks, of which only one knows the end of its Slurm job.
fn with_end(case: &Case, end: &str, knows: usize) -> Outcome {
    let mut command = Command::new("mpirun");
    command.args(["--oversubscribe", "--bind-to", "none"]);
    for rank in 0..3 {
        command.args(if rank == 0 { &["-n", "1"][..] } else { &[":", "-n", "1"] });
        if rank == knows {
            command.args(["-x", &format!("{SLURM_END}={end}")]);
        }
        command.arg(env!("CARGO_BIN_EXE_solver")).arg(case.written());
    }
    Running::spawn(command).wait()
}

#[test]
fn a_run_saves_its_state_before_its_slurm_job_ends_whichever_rank_knows() {
    for knows in [0, 2] {
        let case = endless();
        // Long enough for the start of three ranks beside other tests.
        let end = now() + 10;
        let outcome = with_end(&case, &end.to_string(), knows).expect(3);
        outcome
            .says("the Slurm job ends in")
            .says("stopping on the end of the Slurm job; continue with --restart");
        let results = case.results();
        let (steps, saved) = newest_checkpoint(&results);
        assert!(saved <= end, "the Slurm job was over");
        assert_eq!(results.summary()["status"], "stopped");
        let further = format!("time.end={}", (steps + 8) as f64 / 1024.0);
        case.run_with(3, &["--restart", "--set", &further]).expect(0);
        case.run_with(3, &["--set", "output.folder='straight'", "--set", &further]).expect(0);
        let straight = Results::of(case.folder().join("straight"));
        for name in ["probes.csv", "history.csv"] {
            assert_eq!(straight.text(name), case.results().text(name), "{name}");
        }
    }
}

#[test]
fn a_margin_longer_than_what_is_left_ends_the_run_after_a_step() {
    let case = endless().set("checkpoint.margin", "10000");
    with_end(&case, &(now() + 1000).to_string(), 1).expect(3).says("the end of the Slurm job");
    assert_eq!(case.results().checkpoints(), [1]);
}

#[test]
fn an_end_that_is_over_or_no_time_stops_nothing() {
    let short = || endless().set("time.end", "0.01");
    let outcome = with_end(&short(), &(now() - 1000).to_string(), 0).expect(0);
    outcome.says("s in the past and is ignored");
    with_end(&short(), "UNLIMITED", 0).expect(0).says("completed");
}

#[test]
fn all_ranks_stop_at_the_same_step_when_the_wall_time_is_over() {
    let case = endless().set("checkpoint.wall_limit", "1.5");
    case.run_with(4, &[]).expect(3).says("stopping on the wall-time limit of 1.5 s");
    let steps = case.results().checkpoints()[0];
    assert_eq!(case.results().table("history.csv").rows.len() as u64, steps);
}
