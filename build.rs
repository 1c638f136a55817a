//! Finds the log of commits, whose last one the program names as its source.

use std::{
    env,
    path::{Path, PathBuf},
    process::Command,
};

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rustc-env=CLARKE_GIT_LOG={}", git_log().display());
}

/// The log of the commits that were checked out, or an empty file for a source without one. Only `src/main.rs` reads it, so
/// that a new commit alone compiles the thin binary again and not the library.
fn git_log() -> PathBuf {
    let asked = Command::new("git").args(["rev-parse", "--git-path", "logs/HEAD"]).output();
    let named = asked.ok().filter(|o| o.status.success());
    let log = named.map(|o| PathBuf::from(String::from_utf8_lossy(&o.stdout).trim()));
    if let Some(log) = log.and_then(|log| log.canonicalize().ok()) {
        // Changes rarely, and goes with the repository. Of a source without one, cargo would repeat the build each time.
        if Path::new(".git/config").is_file() {
            println!("cargo::rerun-if-changed=.git/config");
        }
        return log;
    }
    let none = Path::new(&env::var("OUT_DIR").expect("cargo sets OUT_DIR")).join("no_git_log");
    std::fs::write(&none, "").expect("a file is written to OUT_DIR");
    none
}
