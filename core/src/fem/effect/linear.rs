//! Stresses and energies of linear tensors, for a pack of cells.

use crate::{
    fem::space::{Integrity, SimplexPack},
    laws::material::{Isotropic, LinearTensor},
    linear_algebra::{
        simd::{LANES, Pack, sum},
        tensor::{add_scaled, dot},
    },
};
use multiversion::multiversion;

/// Adds `factor` times the stresses of strains or strain rates, times the fractions that the cells carry.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
pub(super) fn add_stresses<T: LinearTensor, const S: usize>(
    tensor: &T,
    factor: f64,
    strain: &Pack<S>,
    integrity: &Integrity,
    stress: &mut Pack<S>,
) {
    let share = integrity.shares().map(|share| factor * share);
    *stress = Pack::from_lanes(|lane| {
        add_scaled(&stress.lane(lane), share[lane], &tensor.stress(&strain.lane(lane)))
    });
}

/// `integral of T(e) : e` over the cells, times the fractions that they carry.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
pub(super) fn square<T: LinearTensor, const D: usize, const S: usize>(
    tensor: &T,
    cells: &SimplexPack<D>,
    integrity: &Integrity,
    strain: &Pack<S>,
) -> f64 {
    let share = integrity.shares();
    let mut squares = [0.0; LANES];
    for lane in 0..LANES {
        let strain = strain.lane(lane);
        squares[lane] = share[lane] * cells.volume[lane] * dot(&strain, &tensor.stress(&strain));
    }
    sum(&squares)
}

/// `integral of s : T^-1(s)` over the cells for the stress `s = T(e) + h`, times the fractions that they carry.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
pub(super) fn inverse_square<const D: usize, const S: usize>(
    tensor: &Isotropic,
    cells: &SimplexPack<D>,
    integrity: &Integrity,
    strain: &Pack<S>,
    history: &Pack<S>,
) -> f64 {
    let share = integrity.shares();
    let mut squares = [0.0; LANES];
    for lane in 0..LANES {
        let stress = add_scaled(&tensor.apply(&strain.lane(lane)), 1.0, &history.lane(lane));
        squares[lane] = share[lane] * cells.volume[lane] * tensor.inverse_square(&stress);
    }
    sum(&squares)
}

/// Adds histories to stresses, times the fractions that the cells carry.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
pub(super) fn add_histories<const S: usize>(history: &Pack<S>, integrity: &Integrity, stress: &mut Pack<S>) {
    let share = integrity.shares();
    *stress = Pack::from_lanes(|lane| add_scaled(&stress.lane(lane), share[lane], &history.lane(lane)));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_side_by_side_are_what_they_are_one_by_one() {
        let tensor = Isotropic { volumetric: 7.0, shear: 3.0 };
        let pack = |shift: usize| -> Pack<6> {
            Pack::from_lanes(|lane| std::array::from_fn(|c| ((13 * lane + c + shift) as f64).sin()))
        };
        let [strain, history] = [pack(0), pack(100)];
        let volume = std::array::from_fn(|lane| lane as f64);
        let cells = SimplexPack::<3> { volume, gradients: [Pack::ZERO; 3] };
        let shares: [f64; LANES] = std::array::from_fn(|lane| 1.0 / (1.0 + lane as f64));
        let mut integrity = Integrity::default();
        integrity.weaken(shares);
        let mut stresses = history;
        add_stresses(&tensor, -2.0, &strain, &integrity, &mut stresses);
        let mut sums = history;
        add_histories(&strain, &integrity, &mut sums);
        let [mut squares, mut inverse_squares] = [0.0; 2];
        for lane in 0..LANES {
            let (strain, history, share) = (strain.lane(lane), history.lane(lane), shares[lane]);
            let stress = tensor.apply(&strain);
            assert_eq!(stresses.lane(lane), add_scaled(&history, -2.0 * share, &stress));
            assert_eq!(sums.lane(lane), add_scaled(&history, share, &strain));
            squares += share * volume[lane] * dot(&strain, &stress);
            let stress = add_scaled(&stress, 1.0, &history);
            inverse_squares += share * volume[lane] * tensor.inverse_square(&stress);
        }
        let found = square(&tensor, &cells, &integrity, &strain);
        assert!((found - squares).abs() < 1e-12 * squares, "{found} {squares}");
        let found = inverse_square(&tensor, &cells, &integrity, &strain, &history);
        assert!((found - inverse_squares).abs() < 1e-12 * inverse_squares, "{found} {inverse_squares}");
    }
}
