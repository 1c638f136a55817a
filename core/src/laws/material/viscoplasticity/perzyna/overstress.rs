//! The parameters of Perzyna's law, the projection on its yield set and its strain rate.

use super::super::flow::WITHOUT_FLOW;
use super::plane_projection::Surface;
use crate::{
    laws::material::{Elastic, Isotropic},
    linear_algebra::{
        simd::{LANES, Pack},
        tensor::{Mandel, normal_components, trace, von_mises},
    },
};
use multiversion::multiversion;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::{array, f64::consts::FRAC_1_SQRT_2};

/// The elastic stress at the end of a step above the yield stress.
#[derive(Debug, Clone, Copy)]
pub(super) struct Overstressed {
    /// Its norm, `q*` or `|s*|`, in Pa.
    pub norm: f64,
    /// `Y*` in Pa.
    pub yield_stress: f64,
}

/// Perzyna's law: the stress rate is `G(s) = -(1/(2 relaxation)) (f/yield_stress)^(exponent - 1) E (s - P_K s)`, where P_K is the
/// projection on the yield set of von Mises and the overstress f is the von Mises norm of s minus the yield stress.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Perzyna", extend("also" = "plasticity, yield, hardening, steel, metal"))]
pub struct Perzyna<N = f64> {
    /// Viscosity lambda: the larger, the slower stress outside the yield set relaxes.
    #[schemars(extend("at_infinity" = WITHOUT_FLOW, "unit" = "Pa s", "exclusiveMinimum" = 0), example = 100.0)]
    pub relaxation: f64,
    /// Yield stress: von Mises norm of the stress above which the material flows. An expression in x, y, z is evaluated at the
    /// centre of each cell.
    #[schemars(extend("at_infinity" = WITHOUT_FLOW, "variables" = "x, y, z", "unit" = "Pa", "minimum" = 0), example = 19.0)]
    pub yield_stress: N,
    /// Exponent of the overstress, relative to the yield stress with its hardening. 1: the law of Wang and Cheng (2022). Above 1 the yield
    /// stress must be positive, and with scheme
    /// lagged_euler explicit_step_bound holds only while the von Mises norm is at most twice the yield stress.
    #[serde(default = "one")]
    #[schemars(range(min = 1), example = 3.0)]
    pub exponent: f64,
    /// Increase of the yield stress per accumulated viscoplastic strain. Absent: no hardening. The energy stored by hardening is
    /// part of viscoplastic_dissipation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0), extend("unit" = "Pa"), example = 100.0)]
    pub hardening_modulus: Option<f64>,
    /// Kinematic hardening (Prager): the yield surface moves with the viscoplastic strain, in uniaxial stress by this modulus times the
    /// strain, so that a material that has flowed one way flows back sooner. Absent: none. The energy stored by it is part of
    /// viscoplastic_dissipation, which falls where it is given back. Not together with [initial.stress].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0), extend("unit" = "Pa"), example = 100.0)]
    pub kinematic_modulus: Option<f64>,
    /// The norm in which the projection on the yield set is the nearest stress.
    #[serde(default)]
    pub metric: Metric,
}

fn one() -> f64 {
    1.0
}

/// A squared norm of the stress t, with the elastic tensor E.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Metric {
    /// (E t, t), as in Wang and Cheng (2022).
    #[default]
    Elasticity,
    /// (E^-1 t, t).
    Compliance,
    /// (t, t). Flow is then associated in plane stress, too: as the relaxation falls to 0, the law tends to classical perfect plasticity.
    Frobenius,
}

/// In plane stress, yield stresses below this share of the stress are treated as zero, because squares of the ratio would overflow.
pub(super) const NO_YIELD_STRESS: f64 = 1e-100;

impl Elastic<Perzyna> {
    /// `(f / yield stress)^(n - 1) (s - P_K s) / (2 lambda)`, the viscoplastic strain rate in 1/s; zero inside the yield surface.
    ///
    /// With this rate `X`, the stress rate is `G(s) = -E X` and the dissipation is `s : X`.
    #[inline]
    pub fn strain_rate<const S: usize>(&self, s: &Mandel<S>) -> Mandel<S> {
        let mut out = [0.0; S];
        let (norm, yield_stress) = (von_mises(s), self.parameters.yield_stress);
        if norm <= yield_stress {
            return out;
        }
        let factor = self.rate_factor(norm / yield_stress - 1.0);
        let projected = self.project_outside(s, norm);
        for c in 0..S {
            out[c] = factor * (s[c] - projected[c]);
        }
        out
    }

    /// `r^(n - 1) / (2 lambda)` at an overstress of `r` times the yield stress.
    pub(super) fn rate_factor(&self, overstress: f64) -> f64 {
        let Perzyna { relaxation, exponent, .. } = self.parameters;
        let rate_factor = 0.5 / relaxation;
        if exponent == 1.0 { rate_factor } else { rate_factor * overstress.powf(exponent - 1.0) }
    }

    /// Deviation, in plane stress, of the metric from that in which the projection is radial: the ratio of its eigenvalues, at
    /// least 1.
    pub(super) fn skewness(&self) -> f64 {
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

    /// The strain rates of a pack of stresses without hardening, equal to those of [`strain_rate`](Self::strain_rate);
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
    pub(super) fn inverse_metric(&self) -> (f64, f64) {
        let Isotropic { volumetric, shear } = self.elasticity;
        let (p, q) = (shear + 2.0 * volumetric, shear);
        match self.parameters.metric {
            Metric::Elasticity => (1.0 / p, 1.0 / q),
            Metric::Compliance => (p, q),
            Metric::Frobenius => (1.0, 1.0),
        }
    }

    /// Inverse eigenvalue of the metric and eigenvalue of the stiffness of flow in plane stress: on `p`, and on `q` and `r`.
    pub(super) fn metric_and_stiffness(&self) -> [(f64, f64); 2] {
        let Isotropic { volumetric, shear } = self.stiffness::<3>();
        let (along, across) = self.inverse_metric();
        [(along, shear + 2.0 * volumetric), (across, shear)]
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
