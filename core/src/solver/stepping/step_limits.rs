//! What keeps adaptive steps from being longer.

use crate::fem::effect::CONTACT_QUANTITIES;

/// Number of the quantities whose errors limit steps.
pub(super) const QUANTITIES: usize = CONTACT_QUANTITIES + 5;

const NAMES: [&str; QUANTITIES] = [
    "velocities",
    "stresses",
    "slip or state of friction",
    "wear",
    "the displacement of an obstacle",
    "the velocity of an obstacle",
    "the angle of an obstacle",
    "the angular velocity of an obstacle",
    "bonds or contact memory",
    "displacements",
    "temperatures",
];

/// Share of the steps below which what limits them is not named.
const LEAST_SHARE: f64 = 0.01;

/// Steps of the shortest length in a row, with larger errors than the tolerance, after which steps are not expected to grow.
const SHORTEST_IN_A_ROW: u64 = 1000;
/// Steps that are left in a run for which this matters.
const MANY: u64 = 10_000;

/// Counts of steps since the run was started or continued. No step depends on them.
#[derive(Debug, Default)]
pub struct StepLimits {
    steps: u64,
    /// Those that could not be twice as long, by the quantity with the largest error.
    limited: [u64; QUANTITIES],
    /// Steps of the shortest length whose error exceeds the tolerance.
    beyond: u64,
    /// Those in a row up to the last step.
    in_a_row: u64,
    /// Whether it was said that steps stay the shortest.
    is_said: bool,
}

impl StepLimits {
    /// Counts a step with these errors of the quantities, given whether they limit it and exceed the tolerance.
    pub(super) fn count(&mut self, errors: [f64; QUANTITIES], [is_limited, is_beyond]: [bool; 2]) {
        self.steps += 1;
        self.beyond += u64::from(is_beyond);
        self.in_a_row = if is_beyond { self.in_a_row + 1 } else { 0 };
        if is_limited && let Some(largest) = (0..QUANTITIES).max_by(|a, b| errors[*a].total_cmp(&errors[*b]))
        {
            self.limited[largest] += 1;
        }
    }

    /// That steps stay the shortest, in words, the first time that they do in a run with this number of steps left.
    pub fn warning(&mut self, left: u64) -> Option<String> {
        let is_stuck = !self.is_said && self.in_a_row >= SHORTEST_IN_A_ROW && left > MANY;
        self.is_said |= is_stuck;
        is_stuck.then(|| {
            let what = self.words().map_or(String::new(), |words| format!(" ({words})"));
            format!(
                "{SHORTEST_IN_A_ROW} adaptive steps in a row have the shortest length and larger errors than the tolerance{what}; {left} such steps are \
                 left. Where these are vibrations that nothing damps, [material.viscosity] of a hundred-thousandth of a second times the stiffness \
                 or [material.damping] damps them, or a larger `smallest_step` passes over them"
            )
        })
    }

    /// What limits steps, in words; `None` if errors limit none.
    pub fn words(&self) -> Option<String> {
        let share = |count: u64| 100.0 * count as f64 / self.steps as f64;
        let is_named = |count: u64| count as f64 >= LEAST_SHARE * self.steps as f64 && count > 0;
        let mut all: Vec<(u64, &str)> = self.limited.into_iter().zip(NAMES).collect();
        all.retain(|(count, _)| is_named(*count));
        all.sort_by_key(|(count, _)| std::cmp::Reverse(*count));
        if all.is_empty() {
            return None;
        }
        let all = all.into_iter().map(|(count, name)| format!("of {name} {:.0} %", share(count)));
        let beyond = match is_named(self.beyond) {
            true => format!("; {:.0} % are of the shortest length, with larger errors", share(self.beyond)),
            false => String::new(),
        };
        Some(format!(
            "steps that errors keep from being twice as long: {}{beyond}",
            all.collect::<Vec<_>>().join(", ")
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quantities_that_limit_steps_are_named_with_their_shares() {
        let mut limits = StepLimits::default();
        assert_eq!(limits.words(), None);
        let errors = |at: usize| {
            let mut errors = [1e-9; QUANTITIES];
            errors[at] = 1e-3;
            errors
        };
        (0..60).for_each(|_| limits.count(errors(1), [true, false]));
        (0..15).for_each(|_| limits.count(errors(3), [true, true]));
        (0..25).for_each(|_| limits.count(errors(0), [false, false]));
        let words = "steps that errors keep from being twice as long: of stresses 60 %, of wear 15 %; 15 % are of the shortest length, \
                     with larger errors";
        assert_eq!(limits.words().as_deref(), Some(words));
        (0..10_000).for_each(|_| limits.count(errors(9), [false, false]));
        assert_eq!(limits.words(), None, "less than one in a hundred steps");
    }

    #[test]
    fn steps_that_stay_the_shortest_are_said_once_where_many_are_left() {
        let mut limits = StepLimits::default();
        let mut take = |count: u64, is_beyond: bool, left: u64| {
            (0..count).for_each(|_| limits.count([1.0; QUANTITIES], [true, is_beyond]));
            limits.warning(left).is_some()
        };
        assert!(!take(999, true, 20_000) && !take(1, false, 20_000) && !take(999, true, 20_000));
        assert!(!take(1, true, 10_000), "the rest is short");
        assert!(take(1, true, 20_000) && !take(1, true, 20_000));
    }
}
