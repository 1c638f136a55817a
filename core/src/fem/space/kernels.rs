//! What a pass does with the nodal values of a pack of cells: gather, differentiate, scatter. Lanes without a cell hold zeros.

use super::{
    SimplexPack,
    quadratic::{MOST_NODES, edges, node_count, offsets},
};
use crate::linear_algebra::{
    simd::{LANES, Pack},
    tensor::component,
};

/// A value at each node of a pack of cells; the first `D + 1` are used of linear cells.
pub type NodalPacks<const D: usize> = [Pack<D>; MOST_NODES];

/// Gathers the values of `count` nodes a cell.
#[inline(always)]
pub(super) fn gather<const D: usize>(count: usize, nodes: &[u32], nodal: &[[f64; D]], packs: &mut [Pack<D>]) {
    if nodes.len() != LANES * count {
        packs[..count].fill(Pack::ZERO);
        for (lane, nodes) in nodes.chunks_exact(count).enumerate() {
            for (pack, &node) in packs.iter_mut().zip(nodes) {
                pack.set(lane, nodal[node as usize]);
            }
        }
        return;
    }
    // Two cells at a time: half as many stores, and of what registers hold.
    for (pair, nodes) in nodes.chunks_exact(2 * count).enumerate() {
        for a in 0..count {
            let one = nodal[nodes[a] as usize];
            let other = nodal[nodes[count + a] as usize];
            for i in 0..D {
                let (pairs, _) = packs[a].0[i].as_chunks_mut::<2>();
                pairs[pair] = [one[i], other[i]];
            }
        }
    }
}

/// The values at the corners of the linear functions with the gradients that quadratic functions have at a point, as
/// [`linear_at`](crate::mesh::shape::linear_at) of one cell.
#[inline(always)]
pub(super) fn linear_at<const D: usize>(place: &[f64; 4], nodal: &NodalPacks<D>) -> [Pack<D>; 4] {
    let mut out = [Pack::ZERO; 4];
    for i in 0..D {
        for a in 0..D + 1 {
            let factor = 4.0 * place[a] - 1.0;
            for lane in 0..LANES {
                out[a].0[i][lane] = factor * nodal[a].0[i][lane];
            }
        }
        for (edge, &[a, b]) in edges(D + 1).iter().enumerate() {
            let [to_a, to_b] = [4.0 * place[b], 4.0 * place[a]];
            for lane in 0..LANES {
                let value = nodal[D + 1 + edge].0[i][lane];
                out[a].0[i][lane] += to_a * value;
                out[b].0[i][lane] += to_b * value;
            }
        }
    }
    out
}

/// Adds to the forces on nodes those that have the virtual work of forces on the corners of linear functions at a point.
#[inline(always)]
pub(super) fn add_nodal_forces<const D: usize>(
    place: &[f64; 4],
    corners: &[Pack<D>; 4],
    forces: &mut NodalPacks<D>,
) {
    for i in 0..D {
        for a in 0..D + 1 {
            let factor = 4.0 * place[a] - 1.0;
            for lane in 0..LANES {
                forces[a].0[i][lane] += factor * corners[a].0[i][lane];
            }
        }
        for (edge, &[a, b]) in edges(D + 1).iter().enumerate() {
            let [of_a, of_b] = [4.0 * place[b], 4.0 * place[a]];
            for lane in 0..LANES {
                let force = of_a * corners[a].0[i][lane] + of_b * corners[b].0[i][lane];
                forces[D + 1 + edge].0[i][lane] += force;
            }
        }
    }
}

/// Gives the linear functions of [`linear_at`] the values of the quadratic functions at the point.
#[inline(always)]
pub(super) fn add_offsets<const D: usize>(
    place: &[f64; 4],
    nodal: &NodalPacks<D>,
    corners: &mut [Pack<D>; 4],
) {
    let offsets = offsets(D + 1, place);
    for i in 0..D {
        let mut offset = [0.0; LANES];
        for a in 0..node_count::<D>() {
            for lane in 0..LANES {
                offset[lane] += offsets[a] * nodal[a].0[i][lane];
            }
        }
        for a in 0..D + 1 {
            for lane in 0..LANES {
                corners[a].0[i][lane] += offset[lane];
            }
        }
    }
}

/// Adds to the forces on nodes what [`add_nodal_forces`] omits of forces on the corners that are not balanced.
#[inline(always)]
pub(super) fn add_offset_forces<const D: usize>(
    place: &[f64; 4],
    corners: &[Pack<D>; 4],
    forces: &mut NodalPacks<D>,
) {
    let offsets = offsets(D + 1, place);
    for i in 0..D {
        for lane in 0..LANES {
            let mut total = 0.0;
            for a in 0..D + 1 {
                total += corners[a].0[i][lane];
            }
            for a in 0..node_count::<D>() {
                forces[a].0[i][lane] += offsets[a] * total;
            }
        }
    }
}

/// Strains of a field with these values at the corners; in a body of revolution with the hoop strain.
#[inline(always)]
pub(super) fn strains<const D: usize, const S: usize>(
    cells: &SimplexPack<D>,
    hoop: Option<&Pack<3>>,
    corners: &[Pack<D>],
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
    if S == 4
        && let Some(hoop) = hoop
    {
        for lane in 0..LANES {
            for a in 0..3 {
                out.0[2][lane] += hoop.0[a][lane] * corners[a].0[0][lane];
            }
        }
    }
    out
}

/// Adds minus the divergence of stresses, integrated with the shape functions, to forces on the corners.
#[inline(always)]
pub(super) fn add_divergence<const D: usize, const S: usize>(
    cells: &SimplexPack<D>,
    hoop: Option<&Pack<3>>,
    stress: &Pack<S>,
    forces: &mut [Pack<D>],
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
    if S == 4
        && let Some(hoop) = hoop
    {
        for lane in 0..LANES {
            for a in 0..3 {
                forces[a].0[0][lane] -= cells.volume[lane] * stress.0[2][lane] * hoop.0[a][lane];
            }
        }
    }
}

/// Adds forces on `count` nodes a cell to those of the body.
#[inline(always)]
pub(super) fn scatter<const D: usize>(
    count: usize,
    nodes: &[u32],
    packs: &[Pack<D>],
    forces: &mut [[f64; D]],
) {
    for (nodes, lane) in nodes.chunks_exact(count).zip(0..LANES) {
        for a in 0..count {
            let force = &mut forces[nodes[a] as usize];
            for i in 0..D {
                force[i] += packs[a].0[i][lane];
            }
        }
    }
}
