//! The invalid jobs of tests/refusals as runs: the program refuses them in the same way as the library.

use super::refusal::{refused_job, try_all};
use std::path::PathBuf;

#[test]
fn bad_jobs_are_refused_before_anything_is_written() {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/refusals");
    let files = std::fs::read_dir(folder).expect("folder").map(|entry| entry.expect("entry").path());
    let jobs: Vec<PathBuf> = files.collect();
    assert!(jobs.len() >= 40, "only {} bad jobs", jobs.len());
    try_all(
        &jobs,
        |job| job.display().to_string(),
        |job| {
            let text = std::fs::read_to_string(job).map_err(|e| e.to_string())?;
            let overrides: Vec<&str> = header(&text, "# set:").collect();
            let words: Vec<String> = header(&text, "# expect:").flat_map(expected).collect();
            let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
            refused_job(folder.path(), &text, &overrides, &words)
        },
    );
}

fn header<'a>(text: &'a str, word: &'a str) -> impl Iterator<Item = &'a str> {
    text.lines().filter_map(move |line| line.strip_prefix(word)).map(str::trim)
}

/// Position and message of a fault that the head of a job announces.
fn expected(line: &str) -> Vec<String> {
    let mut parts: Vec<String> = line.split(" | ").map(str::to_owned).collect();
    if !parts[0].starts_with("--set") {
        parts[0] = format!("job.toml:{}", parts[0]);
    }
    parts
}
