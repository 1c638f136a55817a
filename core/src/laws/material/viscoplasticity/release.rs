//! The stress that is left after creep along its deviator: `s = R s*` with `R = 1 / (1 + x E W)`.
//!
//! `3/2 dev s` is `W s` with `W = 3/2 I - 1/2 tr I`, which shares its eigenspaces with `E`: multiples of the identity, and the rest.

use crate::{
    laws::material::Isotropic,
    linear_algebra::tensor::{Mandel, normal_components, trace, von_mises},
};

/// `W`: the square of the von Mises norm is `s : W s`, also in the plane.
pub(super) const WEIGHT: Isotropic = Isotropic { volumetric: -0.5, shear: 1.5 };

/// The strain rate along the deviator of a stress, and its size, which is a function of the von Mises norm.
#[inline]
pub(super) fn rate_along_deviator<const S: usize>(
    s: &Mandel<S>,
    growth: impl FnOnce(f64) -> f64,
) -> (Mandel<S>, f64) {
    let norm = von_mises(s);
    if norm == 0.0 {
        return ([0.0; S], 0.0);
    }
    let growth = growth(norm);
    (WEIGHT.apply(s).map(|w| growth / norm * w), growth)
}

/// A stress `s*` in a material.
pub(super) struct Release {
    /// Parts of the square of the norm of `s*`, and eigenvalues of `E W`: on multiples of the identity, and on the rest.
    pub squares: [f64; 2],
    pub stiffness: [f64; 2],
}

impl Release {
    /// Of a stress with this von Mises norm.
    pub(super) fn new<const S: usize>(trial: &Mandel<S>, norm: f64, elasticity: &Isotropic) -> Self {
        let normal = normal_components::<S>() as f64;
        let eigenvalues = |tensor: &Isotropic| [tensor.shear + normal * tensor.volumetric, tensor.shear];
        let ([e, f], [w, v]) = (eigenvalues(elasticity), eigenvalues(&WEIGHT));
        let along = w * trace(trial) * trace(trial) / normal;
        Self { squares: [along, (norm * norm - along).max(0.0)], stiffness: [e * w, f * v] }
    }

    /// Minus the derivative of the von Mises norm by the growth `x q(x)` at its start, in Pa: `3 G` where the norm is that of a deviator.
    pub(super) fn stiffness_at_start(&self) -> f64 {
        let [a, b] = self.squares;
        (a * self.stiffness[0] + b * self.stiffness[1]) / (a + b)
    }

    /// The von Mises norm at this `x`, and minus the derivative of its logarithm by that of `x`.
    pub(super) fn at(&self, x: f64) -> (f64, f64) {
        let (mut square, mut fall) = (0.0, 0.0);
        for (part, stiffness) in self.squares.iter().zip(&self.stiffness) {
            let gain = x * stiffness;
            let left = part / ((1.0 + gain) * (1.0 + gain));
            square += left;
            fall += left * gain / (1.0 + gain);
        }
        (square.sqrt(), fall / square)
    }

    /// `R` at this `x`, and its eigenvalues.
    pub(super) fn map<const S: usize>(&self, x: f64) -> (Isotropic, [f64; 2]) {
        let [a, b] = self.stiffness.map(|stiffness| 1.0 / (1.0 + x * stiffness));
        (Isotropic { volumetric: (a - b) / normal_components::<S>() as f64, shear: b }, [a, b])
    }
}
