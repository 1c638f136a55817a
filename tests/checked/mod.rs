//! Runs of jobs, and the quantities that their `[check]` tables name.
//!
//! A quantity is a number of `summary.json` (`max_von_mises`, `certificates.viscosity_modulus`), or of a table at its
//! end: `history.COLUMN`, `probe.NAME.COLUMN` and `resultant.SOURCE.COLUMN` at the last step, `profile.BOUNDARY.max.COLUMN`,
//! `.min.` or `.first.` over the boundary or at its first point, at the last output. `probe.NAME.max.COLUMN` or `.min.` is over all steps.

use std::{path::Path, process::Command};

use clarke::linear_algebra::tensor::larger;

/// Runs a job with these keys changed (`time.step=0.01`) on some ranks, with its results in the folder `output`; an error has the
/// messages of the solver.
pub fn run(job: &Path, ranks: usize, output: &Path, changes: &[&str]) -> Result<(), String> {
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
        .args(changes.iter().flat_map(|change| ["--set", change]))
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

fn extreme(side: &str, mut values: impl Iterator<Item = f64>) -> Option<f64> {
    match side {
        "max" => values.reduce(larger),
        "min" => values.reduce(|a, b| -larger(-a, -b)),
        "first" => values.next(),
        _ => None,
    }
}

/// The quantity in the results of the run in `folder`, if it exists.
pub fn measured(folder: &Path, quantity: &str) -> Option<f64> {
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
