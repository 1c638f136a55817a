//! Tables over time against the time of a run: before its first and after its last point a table is constant.

use super::steps::time_dependent;
use crate::{
    job::{Job, Scalar},
    laws::digits::Digits,
};

/// How far behind the end of a table it is looked at, as a share of the rest of the run.
const BEHIND: f64 = 1e-3;

/// Warnings about tables that do not overlap the run, or that stop on their way within it.
pub(super) fn warnings(job: &Job) -> Vec<String> {
    let run_end = job.time.end;
    let mut found = Vec::new();
    for load in time_dependent(job) {
        let words = load.value.breakpoints().spans.into_iter().filter_map(|span| {
            let [first, last] = span.ends;
            let [from, to, end] = [first, last, run_end].map(Digits);
            if first >= run_end || last <= 0.0 {
                Some(format!(
                    "its table reaches from t = {from} s to {to} s, the run from 0 s to {end} s: the value is that of one end of the table throughout; \
                     correct the times of the table, which are in s from the start of the run, or [time] end"
                ))
            } else if span.is_cut_off && last < run_end && acts_behind(&load.value, last, run_end) {
                Some(format!(
                    "its table ends at t = {to} s on its way, and keeps its last value to the end of the run at t = {end} s: continue the table, or end the \
                     run there; if the value shall stay, repeat it at a later time in the table"
                ))
            } else {
                None
            }
        });
        for words in words.map(|words| format!("{}: {words}", load.key)) {
            if !found.contains(&words) {
                found.push(words);
            }
        }
    }
    found
}

/// Whether a value may differ from 0 just behind the end of a table in it.
fn acts_behind(value: &Scalar, end_of_table: f64, run_end: f64) -> bool {
    value.depends_on_position()
        || value.evaluate(end_of_table + BEHIND * (run_end - end_of_table), &[]) != 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    /// Warnings about a traction with this value in a run of 2 s.
    fn warned(value: &str) -> Vec<String> {
        let text = format!(
            "[mesh.rectangle]\nsize = [1.0, 1.0]\ncells = [1, 1]\n[material]\nhypothesis = \"plane_strain\"\n[material.elasticity]\n\
             youngs_modulus = 1.0\npoisson_ratio = 0.0\n[time]\nend = 2.0\nstep = 0.1\n[[support]]\non = [\"left\"]\nfix = \"all\"\n\
             [[traction]]\non = [\"right\"]\nvalue = [\"{value}\", \"0.5*{value}\"]\n"
        );
        let job = Job::from_text(&text, "job.toml", Path::new("."), &[]);
        warnings(&job.unwrap_or_else(|e| panic!("{e}")).job)
    }

    #[test]
    fn tables_beside_the_run_and_those_that_stop_on_their_way_are_warned_of_but_no_ramps() {
        for (value, words) in [
            ("interpolate(t, 2, 0, 3, 1, 5, 0)", "traction.0.value: its table reaches from t = 2 s to 5 s"),
            (
                "interpolate(t, -3, 0, -1, 1, 0, 0)",
                "its table reaches from t = -3 s to 0 s, the run from 0 s",
            ),
            ("interpolate(t, 0, 0, 1, -1, 1.5, 2)", "its table ends at t = 1.5 s on its way"),
            ("interpolate(2*t, 0, 0, 1, -1, 1.5, 2)", "its table ends at t = 0.75 s on its way"),
        ] {
            let found = warned(value);
            assert!(matches!(&found[..], [one] if one.contains(words)), "{value}: {found:?}");
        }
        for value in [
            "interpolate(t, 1.9, 0, 3, 1, 5, 0)",
            "interpolate(t, 0, 0, 1, 1, 2, 2)",
            "interpolate(t, 0, 0, 1, 1, 1.5, 2)",
            "interpolate(t, 0, 0, 0.5, 1, 1, 0)",
            "interpolate(t, 0, 0, 0.5, 1, 1, 2, 1.5, 2)",
            "interpolate(x, 3, 0, 4, 1, 5, 2)*t",
            "interpolate(t, -1, 5)",
            "if(t < 1, interpolate(t, 0, 0, 0.5, 1, 1, 0.7), 0)",
            "7",
        ] {
            assert_eq!(warned(value), [""; 0], "{value}");
        }
    }
}
