//! The second-order backward differentiation formula for variable steps.
//!
//! The derivative at `t_n` is that of the parabola through the last three values. With `w = k_n / k_{n-1}`
//!
//! ```text
//! (x_n - x~) / k' = x'_n,   k' = k_n (1 + w) / (1 + 2 w),   x~ = ((1 + w)^2 x_{n-1} - w^2 x_{n-2}) / (1 + 2 w)
//! ```
//!
//! for velocity, displacement and, in cells that flow, history: a step of implicit Euler of length `k'` from the blend `x~`. The
//! first step, and the first step in which a cell flows, are steps of implicit Euler; where a cell stops yielding its flow ends
//! (`return_mapping/extrapolated.rs` of the laws). The formula is A-stable for equal steps; it remains stable if steps grow by
//! factors of at most `1 + √2`. (E. Hairer, S. Norsett, G. Wanner, Solving Ordinary Differential Equations I, 1993, chapter III.5.)

use crate::laws::step::{Blend, Step};

/// The blend from which a step starts.
pub(super) fn blend(step: Step) -> Blend {
    if step.previous_length == 0.0 {
        return Blend::euler(step.length);
    }
    let ratio = step.length / step.previous_length;
    let below = 1.0 + 2.0 * ratio;
    Blend {
        recent: (1.0 + ratio) * (1.0 + ratio) / below,
        earlier: -ratio * ratio / below,
        ..Blend::euler(step.length * (1.0 + ratio) / below)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_steps_give_the_textbook_formula() {
        let blend = blend(Step { time: 1.0, length: 0.3, previous_length: 0.3 });
        assert!((blend.length - 0.2).abs() < 1e-15);
        assert!((blend.recent - 4.0 / 3.0).abs() < 1e-15 && (blend.earlier + 1.0 / 3.0).abs() < 1e-15);
    }

    #[test]
    fn parabolas_are_differentiated_exactly_over_any_steps() {
        let value = |t: f64| 3.0 - 2.0 * t + 5.0 * t * t;
        for (length, previous_length) in [(0.3, 0.1), (0.1, 0.3), (0.2, 0.2)] {
            let blend = blend(Step { time: 1.0, length, previous_length });
            let start = blend.of(value(1.0 - length), value(1.0 - length - previous_length));
            assert!(((value(1.0) - start) / blend.length - 8.0).abs() < 1e-12);
        }
    }

    #[test]
    fn the_first_step_is_one_of_implicit_euler() {
        let first = blend(Step { time: 0.3, length: 0.3, previous_length: 0.0 });
        assert_eq!(first, Blend::euler(0.3));
    }
}
