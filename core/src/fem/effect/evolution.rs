use crate::laws::step::Blend;

/// An implicit step for a scalar internal variable that changes in one direction only, such as damage or bonding.
///
/// The law solves one step of implicit Euler of a given length from a given value. A two-step formula starts from the value before the
/// step plus a fraction of the change in the last step. This extrapolated change is limited by the change that the law makes, so that a
/// variable without driving force stays constant: where the extrapolated change exceeds that of the law, the step is one of implicit
/// Euler of twice the formula's length, which is continuous. A variable that did not change in the last step takes a step of implicit
/// Euler.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct IrreversibleStep {
    /// How the step starts.
    pub(super) blend: Blend,
    /// Length of the step in s.
    pub(super) length: f64,
}

impl IrreversibleStep {
    /// The value at the end of the step and its derivative by the driving force, given the value before the step and its change in
    /// the last step. `relax` gives both after a step of implicit Euler from a value over a length in s.
    #[inline]
    pub(super) fn advance(self, before: f64, last: f64, relax: impl Fn(f64, f64) -> [f64; 2]) -> [f64; 2] {
        let share = -self.blend.earlier * last;
        if share == 0.0 {
            return relax(before, self.length);
        }
        let start = before + share;
        let found = relax(start, self.blend.length);
        if (found[0] - start).abs() >= share.abs() { found } else { relax(before, 2.0 * self.blend.length) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Growth at a given rate.
    fn grow(rate: f64) -> impl Fn(f64, f64) -> [f64; 2] {
        move |start, length| [start + length * rate, length]
    }

    const EULER: IrreversibleStep = IrreversibleStep { blend: Blend::euler(0.3), length: 0.3 };
    const TWO_STEPS: IrreversibleStep = IrreversibleStep {
        blend: Blend { recent: 4.0 / 3.0, earlier: -1.0 / 3.0, ..Blend::euler(0.2) },
        length: 0.3,
    };

    #[test]
    fn steady_growth_is_exact_in_both_formulas() {
        assert_eq!(EULER.advance(1.0, 0.6, grow(2.0)), [1.6, 0.3]);
        let [value, slope] = TWO_STEPS.advance(1.0, 0.6, grow(2.0));
        assert!((value - 1.6).abs() < 1e-15 && slope == 0.2, "1 + 0.2 + 0.2 x 2");
        assert_eq!(TWO_STEPS.advance(1.0, 0.0, grow(2.0)), [1.6, 0.3], "the first step that grows");
    }

    #[test]
    fn without_a_rate_nothing_is_added_and_small_rates_join_continuously() {
        assert_eq!(TWO_STEPS.advance(1.0, 0.6, grow(0.0))[0], 1.0);
        let at = |rate| TWO_STEPS.advance(1.0, 0.6, grow(rate))[0];
        assert!((at(0.5) - 1.2).abs() < 1e-15, "twice what the law adds: 1 + 2 x 0.2 x 0.5");
        assert!((at(1.0 - 1e-12) - at(1.0 + 1e-12)).abs() < 1e-11);
    }

    #[test]
    fn values_that_fall_behave_alike() {
        let fall = |rate: f64| TWO_STEPS.advance(1.0, -0.3, grow(rate))[0];
        assert!((fall(-1.0) - 0.7).abs() < 1e-15 && fall(0.0) == 1.0);
    }

    #[test]
    fn parabolas_are_followed_exactly() {
        let value = |t: f64| t * t;
        let (end, k) = (1.5, 0.3);
        let [found, _] =
            TWO_STEPS.advance(value(end - k), value(end - k) - value(end - 2.0 * k), grow(2.0 * end));
        assert!((found - value(end)).abs() < 1e-14);
    }
}
