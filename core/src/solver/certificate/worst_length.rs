//! The length of the worst step.
//!
//! On a motion the decreasing laws feed the power `a + k b` and the matrix of a step of length `k` dissipates `m/k + c + k e`, with the
//! forms `m`, `c`, `e` of mass, viscosity and stiffness. The derivative of their quotient
//!
//! ```text
//! q(k) = (a k + b k^2) / (m + c k + e k^2)      has the sign of      p(k) = a m + 2 b m k + (b c - a e) k^2 ,
//! ```
//!
//! because the cubic terms cancel. With `a, b, m >= 0`, and `m + c k + e k^2 > 0` between the two ends, `p` has no negative coefficient or
//! only the last one, and then changes its sign once, from plus to minus. So `q` rises up to the root of `p`, falls after it, and its
//! largest value between two ends is at the root or at the nearer end. That holds also where a form is less than zero, as those less the
//! power of other laws: the coefficients of `p` in front of `m` are as they were.

/// The length in s between these two of the step with the largest quotient of `a + k b` and `m/k + c + k e`.
pub(super) fn worst_length(
    [shortest, longest]: [f64; 2],
    [constant, proportional]: [f64; 2],
    [mass, viscosity, stiffness]: [f64; 3],
) -> f64 {
    let fall = constant * stiffness - proportional * viscosity;
    if fall <= 0.0 {
        return longest;
    }
    let half = proportional * mass;
    let root = (half + (half * half + constant * mass * fall).sqrt()) / fall;
    if root.is_finite() { root.clamp(shortest, longest) } else { longest }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn quotient(k: f64, [a, b]: [f64; 2], [m, c, e]: [f64; 3]) -> f64 {
        (a + k * b) / (m / k + c + k * e)
    }

    #[test]
    fn the_worst_length_by_hand() {
        let ends = [0.1, 10.0];
        // Only elasticity: a constant decrease is worst in the shortest step, one with the displacement is the same in all.
        assert_eq!(worst_length(ends, [1.0, 0.0], [0.0, 0.0, 3.0]), 0.1);
        assert_eq!(quotient(0.1, [0.0, 1.0], [0.0, 0.0, 3.0]), quotient(10.0, [0.0, 1.0], [0.0, 0.0, 3.0]));
        // Only viscosity, only inertia: the longest.
        assert_eq!(worst_length(ends, [1.0, 1.0], [0.0, 2.0, 0.0]), 10.0);
        assert_eq!(worst_length(ends, [1.0, 0.0], [2.0, 0.0, 0.0]), 10.0);
        // Between the ends: k = (m / e)^(1/2).
        assert_eq!(worst_length(ends, [1.0, 0.0], [8.0, 1.0, 2.0]), 2.0);
    }

    proptest! {
        #[test]
        fn no_other_length_is_worse(
            power in [0.0..2.0f64, 0.0..2.0f64],
            forms in [0.0..2.0f64, 0.01..2.0f64, 0.0..2.0f64],
            ends in [0.01..1.0f64, 1.0..100.0f64],
        ) {
            let worst = quotient(worst_length(ends, power, forms), power, forms);
            for share in 0..=100 {
                let k = ends[0] * (ends[1] / ends[0]).powf(f64::from(share) / 100.0);
                prop_assert!(quotient(k, power, forms) <= worst * (1.0 + 1e-12));
            }
        }
    }
}
