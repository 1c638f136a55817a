//! Where a step ends.

use crate::{effect::Step, state::State};

/// A step that ends within this share of a step of the end ends there.
pub const SNAP: f64 = 1e-6;

/// The step of `length` from here, cut or stretched to end at `end` where that is near.
pub fn next_step(state: &State, length: f64, end: f64) -> Step {
    let previous_length = state.step_length;
    let time = on_the_grid(state.time + length, length);
    if (end - time).abs() <= SNAP * length {
        Step { time: end, length, previous_length }
    } else if time > end {
        Step { time: end, length: end - state.time, previous_length }
    } else {
        Step { time, length, previous_length }
    }
}

/// The multiple of `length` that is meant by a time, if one is: sums of millions of lengths would drift away from it.
fn on_the_grid(time: f64, length: f64) -> f64 {
    let multiple = (time / length).round() * length;
    if (time - multiple).abs() <= SNAP * length { multiple } else { time }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_million_steps_end_where_they_should() {
        let (length, mut time) = (1e-3, 0.0);
        for _ in 0..1_000_000 {
            time = on_the_grid(time + length, length);
        }
        assert_eq!(time, 1000.0);
    }

    #[test]
    fn times_between_multiples_stay_where_they_are() {
        assert_eq!(on_the_grid(0.65, 0.1), 0.65);
        assert_eq!(on_the_grid(0.1 + 0.2, 0.1), 3.0 * 0.1);
    }
}
