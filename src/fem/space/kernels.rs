//! What a pass does with the nodal values of a pack of cells: gather, differentiate, scatter. Lanes without a cell hold zeros.

use super::SimplexPack;
use crate::linear_algebra::{
    simd::{LANES, Pack},
    tensor::component,
};

/// A value at each node of a pack of cells; the first `D + 1` are used.
pub type Corners<const D: usize> = [Pack<D>; 4];

/// Gathers the values of the nodes of cells (`D + 1` a cell).
#[inline(always)]
pub(super) fn gather<const D: usize>(nodes: &[u32], nodal: &[[f64; D]], corners: &mut Corners<D>) {
    if nodes.len() != LANES * (D + 1) {
        corners[..=D].fill(Pack::ZERO);
        for (lane, nodes) in nodes.chunks_exact(D + 1).enumerate() {
            for (corner, &node) in corners.iter_mut().zip(nodes) {
                corner.set(lane, nodal[node as usize]);
            }
        }
        return;
    }
    // Two cells at a time: half as many stores, and of what registers hold.
    for (pair, nodes) in nodes.chunks_exact(2 * (D + 1)).enumerate() {
        for a in 0..D + 1 {
            let one = nodal[nodes[a] as usize];
            let other = nodal[nodes[D + 1 + a] as usize];
            for i in 0..D {
                let (pairs, _) = corners[a].0[i].as_chunks_mut::<2>();
                pairs[pair] = [one[i], other[i]];
            }
        }
    }
}

/// Strains of a field with these values at the corners.
#[inline(always)]
pub(super) fn strains<const D: usize, const S: usize>(
    cells: &SimplexPack<D>,
    corners: &Corners<D>,
) -> Pack<S> {
    let mut out = Pack::ZERO;
    for lane in 0..LANES {
        let mut gradient = [[0.0; D]; D];
        for i in 0..D {
            let first = corners[0].0[i][lane];
            for a in 0..D {
                let difference = corners[a + 1].0[i][lane] - first;
                for j in 0..D {
                    gradient[i][j] += difference * cells.gradients[a].0[j][lane];
                }
            }
        }
        for c in 0..S {
            let (i, j, factor) = component::<S>(c);
            if i == j && i < D {
                out.0[c][lane] = gradient[i][i];
            } else if i < D && j < D {
                out.0[c][lane] = 0.5 * factor * (gradient[i][j] + gradient[j][i]);
            }
        }
    }
    out
}

/// Adds minus the divergence of stresses, integrated with the shape functions, to forces on the corners.
#[inline(always)]
pub(super) fn add_divergence<const D: usize, const S: usize>(
    cells: &SimplexPack<D>,
    stress: &Pack<S>,
    forces: &mut Corners<D>,
) {
    for lane in 0..LANES {
        let mut inner = [[0.0; D]; D];
        for c in 0..S {
            let (i, j, factor) = component::<S>(c);
            if i < D && j < D {
                inner[i][j] = cells.volume[lane] * (1.0 / factor) * stress.0[c][lane];
                inner[j][i] = inner[i][j];
            }
        }
        for i in 0..D {
            let mut total = 0.0;
            for a in 0..D {
                let mut force = 0.0;
                for j in 0..D {
                    force += inner[i][j] * cells.gradients[a].0[j][lane];
                }
                total += force;
                forces[a + 1].0[i][lane] -= force;
            }
            forces[0].0[i][lane] += total;
        }
    }
}

/// Adds forces on the corners of cells to those of their nodes.
#[inline(always)]
pub(super) fn scatter<const D: usize>(nodes: &[u32], corners: &Corners<D>, forces: &mut [[f64; D]]) {
    for (nodes, lane) in nodes.chunks_exact(D + 1).zip(0..LANES) {
        for a in 0..D + 1 {
            let force = &mut forces[nodes[a] as usize];
            for i in 0..D {
                force[i] += corners[a].0[i][lane];
            }
        }
    }
}
