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
mod kinematic;
mod overstress;
mod plane_projection;
mod plane_stress;
mod radial;
#[cfg(test)]
mod tests;

use overstress::Overstressed;
pub use overstress::{Metric, Perzyna};

use super::{
    flow::{Flow, InPlaces, Parameters, one_by_one},
    tangent::Tangent,
};
use crate::{
    laws::{
        law::LawFault,
        material::{Elastic, Elasticity, Hypothesis, Isotropic},
    },
    linear_algebra::{
        simd::{LANES, Pack},
        tensor::{Mandel, dot, normal_components, trace, von_mises},
    },
};

impl<N> InPlaces<N> for Perzyna<N> {
    type AtPlace = Perzyna;

    const YIELD_STRESS: Option<&'static str> = Some("yield_stress");

    fn yield_stress(&self) -> Option<&N> {
        Some(&self.yield_stress)
    }

    fn with_yield_stress(&self, yield_stress: f64) -> Perzyna {
        let Self { relaxation, exponent, hardening_modulus, kinematic_modulus, metric, .. } = *self;
        Perzyna { relaxation, yield_stress, exponent, hardening_modulus, kinematic_modulus, metric }
    }
}

impl Parameters for Perzyna {
    type Flow = Elastic<Self>;

    fn prepare(&self, elasticity: &Elasticity, hypothesis: Hypothesis) -> Elastic<Self> {
        Elastic { parameters: *self, elasticity: elasticity.tensor(hypothesis) }
    }

    fn fault(&self) -> Option<LawFault> {
        (self.yield_stress == 0.0 && self.exponent != 1.0).then(|| {
            let message = "an exponent above 1 requires a positive yield stress";
            LawFault::at_value("exponent", message, "give a positive yield_stress, or delete exponent")
        })
    }

    fn keeps_volume(&self) -> bool {
        true
    }

    fn has_back_stress(&self) -> bool {
        self.kinematic_modulus.is_some_and(|modulus| modulus > 0.0)
    }
}

impl Flow for Elastic<Perzyna> {
    #[inline(always)]
    fn elasticity(&self) -> &Isotropic {
        &self.elasticity
    }

    #[inline(always)]
    fn back_stress<const S: usize>(&self) -> Option<Isotropic> {
        self.back_stress::<S>()
    }

    #[inline(always)]
    fn stiffness<const S: usize>(&self) -> Isotropic {
        self.stiffness::<S>()
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
        let start = Overstressed { norm, yield_stress };
        Some(if S == 3 {
            plane_stress::flow(self, trial, length, start, tangent)
        } else {
            radial::flow(self, trial, length, start, tangent)
        })
    }

    #[inline(always)]
    fn yielding<const S: usize>(&self, stresses: &Pack<S>, accumulated: &[f64; LANES]) -> [bool; LANES] {
        let mut yielding = [false; LANES];
        for lane in 0..LANES {
            let overstress = von_mises(&stresses.lane(lane)) - self.strength(accumulated[lane]);
            yielding[lane] = overstress > 0.0 || overstress.is_nan();
        }
        yielding
    }

    fn has_symmetric_tangent<const S: usize>(&self) -> bool {
        S != 3
    }

    /// An upper bound of the eigenvalues of the derivative of `-G` if the overstress is at most `r` times the yield stress, which
    /// matters for `n > 1` only.
    ///
    /// Along the deviator, with radial projections: `n r^(n - 1) 2 mu / (2 lambda)`, which is sharp. In plane stress the largest
    /// eigenvalue `e` of `E` takes the place of `2 mu`, as that of `E (I - P_K')` for a projection in a metric that commutes with
    /// `E`. The power adds `(n - 1) r^(n - 1) m . E w / (f 2 lambda)` with `w = s - P_K s` and the derivative `m` of the norm: for
    /// diagonal metrics `m . w <= (1 + 1 / (1 + r)) f`, as the mean square of numbers below 1 is below their mean.
    fn fastest_rate<const S: usize>(&self, overstress: f64) -> f64 {
        let n = self.parameters.exponent;
        let modulus = if S == 3 {
            let power = if n == 1.0 { 0.0 } else { (n - 1.0) * (1.0 + 1.0 / (1.0 + overstress)) };
            self.stiffness::<S>().largest_modulus::<S>() * (1.0 + power)
        } else {
            self.stiffness::<S>().shear * n
        };
        self.rate_factor(overstress) * modulus + self.hardening_rate::<S>(overstress)
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
        if self.parameters.yield_stress == 0.0 && !self.hardens() {
            return None;
        }
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
