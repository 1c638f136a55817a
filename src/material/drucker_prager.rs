//! Viscoplasticity with a yield stress that grows with pressure, after Drucker and Prager.
//!
//! `X(s) = (s - P_K s) / (2 lambda)` with the orthogonal projection (in `(t, t)`) on the cone
//!
//! ```text
//! K = { s : sqrt(J2(s)) + alpha p(s) <= c },   p = tr s / 3 (tension positive),   J2 = dev s : dev s / 2
//! ```
//!
//! of friction coefficient `alpha` and cohesion `c`. X is the gradient of `dist(s, K)^2 / (4 lambda)`: associated flow,
//! monotone and dissipative. With `v = sqrt(3) p` and `d = |dev s|` the cone's section is `d / √2 + alpha v / √3 <= c`;
//! outside, the nearest point lies `m = f / (alpha²/3 + 1/2)` times the normal `(alpha / √3, 1 / √2)` away, or at the apex
//! `p = c / alpha` where that would make `d` negative.
//!
//! (D. Drucker, W. Prager, Soil mechanics and plastic analysis or limit design, Quart. Appl. Math. 10 (1952), 157-165;
//! apex: E. de Souza Neto, D. Peric, D. Owen, Computational Methods for Plasticity, 2008, chapter 8; viscous
//! regularisation: G. Duvaut, J.-L. Lions, Les inequations en mecanique et en physique, 1972, chapter 5.)

use super::Isotropic;
use crate::tensor::{Mandel, normal_components, trace};
use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};

/// A Drucker-Prager law at a point, in 3D or plane strain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DruckerPrager {
    /// `lambda` in Pa s, positive.
    pub relaxation: f64,
    /// `alpha`, not negative.
    pub friction_coefficient: f64,
    /// `c` in Pa, not negative: the yield stress in pure shear.
    pub cohesion: f64,
    /// The elastic tensor `E`.
    pub elasticity: Isotropic,
}

impl DruckerPrager {
    /// `X(s)`, the viscoplastic strain rate in 1/s: zero inside the cone.
    #[inline]
    pub fn strain_rate<const S: usize>(&self, s: &Mandel<S>) -> Mandel<S> {
        let mut out = [0.0; S];
        let (mean, size) = mean_and_deviator(s);
        let beyond = self.beyond(mean, size);
        if beyond <= 0.0 {
            return out;
        }
        let (new_mean, scale) = self.nearest(mean, size, beyond);
        let factor = 0.5 / self.relaxation;
        for c in 0..S {
            let (mean, fall) =
                if c < normal_components::<S>() { (mean, mean - new_mean) } else { (0.0, 0.0) };
            out[c] = factor * (fall + (1.0 - scale) * (s[c] - mean));
        }
        out
    }

    /// `P_K s`, the nearest stress of the cone.
    pub fn project<const S: usize>(&self, s: &Mandel<S>) -> Mandel<S> {
        let rate = self.strain_rate(s);
        crate::tensor::add_scaled(s, -2.0 * self.relaxation, &rate)
    }

    /// The fastest relaxation in 1/s: no eigenvalue of the derivative of `-G` is larger.
    pub fn fastest_rate<const S: usize>(&self) -> f64 {
        self.elasticity.largest_modulus::<S>() / (2.0 * self.relaxation)
    }

    /// `sqrt(J2) + alpha p - c`.
    fn beyond(&self, mean: f64, size: f64) -> f64 {
        size * FRAC_1_SQRT_2 + self.friction_coefficient * mean - self.cohesion
    }

    /// Mean stress and factor of the deviator of the nearest point, for a stress outside.
    fn nearest(&self, mean: f64, size: f64, beyond: f64) -> (f64, f64) {
        let alpha = self.friction_coefficient;
        let multiplier = beyond / (alpha * alpha / 3.0 + 0.5);
        let left = size - multiplier * FRAC_1_SQRT_2;
        if left > 0.0 || alpha == 0.0 {
            (mean - multiplier * alpha / 3.0, left.max(0.0) / size)
        } else {
            (self.cohesion / alpha, 0.0)
        }
    }
}

/// `tr s / 3` and `|dev s|`.
fn mean_and_deviator<const S: usize>(s: &Mandel<S>) -> (f64, f64) {
    (trace(s) / 3.0, crate::tensor::von_mises(s) * SQRT_2 / 3f64.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::{Elasticity, Hypothesis, Metric, Perzyna};
    use crate::tensor::{add_scaled, dot};
    use proptest::prelude::*;

    const SOIL: Elasticity = Elasticity { youngs_modulus: 1000.0, poisson_ratio: 0.3 };

    fn law(hypothesis: Hypothesis) -> DruckerPrager {
        DruckerPrager {
            relaxation: 100.0,
            friction_coefficient: 0.6,
            cohesion: 10.0,
            elasticity: SOIL.tensor(hypothesis),
        }
    }

    #[test]
    fn pressure_alone_never_flows_and_raises_the_strength() {
        let law = law(Hypothesis::Space);
        assert_eq!(law.strain_rate(&[-500.0, -500.0, -500.0, 0.0, 0.0, 0.0]), [0.0; 6]);
        // sqrt(J2) = 12 at p = -10 is inside 10 + 6, at p = 0 it is not.
        let shear = 12.0 * SQRT_2;
        assert_eq!(law.strain_rate(&[-10.0, -10.0, -10.0, 0.0, 0.0, shear]), [0.0; 6]);
        assert_ne!(law.strain_rate(&[0.0, 0.0, 0.0, 0.0, 0.0, shear]), [0.0; 6]);
    }

    #[test]
    fn shear_flows_and_dilates_by_hand() {
        // f = 12 - 10 = 2, multiplier 2 / (0.12 + 0.5): deviator down by it over √2, mean stress by 0.2 of it.
        let rate = law(Hypothesis::Space).strain_rate(&[0.0, 0.0, 0.0, 0.0, 0.0, 12.0 * SQRT_2]);
        let multiplier = 2.0 / 0.62;
        assert!((rate[5] - multiplier * FRAC_1_SQRT_2 / 200.0).abs() < 1e-15);
        assert!((rate[0] - multiplier * 0.2 / 200.0).abs() < 1e-15 && rate[0] == rate[2]);
    }

    #[test]
    fn tension_beyond_the_apex_returns_to_it() {
        let apex = law(Hypothesis::Space).project(&[100.0, 101.0, 99.0, 0.0, 0.0, 1.0]);
        for c in 0..6 {
            let expected = if c < 3 { 10.0 / 0.6 } else { 0.0 };
            assert!((apex[c] - expected).abs() < 1e-12, "{apex:?}");
        }
    }

    #[test]
    fn without_friction_it_is_perzynas_law() {
        let elasticity = SOIL.tensor(Hypothesis::Space);
        let cone = DruckerPrager { friction_coefficient: 0.0, ..law(Hypothesis::Space) };
        let cylinder = Perzyna {
            relaxation: 100.0,
            yield_stress: 10.0 * 3f64.sqrt(),
            exponent: 1.0,
            elasticity,
            metric: Metric::Frobenius,
        };
        let s = [31.0, -4.0, 7.0, 12.0, -3.0, 8.0];
        let (one, other) = (cone.strain_rate(&s), cylinder.strain_rate(&s));
        assert!((0..6).all(|c| (one[c] - other[c]).abs() < 1e-15), "{one:?} {other:?}");
    }

    fn check<const S: usize>(hypothesis: Hypothesis, s: &Mandel<S>, other: &Mandel<S>) {
        let law = law(hypothesis);
        let scale = 1.0 + dot(s, s) + dot(other, other);
        let (near, inside) = (law.project(s), law.project(other));
        let (mean, size) = mean_and_deviator(&near);
        assert!(law.beyond(mean, size) <= 1e-12 * scale, "in the cone");
        let away = add_scaled(s, -1.0, &near);
        assert!(dot(&away, &add_scaled(&inside, -1.0, &near)) <= 1e-12 * scale, "nearest");
        assert!(dot(s, &law.strain_rate(s)) >= -1e-14 * scale, "dissipation");
        // Monotone, and no faster than the fastest.
        let change = add_scaled(&law.strain_rate(s), -1.0, &law.strain_rate(other));
        let apart = add_scaled(s, -1.0, other);
        let product = dot(&change, &apart);
        assert!(product >= -1e-14 * scale && dot(&change, &change) * 200.0 <= product + 1e-12 * scale);
    }

    proptest! {
        #[test]
        fn the_projection_is_the_nearest_point_and_flow_is_monotone_and_dissipative(
            s in proptest::array::uniform6(-100.0f64..100.0),
            other in proptest::array::uniform6(-100.0f64..100.0),
        ) {
            let plane = |t: &[f64; 6]| [t[0], t[1], t[2], t[3]];
            check(Hypothesis::PlaneStrain, &plane(&s), &plane(&other));
            check(Hypothesis::Space, &s, &other);
        }
    }
}
