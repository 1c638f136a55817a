//! Launchers whose ranks share the cores with other tests.

use std::process::Command;

/// Sets the environment of a launcher of ranks, for which the folder has to remain as long as it runs: launchers that share one
/// compete in creating and removing it.
pub fn share(launcher: &mut Command) -> tempfile::TempDir {
    let own = tempfile::tempdir().expect("folder");
    launcher
        .env("OMPI_MCA_orte_tmpdir_base", own.path())
        // Waiting ranks yield.
        .env("OMPI_MCA_mpi_yield_when_idle", "1")
        .env("OMP_NUM_THREADS", "1")
        .env("OPENBLAS_NUM_THREADS", "1")
        // Open MPI refuses to start as root otherwise, and ignores these for others.
        .env("OMPI_ALLOW_RUN_AS_ROOT", "1")
        .env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1");
    own
}
