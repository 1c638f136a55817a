//! Starts scenarios: words for the test `scenario` of this program, or a test with its path, and words for it.

use std::path::Path;
use std::process::{Command, Output};

pub const SCENARIO: &str = "CLARKE_TEST_SCENARIO";
pub const FOLDER: &str = "CLARKE_TEST_FOLDER";

pub fn run(ranks: usize, scenario: &str, folder: &Path) {
    let output = start(ranks, scenario, folder);
    let words =
        format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{scenario} on {ranks} ranks:\n{words}");
    assert!(words.contains("1 passed"), "{scenario} on {ranks} ranks has not run:\n{words}");
    assert!(!words.contains("HDF5-DIAG"), "HDF5 printed its error stack:\n{words}");
    print!("{words}");
}

pub fn start(ranks: usize, scenario: &str, folder: &Path) -> Output {
    let test = scenario.split(' ').next().filter(|test| test.contains("::")).unwrap_or("scenario");
    // Launchers that share this folder compete in creating and removing it.
    let own = tempfile::tempdir().expect("folder");
    Command::new("mpirun")
        .env("OMPI_MCA_orte_tmpdir_base", own.path())
        .args(["--oversubscribe", "--bind-to", "none", "--timeout", "300", "-n", &ranks.to_string()])
        .arg(std::env::current_exe().expect("this program"))
        .args(["--include-ignored", "--exact", test, "--nocapture", "--test-threads", "1"])
        .env(SCENARIO, scenario)
        .env(FOLDER, folder)
        .env("OMP_NUM_THREADS", "1")
        // Tests share the cores: waiting ranks yield.
        .env("OMPI_MCA_mpi_yield_when_idle", "1")
        .env("OMPI_ALLOW_RUN_AS_ROOT", "1")
        .env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1")
        .output()
        .expect("mpirun")
}

/// A pseudorandom number.
pub fn scramble(seed: u64) -> u64 {
    let mixed = (seed.wrapping_add(0x9e37_79b9_7f4a_7c15) ^ (seed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb) ^ (mixed >> 31)
}
