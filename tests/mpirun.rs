//! Starts scenarios: a test of this program by its path, and words for it.

use crate::cores::{self, Cores};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const WORDS: &str = "CLARKE_TEST_SCENARIO";
const FOLDER: &str = "CLARKE_TEST_FOLDER";
/// Seconds after which a scenario has hung.
const LIMIT: &str = "300";

/// The words for the test that was started under `mpirun`.
pub fn words() -> String {
    std::env::var(WORDS).expect("a scenario")
}

/// The folder of the test that was started under `mpirun`; none where it has still to be started.
pub fn folder() -> Option<PathBuf> {
    std::env::var_os(FOLDER).map(PathBuf::from)
}

pub fn run(ranks: usize, scenario: &str, folder: &Path) {
    check(ranks, scenario, &start(ranks, scenario, folder));
}

/// The same on one rank with the kernels that OpenBLAS has for this processor; with those that it chooses if this is empty.
pub fn run_with_kernels(kernels: &str, scenario: &str, folder: &Path) {
    let take = |launcher: &mut Command| {
        match kernels {
            "" => launcher.env_remove(cores::KERNELS),
            kernels => launcher.env(cores::KERNELS, kernels),
        };
    };
    check(1, scenario, &start_as(1, scenario, folder, take));
}

fn check(ranks: usize, scenario: &str, output: &Output) {
    let words =
        format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{scenario} on {ranks} ranks:\n{words}");
    assert!(words.contains("1 passed"), "{scenario} on {ranks} ranks has not run:\n{words}");
    assert!(!words.contains("HDF5-DIAG"), "HDF5 printed its error stack:\n{words}");
    print!("{words}");
}

/// Starts a scenario and waits for it. One rank is started without `mpirun`, which would take longer than many a scenario.
pub fn start(ranks: usize, scenario: &str, folder: &Path) -> Output {
    start_as(ranks, scenario, folder, |_| {})
}

fn start_as(ranks: usize, scenario: &str, folder: &Path, change: impl Fn(&mut Command)) -> Output {
    let (test, words) = scenario.split_once(' ').unwrap_or((scenario, ""));
    let program = std::env::current_exe().expect("this program");
    let mut launcher = Command::new(if ranks == 1 { "timeout" } else { "mpirun" });
    if ranks == 1 {
        launcher.args(["--signal=KILL", LIMIT]);
        // As the solver does: no daemon, and no file in memory shared with others.
        launcher.env("OMPI_MCA_ess_singleton_isolated", "1").env("OMPI_MCA_sharedfp", "^sm");
    } else {
        launcher.args(["--oversubscribe", "--bind-to", "none", "--timeout", LIMIT, "-n", &ranks.to_string()]);
    }
    let (_cores, _folder) = (Cores::take(ranks), cores::share(&mut launcher));
    change(&mut launcher);
    launcher
        .arg(program)
        .args(["--include-ignored", "--exact", test, "--nocapture", "--test-threads", "1"])
        .env(WORDS, words)
        .env(FOLDER, folder)
        .output()
        .expect("a launcher")
}

/// A pseudorandom number.
pub fn scramble(seed: u64) -> u64 {
    let mixed = (seed.wrapping_add(0x9e37_79b9_7f4a_7c15) ^ (seed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb) ^ (mixed >> 31)
}
