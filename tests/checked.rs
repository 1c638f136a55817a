//! Runs of jobs of the repository.

use crate::cores::{self, Cores};
use std::{path::Path, process::Command};

/// Runs a job with these keys changed (`time.step=0.01`) on some ranks, with its results in the folder `output`; an error has the
/// messages of the solver. One rank is started without `mpirun`, which would take longer than many a run.
pub fn run(job: &Path, ranks: usize, output: &Path, changes: &[&str]) -> Result<(), String> {
    let solver = env!("CARGO_BIN_EXE_solver");
    let mut command = Command::new(if ranks == 1 { solver } else { "mpirun" });
    if ranks > 1 {
        command.args(["--oversubscribe", "--bind-to", "none", "-n", &ranks.to_string(), solver]);
    }
    let (_cores, _folder) = (Cores::take(ranks), cores::share(&mut command));
    let run = command
        .arg(job)
        .args(["--set", &format!("output.folder={output:?}")])
        .args(changes.iter().flat_map(|change| ["--set", change]))
        .output()
        .map_err(|error| format!("the solver on {ranks} rank(s): {error}"))?;
    let words = String::from_utf8_lossy(&run.stderr);
    if run.status.success() { Ok(()) } else { Err(format!("{}\n{words}", run.status)) }
}
