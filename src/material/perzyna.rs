//! Viscoplasticity of Perzyna type.
//!
//! `G(s) = -1/(2 lambda) E (s - P_K s)` (section 5 of Wang and Cheng 2022), where `P_K` projects on the stresses
//! whose von Mises norm is at most the yield stress, orthogonally in one of three metrics.
//!
//! Plane strain and 3D: every isotropic metric separates pressure from deviator, so the projection scales the deviator
//! by `yield stress / von Mises norm`. Plane stress: with `p = (s11 + s22)/√2`, `q = (s11 - s22)/√2`, `r = √2 s12` the
//! squared norm is `p²/2 + 3 (q² + r²)/2` and every isotropic metric is diagonal, `a` on `p` and `b` on `q`, `r`. The
//! stationary point is `p a/(a + m)`, `(q, r) b/(b + 3 m)` with the multiplier `m >= 0` that puts it on the surface: one
//! scalar, monotone equation, solved by Newton's method on the reciprocal of the norm.
//!
//! Power law: with the overstress `f = von Mises norm - yield stress` the rate is
//! `1/(2 lambda) (f / yield stress)^(n - 1) (s - P_K s)`, the paper's for `n = 1`. Where the projection is radial, this is
//! Perzyna's `<f / yield stress>^n` along the deviator (P. Perzyna, Fundamental problems in viscoplasticity, Advances in
//! Applied Mechanics 9 (1966), 243-377; E. de Souza Neto, D. Peric, D. Owen, Computational Methods for Plasticity, 2008,
//! chapter 11), with a viscosity that does not depend on `n` at `f = yield stress`.

use super::{Isotropic, plane_projection::Surface};
use crate::{
    lanes::{LANES, Pack},
    tensor::{Mandel, dot, normal_components, trace, von_mises},
};
use multiversion::multiversion;
use std::{array, f64::consts::FRAC_1_SQRT_2};

/// The norm in which the projection is orthogonal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Metric {
    /// `(E t, t)`, as the paper writes it.
    Elasticity,
    /// `(E^-1 t, t)`, usual in plasticity.
    Compliance,
    /// `(t, t)`.
    Frobenius,
}

/// A Perzyna law at a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Perzyna {
    /// `lambda` in Pa s, positive.
    pub relaxation: f64,
    /// Uniaxial yield stress in Pa, not negative.
    pub yield_stress: f64,
    /// `n`, at least 1; 1 unless the yield stress is positive.
    pub exponent: f64,
    /// The elastic tensor `E`.
    pub elasticity: Isotropic,
    /// Metric of the projection.
    pub metric: Metric,
}

/// Share of the stress below which a yield stress counts as none in plane stress: squares of their ratio would overflow.
pub(super) const NO_YIELD_STRESS: f64 = 1e-100;

impl Perzyna {
    /// `(f / yield stress)^(n - 1) (s - P_K s) / (2 lambda)`, the viscoplastic strain rate in 1/s: zero inside the yield surface.
    ///
    /// The stress rate is `G(s) = -E` of it, the dissipation `s :` it.
    #[inline]
    pub fn strain_rate<const S: usize>(&self, s: &Mandel<S>) -> Mandel<S> {
        let mut out = [0.0; S];
        let norm = von_mises(s);
        if norm <= self.yield_stress {
            return out;
        }
        let factor = self.pace(norm / self.yield_stress - 1.0);
        let projected = self.project_outside(s, norm);
        for c in 0..S {
            out[c] = factor * (s[c] - projected[c]);
        }
        out
    }

    /// The fastest relaxation in 1/s where the overstress is at most so many times the yield stress, `r`, which only counts for
    /// `n > 1`: no eigenvalue of the derivative of `-G` is larger.
    ///
    /// Along the deviator, with radial projections: `n r^(n - 1) 2 mu / (2 lambda)`, which is sharp. In plane stress the largest
    /// eigenvalue `e` of `E` takes the place of `2 mu`, as that of `E (I - P_K')` for a projection in a metric that commutes with
    /// `E`. The power adds `(n - 1) r^(n - 1) m . E w / (f 2 lambda)` with `w = s - P_K s` and the derivative `m` of the norm: for
    /// diagonal metrics `m . w <= (1 + 1 / (1 + r)) f`, as the mean square of numbers below 1 is below their mean.
    pub fn fastest_rate<const S: usize>(&self, overstress: f64) -> f64 {
        let n = self.exponent;
        let modulus = if S == 3 {
            let power = if n == 1.0 { 0.0 } else { (n - 1.0) * (1.0 + 1.0 / (1.0 + overstress)) };
            self.elasticity.largest_modulus::<S>() * (1.0 + power)
        } else {
            self.elasticity.shear * n
        };
        self.pace(overstress) * modulus
    }

    /// `r^(n - 1) / (2 lambda)` at an overstress of `r` times the yield stress.
    pub(super) fn pace(&self, overstress: f64) -> f64 {
        let pace = 0.5 / self.relaxation;
        if self.exponent == 1.0 { pace } else { pace * overstress.powf(self.exponent - 1.0) }
    }

    /// The overstress over the yield stress, which is positive.
    pub fn overstress<const S: usize>(&self, s: &Mandel<S>) -> f64 {
        (von_mises(s) / self.yield_stress - 1.0).max(0.0)
    }

    /// How far the metric is from that in which the projection is radial, in plane stress: the ratio of its eigenvalues, at
    /// least 1.
    pub(super) fn skewness(&self) -> f64 {
        let (along, across) = self.inverse_metric();
        (along / across).max(across / along)
    }

    /// `P_K s`, the closest stress with von Mises norm at most the yield stress.
    pub fn project<const S: usize>(&self, s: &Mandel<S>) -> Mandel<S> {
        let norm = von_mises(s);
        if norm <= self.yield_stress { *s } else { self.project_outside(s, norm) }
    }

    #[inline(always)]
    fn project_outside<const S: usize>(&self, s: &Mandel<S>, norm: f64) -> Mandel<S> {
        if S == 3 {
            return self.project_plane_stress(s, norm);
        }
        self.scale_deviator(s, norm)
    }

    #[inline(always)]
    fn scale_deviator<const S: usize>(&self, s: &Mandel<S>, norm: f64) -> Mandel<S> {
        let n = normal_components::<S>();
        let mean = trace(s) / n as f64;
        let scale = self.yield_stress / norm;
        let mut out = [0.0; S];
        for c in 0..S {
            let pressure = if c < n { mean } else { 0.0 };
            out[c] = pressure + scale * (s[c] - pressure);
        }
        out
    }

    /// The strain rates of stresses side by side, as [`strain_rate`](Self::strain_rate) gives them one by one; `None` if all are
    /// zero.
    pub fn strain_rates<const S: usize>(&self, stresses: &Pack<S>) -> Option<Pack<S>> {
        strain_rates(self, stresses)
    }

    fn project_plane_stress<const S: usize>(&self, s: &Mandel<S>, norm: f64) -> Mandel<S> {
        let mut out = [0.0; S];
        if self.yield_stress > NO_YIELD_STRESS * norm {
            let projected = self.project_plane_stresses([&[s[0]], &[s[1]], &[s[2]]], &[norm]);
            out[..3].copy_from_slice(projected.as_flattened());
        }
        out
    }

    /// The projections of plane stresses, component by component.
    #[inline(always)]
    fn project_plane_stresses<const N: usize>(&self, s: [&[f64; N]; 3], norms: &[f64; N]) -> [[f64; N]; 3] {
        let (along, across) = self.inverse_metric();
        let surface = Surface { along, across: 3.0 * across, yield_stress: self.yield_stress };
        let [mut p, mut q] = [[0.0; N]; 2];
        let [mut volumetric, mut deviatoric] = [[0.0; N]; 2];
        for i in 0..N {
            (p[i], q[i]) = ((s[0][i] + s[1][i]) * FRAC_1_SQRT_2, (s[0][i] - s[1][i]) * FRAC_1_SQRT_2);
            (volumetric[i], deviatoric[i]) = (0.5 * p[i] * p[i], 1.5 * (q[i] * q[i] + s[2][i] * s[2][i]));
        }
        let multipliers = surface.multipliers(&volumetric, &deviatoric, norms);
        let mut out = [[0.0; N]; 3];
        for i in 0..N {
            let p = p[i] / (1.0 + surface.along * multipliers[i]) * FRAC_1_SQRT_2;
            let b = 1.0 / (1.0 + surface.across * multipliers[i]);
            let q = q[i] * b * FRAC_1_SQRT_2;
            (out[0][i], out[1][i], out[2][i]) = (p + q, p - q, s[2][i] * b);
        }
        out
    }

    /// Inverse eigenvalues of the metric in plane stress: on `p`, and on `q` and `r`.
    fn inverse_metric(&self) -> (f64, f64) {
        let Isotropic { volumetric, shear } = self.elasticity;
        let (p, q) = (shear + 2.0 * volumetric, shear);
        match self.metric {
            Metric::Elasticity => (1.0 / p, 1.0 / q),
            Metric::Compliance => (p, q),
            Metric::Frobenius => (1.0, 1.0),
        }
    }

    /// Inverse eigenvalue of the metric and eigenvalue of `E` in plane stress: on `p`, and on `q` and `r`.
    pub(super) fn metric_and_elasticity(&self) -> [(f64, f64); 2] {
        let Isotropic { volumetric, shear } = self.elasticity;
        let (along, across) = self.inverse_metric();
        [(along, shear + 2.0 * volumetric), (across, shear)]
    }

    /// `t : t` in the metric of the projection.
    pub fn metric_square<const S: usize>(&self, t: &Mandel<S>) -> f64 {
        match self.metric {
            Metric::Elasticity => dot(t, &self.elasticity.apply(t)),
            Metric::Compliance => self.elasticity.inverse_square(t),
            Metric::Frobenius => dot(t, t),
        }
    }
}

#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
fn strain_rates<const S: usize>(law: &Perzyna, stresses: &Pack<S>) -> Option<Pack<S>> {
    let yield_stress = law.yield_stress;
    let mut norms = [0.0; LANES];
    for lane in 0..LANES {
        norms[lane] = von_mises(&stresses.lane(lane));
    }
    let largest = norms.iter().fold(0.0, |most: f64, norm| if *norm > most { *norm } else { most });
    if largest <= yield_stress {
        return None;
    }
    let factor = 0.5 / law.relaxation;
    let rates = if law.exponent != 1.0 || (S == 3 && yield_stress <= NO_YIELD_STRESS * largest) {
        Pack::from_lanes(|lane| law.strain_rate(&stresses.lane(lane)))
    } else {
        let projected = if S == 3 {
            let columns = [&stresses.0[0], &stresses.0[1], &stresses.0[2]];
            let projected = law.project_plane_stresses(columns, &norms);
            Pack::from_lanes(|lane| array::from_fn(|c| projected[c.min(2)][lane]))
        } else {
            Pack::from_lanes(|lane| law.scale_deviator(&stresses.lane(lane), norms[lane]))
        };
        Pack::from_lanes(|lane| {
            let factor = if norms[lane] > yield_stress { factor } else { 0.0 };
            array::from_fn(|c| {
                let rate = factor * (stresses.0[c][lane] - projected.0[c][lane]);
                if factor > 0.0 { rate } else { 0.0 }
            })
        })
    };
    Some(rates)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::{Elasticity, Hypothesis};
    use proptest::prelude::*;

    const PAPER: Elasticity = Elasticity { youngs_modulus: 1000.0, poisson_ratio: 0.4 };
    const METRICS: [Metric; 3] = [Metric::Elasticity, Metric::Compliance, Metric::Frobenius];

    fn law(metric: Metric, hypothesis: Hypothesis) -> Perzyna {
        Perzyna {
            relaxation: 100.0,
            yield_stress: 19.0,
            exponent: 1.0,
            elasticity: PAPER.tensor(hypothesis),
            metric,
        }
    }

    #[test]
    fn stress_inside_the_yield_surface_flows_not_at_all() {
        let law = law(Metric::Elasticity, Hypothesis::PlaneStress);
        assert_eq!(law.strain_rate(&[18.9, 0.0, 0.0]), [0.0; 3]);
        assert_eq!(law.project(&[18.9, 0.0, 0.0]), [18.9, 0.0, 0.0]);
    }

    #[test]
    fn stresses_flow_together_as_they_do_one_by_one() {
        let stresses = [[40.0, -3.0, 7.0], [0.0; 3], [1e6, 1e6, 0.0], [12.0, 3.0, 1.0], [-25.0, 20.0, 30.0]];
        for (metric, exponent) in [(METRICS[0], 1.0), (METRICS[1], 1.0), (METRICS[2], 2.5)] {
            let law = Perzyna { exponent, ..law(metric, Hypothesis::PlaneStress) };
            let side_by_side = Pack::from_lanes(|lane| stresses.get(lane).copied().unwrap_or([0.0; 3]));
            let rates = law.strain_rates(&side_by_side).expect("flow");
            assert!((0..LANES).all(|lane| rates.lane(lane) == law.strain_rate(&side_by_side.lane(lane))));
            assert!((5..LANES).all(|lane| rates.lane(lane) == [0.0; 3]));
            let space = Perzyna { exponent, ..self::law(metric, Hypothesis::Space) };
            let side_by_side =
                Pack::from_lanes(|lane| array::from_fn(|c| side_by_side.0[c % 3][lane] * (1.0 + c as f64)));
            let rates: Pack<6> = space.strain_rates(&side_by_side).expect("flow");
            assert!((0..LANES).all(|lane| rates.lane(lane) == space.strain_rate(&side_by_side.lane(lane))));
            assert_eq!(law.strain_rates(&Pack::from_lanes(|lane| [lane as f64, 0.0, 0.0])), None);
        }
    }

    #[test]
    fn pure_shear_is_scaled_to_the_surface_in_every_metric() {
        for metric in METRICS {
            let projected = law(metric, Hypothesis::PlaneStress).project(&[0.0, 0.0, 100.0]);
            assert!((projected[2] - 19.0 / 1.5f64.sqrt()).abs() < 1e-12, "{projected:?}");
        }
    }

    #[test]
    fn equibiaxial_stress_is_scaled_in_plane_stress_and_free_in_space() {
        for metric in METRICS {
            let plane = law(metric, Hypothesis::PlaneStress).project(&[38.0, 38.0, 0.0]);
            assert!((plane[0] - 19.0).abs() < 1e-12 && (plane[1] - 19.0).abs() < 1e-12, "{plane:?}");
        }
        let pressure = [50.0, 50.0, 50.0, 0.0, 0.0, 0.0];
        assert_eq!(law(Metric::Elasticity, Hypothesis::Space).project(&pressure), pressure);
    }

    #[test]
    fn uniaxial_viscoplastic_strain_rate_in_space_by_hand() {
        // s = (31, 0, 0): deviator (62/3, -31/3, -31/3), scaled by 1 - 19/31, over 2 lambda = 200.
        let rate = law(Metric::Frobenius, Hypothesis::Space).strain_rate(&[31.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert!((rate[0] - 8.0 / 200.0).abs() < 1e-15, "{rate:?}");
        assert!((rate[1] + 4.0 / 200.0).abs() < 1e-15);
    }

    #[test]
    fn uniaxial_rates_just_beyond_yield_in_plane_stress_by_hand() {
        // The share of the overstress over 2 lambda that docs/conventions.md states; 2/3 in space.
        let k = 0.4;
        for (metric, share) in [
            (Metric::Elasticity, (1.0 + k / 2.0) / (1.25 + k)),
            (Metric::Frobenius, 0.8),
            (Metric::Compliance, (4.0 - 2.0 * k) / (5.0 - 4.0 * k)),
        ] {
            let law = Perzyna {
                elasticity: Elasticity { youngs_modulus: 1000.0, poisson_ratio: k }
                    .tensor(Hypothesis::PlaneStress),
                ..law(metric, Hypothesis::PlaneStress)
            };
            let rate = law.strain_rate(&[19.0 + 1e-5, 0.0, 0.0])[0] / (1e-5 / 200.0);
            assert!((rate - share).abs() < 1e-5, "{metric:?}: {rate} for {share}");
        }
    }

    #[test]
    fn power_law_rate_by_hand() {
        // Overstress 12 of 19: the linear law's 8 / 200 is scaled by (12 / 19)^(n - 1).
        let stress = [31.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let mut law = law(Metric::Frobenius, Hypothesis::Space);
        for exponent in [1.0, 2.0, 3.5] {
            law.exponent = exponent;
            let expected = 8.0 / 200.0 * (12.0f64 / 19.0).powf(exponent - 1.0);
            assert!((law.strain_rate(&stress)[0] - expected).abs() < 1e-15, "{exponent}");
        }
        assert_eq!(law.strain_rate(&[18.9, 0.0, 0.0, 0.0, 0.0, 0.0]), [0.0; 6]);
    }

    #[test]
    fn zero_yield_stress_leaves_no_plane_stress() {
        let mut law = law(Metric::Elasticity, Hypothesis::PlaneStress);
        law.yield_stress = 0.0;
        assert_eq!(law.project(&[3.0, 4.0, 5.0]), [0.0; 3]);
        // Then all of the stress flows, over 2 lambda = 200; of stresses side by side, too.
        let rates = law.strain_rates(&Pack::from_lanes(|lane| [3.0 * lane as f64, 4.0, -5.0])).expect("flow");
        for lane in 0..LANES {
            let expected = [3.0 * lane as f64, 4.0, -5.0].map(|s| s / 200.0);
            assert!((0..3).all(|c| (rates.lane(lane)[c] - expected[c]).abs() < 1e-15), "{rates:?}");
        }
    }

    fn check_projection<const S: usize>(law: &Perzyna, s: &Mandel<S>, other: &Mandel<S>) {
        let scale = 1.0 + dot(s, s).sqrt() + dot(other, other).sqrt();
        let p = law.project(s);
        let again = law.project(&p);
        assert!(von_mises(&p) <= 19.0 * (1.0 + 1e-12));
        if von_mises(s) > 19.0 {
            assert!((von_mises(&p) - 19.0).abs() < 1e-10 * 19.0, "on the surface");
        }
        for c in 0..S {
            assert!((again[c] - p[c]).abs() < 1e-9 * scale, "idempotent");
        }
        let inside = law.project(other);
        let mut to_other = [0.0; S];
        let mut away = [0.0; S];
        for c in 0..S {
            (to_other[c], away[c]) = (inside[c] - p[c], s[c] - p[c]);
        }
        let mut sum = [0.0; S];
        for c in 0..S {
            sum[c] = to_other[c] + away[c];
        }
        // <away, to_other> in the metric, by polarisation: not positive for a projection on a convex set.
        let product =
            0.5 * (law.metric_square(&sum) - law.metric_square(&away) - law.metric_square(&to_other));
        let size = law.metric_square(&sum) + law.metric_square(&away) + law.metric_square(&to_other);
        assert!(product <= 1e-10 * size, "orthogonal: {product} of {size}");
        assert!(dot(s, &law.strain_rate(s)) >= -1e-12 * scale * scale, "dissipation");
    }

    proptest! {
        #[test]
        fn projections_are_idempotent_on_the_surface_orthogonal_and_dissipative(
            s in proptest::array::uniform6(-200.0f64..200.0),
            other in proptest::array::uniform6(-200.0f64..200.0),
            metric in proptest::sample::select(&METRICS[..]),
        ) {
            let first = |t: &[f64; 6]| [t[0], t[1], t[3]];
            let plane = |t: &[f64; 6]| [t[0], t[1], t[2], t[3]];
            check_projection(&law(metric, Hypothesis::PlaneStress), &first(&s), &first(&other));
            check_projection(&law(metric, Hypothesis::PlaneStrain), &plane(&s), &plane(&other));
            check_projection(&law(metric, Hypothesis::Space), &s, &other);
        }
    }
}
