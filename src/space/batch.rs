//! Passes over cells in batches that stay in cache: gather nodal values, let the effects work, scatter forces.
//!
//! A batch is of one material, so that effects look their law up once a batch.

use super::{Geometry, Simplex};
use crate::{
    mesh::Mesh,
    tensor::{Mandel, Vector, component, symmetric_part},
};
use arrayvec::ArrayVec;

/// Most cells of a batch.
pub const BATCH: usize = 128;

/// A value for each cell of a batch; nothing where it is not needed.
pub type OfCells<T> = ArrayVec<T, BATCH>;
/// A value for each node of each cell of a batch; nothing where it is not needed.
pub type OfNodes<T> = ArrayVec<T, { 4 * BATCH }>;

/// What a pass gathers for its effects.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Needs {
    /// Strain of the displacement.
    pub strain: bool,
    /// Strain of the displacement before the step.
    pub strain_before: bool,
    /// Strain of the velocity.
    pub strain_rate: bool,
    /// Velocity at the cell's nodes.
    pub velocity: bool,
    /// Change of the velocity over the last step at the cell's nodes.
    pub velocity_change: bool,
    /// Elastic stress of the displacement and the histories, before anything weakens it.
    pub elastic_stress: bool,
}

impl Needs {
    /// What either needs.
    pub fn or(self, other: Self) -> Self {
        Self {
            strain: self.strain || other.strain,
            strain_before: self.strain_before || other.strain_before,
            strain_rate: self.strain_rate || other.strain_rate,
            velocity: self.velocity || other.velocity,
            velocity_change: self.velocity_change || other.velocity_change,
            elastic_stress: self.elastic_stress || other.elastic_stress,
        }
    }
}

/// Nodal values with ghosts, `D` a node.
#[derive(Debug, Clone, Copy)]
pub struct Nodal<'a> {
    /// Displacement in m.
    pub displacement: &'a [f64],
    /// Displacement before the step in m; read where effects need its strain.
    pub previous_displacement: &'a [f64],
    /// Velocity in m/s.
    pub velocity: &'a [f64],
    /// Velocity before the last step in m/s.
    pub previous_velocity: &'a [f64],
}

/// The share of the elastic stress that each cell of a batch still bears; all of it where nothing was weakened.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Integrity(OfCells<f64>);

impl Integrity {
    /// The share of a cell, by its position in the batch.
    #[inline(always)]
    pub fn of(&self, at: usize) -> f64 {
        self.0.get(at).copied().unwrap_or(1.0)
    }

    /// Multiplies the shares of the batch's cells by these.
    pub fn weaken(&mut self, shares: impl Iterator<Item = f64>) {
        if self.0.is_empty() {
            self.0.extend(shares);
        } else {
            self.0.iter_mut().zip(shares).for_each(|(all, share)| *all *= share);
        }
    }
}

/// A run of cells with their gathered inputs and the outputs that effects add to; all on the stack of the pass.
#[derive(Debug)]
pub struct Batch<'g, const D: usize, const S: usize> {
    /// Position among the runs of the geometry.
    pub number: usize,
    /// Position among the body's materials.
    pub material: usize,
    /// Local number of the first cell.
    pub first: usize,
    /// Geometry of the cells of the batch.
    pub cells: &'g [Simplex<D>],
    /// Strain of the displacement, one a cell, if needed.
    pub strain: OfCells<Mandel<S>>,
    /// Strain of the displacement before the step, one a cell, if needed.
    pub strain_before: OfCells<Mandel<S>>,
    /// Strain of the velocity in 1/s, one a cell, if needed.
    pub strain_rate: OfCells<Mandel<S>>,
    /// Velocity, `D + 1` nodes a cell, if needed.
    pub velocity: OfNodes<Vector<D>>,
    /// Change of the velocity over the last step, `D + 1` nodes a cell, if needed.
    pub velocity_change: OfNodes<Vector<D>>,
    /// Elastic stress `E e(u) + H` in Pa before anything weakens it, one a cell, if needed; effects add to it.
    pub elastic_stress: OfCells<Mandel<S>>,
    /// What the cells still bear of it.
    pub integrity: Integrity,
    /// Output: stress in Pa, one a cell.
    pub stress: OfCells<Mandel<S>>,
    /// Output: force in N on the cell's nodes, `D + 1` a cell.
    pub force: OfNodes<Vector<D>>,
}

impl<'g, const D: usize, const S: usize> Batch<'g, D, S> {
    /// Visits all cells of the mesh in batches with the outputs zero; `visit` may read them afterwards.
    pub fn for_all(
        mesh: &Mesh<D>,
        geometry: &'g Geometry<D>,
        nodal: Nodal<'_>,
        needs: Needs,
        mut visit: impl FnMut(&mut Self),
    ) {
        let mut batch = Self {
            number: 0,
            material: 0,
            first: 0,
            cells: &[],
            strain: zeros(needs.strain, BATCH),
            strain_before: zeros(needs.strain_before, BATCH),
            strain_rate: zeros(needs.strain_rate, BATCH),
            velocity: zeros(needs.velocity, BATCH * (D + 1)),
            velocity_change: zeros(needs.velocity_change, BATCH * (D + 1)),
            elastic_stress: zeros(needs.elastic_stress, BATCH),
            integrity: Integrity::default(),
            stress: zeros(true, BATCH),
            force: zeros(true, BATCH * (D + 1)),
        };
        for (number, run) in geometry.runs.iter().enumerate() {
            (batch.number, batch.material, batch.first) = (number, run.material, run.first);
            batch.cells = &geometry.cells[run.first..run.first + run.count];
            batch.stress[..run.count].fill([0.0; S]);
            batch.force[..run.count * (D + 1)].fill([0.0; D]);
            batch.elastic_stress.fill([0.0; S]);
            batch.integrity.0.clear();
            batch.gather(mesh, nodal, needs);
            visit(&mut batch);
        }
    }

    fn gather(&mut self, mesh: &Mesh<D>, nodal: Nodal<'_>, needs: Needs) {
        let nodes = &mesh.cells[self.first * (D + 1)..(self.first + self.cells.len()) * (D + 1)];
        for (at, (cell, nodes)) in self.cells.iter().zip(nodes.chunks_exact(D + 1)).enumerate() {
            if needs.strain {
                let values = values_at::<D>(nodal.displacement, nodes);
                self.strain[at] = symmetric_part(&cell.field_gradient(&values[..=D]));
            }
            if needs.strain_before {
                let values = values_at::<D>(nodal.previous_displacement, nodes);
                self.strain_before[at] = symmetric_part(&cell.field_gradient(&values[..=D]));
            }
            if !(needs.strain_rate || needs.velocity || needs.velocity_change) {
                continue;
            }
            let values = values_at::<D>(nodal.velocity, nodes);
            if needs.strain_rate {
                self.strain_rate[at] = symmetric_part(&cell.field_gradient(&values[..=D]));
            }
            if needs.velocity {
                self.velocity[at * (D + 1)..][..=D].copy_from_slice(&values[..=D]);
            }
            if needs.velocity_change {
                let before = values_at::<D>(nodal.previous_velocity, nodes);
                for a in 0..=D {
                    self.velocity_change[at * (D + 1) + a] =
                        std::array::from_fn(|i| values[a][i] - before[a][i]);
                }
            }
        }
    }

    /// Adds the force outputs and the divergence of the stress outputs to nodal forces (`D` a node, with ghosts).
    pub fn scatter(&self, mesh: &Mesh<D>, forces: &mut [f64]) {
        let nodes = &mesh.cells[self.first * (D + 1)..(self.first + self.cells.len()) * (D + 1)];
        for (at, (cell, nodes)) in self.cells.iter().zip(nodes.chunks_exact(D + 1)).enumerate() {
            let mut matrix = [[0.0; D]; D];
            for c in 0..S {
                let (i, j, factor) = component::<S>(c);
                if i < D && j < D {
                    matrix[i][j] = self.stress[at][c] / factor;
                    matrix[j][i] = matrix[i][j];
                }
            }
            let mut first = [0.0; D];
            for a in 1..=D {
                let gradient = &cell.gradients[a - 1];
                let target = &mut forces[nodes[a] as usize * D..][..D];
                for i in 0..D {
                    let mut inner = 0.0;
                    for j in 0..D {
                        inner += matrix[i][j] * gradient[j];
                    }
                    inner *= cell.volume;
                    first[i] += inner;
                    target[i] += self.force[at * (D + 1) + a][i] - inner;
                }
            }
            let target = &mut forces[nodes[0] as usize * D..][..D];
            for i in 0..D {
                target[i] += self.force[at * (D + 1)][i] + first[i];
            }
        }
    }
}

fn zeros<const W: usize, const MOST: usize>(needed: bool, count: usize) -> ArrayVec<[f64; W], MOST> {
    std::iter::repeat_n([0.0; W], if needed { count } else { 0 }).collect()
}

#[inline(always)]
fn values_at<const D: usize>(nodal: &[f64], nodes: &[u32]) -> [Vector<D>; 4] {
    let mut out = [[0.0; D]; 4];
    for a in 0..=D {
        out[a].copy_from_slice(&nodal[nodes[a] as usize * D..][..D]);
    }
    out
}
