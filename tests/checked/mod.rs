//! Runs of jobs of the repository.

use std::{path::Path, process::Command};

/// Runs a job with these keys changed (`time.step=0.01`) on some ranks, with its results in the folder `output`; an error has the
/// messages of the solver.
pub fn run(job: &Path, ranks: usize, output: &Path, changes: &[&str]) -> Result<(), String> {
    // Launchers that share this folder compete in creating and removing it.
    let own = tempfile::tempdir().map_err(|error| format!("folder: {error}"))?;
    let run = Command::new("mpirun")
        .env("OMPI_MCA_orte_tmpdir_base", own.path())
        .args([
            "--oversubscribe",
            "--bind-to",
            "none",
            "-n",
            &ranks.to_string(),
            env!("CARGO_BIN_EXE_solver"),
        ])
        .arg(job)
        .args(["--set", &format!("output.folder={output:?}")])
        .args(changes.iter().flat_map(|change| ["--set", change]))
        .env("OMP_NUM_THREADS", "1")
        .env("OMPI_ALLOW_RUN_AS_ROOT", "1")
        .env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1")
        .output()
        .map_err(|error| format!("mpirun: {error}"))?;
    let words = String::from_utf8_lossy(&run.stderr);
    if run.status.success() { Ok(()) } else { Err(format!("{}\n{words}", run.status)) }
}
