//! Launchers whose ranks share the cores with other tests.

use std::{
    path::{Path, PathBuf},
    process::Command,
    sync::LazyLock,
};

/// The library of `sched_yield.c`, compiled once.
static SLEEPING: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let built = folder.join(format!("sched_yield-{}.so", std::process::id()));
    let library = folder.join("sched_yield.so");
    let source = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/sched_yield.c");
    let compiled =
        Command::new("cc").args(["-O2", "-shared", "-fPIC", source, "-o"]).arg(&built).status().expect("cc");
    assert!(compiled.success(), "{source} is not compiled");
    std::fs::rename(&built, &library).expect("moved");
    library
});

/// Sets the environment of a launcher of ranks, for which the folder has to remain as long as it runs: launchers that share one
/// compete in creating and removing it.
pub fn share(launcher: &mut Command) -> tempfile::TempDir {
    let own = tempfile::tempdir().expect("folder");
    launcher
        .env("OMPI_MCA_orte_tmpdir_base", own.path())
        .env("OMPI_MCA_mpi_yield_when_idle", "1")
        .env("LD_PRELOAD", &*SLEEPING)
        .env("OMP_NUM_THREADS", "1")
        .env("OPENBLAS_NUM_THREADS", "1")
        // Open MPI refuses to start as root otherwise, and ignores these for others.
        .env("OMPI_ALLOW_RUN_AS_ROOT", "1")
        .env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1");
    own
}
