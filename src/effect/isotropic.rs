//! Stresses and energies of isotropic tensors, pack by pack.

use crate::{
    lanes::{LANES, Pack},
    material::Isotropic,
    space::{Integrity, SimplexPack},
    tensor::{add_scaled, dot},
};
use multiversion::multiversion;

/// Adds `factor` times the stresses of strains or strain rates, as far as the cells bear them.
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn add_stresses<const S: usize>(
    tensor: &Isotropic,
    factor: f64,
    strains: &[Pack<S>],
    integrity: &Integrity,
    stresses: &mut [Pack<S>],
) {
    for (pack, (stress, strain)) in stresses.iter_mut().zip(strains).enumerate() {
        let share = integrity.of(pack).map(|share| factor * share);
        *stress = Pack::from_lanes(|lane| {
            add_scaled(&stress.lane(lane), share[lane], &tensor.apply(&strain.lane(lane)))
        });
    }
}

/// `integral of T(e) : e` over the cells, as far as they bear it.
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn square<const D: usize, const S: usize>(
    tensor: &Isotropic,
    cells: &[SimplexPack<D>],
    integrity: &Integrity,
    strains: &[Pack<S>],
) -> f64 {
    let mut sums = [0.0; LANES];
    for (pack, (cells, strain)) in cells.iter().zip(strains).enumerate() {
        let share = integrity.of(pack);
        for lane in 0..LANES {
            let strain = strain.lane(lane);
            sums[lane] += share[lane] * cells.volume[lane] * dot(&strain, &tensor.apply(&strain));
        }
    }
    sums.iter().sum()
}

/// `integral of s : T^-1(s)` over the cells of the stresses `s = T(e) + h`, as far as they bear them.
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn inverse_square<const D: usize, const S: usize>(
    tensor: &Isotropic,
    cells: &[SimplexPack<D>],
    integrity: &Integrity,
    strains: &[Pack<S>],
    histories: &[Pack<S>],
) -> f64 {
    let mut sums = [0.0; LANES];
    let packs = cells.iter().zip(strains).zip(histories);
    for (pack, ((cells, strain), history)) in packs.enumerate() {
        let share = integrity.of(pack);
        for lane in 0..LANES {
            let stress = add_scaled(&tensor.apply(&strain.lane(lane)), 1.0, &history.lane(lane));
            sums[lane] += share[lane] * cells.volume[lane] * tensor.inverse_square(&stress);
        }
    }
    sums.iter().sum()
}

/// Adds histories to stresses, as far as the cells bear them.
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn add_histories<const S: usize>(
    histories: &[Pack<S>],
    integrity: &Integrity,
    stresses: &mut [Pack<S>],
) {
    for (pack, (stress, history)) in stresses.iter_mut().zip(histories).enumerate() {
        let share = integrity.of(pack);
        *stress = Pack::from_lanes(|lane| add_scaled(&stress.lane(lane), share[lane], &history.lane(lane)));
    }
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
        let [strains, histories] = [[pack(0), pack(50)], [pack(100), pack(150)]];
        let volume = std::array::from_fn(|lane| lane as f64);
        let cells = [SimplexPack::<3> { volume, gradients: [Pack::ZERO; 3] }; 2];
        let shares: [[f64; LANES]; 2] = [[0.5; LANES], std::array::from_fn(|lane| 1.0 / (1.0 + lane as f64))];
        let mut integrity = Integrity::default();
        integrity.weaken(shares.into_iter());
        let mut stresses = histories;
        add_stresses(&tensor, -2.0, &strains, &integrity, &mut stresses);
        let [mut squares, mut inverse_squares] = [0.0; 2];
        for pack in 0..2 {
            for lane in 0..LANES {
                let (strain, history) = (strains[pack].lane(lane), histories[pack].lane(lane));
                let stress = tensor.apply(&strain);
                let share = shares[pack][lane];
                assert_eq!(stresses[pack].lane(lane), add_scaled(&history, -2.0 * share, &stress));
                squares += share * volume[lane] * dot(&strain, &stress);
                let stress = add_scaled(&stress, 1.0, &history);
                inverse_squares += share * volume[lane] * tensor.inverse_square(&stress);
            }
        }
        let found = square(&tensor, &cells, &integrity, &strains);
        assert!((found - squares).abs() < 1e-12 * squares, "{found} {squares}");
        let found = inverse_square(&tensor, &cells, &integrity, &strains, &histories);
        assert!((found - inverse_squares).abs() < 1e-12 * inverse_squares, "{found} {inverse_squares}");
    }
}
