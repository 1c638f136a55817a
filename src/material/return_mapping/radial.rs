//! Perzyna's law where the projection is radial, in plane strain and 3D.
//!
//! `dev s` stays along `dev s*`, and with the von Mises norm `q`, the shear factor `2 G` of `E` and the growth `dp` of the
//! accumulated strain
//!
//! ```text
//! q = q* - 3 G dp,   f = q - Y,   Y = Y* + h dp,   dp = (k / (3 lambda)) (f / Y)^(n - 1) f
//! ```
//!
//! so that `f + c dp(f) = q* - Y*` with `c = 3 G + h`: increasing, and linear for `n = 1`.

use super::{Tangent, add_product, increasing_root};
use crate::{
    material::Hardening,
    tensor::{Mandel, normal_components, trace},
};

/// Flow of the step, and growth of the accumulated strain. `start` holds `q*` and `Y*`.
pub(super) fn flow<const S: usize>(
    law: &Hardening,
    trial: &Mandel<S>,
    length: f64,
    start: (f64, f64),
    tangent: Option<&mut Tangent<S>>,
) -> (Mandel<S>, f64) {
    let (norm, yield_stress) = start;
    let (shear, hardening, power) = (law.perzyna.elasticity.shear, law.modulus, law.perzyna.exponent);
    let rate = length / (3.0 * law.perzyna.relaxation);
    let stiffness = 1.5 * shear + hardening;
    let excess = norm - yield_stress;
    let growth = if power == 1.0 {
        rate * excess / (1.0 + rate * stiffness)
    } else {
        let overstress = increasing_root(0.0, excess, excess, |f| {
            let y = yield_stress + hardening * (excess - f) / stiffness;
            let ratio = (f / y).powf(power - 1.0);
            let slope = power * ratio + (power - 1.0) * hardening / stiffness * ratio * f / y;
            [f + stiffness * rate * ratio * f - excess, 1.0 + stiffness * rate * slope]
        });
        (excess - overstress) / stiffness
    };
    let mean = trace(trial) / 3.0;
    let mut deviator = *trial;
    deviator.iter_mut().take(normal_components::<S>()).for_each(|d| *d -= mean);
    if let Some(tangent) = tangent {
        let f = excess - stiffness * growth;
        let y = yield_stress + hardening * growth;
        let (by_overstress, by_yield_stress) = if power == 1.0 {
            (rate, 0.0)
        } else {
            let ratio = (f / y).powf(power - 1.0);
            (rate * power * ratio, -rate * (power - 1.0) * ratio * f / y)
        };
        let growing = by_overstress / (1.0 + stiffness * by_overstress - hardening * by_yield_stress);
        let (scale, slope) = (1.0 - 1.5 * shear * growth / norm, 1.0 - 1.5 * shear * growing);
        write_tangent(tangent, &deviator, scale, slope);
    }
    (deviator.map(|d| 1.5 * growth / norm * d), growth)
}

/// The tangent of scaling the deviator by `scale`, its length growing by `slope`.
fn write_tangent<const S: usize>(tangent: &mut Tangent<S>, deviator: &Mandel<S>, scale: f64, slope: f64) {
    let normal = normal_components::<S>();
    let square = crate::tensor::dot(deviator, deviator);
    for i in 0..S {
        for j in 0..S {
            let volumetric = if i < normal && j < normal { (1.0 - scale) / 3.0 } else { 0.0 };
            tangent[i][j] = volumetric + if i == j { scale } else { 0.0 };
        }
    }
    add_product(tangent, (slope - scale) / square, deviator, deviator);
}
