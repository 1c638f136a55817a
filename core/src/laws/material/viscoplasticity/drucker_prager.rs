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

use super::{
    flow::{Flow, InPlaces, Parameters, WITHOUT_FLOW},
    tangent::{Tangent, add_product, write_isotropic},
    thickness::ThroughThickness,
};
use crate::{
    laws::material::{Elastic, Elasticity, Hypothesis, Isotropic},
    linear_algebra::tensor::{Mandel, dot, normal_components, trace},
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};

/// The law of Drucker and Prager: the viscoplastic strain rate is (s - P_K s)/(2 relaxation), where P_K s is the stress nearest to
/// s, in the norm (t, t), in the yield set sqrt(J2) + friction_coefficient p <= cohesion with the mean stress p (positive in
/// tension).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "DruckerPrager", extend("also" = "soil, sand, clay, rock, concrete"))]
pub struct DruckerPrager<N = f64> {
    /// Viscosity lambda: the larger, the slower stress outside the yield set relaxes.
    #[schemars(extend("at_infinity" = WITHOUT_FLOW, "unit" = "Pa s", "exclusiveMinimum" = 0), example = 100.0)]
    pub relaxation: f64,
    /// Increase of the yield stress in shear, sqrt(J2), per pressure.
    #[schemars(range(min = 0), example = 0.6)]
    pub friction_coefficient: f64,
    /// Yield stress in pure shear at zero pressure. An expression in x, y, z is evaluated at the centre of each cell.
    #[schemars(extend("at_infinity" = WITHOUT_FLOW, "variables" = "x, y, z", "unit" = "Pa", "minimum" = 0), example = 1e4)]
    pub cohesion: N,
}

impl<N> InPlaces<N> for DruckerPrager<N> {
    type AtPlace = DruckerPrager;

    const YIELD_STRESS: Option<&'static str> = Some("cohesion");

    fn yield_stress(&self) -> Option<&N> {
        Some(&self.cohesion)
    }

    fn with_yield_stress(&self, cohesion: f64) -> DruckerPrager {
        let Self { relaxation, friction_coefficient, .. } = *self;
        DruckerPrager { relaxation, friction_coefficient, cohesion }
    }
}

impl Parameters for DruckerPrager {
    type Flow = ThroughThickness<Elastic<Self>>;

    fn prepare(&self, elasticity: &Elasticity, hypothesis: Hypothesis) -> Self::Flow {
        ThroughThickness::new(*self, elasticity, hypothesis)
    }

    fn keeps_volume(&self) -> bool {
        self.friction_coefficient == 0.0
    }
}

impl Elastic<DruckerPrager> {
    /// `X(s)`, the viscoplastic strain rate in 1/s: zero inside the cone.
    #[inline]
    pub fn strain_rate<const S: usize>(&self, s: &Mandel<S>) -> Mandel<S> {
        let mut out = [0.0; S];
        let (mean, size) = mean_and_deviator(s);
        let beyond = self.yield_function(mean, size);
        if beyond <= 0.0 {
            return out;
        }
        let (new_mean, scale) = self.nearest(mean, size, beyond);
        let factor = 0.5 / self.parameters.relaxation;
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
        crate::linear_algebra::tensor::add_scaled(s, -2.0 * self.parameters.relaxation, &rate)
    }

    /// `sqrt(J2) + alpha p - c`.
    fn yield_function(&self, mean: f64, size: f64) -> f64 {
        size * FRAC_1_SQRT_2 + self.parameters.friction_coefficient * mean - self.parameters.cohesion
    }

    /// Mean stress and factor of the deviator of the nearest point, for a stress outside.
    fn nearest(&self, mean: f64, size: f64, beyond: f64) -> (f64, f64) {
        let alpha = self.parameters.friction_coefficient;
        let multiplier = beyond / (alpha * alpha / 3.0 + 0.5);
        let left = size - multiplier * FRAC_1_SQRT_2;
        if left > 0.0 || alpha == 0.0 {
            (mean - multiplier * alpha / 3.0, left.max(0.0) / size)
        } else {
            (self.parameters.cohesion / alpha, 0.0)
        }
    }
}

/// `tr s / 3` and `|dev s|`.
fn mean_and_deviator<const S: usize>(s: &Mandel<S>) -> (f64, f64) {
    (trace(s) / 3.0, crate::linear_algebra::tensor::von_mises(s) * SQRT_2 / 3f64.sqrt())
}

impl Flow for Elastic<DruckerPrager> {
    #[inline(always)]
    fn elasticity(&self) -> &Isotropic {
        &self.elasticity
    }

    #[inline]
    fn rate<const S: usize>(&self, s: &Mandel<S>, _accumulated: f64) -> (Mandel<S>, f64) {
        (self.strain_rate(s), 0.0)
    }

    /// With `eta = k / (2 lambda)`, the factors `K'` and `2 G` of `E` on mean and deviator and the multiplier
    /// `m = f / (alpha² / 3 + 1/2)` of the projection, the mean stress falls by `eta K' m alpha / 3` and the deviator's length
    /// by `eta 2 G m / √2`; so `f* = f (1 + eta (G + K' alpha² / 3) / (alpha² / 3 + 1/2))`. Beyond the apex both distances to
    /// it shrink on their own, by `1 + eta K'` and `1 + eta 2 G`.
    fn flow_to_end<const S: usize>(
        &self,
        trial: &Mandel<S>,
        length: f64,
        _accumulated: f64,
        tangent: Option<&mut Tangent<S>>,
    ) -> Option<(Mandel<S>, f64)> {
        let DruckerPrager { relaxation, friction_coefficient: alpha, cohesion } = self.parameters;
        let mean = trace(trial) / 3.0;
        let mut deviator = *trial;
        deviator.iter_mut().take(3).for_each(|d| *d -= mean);
        let size = dot(&deviator, &deviator).sqrt();
        let beyond = size * FRAC_1_SQRT_2 + alpha * mean - cohesion;
        if beyond <= 0.0 {
            return None;
        }
        let eta = 0.5 * length / relaxation;
        let (shear, bulk) = (self.elasticity.shear, self.elasticity.shear + 3.0 * self.elasticity.volumetric);
        let square = alpha * alpha / 3.0 + 0.5;
        let share = 1.0 / (square + eta * (0.5 * shear + bulk * alpha * alpha / 3.0));
        let multiplier = share * beyond;
        let mut identity = [0.0; S];
        identity[..3].fill(1.0);
        // Where the deviator of the projection would turn round, the apex is nearest.
        if size > (1.0 + eta * shear) * multiplier * FRAC_1_SQRT_2 || alpha == 0.0 {
            let direction = if size > 0.0 { deviator.map(|d| d / size) } else { deviator };
            if let Some(tangent) = tangent {
                let fall = |part: f64| eta * part * share;
                let scale = 1.0 - eta * shear * multiplier * FRAC_1_SQRT_2 / size;
                write_isotropic(tangent, 1.0 - fall(bulk * alpha * alpha / 3.0), scale);
                add_product(tangent, 1.0 - fall(0.5 * shear) - scale, &direction, &direction);
                let mixed = fall(alpha / 3.0 * FRAC_1_SQRT_2);
                add_product(tangent, -mixed * bulk, &identity, &direction);
                add_product(tangent, -mixed * shear, &direction, &identity);
            }
            let mut flow = direction.map(|d| eta * multiplier * FRAC_1_SQRT_2 * d);
            flow.iter_mut().take(3).for_each(|f| *f += eta * multiplier * alpha / 3.0);
            return Some((flow, 0.0));
        }
        let (along, across) = (1.0 / (1.0 + eta * bulk), 1.0 / (1.0 + eta * shear));
        if let Some(tangent) = tangent {
            write_isotropic(tangent, along, across);
        }
        let mut flow = deviator.map(|d| eta * across * d);
        flow.iter_mut().take(3).for_each(|f| *f += eta * along * (mean - cohesion / alpha));
        Some((flow, 0.0))
    }

    /// No eigenvalue of the derivative of `-G` is larger.
    fn fastest_rate<const S: usize>(&self, _overstress: f64) -> f64 {
        self.elasticity.largest_modulus::<S>() / (2.0 * self.parameters.relaxation)
    }

    fn equivalent_stress<const S: usize>(&self, s: &Mandel<S>) -> Option<(f64, Mandel<S>)> {
        let alpha = self.parameters.friction_coefficient;
        let mean = trace(s) / 3.0;
        let mut deviator = *s;
        deviator.iter_mut().take(normal_components::<S>()).for_each(|d| *d -= mean);
        let size = dot(&deviator, &deviator).sqrt();
        let factor = if size > 0.0 { FRAC_1_SQRT_2 / size } else { 0.0 };
        let mut direction = deviator.map(|d| factor * d);
        direction.iter_mut().take(3).for_each(|d| *d += alpha / 3.0);
        Some((size * FRAC_1_SQRT_2 + alpha * mean, direction))
    }

    fn strength(&self, _accumulated: f64) -> f64 {
        self.parameters.cohesion
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::material::{Metric, Perzyna};
    use crate::linear_algebra::tensor::add_scaled;
    use proptest::prelude::*;

    const SOIL: Elasticity = Elasticity::linear(1000.0, 0.3);

    const LAW: DruckerPrager = DruckerPrager { relaxation: 100.0, friction_coefficient: 0.6, cohesion: 10.0 };

    fn law(hypothesis: Hypothesis) -> Elastic<DruckerPrager> {
        LAW.prepare(&SOIL, hypothesis).space
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
        let cone = DruckerPrager { friction_coefficient: 0.0, ..LAW }.prepare(&SOIL, Hypothesis::Space).space;
        let cylinder = Perzyna {
            relaxation: 100.0,
            yield_stress: 10.0 * 3f64.sqrt(),
            exponent: 1.0,
            hardening_modulus: None,
            kinematic_modulus: None,
            metric: Metric::Frobenius,
        }
        .prepare(&SOIL, Hypothesis::Space);
        let s = [31.0, -4.0, 7.0, 12.0, -3.0, 8.0];
        let (one, other) = (cone.strain_rate(&s), cylinder.strain_rate(&s));
        assert!((0..6).all(|c| (one[c] - other[c]).abs() < 1e-15), "{one:?} {other:?}");
    }

    fn check<const S: usize>(hypothesis: Hypothesis, s: &Mandel<S>, other: &Mandel<S>) {
        let law = law(hypothesis);
        let scale = 1.0 + dot(s, s) + dot(other, other);
        let (near, inside) = (law.project(s), law.project(other));
        let (mean, size) = mean_and_deviator(&near);
        assert!(law.yield_function(mean, size) <= 1e-12 * scale, "in the cone");
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
