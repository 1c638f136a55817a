//! The cost of target errors: for each scheme, the fastest run that reaches the target.

use super::{
    document::Study,
    results::{Reached, Results, RunResult, TargetResult},
};

/// One result for each target error of the study.
pub(super) fn targets(study: &Study, results: &Results) -> Vec<TargetResult> {
    let mut lines: Vec<String> = Vec::new();
    for run in &results.runs {
        if !lines.contains(&run.line()) {
            lines.push(run.line());
        }
    }
    let mut out = Vec::new();
    for (at, (norm, shown)) in study.norm.iter().zip(&results.norms).enumerate() {
        for &error in &norm.targets {
            let mut reached: Vec<Reached> =
                lines.iter().map(|line| fastest(&results.runs, line, at, error)).collect();
            let best = reached.iter().filter_map(|r| r.seconds).fold(f64::INFINITY, f64::min);
            reached.iter_mut().for_each(|r| r.ratio = r.seconds.map(|seconds| seconds / best));
            out.push(TargetResult { norm: shown.name.clone(), error, reached });
        }
    }
    out
}

fn fastest(runs: &[RunResult], line: &str, norm: usize, target: f64) -> Reached {
    let error = |run: &RunResult| run.errors.get(norm)?.as_ref().map(|error| error.error);
    let seconds = |run: &RunResult| run.seconds.map(|seconds| seconds.computing);
    let good = |run: &&RunResult| run.line() == line && error(run).is_some_and(|error| error <= target);
    let best = runs.iter().filter(good).filter_map(|run| Some((run, seconds(run)?)));
    let best = best.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(run, _)| run);
    let dominant_error = best.and_then(|run| {
        let error = run.errors.get(norm)?.as_ref()?;
        Some(if error.of_steps? > error.of_mesh? { "steps" } else { "mesh" })
    });
    Reached {
        scheme: line.to_owned(),
        run: best.map(|run| run.name.clone()),
        error: best.and_then(error),
        steps: best.map(|run| run.counts.steps),
        seconds: best.and_then(seconds),
        ratio: None,
        dominant_error,
    }
}
