//! Derivatives of stresses at the end of a step.

use crate::linear_algebra::tensor::{Mandel, normal_components};

/// A square matrix over the components of a stress.
pub type Tangent<const S: usize> = [[f64; S]; S];

/// Writes the tangent that is `along` on multiples of the identity and `across` on the rest.
pub(super) fn write_isotropic<const S: usize>(tangent: &mut Tangent<S>, along: f64, across: f64) {
    let normal = normal_components::<S>();
    for i in 0..S {
        for j in 0..S {
            let shared = if i < normal && j < normal { (along - across) / normal as f64 } else { 0.0 };
            tangent[i][j] = shared + if i == j { across } else { 0.0 };
        }
    }
}

/// Adds `factor * a b^T`.
pub(super) fn add_product<const S: usize>(
    tangent: &mut Tangent<S>,
    factor: f64,
    a: &Mandel<S>,
    b: &Mandel<S>,
) {
    for i in 0..S {
        for j in 0..S {
            tangent[i][j] += factor * a[i] * b[j];
        }
    }
}
