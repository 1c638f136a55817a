//! Forces and energies of the consistent mass matrix, for a pack of cells.

use crate::{
    fem::space::{Batch, Corners, SimplexPack},
    laws::material::ByMaterial,
    linear_algebra::simd::{LANES, sum},
};
use multiversion::multiversion;

/// Adds `factor * M v` to the forces of a batch.
pub(super) fn add_to_batch<const D: usize, const S: usize>(
    density: &ByMaterial<f64>,
    factor: f64,
    batch: &mut Batch<D, S>,
) {
    let Some(density) = density.get(batch.material) else { return };
    let factor = factor * density / ((D + 1) * (D + 2)) as f64;
    add(factor, batch.cells, &batch.velocity, &mut batch.force);
}

/// Adds `factor * volume` times each nodal velocity and the sum of them all to the nodal forces.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
fn add<const D: usize>(
    factor: f64,
    cells: &SimplexPack<D>,
    velocities: &Corners<D>,
    forces: &mut Corners<D>,
) {
    for lane in 0..LANES {
        let factor = factor * cells.volume[lane];
        for i in 0..D {
            let mut total = velocities[0].0[i][lane];
            for a in 0..D {
                total += velocities[a + 1].0[i][lane];
            }
            for a in 0..D + 1 {
                forces[a].0[i][lane] += factor * (total + velocities[a].0[i][lane]);
            }
        }
    }
}

/// `integral of density w . w` over cells with these nodal values.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
pub(super) fn square<const D: usize>(density: f64, cells: &SimplexPack<D>, nodal: &Corners<D>) -> f64 {
    let factor = density / ((D + 1) * (D + 2)) as f64;
    let mut integrals = [0.0; LANES];
    for lane in 0..LANES {
        let mut sum = 0.0;
        for i in 0..D {
            let (mut total, mut squares) = (0.0, 0.0);
            for a in 0..D + 1 {
                let w = nodal[a].0[i][lane];
                total += w;
                squares += w * w;
            }
            sum += total * total + squares;
        }
        integrals[lane] = cells.volume[lane] * sum;
    }
    factor * sum(&integrals)
}
