//! Common properties of all refusals.

use crate::launch::{Outcome, run, unwrapped};
use std::{
    path::Path,
    sync::atomic::{AtomicUsize, Ordering},
};

/// Number of ranks of each refused run.
const RANKS: usize = 2;
/// Number of simultaneous runs.
const THREADS: usize = 4;

/// Runs a job that stands alone in a folder; the refusal must hold these words, and the folder nothing new.
pub fn refused_job(folder: &Path, job: &str, overrides: &[&str], words: &[String]) -> Result<(), String> {
    std::fs::write(folder.join("job.toml"), job).map_err(|e| e.to_string())?;
    let path = folder.join("job.toml").display().to_string();
    let mut arguments = vec![path.as_str()];
    arguments.extend(overrides.iter().flat_map(|pair| ["--set", pair]));
    refused(&run(RANKS, &arguments), words)?;
    let left: Vec<_> = std::fs::read_dir(folder).map_err(|e| e.to_string())?.flatten().collect();
    if left.len() == 1 { Ok(()) } else { Err(format!("the folder holds {left:?}")) }
}

/// Exit code 2, all the words, on one rank only, and no trace of a panic or of output.
pub fn refused(outcome: &Outcome, words: &[String]) -> Result<(), String> {
    let said = &outcome.stderr;
    let fault = |what: String| Err(format!("{what}\n{}\n{said}", outcome.stdout));
    if outcome.code != 2 {
        return fault(format!("exit code {}", outcome.code));
    }
    let joined = unwrapped(said);
    if let Some(missing) = words.iter().find(|part| !joined.contains(*part)) {
        return fault(format!("not said: {missing}"));
    }
    if ["panicked", "RUST_BACKTRACE", "MPI_ABORT", "Segmentation"].iter().any(|trace| said.contains(trace)) {
        return fault("it crashed".into());
    }
    let sums = said.lines().filter(|line| line.ends_with("in the job") && line.contains(" fault")).count();
    let errors = said.lines().filter(|line| line.starts_with("error: ")).count();
    if sums > 1 || (sums == 0 && errors != 1) {
        return fault(format!("said {} times", sums.max(errors)));
    }
    if outcome.stdout.contains("error") {
        return fault("a refusal on the standard output".into());
    }
    Ok(())
}

/// Tries all cases, several at a time; fails with the faults of all that differ from what they should do.
#[track_caller]
pub fn try_all<T: Sync>(
    cases: &[T],
    name: impl Fn(&T) -> String + Sync,
    test: impl Fn(&T) -> Result<(), String> + Sync,
) {
    let next = AtomicUsize::new(0);
    let work = || {
        let mut faults = Vec::new();
        while let Some(case) = cases.get(next.fetch_add(1, Ordering::Relaxed)) {
            faults.extend(test(case).err().map(|fault| format!("{}: {fault}", name(case))));
        }
        faults
    };
    let faults: Vec<String> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..THREADS).map(|_| scope.spawn(work)).collect();
        threads.into_iter().flat_map(|thread| thread.join().expect("no thread fails")).collect()
    });
    assert!(faults.is_empty(), "{} cases:\n{}", faults.len(), faults.join("\n=====\n"));
}
