//! What a pass does with nodal values of packs of cells: gather, differentiate, scatter. Corners of a pack are `D + 1` packs of
//! nodal values; lanes without a cell hold zeros.

use super::SimplexPack;
use crate::{
    lanes::{LANES, Pack},
    tensor::component,
};
use multiversion::multiversion;

/// Gathers the values (`D` a node) of the nodes of cells (`D + 1` a cell).
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn gather<const D: usize>(nodes: &[u32], nodal: &[f64], corners: &mut [Pack<D>]) {
    let (nodal, _) = nodal.as_chunks::<D>();
    for (nodes, corners) in nodes.chunks(LANES * (D + 1)).zip(corners.chunks_exact_mut(D + 1)) {
        if nodes.len() < LANES * (D + 1) {
            corners.fill(Pack::ZERO);
            for (lane, nodes) in nodes.chunks_exact(D + 1).enumerate() {
                for (corner, &node) in corners.iter_mut().zip(nodes) {
                    corner.set(lane, nodal[node as usize]);
                }
            }
            continue;
        }
        // Four cells at a time: stores one by one would take longer than all the rest.
        for (four, nodes) in nodes.chunks_exact(4 * (D + 1)).enumerate() {
            for a in 0..=D {
                let values: [&[f64; D]; 4] =
                    std::array::from_fn(|cell| &nodal[nodes[cell * (D + 1) + a] as usize]);
                for i in 0..D {
                    let (lanes, _) = corners[a].0[i].as_chunks_mut::<4>();
                    lanes[four] = values.map(|value| value[i]);
                }
            }
        }
    }
}

/// Strains of fields with these values at the corners.
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn strains<const D: usize, const S: usize>(
    cells: &[SimplexPack<D>],
    corners: &[Pack<D>],
    strains: &mut [Pack<S>],
) {
    for ((cells, corners), strain) in cells.iter().zip(corners.chunks_exact(D + 1)).zip(strains) {
        *strain = Pack::from_lanes(|lane| {
            let along = |i: usize, j: usize| {
                let term = |a: usize| {
                    (corners[a + 1].0[i][lane] - corners[0].0[i][lane]) * cells.gradients[a].0[j][lane]
                };
                let mut sum = term(0);
                for a in 1..D {
                    sum += term(a);
                }
                sum
            };
            let mut out = [0.0; S];
            for c in 0..S {
                let (i, j, factor) = component::<S>(c);
                if i == j && i < D {
                    out[c] = along(i, i);
                } else if i < D && j < D {
                    out[c] = 0.5 * factor * (along(i, j) + along(j, i));
                }
            }
            out
        });
    }
}

/// Adds minus the divergence of stresses, integrated with the shape functions, to forces on the corners.
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn add_divergence<const D: usize, const S: usize>(
    cells: &[SimplexPack<D>],
    stresses: &[Pack<S>],
    forces: &mut [Pack<D>],
) {
    for ((cells, stress), forces) in cells.iter().zip(stresses).zip(forces.chunks_exact_mut(D + 1)) {
        let mut total = Pack::<D>::ZERO;
        for a in 1..=D {
            let force = Pack::<D>::from_lanes(|lane| {
                let mut matrix = [[0.0; D]; D];
                for c in 0..S {
                    let (i, j, factor) = component::<S>(c);
                    if i < D && j < D {
                        matrix[i][j] = cells.volume[lane] * (1.0 / factor) * stress.0[c][lane];
                        matrix[j][i] = matrix[i][j];
                    }
                }
                let gradient = cells.gradients[a - 1].lane(lane);
                std::array::from_fn(|i| crate::tensor::dot(&matrix[i], &gradient))
            });
            for i in 0..D {
                for lane in 0..LANES {
                    total.0[i][lane] += force.0[i][lane];
                    forces[a].0[i][lane] -= force.0[i][lane];
                }
            }
        }
        for i in 0..D {
            for lane in 0..LANES {
                forces[0].0[i][lane] += total.0[i][lane];
            }
        }
    }
}

/// Adds forces on the corners of cells to those of their nodes (`D` a node).
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn scatter<const D: usize>(nodes: &[u32], corners: &[Pack<D>], forces: &mut [f64]) {
    let (forces, _) = forces.as_chunks_mut::<D>();
    for (nodes, corners) in nodes.chunks(LANES * (D + 1)).zip(corners.chunks_exact(D + 1)) {
        for (nodes, lane) in nodes.chunks_exact(D + 1).zip(0..LANES) {
            for a in 0..=D {
                let force = &mut forces[nodes[a] as usize];
                for i in 0..D {
                    force[i] += corners[a].0[i][lane];
                }
            }
        }
    }
}
