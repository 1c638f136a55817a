//! The numbers of a finished run against those that its job expects.

use super::study::quantity;
use crate::{
    job::{Expected, Job},
    laws::digits::Digits,
};
use std::path::Path;

/// The numbers of a run beside those that its job expects.
pub struct Comparison {
    /// How many are as expected, in words.
    pub outcome: String,
    /// What differs by more than the job accepts, a sentence for each number.
    pub differences: Vec<String>,
}

/// Compares the output folder of a run with the `[check]` table of its job; `None` if it has none.
pub fn compare(job: &Job, folder: &Path) -> Option<Comparison> {
    let of = |(name, expected): (&String, &Expected)| {
        difference(quantity(folder, name), expected).map(|words| format!("{name}: {words}"))
    };
    let differences: Vec<String> = job.check.iter().filter_map(of).collect();
    let all = job.check.len();
    let outcome = format!("{} of {all} numbers are as expected", all - differences.len());
    (all > 0).then_some(Comparison { outcome, differences })
}

/// How a number differs from the expected one by more than is accepted; numbers that are not finite do.
fn difference(found: Option<f64>, expected: &Expected) -> Option<String> {
    let Some(found) = found else { return Some("the run left no such number".into()) };
    let off = (found - expected.value).abs();
    let relative = expected.relative.is_none_or(|bound| off <= bound * expected.value.abs());
    let absolute = expected.absolute.is_none_or(|bound| off <= bound);
    (!(relative && absolute)).then(|| {
        let relative = expected.relative.map(|bound| format!("{} %", Digits(100.0 * bound)));
        let absolute = expected.absolute.map(|bound| Digits(bound).to_string());
        let accepted: Vec<String> = relative.into_iter().chain(absolute).collect();
        format!(
            "{} instead of {}, off by {}, accepted are {}",
            Digits(found),
            Digits(expected.value),
            Digits(off),
            accepted.join(" and ")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_differ_by_more_than_is_accepted_or_are_missing_or_not_finite() {
        let expected = |relative, absolute| Expected { value: -200.0, relative, absolute };
        let within = [(Some(0.01), None), (None, Some(2.0)), (Some(0.01), Some(2.0))];
        for (relative, absolute) in within {
            let expected = expected(relative, absolute);
            assert_eq!(difference(Some(-198.5), &expected), None);
            for found in [-197.0, f64::NAN, f64::INFINITY] {
                assert!(difference(Some(found), &expected).is_some(), "{found}");
            }
            assert_eq!(difference(None, &expected).as_deref(), Some("the run left no such number"));
        }
        assert_eq!(
            difference(Some(-197.0), &expected(Some(0.01), None)).as_deref(),
            Some("-197 instead of -200, off by 3, accepted are 1 %")
        );
        assert!(difference(Some(-198.5), &expected(Some(0.01), Some(1.0))).is_some(), "both have to hold");
    }

    #[test]
    fn a_quantity_that_the_run_did_not_leave_is_missing() {
        let folder = tempfile::tempdir().expect("folder");
        std::fs::write(folder.path().join("summary.json"), r#"{"status": "completed"}"#).expect("written");
        std::fs::write(folder.path().join("probes.csv"), "step,probe,velocity_y\n1,a,1\n").expect("written");
        let expected = Expected { value: 0.0, relative: None, absolute: Some(1e9) };
        let found = |name: &str| difference(quantity(folder.path(), name), &expected);
        for name in
            ["max_von_misses", "status", "history.work", "probe.b.velocity_y", "probe.a.velocity", "probe.a"]
        {
            assert!(found(name).is_some(), "{name}");
        }
        assert_eq!(found("probe.a.velocity_y"), None);
    }
}
