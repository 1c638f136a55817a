//! The line of the log after a step.

use crate::solver::stepping::StepOutcome;
use std::fmt::{self, Display, Formatter};

/// Formats itself without allocating: runs log many steps.
pub(super) struct StepLine<'a> {
    pub step: u64,
    /// The last step of the run.
    pub last: u64,
    /// In s.
    pub time: f64,
    pub outcome: &'a StepOutcome,
    pub imbalance: f64,
    /// Wall time to the end in s.
    pub left: f64,
}

impl Display for StepLine<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { step, last, time, outcome, imbalance, left } = self;
        write!(
            f,
            "step {step:>6}/{last}  t = {time:.6} s  newton {:>2}  linear {:>4}  branch changes {:>4}  inclusion {:.1e}  ",
            outcome.newton_iterations,
            outcome.linear_iterations,
            outcome.active_changes,
            outcome.inclusion_residual,
        )?;
        write_kinds(outcome, f)?;
        write!(f, "energy {imbalance:.1e}  ")?;
        write_clock_time(*left, f)?;
        write!(f, " left")
    }
}

/// Counts of contact points by state; `branches` counts them by branch of the normal law. Zero counts are left out.
fn write_kinds(outcome: &StepOutcome, f: &mut Formatter<'_>) -> fmt::Result {
    let points = &outcome.points;
    if let Some(last) = points.branches.iter().rposition(|count| *count > 0) {
        for (at, count) in points.branches[..=last].iter().enumerate() {
            write!(f, "{}{count}", if at == 0 { "branches " } else { "/" })?;
        }
        write!(f, "  ")?;
    }
    let counts = [
        ("open", points.open),
        ("held", points.held),
        ("sticking", points.sticking),
        ("slipping", points.slipping),
        ("separated", points.separated),
        ("indefinite", outcome.indefinite_solves),
        ("solutions", outcome.solutions),
    ];
    counts.iter().filter(|(_, count)| *count > 0).try_for_each(|(name, count)| write!(f, "{name} {count}  "))
}

/// Seconds as `12 s`, `3 min 05 s` or `2 h 07 min`.
fn write_clock_time(seconds: f64, f: &mut Formatter<'_>) -> fmt::Result {
    let whole = seconds.round() as u64;
    match whole {
        0..60 => write!(f, "{whole} s"),
        60..3600 => write!(f, "{} min {:02} s", whole / 60, whole % 60),
        _ => write!(f, "{} h {:02} min", whole / 3600, whole / 60 % 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_tells_the_step_and_the_time_left() {
        let mut outcome =
            StepOutcome { newton_iterations: 2, linear_iterations: 31, ..StepOutcome::default() };
        (outcome.points.branches[0], outcome.points.branches[1], outcome.points.slipping) = (4, 1, 2);
        let line = StepLine { step: 3, last: 64, time: 0.5, outcome: &outcome, imbalance: 1e-9, left: 185.0 };
        assert_eq!(
            line.to_string(),
            "step      3/64  t = 0.500000 s  newton  2  linear   31  branch changes    0  inclusion 0.0e0  branches 4/1  \
             slipping 2  energy 1.0e-9  3 min 05 s left"
        );
    }
}
