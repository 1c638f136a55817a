//! Laws whose implicit step is linear, piece by piece.

use super::{Tangent, add_product};
use crate::{
    material::{DruckerPrager, Maxwell},
    tensor::{Mandel, dot, normal_components, trace},
};
use std::f64::consts::FRAC_1_SQRT_2;

/// Flow under Maxwell's law: `E` and the dashpots share their eigenspaces, the multiples of the identity and its
/// complement.
pub(super) fn maxwell<const S: usize>(
    law: &Maxwell,
    trial: &Mandel<S>,
    length: f64,
    tangent: Option<&mut Tangent<S>>,
) -> Mandel<S> {
    let normal = normal_components::<S>();
    let [along, across] = law.decay_rates::<S>().map(|rate| 1.0 / (1.0 + length * rate));
    let mean = trace(trial) / normal as f64;
    let mut stress = trial.map(|s| across * s);
    stress.iter_mut().take(normal).for_each(|s| *s += (along - across) * mean);
    if let Some(tangent) = tangent {
        for i in 0..S {
            for j in 0..S {
                let shared = if i < normal && j < normal { (along - across) / normal as f64 } else { 0.0 };
                tangent[i][j] = shared + if i == j { across } else { 0.0 };
            }
        }
    }
    law.strain_rate(&stress).map(|rate| length * rate)
}

/// Flow under the law of Drucker and Prager, outside the cone.
///
/// With `eta = k / (2 lambda)`, the factors `K'` and `2 G` of `E` on mean and deviator and the multiplier
/// `m = f / (alpha² / 3 + 1/2)` of the projection, the mean stress falls by `eta K' m alpha / 3` and the deviator's length
/// by `eta 2 G m / √2`; so `f* = f (1 + eta (G + K' alpha² / 3) / (alpha² / 3 + 1/2))`. Beyond the apex both distances to
/// it shrink on their own, by `1 + eta K'` and `1 + eta 2 G`.
pub(super) fn drucker_prager<const S: usize>(
    law: &DruckerPrager,
    trial: &Mandel<S>,
    length: f64,
    tangent: Option<&mut Tangent<S>>,
) -> Option<Mandel<S>> {
    let alpha = law.friction_coefficient;
    let mean = trace(trial) / 3.0;
    let mut deviator = *trial;
    deviator.iter_mut().take(3).for_each(|d| *d -= mean);
    let size = dot(&deviator, &deviator).sqrt();
    let beyond = size * FRAC_1_SQRT_2 + alpha * mean - law.cohesion;
    if beyond <= 0.0 {
        return None;
    }
    let eta = 0.5 * length / law.relaxation;
    let (shear, bulk) = (law.elasticity.shear, law.elasticity.shear + 3.0 * law.elasticity.volumetric);
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
            isotropic(tangent, 1.0 - fall(bulk * alpha * alpha / 3.0), scale);
            add_product(tangent, 1.0 - fall(0.5 * shear) - scale, &direction, &direction);
            let mixed = fall(alpha / 3.0 * FRAC_1_SQRT_2);
            add_product(tangent, -mixed * bulk, &identity, &direction);
            add_product(tangent, -mixed * shear, &direction, &identity);
        }
        let mut flow = direction.map(|d| eta * multiplier * FRAC_1_SQRT_2 * d);
        flow.iter_mut().take(3).for_each(|f| *f += eta * multiplier * alpha / 3.0);
        return Some(flow);
    }
    let (along, across) = (1.0 / (1.0 + eta * bulk), 1.0 / (1.0 + eta * shear));
    if let Some(tangent) = tangent {
        isotropic(tangent, along, across);
    }
    let mut flow = deviator.map(|d| eta * across * d);
    flow.iter_mut().take(3).for_each(|f| *f += eta * along * (mean - law.cohesion / alpha));
    Some(flow)
}

/// `along` on the mean stress, `across` on the deviator.
fn isotropic<const S: usize>(tangent: &mut Tangent<S>, along: f64, across: f64) {
    for i in 0..S {
        for j in 0..S {
            let mean = if i < 3 && j < 3 { (along - across) / 3.0 } else { 0.0 };
            tangent[i][j] = mean + if i == j { across } else { 0.0 };
        }
    }
}
