//! Every job under jobs/, every case under tests/cases and every recipe of docs/recipes.md reproduces the numbers of its `[check]` table,
//! on one and on two ranks.
//! The cases are problems of manuals and publications at default settings.

use std::path::{Path, PathBuf};

use crate::{checked::run, documents::recipes};
use clarke::{job::Job, postprocessing::check::compare};

/// All jobs of the repository, without studies, and all cases.
pub fn jobs() -> Vec<PathBuf> {
    let mut found = Vec::new();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut folders = vec![root.join("jobs"), root.join("tests/cases")];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("folder") {
            let path = entry.expect("entry").path();
            if path.is_dir() {
                let name = path.file_name().expect("name");
                folders.extend((name != "out" && name != "studies").then_some(path));
            } else if path.extension().is_some_and(|extension| extension == "toml") {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

fn faults(files: &[PathBuf], ranks: usize) -> Vec<String> {
    let mut faults = Vec::new();
    for file in files {
        let name = format!("{} on {ranks} rank(s)", file.display());
        let job = Job::load(file, &[]).expect("a job of the repository").job;
        if job.check.is_empty() {
            faults.push(format!("{name}: no [check] table"));
            continue;
        }
        let output = tempfile::tempdir().expect("folder");
        if let Err(words) = run(file, ranks, output.path(), &[]) {
            faults.push(format!("{name}: {words}"));
            continue;
        }
        let found = compare(&job, output.path()).expect("a table [check]");
        faults.extend(found.differences.into_iter().map(|words| format!("{name}: {words}")));
    }
    faults
}

#[test]
fn every_job_gives_its_numbers_on_one_rank() {
    let faults = faults(&jobs(), 1);
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn every_job_gives_its_numbers_on_two_ranks() {
    let faults = faults(&jobs(), 2);
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn every_recipe_gives_its_numbers_on_one_and_two_ranks() {
    let folder = tempfile::tempdir().expect("folder");
    let recipes = recipes(folder.path());
    for ranks in [1, 2] {
        let faults = faults(&recipes, ranks);
        assert!(faults.is_empty(), "{}", faults.join("\n"));
    }
}

#[test]
fn cases_run_at_default_settings_and_name_their_source() {
    for file in jobs().iter().filter(|file| file.parent().is_some_and(|folder| folder.ends_with("cases"))) {
        let text = std::fs::read_to_string(file).expect("a case");
        let is_plain = !text.contains("[solver") && !text.contains("\ntolerance");
        assert!(is_plain, "{} sets a parameter of the solver", file.display());
        assert!(text.contains("accepted: "), "{} does not state the accepted error", file.display());
    }
}

#[test]
fn the_jobs_are_found() {
    let names: Vec<String> =
        jobs().iter().map(|job| job.file_stem().expect("name").to_string_lossy().into_owned()).collect();
    for name in ["notched_plate", "wheel_segment", "wang_cheng_2022", "wang_cheng_cube", "patch_on_a_plane"] {
        assert!(names.iter().any(|found| found == name), "{name} is not among {names:?}");
    }
}
