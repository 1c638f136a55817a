//! The error that a step makes in stresses and histories.

use super::{Step, linear};
use crate::{fem::space::Batch, laws::material::Isotropic, linear_algebra::simd::Pack};

/// The deviation of the next value from the straight line through the last two: `k_n / (k_n + k_{n-1}) (x_n - x_{n-1} - w (x_{n-1} -
/// x_{n-2}))` with `w = k_n / k_{n-1}`, the local error of implicit Euler. Before the first step values are taken as
/// constant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Curvature {
    share: f64,
    ratio: f64,
}

impl Curvature {
    /// Over this step and the one before it.
    pub fn of(step: Step) -> Self {
        if step.previous_length > 0.0 {
            let ratio = step.length / step.previous_length;
            Self { share: ratio / (1.0 + ratio), ratio }
        } else {
            Self { share: 0.5, ratio: 0.0 }
        }
    }

    /// The error of a value, given it at the end of the step, before the step and before the last step.
    #[inline(always)]
    pub fn error(self, [now, before, earlier]: [f64; 3]) -> f64 {
        self.share * (now - before - self.ratio * (before - earlier))
    }
}

/// Squares of norms in J, summed over cells and nodes: `s : E^-1 s` for a stress `s`, twice the energy for a spring.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StressError {
    /// Of the errors that histories make in stresses and forces.
    pub error: f64,
    /// Of the stresses and forces without viscosity at the end of the step.
    pub size: f64,
}

impl StressError {
    /// Adds a history of stresses of the cells of a batch and its error, given its values at the end of the step, before it and before
    /// the step before it.
    pub(super) fn add_history<const D: usize, const S: usize>(
        &mut self,
        elasticity: &Isotropic,
        batch: &Batch<D, S>,
        curvature: Curvature,
        [now, before, earlier]: [&Pack<S>; 3],
    ) {
        let error: Pack<S> = Pack::from_lanes(|lane| {
            std::array::from_fn(|c| curvature.error([now, before, earlier].map(|values| values.0[c][lane])))
        });
        let (cells, integrity) = (batch.cells, &batch.integrity);
        self.error += linear::inverse_square(elasticity, cells, integrity, &Pack::ZERO, &error);
        self.size += linear::inverse_square(elasticity, cells, integrity, &batch.strain, now);
    }
}

/// Squares of a quantity that a step changes, summed over points: of its error, of its deviation from its value at the start of the run,
/// and of a deviation below which its error does not matter.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Deviation {
    /// Of the error.
    pub error: f64,
    /// Of the deviation at the end of the step.
    pub size: f64,
    /// Of the negligible deviation.
    pub negligible: f64,
}

impl Deviation {
    /// Adds a value with this weight, given its error, its deviation and a negligible one.
    pub(super) fn add(&mut self, weight: f64, [error, size, negligible]: [f64; 3]) {
        self.error += weight * error * error;
        self.size += weight * size * size;
        self.negligible += weight * negligible * negligible;
    }
}

/// Number of the quantities of contacts whose errors are measured against their own deviations: what friction keeps, wear, and
/// displacement, velocity, angle and angular velocity of obstacles that forces move.
pub const CONTACT_QUANTITIES: usize = 6;
/// Number of those of them that belong to points.
pub const FIRST_OF_OBSTACLES: usize = 2;

#[cfg(test)]
mod tests {
    use super::*;

    fn curvature(length: f64, previous_length: f64) -> Curvature {
        Curvature::of(Step { time: 1.0, length, previous_length })
    }

    #[test]
    fn parabolas_have_half_their_second_derivative_times_the_square_of_the_step() {
        let value = |t: f64| 3.0 - 2.0 * t + 5.0 * t * t;
        for (length, before) in [(0.2, 0.1), (0.1, 0.2), (0.3, 0.3)] {
            let values = [value(1.0), value(1.0 - length), value(1.0 - length - before)];
            let error = curvature(length, before).error(values);
            assert!((error - 5.0 * length * length).abs() < 1e-14, "{length} after {before}: {error}");
        }
        assert_eq!(curvature(0.2, 0.1).error([9.0, 3.0, 1.0]), 2.0 / 3.0 * 2.0, "w = 2");
        assert_eq!(curvature(0.1, 0.2).error([9.0, 3.0, 1.0]), 0.5 / 1.5 * 5.0, "w = 1/2");
    }

    #[test]
    fn the_first_step_counts_half_of_its_change() {
        assert_eq!(curvature(0.2, 0.0).error([9.0, 3.0, f64::MAX]), 3.0);
    }
}
