//! Launchers whose ranks share the cores with other tests.

use std::{
    process::Command,
    sync::{Condvar, Mutex},
};

/// How many cores runs of tests use, and the signal that some were left.
static USED: Mutex<usize> = Mutex::new(0);
static LEFT: Condvar = Condvar::new();

/// Cores that a run has for itself until this is dropped, one a rank as far as there are as many. Ranks that wait for each other while
/// those of other runs compute would use their cores for waiting.
pub struct Cores(usize);

impl Cores {
    /// Waits until the cores are free.
    pub fn take(ranks: usize) -> Self {
        let all = std::thread::available_parallelism().map_or(1, usize::from);
        let wanted = ranks.min(all);
        let used = USED.lock().expect("cores");
        *LEFT.wait_while(used, |used| *used + wanted > all).expect("cores") += wanted;
        Self(wanted)
    }
}

impl Drop for Cores {
    fn drop(&mut self) {
        *USED.lock().expect("cores") -= self.0;
        LEFT.notify_all();
    }
}

/// Sets the environment of a launcher of ranks, for which the folder has to remain as long as it runs: launchers that share one
/// compete in creating and removing it.
pub fn share(launcher: &mut Command) -> tempfile::TempDir {
    let own = tempfile::tempdir().expect("folder");
    launcher
        .env("OMPI_MCA_orte_tmpdir_base", own.path())
        // Ranks of one machine need no search for networks; the solver says so itself.
        .env("OMPI_MCA_pml", "ob1")
        // Waiting ranks yield.
        .env("OMPI_MCA_mpi_yield_when_idle", "1")
        .env("OMP_NUM_THREADS", "1")
        .env("OPENBLAS_NUM_THREADS", "1")
        // Open MPI refuses to start as root otherwise, and ignores these for others.
        .env("OMPI_ALLOW_RUN_AS_ROOT", "1")
        .env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1");
    if has_kernels_of_haswell() && std::env::var_os(KERNELS).is_none() {
        launcher.env(KERNELS, "Haswell");
    }
    own
}

/// The environment variable with the processor whose kernels OpenBLAS takes. Rounding errors depend on them, and on these the counts of
/// iterations where bonds fail or cells flow: those of one kind, so that counts are the same on newer processors, too.
pub const KERNELS: &str = "OPENBLAS_CORETYPE";

#[cfg(target_arch = "x86_64")]
fn has_kernels_of_haswell() -> bool {
    is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma")
}

#[cfg(not(target_arch = "x86_64"))]
fn has_kernels_of_haswell() -> bool {
    false
}
