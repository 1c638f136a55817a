//! The numbers of a finished run against those that its job expects.

use super::study::quantity;
use crate::{
    job::{Expected, Job},
    laws::digits::Digits,
};
use std::path::Path;

/// What differs from the `[check]` table of a job in the output folder of its run by more than the job accepts, a sentence for each number.
pub fn differences(job: &Job, folder: &Path) -> Vec<String> {
    let of = |(name, expected): (&String, &Expected)| {
        difference(quantity(folder, name), expected).map(|words| format!("{name}: {words}"))
    };
    job.check.iter().filter_map(of).collect()
}

/// How a number differs from the expected one by more than is accepted; numbers that are not finite do.
fn difference(found: Option<f64>, expected: &Expected) -> Option<String> {
    let Some(found) = found else { return Some("the run left no such number".into()) };
    let off = (found - expected.value).abs();
    let relative = expected.relative.is_none_or(|bound| off <= bound * expected.value.abs());
    let absolute = expected.absolute.is_none_or(|bound| off <= bound);
    (!(relative && absolute)).then(|| {
        let accepted: Vec<String> = [(expected.relative, " of it"), (expected.absolute, "")]
            .into_iter()
            .filter_map(|(bound, of)| Some(format!("{:e}{of}", bound?)))
            .collect();
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
            Some("-197 instead of -200, off by 3, accepted are 1e-2 of it")
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
