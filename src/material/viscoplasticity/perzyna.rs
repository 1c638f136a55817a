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

mod hardening;
mod plane_projection;
mod plane_stress;
mod radial;
#[cfg(test)]
mod tests;

use super::{
    flow::{Flow, Parameters, one_by_one},
    tangent::Tangent,
};
use crate::{
    law::LawFault,
    material::{Elastic, Elasticity, Hypothesis, Isotropic},
    simd::{LANES, Pack},
    tensor::{Mandel, dot, normal_components, trace, von_mises},
};
use multiversion::multiversion;
use plane_projection::Surface;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::{array, f64::consts::FRAC_1_SQRT_2};

/// Perzyna's law `G(s) = -(1/(2 relaxation)) (f/yield_stress)^(exponent - 1) E (s - P_K s)`, where P_K projects on the von Mises
/// yield set K and f is the von Mises norm beyond the yield stress.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Perzyna {
    /// The viscosity lambda: the larger, the slower stress beyond the yield set relaxes.
    #[schemars(extend("unit" = "Pa s", "exclusiveMinimum" = 0), example = 100.0)]
    pub relaxation: f64,
    /// Von Mises norm at which flow begins.
    #[schemars(range(min = 0), extend("unit" = "Pa"), example = 19.0)]
    pub yield_stress: f64,
    /// Power of the overstress; 1 is Wang and Cheng's law. Above 1 the yield stress must be positive, and the bound of
    /// explicit steps holds while the von Mises norm is at most twice the yield stress.
    #[serde(default = "one")]
    #[schemars(range(min = 1), example = 3.0)]
    pub exponent: f64,
    /// Growth of the yield stress with the accumulated viscoplastic strain, which is kept for every cell; absent: no hardening.
    /// What hardening stores is part of viscoplastic_dissipation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0), extend("unit" = "Pa"), example = 100.0)]
    pub hardening_modulus: Option<f64>,
    /// The norm in which the projection on the yield set is the nearest point.
    #[serde(default)]
    pub metric: Metric,
}

fn one() -> f64 {
    1.0
}

/// A norm of stresses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Metric {
    /// (E t, t): Wang and Cheng's.
    #[default]
    Elasticity,
    /// (E^-1 t, t): the usual choice in plasticity.
    Compliance,
    /// (t, t).
    Frobenius,
}

impl Parameters for Perzyna {
    type Flow = Elastic<Self>;

    fn prepare(&self, elasticity: &Elasticity, hypothesis: Hypothesis) -> Elastic<Self> {
        Elastic { parameters: *self, elasticity: elasticity.tensor(hypothesis) }
    }

    fn fault(&self) -> Option<LawFault> {
        (self.yield_stress == 0.0 && self.exponent != 1.0).then(|| {
            let message = "a power of the overstress over the yield stress needs a positive yield stress";
            LawFault::at_value("exponent", message, "give a positive yield_stress, or leave exponent out")
        })
    }

    fn keeps_volume(&self) -> bool {
        true
    }
}

/// Share of the stress below which a yield stress counts as none in plane stress: squares of their ratio would overflow.
const NO_YIELD_STRESS: f64 = 1e-100;

impl Elastic<Perzyna> {
    /// `(f / yield stress)^(n - 1) (s - P_K s) / (2 lambda)`, the viscoplastic strain rate in 1/s: zero inside the yield surface.
    ///
    /// The stress rate is `G(s) = -E` of it, the dissipation `s :` it.
    #[inline]
    pub fn strain_rate<const S: usize>(&self, s: &Mandel<S>) -> Mandel<S> {
        let mut out = [0.0; S];
        let (norm, yield_stress) = (von_mises(s), self.parameters.yield_stress);
        if norm <= yield_stress {
            return out;
        }
        let factor = self.pace(norm / yield_stress - 1.0);
        let projected = self.project_outside(s, norm);
        for c in 0..S {
            out[c] = factor * (s[c] - projected[c]);
        }
        out
    }

    /// `r^(n - 1) / (2 lambda)` at an overstress of `r` times the yield stress.
    fn pace(&self, overstress: f64) -> f64 {
        let Perzyna { relaxation, exponent, .. } = self.parameters;
        let pace = 0.5 / relaxation;
        if exponent == 1.0 { pace } else { pace * overstress.powf(exponent - 1.0) }
    }

    /// How far the metric is from that in which the projection is radial, in plane stress: the ratio of its eigenvalues, at
    /// least 1.
    fn skewness(&self) -> f64 {
        let (along, across) = self.inverse_metric();
        (along / across).max(across / along)
    }

    /// `P_K s`, the closest stress with von Mises norm at most the yield stress.
    pub fn project<const S: usize>(&self, s: &Mandel<S>) -> Mandel<S> {
        let norm = von_mises(s);
        if norm <= self.parameters.yield_stress { *s } else { self.project_outside(s, norm) }
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
        let scale = self.parameters.yield_stress / norm;
        let mut out = [0.0; S];
        for c in 0..S {
            let pressure = if c < n { mean } else { 0.0 };
            out[c] = pressure + scale * (s[c] - pressure);
        }
        out
    }

    /// The strain rates of stresses side by side without hardening, as [`strain_rate`](Self::strain_rate) gives them one by one;
    /// `None` if all are zero.
    pub fn strain_rates<const S: usize>(&self, stresses: &Pack<S>) -> Option<Pack<S>> {
        strain_rates(self, stresses)
    }

    fn project_plane_stress<const S: usize>(&self, s: &Mandel<S>, norm: f64) -> Mandel<S> {
        let mut out = [0.0; S];
        if self.parameters.yield_stress > NO_YIELD_STRESS * norm {
            let projected = self.project_plane_stresses([&[s[0]], &[s[1]], &[s[2]]], &[norm]);
            out[..3].copy_from_slice(projected.as_flattened());
        }
        out
    }

    /// The projections of plane stresses, component by component.
    #[inline(always)]
    fn project_plane_stresses<const N: usize>(&self, s: [&[f64; N]; 3], norms: &[f64; N]) -> [[f64; N]; 3] {
        let (along, across) = self.inverse_metric();
        let surface = Surface { along, across: 3.0 * across, yield_stress: self.parameters.yield_stress };
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
        match self.parameters.metric {
            Metric::Elasticity => (1.0 / p, 1.0 / q),
            Metric::Compliance => (p, q),
            Metric::Frobenius => (1.0, 1.0),
        }
    }

    /// Inverse eigenvalue of the metric and eigenvalue of `E` in plane stress: on `p`, and on `q` and `r`.
    fn metric_and_elasticity(&self) -> [(f64, f64); 2] {
        let Isotropic { volumetric, shear } = self.elasticity;
        let (along, across) = self.inverse_metric();
        [(along, shear + 2.0 * volumetric), (across, shear)]
    }

    /// `t : t` in the metric of the projection.
    pub fn metric_square<const S: usize>(&self, t: &Mandel<S>) -> f64 {
        match self.parameters.metric {
            Metric::Elasticity => dot(t, &self.elasticity.apply(t)),
            Metric::Compliance => self.elasticity.inverse_square(t),
            Metric::Frobenius => dot(t, t),
        }
    }
}

impl Flow for Elastic<Perzyna> {
    #[inline(always)]
    fn elasticity(&self) -> &Isotropic {
        &self.elasticity
    }

    #[inline]
    fn rate<const S: usize>(&self, s: &Mandel<S>, accumulated: f64) -> (Mandel<S>, f64) {
        let rate = self.hardened(accumulated).strain_rate(s);
        let work = dot(s, &rate);
        (rate, if work > 0.0 { work / von_mises(s) } else { 0.0 })
    }

    #[inline(always)]
    fn rates<const S: usize>(
        &self,
        stresses: &Pack<S>,
        accumulated: &[f64; LANES],
        growths: &mut [f64; LANES],
    ) -> Option<Pack<S>> {
        if !self.hardens() {
            return self.strain_rates(stresses);
        }
        Some(one_by_one(self, stresses, accumulated, growths))
    }

    fn flow_to_end<const S: usize>(
        &self,
        trial: &Mandel<S>,
        length: f64,
        accumulated: f64,
        tangent: Option<&mut Tangent<S>>,
    ) -> Option<(Mandel<S>, f64)> {
        let (norm, yield_stress) = (von_mises(trial), self.strength(accumulated));
        if norm <= yield_stress {
            return None;
        }
        let start = (norm, yield_stress);
        Some(if S == 3 {
            plane_stress::flow(self, trial, length, start, tangent)
        } else {
            radial::flow(self, trial, length, start, tangent)
        })
    }

    fn has_symmetric_tangent<const S: usize>(&self) -> bool {
        S != 3
    }

    /// No eigenvalue of the derivative of `-G` is larger where the overstress is at most so many times the yield stress, `r`, which
    /// only counts for `n > 1`.
    ///
    /// Along the deviator, with radial projections: `n r^(n - 1) 2 mu / (2 lambda)`, which is sharp. In plane stress the largest
    /// eigenvalue `e` of `E` takes the place of `2 mu`, as that of `E (I - P_K')` for a projection in a metric that commutes with
    /// `E`. The power adds `(n - 1) r^(n - 1) m . E w / (f 2 lambda)` with `w = s - P_K s` and the derivative `m` of the norm: for
    /// diagonal metrics `m . w <= (1 + 1 / (1 + r)) f`, as the mean square of numbers below 1 is below their mean.
    fn fastest_rate<const S: usize>(&self, overstress: f64) -> f64 {
        let n = self.parameters.exponent;
        let modulus = if S == 3 {
            let power = if n == 1.0 { 0.0 } else { (n - 1.0) * (1.0 + 1.0 / (1.0 + overstress)) };
            self.elasticity.largest_modulus::<S>() * (1.0 + power)
        } else {
            self.elasticity.shear * n
        };
        self.pace(overstress) * modulus + self.hardening_rate::<S>(overstress)
    }

    fn is_power_law(&self) -> bool {
        self.parameters.exponent != 1.0
    }

    #[inline]
    fn overstress<const S: usize>(&self, s: &Mandel<S>, accumulated: f64) -> f64 {
        (von_mises(s) / self.strength(accumulated) - 1.0).max(0.0)
    }

    fn hardens(&self) -> bool {
        self.parameters.hardening_modulus.is_some()
    }

    fn equivalent_stress<const S: usize>(&self, s: &Mandel<S>) -> Option<(f64, Mandel<S>)> {
        let mean = trace(s) / 3.0;
        let mut deviator = *s;
        deviator.iter_mut().take(normal_components::<S>()).for_each(|d| *d -= mean);
        let norm = von_mises(s);
        let factor = if norm > 0.0 { 1.5 / norm } else { 0.0 };
        Some((norm, deviator.map(|d| factor * d)))
    }

    fn strength(&self, accumulated: f64) -> f64 {
        self.parameters.yield_stress + self.hardening_modulus() * accumulated
    }

    fn hardening_modulus(&self) -> f64 {
        self.parameters.hardening_modulus.unwrap_or(0.0)
    }
}

#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
fn strain_rates<const S: usize>(law: &Elastic<Perzyna>, stresses: &Pack<S>) -> Option<Pack<S>> {
    let yield_stress = law.parameters.yield_stress;
    let mut norms = [0.0; LANES];
    for lane in 0..LANES {
        norms[lane] = von_mises(&stresses.lane(lane));
    }
    let largest = norms.iter().fold(0.0, |most: f64, norm| if *norm > most { *norm } else { most });
    if largest <= yield_stress {
        return None;
    }
    let factor = 0.5 / law.parameters.relaxation;
    let rates = if law.parameters.exponent != 1.0 || (S == 3 && yield_stress <= NO_YIELD_STRESS * largest) {
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
