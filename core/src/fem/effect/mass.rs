//! Forces and energies of the consistent mass matrix, for a pack of cells.

use crate::{
    fem::space::{
        Batch, CellShape, MOST_NODES, MOST_POINTS, MassCoefficients, NodalPacks, OPPOSITE, SimplexPack,
        cell_rule, edges, fine_cell_rule,
    },
    laws::material::ByMaterial,
    linear_algebra::simd::{LANES, sum},
};
use multiversion::multiversion;

/// Adds `factor * M v` to the forces of a batch; of quadratic cells at their first point.
pub(super) fn add_to_batch<const D: usize, const S: usize>(
    density: &ByMaterial<f64>,
    factor: f64,
    batch: &mut Batch<D, S>,
) {
    let Some(density) = density.get(batch.material).filter(|_| batch.point == 0) else { return };
    let factor = factor * density;
    match batch.shape {
        CellShape::Linear => {
            let factor = factor / ((D + 1) * (D + 2)) as f64;
            add(factor, batch.cells, &batch.velocity, &mut batch.force);
        }
        CellShape::Straight => add_straight(factor, batch.cells, &batch.velocity, &mut batch.force),
        CellShape::Curved(weights) | CellShape::LinearRing(weights) => {
            add_weighted((batch.shape, weights), factor, &batch.velocity, &mut batch.force);
        }
    }
}

/// `integral of density w . w` over the cells of a batch with these nodal values; of quadratic cells all of it at their first point.
pub(super) fn square<const D: usize, const S: usize>(
    density: f64,
    batch: &Batch<D, S>,
    nodal: &NodalPacks<D>,
) -> f64 {
    match batch.shape {
        CellShape::Linear => square_linear(density, batch.cells, nodal),
        _ if batch.point > 0 => 0.0,
        CellShape::Straight => square_straight(density, batch.cells, nodal),
        CellShape::Curved(weights) | CellShape::LinearRing(weights) => {
            square_weighted((batch.shape, weights), density, nodal)
        }
    }
}

/// Adds `factor * volume` times each nodal velocity and the sum of them all to the nodal forces.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
fn add<const D: usize>(
    factor: f64,
    cells: &SimplexPack<D>,
    velocities: &NodalPacks<D>,
    forces: &mut NodalPacks<D>,
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
fn square_linear<const D: usize>(density: f64, cells: &SimplexPack<D>, nodal: &NodalPacks<D>) -> f64 {
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

/// The factor of [`times_straight`], given the weights of points of quadratic cells.
fn straight_factor<const D: usize>(density: f64) -> f64 {
    density * MassCoefficients::of::<D>().scale * cell_rule::<D>().len() as f64
}

/// The mass matrix of a quadratic cell with straight sides times component `i` of nodal values, without its scale and volume.
#[inline(always)]
fn times_straight<const D: usize>(nodal: &NodalPacks<D>, i: usize, lane: usize) -> [f64; MOST_NODES] {
    let form = MassCoefficients::of::<D>();
    let value = |node: usize| nodal[node].0[i][lane];
    let (mut of_corners, mut of_edges) = (0.0, 0.0);
    for a in 0..D + 1 {
        of_corners += value(a);
    }
    for e in 0..D * (D + 1) / 2 {
        of_edges += value(D + 1 + e);
    }
    let mut out = [0.0; MOST_NODES];
    for a in 0..D + 1 {
        out[a] = form.corner[0] * value(a) + form.corner[1] * of_corners + form.mixed[0] * of_edges;
    }
    for (e, &[a, b]) in edges(D + 1).iter().enumerate() {
        let own = value(D + 1 + e);
        out[a] += form.mixed[1] * own;
        out[b] += form.mixed[1] * own;
        out[D + 1 + e] = form.edge[0] * own
            + form.edge[1] * of_edges
            + form.mixed[0] * of_corners
            + form.mixed[1] * (value(a) + value(b));
        if D == 3 {
            out[D + 1 + e] += form.edge[2] * value(D + 1 + OPPOSITE[e]);
        }
    }
    out
}

/// The shape of cells whose mass is summed over the points of the fine rule, and the weights of these points.
type Weighted<'a> = (CellShape<'a>, &'a [[f64; LANES]; MOST_POINTS]);

/// The mass matrix of a cell of density 1 times component `i` of nodal values.
#[inline(always)]
fn times_weighted<const D: usize>(
    (shape, weights): Weighted,
    nodal: &NodalPacks<D>,
    i: usize,
    lane: usize,
) -> [f64; MOST_NODES] {
    let (nodes, mut out) = (shape.nodes::<D>(), [0.0; MOST_NODES]);
    for ((place, _), weights) in fine_cell_rule::<D>().iter().zip(weights) {
        let shares = shape.values::<D>(place);
        let mut value = 0.0;
        for a in 0..nodes {
            value += shares[a] * nodal[a].0[i][lane];
        }
        for a in 0..nodes {
            out[a] += weights[lane] * shares[a] * value;
        }
    }
    out
}

#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
fn add_straight<const D: usize>(
    factor: f64,
    cells: &SimplexPack<D>,
    velocities: &NodalPacks<D>,
    forces: &mut NodalPacks<D>,
) {
    let factor = straight_factor::<D>(factor);
    for i in 0..D {
        for lane in 0..LANES {
            let momentum = times_straight(velocities, i, lane);
            let factor = factor * cells.volume[lane];
            for a in 0..D + 1 + D * (D + 1) / 2 {
                forces[a].0[i][lane] += factor * momentum[a];
            }
        }
    }
}

#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
fn square_straight<const D: usize>(density: f64, cells: &SimplexPack<D>, nodal: &NodalPacks<D>) -> f64 {
    let mut integrals = [0.0; LANES];
    for i in 0..D {
        for lane in 0..LANES {
            let momentum = times_straight(nodal, i, lane);
            let mut sum = 0.0;
            for a in 0..D + 1 + D * (D + 1) / 2 {
                sum += momentum[a] * nodal[a].0[i][lane];
            }
            integrals[lane] += cells.volume[lane] * sum;
        }
    }
    straight_factor::<D>(density) * sum(&integrals)
}

fn add_weighted<const D: usize>(
    weighted: Weighted,
    factor: f64,
    velocities: &NodalPacks<D>,
    forces: &mut NodalPacks<D>,
) {
    for i in 0..D {
        for lane in 0..LANES {
            let momentum = times_weighted(weighted, velocities, i, lane);
            for (force, momentum) in forces.iter_mut().zip(momentum).take(weighted.0.nodes::<D>()) {
                force.0[i][lane] += factor * momentum;
            }
        }
    }
}

fn square_weighted<const D: usize>(weighted: Weighted, density: f64, nodal: &NodalPacks<D>) -> f64 {
    let mut integrals = [0.0; LANES];
    for i in 0..D {
        for lane in 0..LANES {
            let momentum = times_weighted(weighted, nodal, i, lane);
            let products = momentum.iter().zip(nodal).map(|(m, value)| m * value.0[i][lane]);
            integrals[lane] += products.take(weighted.0.nodes::<D>()).sum::<f64>();
        }
    }
    density * sum(&integrals)
}
