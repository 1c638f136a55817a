//! The jobs of the project, for benchmarks.

use std::path::{Path, PathBuf};

/// Folders of jobs.
const FOLDERS: [&str; 4] = ["jobs", "jobs/papers", "jobs/hard", "jobs/verification"];

/// The jobs of these folders whose names contain one of these words, all without words, in the order of their names.
pub fn jobs(words: &[String]) -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut jobs: Vec<PathBuf> = FOLDERS
        .iter()
        .flat_map(|folder| std::fs::read_dir(root.join(folder)).expect("a folder of jobs"))
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "toml"))
        .filter(|path| words.is_empty() || words.iter().any(|word| path.display().to_string().contains(word)))
        .collect();
    jobs.sort();
    jobs
}
