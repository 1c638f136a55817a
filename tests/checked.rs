//! Runs of jobs of the repository.

use crate::cores;
use std::{path::Path, process::Command};

/// Runs a job with these keys changed (`time.step=0.01`) on some ranks, with its results in the folder `output`; an error has the
/// messages of the solver.
pub fn run(job: &Path, ranks: usize, output: &Path, changes: &[&str]) -> Result<(), String> {
    let mut launcher = Command::new("mpirun");
    let _folder = cores::share(&mut launcher);
    let run = launcher
        .args(["--oversubscribe", "--bind-to", "none", "-n", &ranks.to_string()])
        .arg(env!("CARGO_BIN_EXE_solver"))
        .arg(job)
        .args(["--set", &format!("output.folder={output:?}")])
        .args(changes.iter().flat_map(|change| ["--set", change]))
        .output()
        .map_err(|error| format!("mpirun: {error}"))?;
    let words = String::from_utf8_lossy(&run.stderr);
    if run.status.success() { Ok(()) } else { Err(format!("{}\n{words}", run.status)) }
}
