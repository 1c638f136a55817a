//! Every job under jobs/ reproduces the numbers of its `[check]` table, on one and on two ranks.
//!
//! A quantity is a number of `summary.json` (`max_von_mises`, `certificates.viscosity_modulus`), or of a table at its
//! end: `history.COLUMN`, `probe.NAME.COLUMN` and `resultant.SOURCE.COLUMN` at the last step, `profile.BOUNDARY.max.COLUMN` or
//! `.min.` over the boundary at the last output. `probe.NAME.max.COLUMN` or `.min.` is over all steps.

use std::path::{Path, PathBuf};
use std::process::Command;

use clarke::{
    job::{Expected, Job},
    linear_algebra::tensor::larger,
};

/// All jobs of the repository, without studies.
fn jobs() -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![Path::new(env!("CARGO_MANIFEST_DIR")).join("jobs")];
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

fn run(job: &Path, ranks: usize, output: &Path) -> Result<(), String> {
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
        .env("OMP_NUM_THREADS", "1")
        .env("OMPI_ALLOW_RUN_AS_ROOT", "1")
        .env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1")
        .output()
        .map_err(|error| format!("mpirun: {error}"))?;
    let words = String::from_utf8_lossy(&run.stderr);
    if run.status.success() { Ok(()) } else { Err(format!("{}\n{words}", run.status)) }
}

/// The numbers of a column in the rows in which another column contains this word (in all rows without a filter).
fn column(folder: &Path, table: &str, filter: Option<(&str, &str)>, name: &str) -> Option<Vec<f64>> {
    let text = std::fs::read_to_string(folder.join(table)).ok()?;
    let mut rows = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let header = rows.next()?;
    let place = |name: &str| header.iter().position(|column| *column == name);
    let (wanted, filter) = match filter {
        Some((column, word)) => (place(name)?, Some((place(column)?, word))),
        None => (place(name)?, None),
    };
    let kept = rows.filter(|row| filter.is_none_or(|(column, word)| row[column] == word));
    kept.map(|row| row[wanted].parse().ok()).collect()
}

fn extreme(side: &str, values: impl Iterator<Item = f64>) -> Option<f64> {
    match side {
        "max" => values.reduce(larger),
        "min" => values.reduce(|a, b| -larger(-a, -b)),
        _ => None,
    }
}

/// The quantity in the results of the run in `folder`, if it exists.
fn measured(folder: &Path, quantity: &str) -> Option<f64> {
    let parts: Vec<&str> = quantity.split('.').collect();
    match parts[..] {
        ["probe", name, field] => column(folder, "probes.csv", Some(("probe", name)), field)?.pop(),
        ["probe", name, side, field] => {
            let all = column(folder, "probes.csv", Some(("probe", name)), field)?.into_iter();
            extreme(side, all)
        }
        ["resultant", source, field] => {
            column(folder, "resultants.csv", Some(("source", source)), field)?.pop()
        }
        ["history", field] => column(folder, "history.csv", None, field)?.pop(),
        ["profile", boundary, side, field] => {
            let filter = Some(("profile", boundary));
            let times = column(folder, "profiles.csv", filter, "time")?;
            let values = column(folder, "profiles.csv", filter, field)?;
            let rows = times.iter().zip(values).filter(|(time, _)| Some(*time) == times.last());
            extreme(side, rows.map(|(_, value)| value))
        }
        _ => {
            let text = std::fs::read_to_string(folder.join("summary.json")).ok()?;
            let summary: serde_json::Value = serde_json::from_str(&text).ok()?;
            summary.pointer(&format!("/{}", parts.join("/")))?.as_f64()
        }
    }
}

/// The error of a number, if there is one.
fn difference(found: Option<f64>, expected: &Expected) -> Option<String> {
    let Some(found) = found else { return Some("the run left no such number".into()) };
    let off = (found - expected.value).abs();
    let relative = expected.relative.is_none_or(|bound| off <= bound * expected.value.abs());
    let absolute = expected.absolute.is_none_or(|bound| off <= bound);
    if relative && absolute { None } else { Some(format!("{found:e} instead of {:e}", expected.value)) }
}

fn faults(ranks: usize) -> Vec<String> {
    let mut faults = Vec::new();
    for file in jobs() {
        let name = format!("{} on {ranks} rank(s)", file.display());
        let job = Job::load(&file, &[]).expect("a job of the repository").job;
        if job.check.is_empty() {
            faults.push(format!("{name}: no [check] table"));
            continue;
        }
        let output = tempfile::tempdir().expect("folder");
        if let Err(words) = run(&file, ranks, output.path()) {
            faults.push(format!("{name}: {words}"));
            continue;
        }
        for (quantity, expected) in &job.check {
            let fault = difference(measured(output.path(), quantity), expected);
            faults.extend(fault.map(|words| format!("{name}: {quantity}: {words}")));
        }
    }
    faults
}

#[test]
fn every_job_gives_its_numbers_on_one_rank() {
    let faults = faults(1);
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn every_job_gives_its_numbers_on_two_ranks() {
    let faults = faults(2);
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn the_jobs_are_found() {
    let names: Vec<String> =
        jobs().iter().map(|job| job.file_stem().expect("name").to_string_lossy().into_owned()).collect();
    for name in ["notched_plate", "wheel_segment", "wang_cheng_2022", "wang_cheng_cube"] {
        assert!(names.iter().any(|found| found == name), "{name} is not among {names:?}");
    }
}

#[test]
fn numbers_are_read_where_the_quantity_says() {
    let folder = tempfile::tempdir().expect("folder");
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("written");
    write("summary.json", r#"{"max_von_mises": 4.5, "status": "completed", "certificates": {"theta": 0.5}}"#);
    write("history.csv", "step,work\n1,2.5\n2,3.5\n");
    write("probes.csv", "step,probe,velocity_y\n1,a,1\n1,b,2\n2,a,3\n2,b,4\n");
    write("profiles.csv", "time,profile,x,pressure\n1,low,0,9\n2,low,0,-1\n2,low,1,5\n2,top,0,7\n");
    let cases = [
        ("max_von_mises", 4.5),
        ("certificates.theta", 0.5),
        ("history.work", 3.5),
        ("probe.a.velocity_y", 3.0),
        ("probe.b.min.velocity_y", 2.0),
        ("probe.a.max.velocity_y", 3.0),
        ("profile.low.max.pressure", 5.0),
        ("profile.low.min.pressure", -1.0),
    ];
    for (quantity, value) in cases {
        assert_eq!(measured(folder.path(), quantity), Some(value), "{quantity}");
    }
}

#[test]
fn a_quantity_that_the_run_did_not_leave_is_a_fault() {
    let folder = tempfile::tempdir().expect("folder");
    std::fs::write(folder.path().join("summary.json"), r#"{"status": "completed"}"#).expect("written");
    std::fs::write(folder.path().join("probes.csv"), "step,probe,velocity_y\n1,a,1\n").expect("written");
    let expected = Expected { value: 0.0, relative: None, absolute: Some(1e9) };
    let absent =
        ["max_von_misses", "status", "history.work", "probe.b.velocity_y", "probe.a.velocity", "probe.a"];
    for quantity in absent {
        assert!(difference(measured(folder.path(), quantity), &expected).is_some(), "{quantity}");
    }
}

#[test]
fn a_number_that_is_off_or_not_a_number_is_a_fault() {
    let expected = Expected { value: -2.0, relative: Some(1e-6), absolute: None };
    assert_eq!(difference(Some(-2.000001), &expected), None);
    assert!(difference(Some(-2.00001), &expected).is_some());
    assert!(difference(Some(2.0), &expected).is_some());
    assert!(difference(Some(f64::NAN), &expected).is_some());
}
