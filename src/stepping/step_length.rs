//! Where a step ends.

use crate::{effect::Step, state::State};

/// A step that ends within this share of a step of the end ends there.
pub const SNAP: f64 = 1e-6;

/// The step of `length` from here, cut or stretched to end at `end` where that is near.
pub fn next_step(state: &State, length: f64, end: f64) -> Step {
    let previous_length = state.step_length;
    let time = state.time + length;
    if (end - time).abs() <= SNAP * length {
        Step { time: end, length, previous_length }
    } else if time > end {
        Step { time: end, length: end - state.time, previous_length }
    } else {
        Step { time, length, previous_length }
    }
}
