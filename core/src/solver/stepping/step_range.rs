//! The lengths of the steps of a run.

use super::step_length::{Landings, TIME_TOLERANCE};
use crate::{fem::effect::Step, job::Scheme};
use serde::{Deserialize, Serialize};

/// The lengths that steps of a run may have, and what a scheme makes of them.
///
/// The matrix of a step of length `k` is that of a length `k' <= k` (see [`Scheme::formula`]), and friction takes the slip of the whole
/// step, so that its dependence on the slip is scaled by `k`, and that of the matrix on the displacement by `k'`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct StepRange {
    /// The shortest and the longest step in s.
    pub steps: [f64; 2],
    /// The least and the greatest `k'` in s.
    pub matrices: [f64; 2],
}

impl StepRange {
    /// The range of a single step under a scheme.
    pub fn of(scheme: Scheme, step: Step) -> Self {
        Self { steps: [step.length; 2], matrices: [scheme.formula()(step).length; 2] }
    }

    /// The range of all fixed steps of a run.
    pub fn fixed(scheme: Scheme, landings: &Landings) -> Self {
        let mut all = None;
        landings.visit_fixed_steps(|step| {
            let own = Self::of(scheme, step);
            all = Some(all.map_or(own, |all: Self| all.or(own)));
        });
        let whole = Step { time: landings.length, length: landings.length, previous_length: 0.0 };
        all.unwrap_or_else(|| Self::of(scheme, whole))
    }

    /// The range of adaptive steps between these lengths in s, each after a step of any length.
    pub fn adaptive(scheme: Scheme, [shortest, longest]: [f64; 2]) -> Self {
        let after =
            |length, previous_length| Self::of(scheme, Step { time: length, length, previous_length });
        // Under two-step schemes `k' / k` falls with the ratio of successive steps.
        after(shortest, 0.0).or(after(shortest, 1e-15 * shortest)).or(after(longest, 0.0))
    }

    /// The least range that contains both.
    pub fn or(self, other: Self) -> Self {
        let both =
            |[low, high]: [f64; 2], [lower, higher]: [f64; 2]| [f64::min(low, lower), f64::max(high, higher)];
        Self { steps: both(self.steps, other.steps), matrices: both(self.matrices, other.matrices) }
    }

    /// Whether it contains another range, up to the rounding of times.
    pub fn contains(&self, other: Self) -> bool {
        let near = 1.0 + TIME_TOLERANCE;
        let within =
            |[low, high]: [f64; 2], [lower, higher]: [f64; 2]| low <= near * lower && higher <= near * high;
        within(self.steps, other.steps) && within(self.matrices, other.matrices)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solver::stepping::step_length::Forgets;

    fn fixed(scheme: Scheme, times: Vec<f64>, end: f64) -> StepRange {
        let landings = Landings {
            times,
            output_times: Vec::new(),
            interval: None,
            breakpoints: Vec::new(),
            length: 0.1,
            is_fixed: true,
            forgets: if scheme.states() > 1 { Forgets::Jumps } else { Forgets::Nothing },
            end,
        };
        StepRange::fixed(scheme, &landings)
    }

    fn close(found: [f64; 2], expected: [f64; 2]) {
        let near = |(a, b): (f64, f64)| (a - b).abs() <= 1e-12;
        assert!(found.into_iter().zip(expected).all(near), "{found:?} instead of {expected:?}");
    }

    #[test]
    fn equal_steps_have_one_length_except_under_a_two_step_scheme() {
        let range = |scheme| fixed(scheme, Vec::new(), 1e5);
        for (scheme, matrix) in
            [(Scheme::LaggedEuler, 0.1), (Scheme::ImplicitEuler, 0.1), (Scheme::Midpoint, 0.05)]
        {
            close(range(scheme).steps, [0.1; 2]);
            close(range(scheme).matrices, [matrix; 2]);
        }
        let two = range(Scheme::Bdf2);
        close(two.matrices, [0.2 / 3.0, 0.1]);
    }

    #[test]
    fn shortened_steps_are_in_the_range() {
        close(fixed(Scheme::ImplicitEuler, vec![0.13], 0.2).steps, [0.03, 0.1]);
        close(fixed(Scheme::ImplicitEuler, Vec::new(), 0.04).steps, [0.04; 2]);
        close(fixed(Scheme::ImplicitEuler, Vec::new(), 100.01).steps, [0.01, 0.1]);
        // Ends that are multiples of the step but for rounding are reached.
        for end in [f64::next_up(0.3), f64::next_down(0.3), 3.0 * 0.1, f64::next_up(7.0)] {
            close(fixed(Scheme::ImplicitEuler, Vec::new(), end).steps, [0.1; 2]);
        }
        // Steps have their full length again after 7.25 s: the last one takes 0.06 s.
        close(fixed(Scheme::ImplicitEuler, vec![7.25], 100.01).steps, [0.05, 0.1]);
        // After 0.1 s the step of 0.05 s has w = 1/2 and k' = 0.0375 s; that of 0.1 s after it w = 2 and k' = 0.06 s.
        let two = fixed(Scheme::Bdf2, vec![0.15], 0.25);
        close(two.matrices, [0.0375, 0.1]);
    }

    #[test]
    fn adaptive_steps_may_follow_any_other() {
        let two = StepRange::adaptive(Scheme::Bdf2, [0.01, 0.1]);
        close(two.matrices, [0.005, 0.1]);
        assert!(
            two.contains(StepRange::of(
                Scheme::Bdf2,
                Step { time: 1.0, length: 0.01, previous_length: 1e-9 }
            ))
        );
        assert!(
            !two.contains(StepRange::of(
                Scheme::Bdf2,
                Step { time: 1.0, length: 0.009, previous_length: 0.0 }
            ))
        );
        assert!(!two.contains(StepRange::of(
            Scheme::Bdf2,
            Step { time: 1.0, length: f64::NAN, previous_length: 0.0 }
        )));
        close(StepRange::adaptive(Scheme::Midpoint, [0.01, 0.1]).matrices, [0.005, 0.05]);
    }
}
