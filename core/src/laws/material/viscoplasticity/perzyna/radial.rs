//! Perzyna's law where the projection is radial, in plane strain and 3D.
//!
//! `dev s` stays along `dev s*`, and with the von Mises norm `q`, the shear factor `2 G` of `E` and the growth `dp` of the
//! accumulated strain
//!
//! ```text
//! q = q* - 3 G dp,   f = q - Y,   Y = Y* + h dp,   dp = (k / (3 lambda)) (f / Y)^(n - 1) f
//! ```
//!
//! so that `f + c dp(f) = q* - Y*` with `c = 3 G + h`, which is increasing, and linear for `n = 1`. Otherwise its logarithm is
//! solved for that of
//! `f`, so that large exponents and overstresses far above the yield stress neither need many iterations nor overflow.

use super::overstress::{Overstressed, Perzyna};
use crate::{
    laws::material::{
        Elastic,
        viscoplasticity::{
            flow::Flow,
            tangent::{Tangent, add_product, write_isotropic},
        },
    },
    linear_algebra::tensor::{Mandel, dot, normal_components, trace},
};

/// Larger than the number of iterations for any law.
const ITERATIONS: usize = 100;

/// Flow of the step, and increment of the accumulated strain, from `q*` and `Y*`.
pub(super) fn flow<const S: usize>(
    law: &Elastic<Perzyna>,
    trial: &Mandel<S>,
    length: f64,
    Overstressed { norm, yield_stress }: Overstressed,
    tangent: Option<&mut Tangent<S>>,
) -> (Mandel<S>, f64) {
    let Perzyna { relaxation, exponent: power, .. } = law.parameters;
    let (shear, hardening) = (law.stiffness::<S>().shear, law.hardening_modulus());
    let stiffness = 1.5 * shear + hardening;
    let excess = norm - yield_stress;
    let rate = length / (3.0 * relaxation);
    let equation = Equation { excess, yield_stress, power, rate, stiffness, hardening };
    let (growth, growing) = if power == 1.0 { equation.solve_linear() } else { equation.solve_power() };
    let mean = trace(trial) / 3.0;
    let mut deviator = *trial;
    deviator.iter_mut().take(normal_components::<S>()).for_each(|d| *d -= mean);
    if let Some(tangent) = tangent {
        let (scale, slope) = (1.0 - 1.5 * shear * growth / norm, 1.0 - 1.5 * shear * growing);
        write_isotropic(tangent, 1.0, scale);
        add_product(tangent, (slope - scale) / dot(&deviator, &deviator), &deviator, &deviator);
    }
    (deviator.map(|d| 1.5 * growth / norm * d), growth)
}

/// The equation of the overstress `f`.
struct Equation {
    /// `q* - Y*`.
    excess: f64,
    /// `Y*`.
    yield_stress: f64,
    /// `n`.
    power: f64,
    /// `k / (3 lambda)`.
    rate: f64,
    /// `c`.
    stiffness: f64,
    /// `h`.
    hardening: f64,
}

impl Equation {
    /// `dp`, and its derivative by `q*`, for `n = 1`.
    fn solve_linear(&self) -> (f64, f64) {
        let growing = self.rate / (1.0 + self.rate * self.stiffness);
        (growing * self.excess, growing)
    }

    /// `dp`, and its derivative by `q*`, for `n` above 1.
    fn solve_power(&self) -> (f64, f64) {
        let Self { excess, yield_stress, power, rate, stiffness, hardening } = *self;
        // The logarithm of `c dp / f`, the ratio of flow to remaining overstress; the ratio itself may overflow.
        let flow_at = |f: f64| {
            let y = yield_stress + hardening * (excess - f) / stiffness;
            ((stiffness * rate).ln() + (power - 1.0) * (f / y).ln(), y)
        };
        // Convex in the logarithm of `f`, so that Newton's method converges from above.
        let mut logarithm = excess.ln();
        for _ in 0..ITERATIONS {
            let f = logarithm.exp();
            let (flow, y) = flow_at(f);
            let slope = 1.0 + share(flow) * (power - 1.0) * (1.0 + hardening * f / (stiffness * y));
            let change = (logarithm + softplus(flow) - excess.ln()) / slope;
            logarithm -= change;
            if change.abs() <= 2.0 * f64::EPSILON * (1.0 + logarithm.abs()) {
                break;
            }
        }
        let overstress = logarithm.exp();
        let (flow, y) = flow_at(overstress);
        let by_yield_stress = hardening * (power - 1.0) * overstress / y;
        let growing = power / (stiffness * ((-flow).exp() + power) + by_yield_stress);
        (excess * share(flow) / stiffness, growing)
    }
}

/// `ln(1 + e^x)`.
fn softplus(x: f64) -> f64 {
    x.max(0.0) + (-x.abs()).exp().ln_1p()
}

/// `e^x / (1 + e^x)`.
fn share(x: f64) -> f64 {
    1.0 / (1.0 + (-x).exp())
}
