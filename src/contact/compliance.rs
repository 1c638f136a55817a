//! Normal compliance: a foundation whose pressure is a power of the penetration.
//!
//! `-sigma_nu = stiffness * max(u_nu - gap, 0)^exponent`. Within a step of length `k` that starts with the penetration `d`
//! it is a law of the velocity, `p(r) = stiffness * max(d + k r, 0)^exponent`, which rises: its relaxed monotonicity
//! constant is 0.

use super::{NodeContext, Resolved};

/// Parameters of the law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Compliance {
    /// Pressure at unit penetration, in Pa/m^exponent, positive.
    pub stiffness: f64,
    /// Exponent, at least 1.
    pub exponent: f64,
}

/// Bisection halves the bracket if Newton's method does not; more iterations than the bits of a number serve nothing.
const ITERATIONS: usize = 100;

impl Compliance {
    /// Pressure in Pa at a penetration in m.
    pub fn pressure(&self, penetration: f64) -> f64 {
        if penetration <= 0.0 {
            return 0.0;
        }
        if self.exponent == 1.0 {
            self.stiffness * penetration
        } else {
            self.stiffness * penetration.powf(self.exponent)
        }
    }

    /// Derivative of the pressure in Pa/m.
    pub fn stiffness_at(&self, penetration: f64) -> f64 {
        if penetration <= 0.0 {
            return 0.0;
        }
        self.stiffness * self.exponent * penetration.powf(self.exponent - 1.0)
    }

    /// Stored energy in J/m²: the integral of the pressure over the penetration.
    pub fn energy(&self, penetration: f64) -> f64 {
        self.pressure(penetration) * penetration.max(0.0) / (self.exponent + 1.0)
    }

    /// Velocity and pressure where `c r + p(d + k r) = s`, for a positive `c`.
    pub fn resolve(&self, s: f64, c: f64, node: NodeContext) -> Resolved {
        let NodeContext { penetration, step_length } = node;
        let free = s / c;
        let excess = penetration + step_length * free;
        if excess <= 0.0 {
            return Resolved { velocity: free, pressure: 0.0, derivative: 1.0 / c, branch: 0 };
        }
        // The penetration d at the end of the step solves d + (k / c) p(d) = excess: monotone and convex.
        let ratio = step_length / c;
        let reached = self.penetration(excess, ratio);
        let pressure = self.pressure(reached);
        let derivative = 1.0 / (c + step_length * self.stiffness_at(reached));
        Resolved { velocity: (s - pressure) / c, pressure, derivative, branch: 1 }
    }

    fn penetration(&self, excess: f64, ratio: f64) -> f64 {
        if self.exponent == 1.0 {
            return excess / (1.0 + ratio * self.stiffness);
        }
        let (mut low, mut high) = (0.0, excess);
        let mut at = excess;
        for _ in 0..ITERATIONS {
            let value = at + ratio * self.pressure(at) - excess;
            if value > 0.0 {
                high = at;
            } else {
                low = at;
            }
            let newton = at - value / (1.0 + ratio * self.stiffness_at(at));
            let next = if low < newton && newton < high { newton } else { 0.5 * (low + high) };
            if (next - at).abs() <= 4.0 * f64::EPSILON * next {
                return next;
            }
            at = next;
        }
        at
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_linear_foundation_by_hand() {
        let law = Compliance { stiffness: 100.0, exponent: 1.0 };
        assert_eq!([law.pressure(-1.0), law.pressure(0.5), law.energy(0.5)], [0.0, 50.0, 12.5]);
        // d + 0.5 * 100 d = 1.02 with d = 0.02.
        let node = NodeContext { penetration: 0.02, step_length: 1.0 };
        let found = law.resolve(2.0, 2.0, node);
        assert!((found.pressure - 2.0).abs() < 1e-14 && found.velocity.abs() < 1e-14);
        assert!((found.derivative - 1.0 / 102.0).abs() < 1e-16);
        let open = law.resolve(-4.0, 2.0, node);
        assert_eq!((open.velocity, open.pressure, open.branch), (-2.0, 0.0, 0));
    }

    proptest! {
        #[test]
        fn the_resolvent_solves_its_equation(
            exponent in 1.0f64..2.0, stiffness in 0.1f64..1e4, start in -1.0f64..1.0, s in -1e3f64..1e3, c in 0.1f64..100.0,
        ) {
            let law = Compliance { stiffness, exponent };
            let node = NodeContext { penetration: start, step_length: 0.1 };
            let found = law.resolve(s, c, node);
            let open = c * found.velocity + law.pressure(start + 0.1 * found.velocity) - s;
            let size = s.abs() + c * found.velocity.abs() + (1.0 + law.stiffness_at(start.max(0.0)) ) * 1e-2;
            prop_assert!(open.abs() < 1e-9 * (1.0 + size), "{} of {}", open, size);
            let h = 1e-4 * (1.0 + s.abs());
            let (above, below) = (law.resolve(s + h, c, node), law.resolve(s - h, c, node));
            if above.branch == below.branch && start + 0.1 * found.velocity > 1e-2 {
                let quotient = (above.velocity - below.velocity) / (2.0 * h);
                prop_assert!((quotient - found.derivative).abs() < 1e-3 * found.derivative);
            }
        }

        #[test]
        fn pressure_is_the_derivative_of_the_energy(exponent in 1.0f64..3.0, penetration in 0.01f64..1.0) {
            let law = Compliance { stiffness: 7.0, exponent };
            let h = 1e-6;
            let quotient = (law.energy(penetration + h) - law.energy(penetration - h)) / (2.0 * h);
            prop_assert!((quotient - law.pressure(penetration)).abs() < 1e-7);
        }
    }
}
