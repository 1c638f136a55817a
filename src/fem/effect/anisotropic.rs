//! Stresses and energies of tensors that are not isotropic, for a pack of cells.

use crate::{
    fem::space::Batch,
    laws::material::Anisotropic,
    linear_algebra::{
        simd::Pack,
        tensor::{Mandel, add_scaled, dot},
    },
};

/// `integral of T(e) : e` over the cells of a batch.
pub(super) fn square<const D: usize, const S: usize>(
    tensor: &Anisotropic,
    batch: &Batch<D, S>,
    strain: impl Fn(usize) -> Mandel<S>,
) -> f64 {
    let of_lane = |lane| {
        let strain = strain(lane);
        batch.cells.volume[lane] * dot(&strain, &tensor.apply(&strain))
    };
    (0..batch.count).map(of_lane).sum()
}

/// Adds `factor` times the stresses of strains.
pub(super) fn add_stresses<const S: usize>(
    tensor: &Anisotropic,
    factor: f64,
    strain: &Pack<S>,
    stress: &mut Pack<S>,
) {
    *stress =
        Pack::from_lanes(|lane| add_scaled(&stress.lane(lane), factor, &tensor.apply(&strain.lane(lane))));
}
