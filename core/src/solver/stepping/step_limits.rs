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

/// Counts of steps since the run was started or continued. No step depends on them.
#[derive(Debug, Default)]
pub struct StepLimits {
    steps: u64,
    /// Those that could not be twice as long, by the quantity with the largest error.
    limited: [u64; QUANTITIES],
    /// Steps of the shortest length whose error exceeds the tolerance.
    beyond: u64,
}

impl StepLimits {
    /// Counts a step with these errors of the quantities, given whether they limit it and exceed the tolerance.
    pub(super) fn count(&mut self, errors: [f64; QUANTITIES], [is_limited, is_beyond]: [bool; 2]) {
        self.steps += 1;
        self.beyond += u64::from(is_beyond);
        if is_limited && let Some(largest) = (0..QUANTITIES).max_by(|a, b| errors[*a].total_cmp(&errors[*b]))
        {
            self.limited[largest] += 1;
        }
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
}
