//! Passes over cells in batches that stay in cache: gather nodal values, let the effects work, scatter forces.
//!
//! A batch is of one material, so that effects look their law up once a batch.

use super::{Geometry, SimplexPack, kernels};
use crate::{
    lanes::{LANES, Pack},
    mesh::Mesh,
    tensor::add_scaled,
};
use arrayvec::ArrayVec;

/// Most cells of a batch, a multiple of the lanes.
pub const BATCH: usize = 16;

/// A value for each pack of cells of a batch; nothing where it is not needed.
pub type OfCells<T> = ArrayVec<T, { BATCH / LANES }>;
/// A value for each node of each pack of cells of a batch; nothing where it is not needed.
pub type OfNodes<T> = ArrayVec<T, { 4 * BATCH / LANES }>;

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
pub struct Integrity(OfCells<[f64; LANES]>);

impl Integrity {
    /// The shares of a pack of cells, by its position in the batch.
    #[inline(always)]
    pub fn of(&self, pack: usize) -> [f64; LANES] {
        self.0.get(pack).copied().unwrap_or([1.0; LANES])
    }

    /// Multiplies the shares of the batch's cells by these, pack by pack.
    pub fn weaken(&mut self, shares: impl Iterator<Item = [f64; LANES]>) {
        if self.0.is_empty() {
            self.0.extend(shares);
        } else {
            let all = self.0.as_flattened_mut().iter_mut();
            all.zip(shares.flatten()).for_each(|(all, share)| *all *= share);
        }
    }
}

/// A run of cells in packs, with their gathered inputs and the outputs that effects add to. Fields that are needed have one pack
/// for each pack of cells, or `D + 1` where they are of nodes; the others are empty. All is on the
/// stack of the pass.
#[derive(Debug)]
pub struct Batch<'g, const D: usize, const S: usize> {
    /// Position among the runs of the geometry.
    pub number: usize,
    /// Position among the body's materials.
    pub material: usize,
    /// Local number of the first cell.
    pub first: usize,
    /// Number of cells.
    pub count: usize,
    /// Geometry of the cells of the batch.
    pub cells: &'g [SimplexPack<D>],
    /// Strain of the displacement.
    pub strain: OfCells<Pack<S>>,
    /// Strain of the displacement before the step.
    pub strain_before: OfCells<Pack<S>>,
    /// Strain of the velocity in 1/s.
    pub strain_rate: OfCells<Pack<S>>,
    /// Velocity at the nodes of cells.
    pub velocity: OfNodes<Pack<D>>,
    /// Change of the velocity over the last step at the nodes of cells.
    pub velocity_change: OfNodes<Pack<D>>,
    /// Elastic stress `E e(u) + H` in Pa before anything weakens it; effects add to it.
    pub elastic_stress: OfCells<Pack<S>>,
    /// What the cells still bear of it.
    pub integrity: Integrity,
    /// Output: stress in Pa.
    pub stress: OfCells<Pack<S>>,
    /// Output: force in N on the nodes of cells.
    pub force: OfNodes<Pack<D>>,
    /// Nodal values that only strains are made of.
    corners: OfNodes<Pack<D>>,
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
            count: 0,
            cells: &[],
            strain: ArrayVec::new(),
            strain_before: ArrayVec::new(),
            strain_rate: ArrayVec::new(),
            velocity: ArrayVec::new(),
            velocity_change: ArrayVec::new(),
            elastic_stress: ArrayVec::new(),
            integrity: Integrity::default(),
            stress: ArrayVec::new(),
            force: ArrayVec::new(),
            corners: ArrayVec::new(),
        };
        for (number, run) in geometry.runs.iter().enumerate() {
            (batch.number, batch.material) = (number, run.material);
            (batch.first, batch.count) = (run.first, run.count);
            batch.cells = geometry.of_run(run);
            geometry.runs.get(number + 1).into_iter().for_each(|next| geometry.prefetch(next));
            batch.clear(needs);
            batch.gather(mesh, nodal, needs);
            visit(&mut batch);
        }
    }

    /// Fits all fields to the number of packs and makes those zero that effects add to.
    fn clear(&mut self, needs: Needs) {
        let packs = self.cells.len();
        let length = |needed: bool| if needed { packs } else { 0 };
        fit(&mut self.strain, length(needs.strain), Pack::ZERO);
        fit(&mut self.strain_before, length(needs.strain_before), Pack::ZERO);
        fit(&mut self.strain_rate, length(needs.strain_rate), Pack::ZERO);
        fit(&mut self.velocity, length(needs.velocity) * (D + 1), Pack::ZERO);
        fit(&mut self.velocity_change, length(needs.velocity_change) * (D + 1), Pack::ZERO);
        fit(&mut self.corners, packs * (D + 1), Pack::ZERO);
        clear(&mut self.elastic_stress, length(needs.elastic_stress), Pack::ZERO);
        clear(&mut self.stress, packs, Pack::ZERO);
        clear(&mut self.force, packs * (D + 1), Pack::ZERO);
        self.integrity.0.clear();
    }

    fn nodes<'m>(&self, mesh: &'m Mesh<D>) -> &'m [u32] {
        &mesh.cells[self.first * (D + 1)..(self.first + self.count) * (D + 1)]
    }

    fn gather(&mut self, mesh: &Mesh<D>, nodal: Nodal<'_>, needs: Needs) {
        let nodes = self.nodes(mesh);
        if needs.strain {
            kernels::gather(nodes, nodal.displacement, &mut self.corners);
            kernels::strains(self.cells, &self.corners, &mut self.strain);
        }
        if needs.strain_before {
            kernels::gather(nodes, nodal.previous_displacement, &mut self.corners);
            kernels::strains(self.cells, &self.corners, &mut self.strain_before);
        }
        let velocity = if needs.velocity { &mut self.velocity } else { &mut self.corners };
        if needs.strain_rate || needs.velocity || needs.velocity_change {
            kernels::gather(nodes, nodal.velocity, velocity);
        }
        if needs.strain_rate {
            kernels::strains(self.cells, velocity, &mut self.strain_rate);
        }
        if needs.velocity_change {
            kernels::gather(nodes, nodal.previous_velocity, &mut self.velocity_change);
            for (change, velocity) in self.velocity_change.iter_mut().zip(velocity) {
                *change = Pack::from_lanes(|lane| add_scaled(&velocity.lane(lane), -1.0, &change.lane(lane)));
            }
        }
    }

    /// Adds the force outputs and the divergence of the stress outputs to nodal forces (`D` a node, with ghosts).
    pub fn scatter(&mut self, mesh: &Mesh<D>, forces: &mut [f64]) {
        kernels::add_divergence(self.cells, &self.stress, &mut self.force);
        kernels::scatter(self.nodes(mesh), &self.force, forces);
    }
}

/// Makes a list this long; what it keeps are values of the batch before.
fn fit<T: Copy, const MOST: usize>(list: &mut ArrayVec<T, MOST>, length: usize, zero: T) {
    list.truncate(length);
    list.extend(std::iter::repeat_n(zero, length - list.len()));
}

/// Makes a list this long, of zeros.
fn clear<T: Copy, const MOST: usize>(list: &mut ArrayVec<T, MOST>, length: usize, zero: T) {
    list.clear();
    fit(list, length, zero);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::place;
    use crate::tensor::{Mandel, Vector, apply, symmetric_part};

    fn number(i: usize) -> f64 {
        (i as f64 * 1.7).sin()
    }

    fn close<const N: usize>(found: [f64; N], expected: [f64; N]) {
        for i in 0..N {
            assert!(
                (found[i] - expected[i]).abs() <= 1e-12 * (1.0 + expected[i].abs()),
                "{found:?} {expected:?}"
            );
        }
    }

    /// Runs of one cell, of some, of two batches and a rest, and of full packs.
    fn regions() -> Vec<u16> {
        let lengths = [1, 5, 2 * BATCH + 3, 2 * LANES, LANES + 1];
        lengths.iter().enumerate().flat_map(|(region, &length)| vec![region as u16; length]).collect()
    }

    fn check<const D: usize, const S: usize>() {
        let cell_regions = regions();
        let count = cell_regions.len();
        let total = count + D;
        let node = |i: usize| {
            std::array::from_fn(|j| 3.0 * number(5 * i + j) + if i % (D + 1) == j { 9.0 } else { 0.0 })
        };
        let mesh = Mesh::<D> {
            nodes: (0..total).map(node).collect(),
            cells: (0..count).flat_map(|cell| (cell..=cell + D).map(|node| node as u32)).collect(),
            cell_regions,
            ..Mesh::default()
        };
        let geometry = Geometry::with_materials(&mesh, |region| region);
        let values = |shift: usize| -> Vec<f64> { (0..total * D).map(|i| number(i + shift)).collect() };
        let [u, v, w] = [values(0), values(11), values(29)];
        let nodal =
            Nodal { displacement: &u, previous_displacement: &w, velocity: &v, previous_velocity: &w };
        let needs = Needs {
            strain: true,
            strain_before: true,
            strain_rate: true,
            velocity: true,
            velocity_change: true,
            elastic_stress: false,
        };
        let [mut forces, mut expected] = [vec![0.0; total * D], vec![0.0; total * D]];
        let mut visited = 0;
        Batch::<D, S>::for_all(&mesh, &geometry, nodal, needs, |batch| {
            for at in 0..batch.count {
                let (pack, lane) = place(at);
                let (cell, nodes) = (geometry.cell(batch.first + at), mesh.cell(batch.first + at));
                let of = |all: &[f64]| -> Vec<Vector<D>> {
                    nodes.iter().map(|&n| std::array::from_fn(|i| all[n as usize * D + i])).collect()
                };
                let strain = |all: &[f64]| symmetric_part(&cell.field_gradient(&of(all)));
                close(batch.strain[pack].lane(lane), strain(&u));
                close(batch.strain_before[pack].lane(lane), strain(&w));
                close(batch.strain_rate[pack].lane(lane), strain(&v));
                let stress: Mandel<S> = std::array::from_fn(|c| number(S * (batch.first + at) + c));
                batch.stress[pack].set(lane, stress);
                for a in 0..=D {
                    let (velocity, before) = (of(&v)[a], of(&w)[a]);
                    assert_eq!(batch.velocity[pack * (D + 1) + a].lane(lane), velocity);
                    let change = batch.velocity_change[pack * (D + 1) + a].lane(lane);
                    assert_eq!(change, std::array::from_fn(|i| velocity[i] - before[i]));
                    let force: Vector<D> = std::array::from_fn(|i| number(7 * at + a + i));
                    batch.force[pack * (D + 1) + a].set(lane, force);
                    let inner = apply::<D, S>(&stress, &cell.gradient(a));
                    for i in 0..D {
                        expected[nodes[a] as usize * D + i] += force[i] - cell.volume * inner[i];
                    }
                }
                visited += 1;
            }
            for (pack, lane) in (batch.count..batch.cells.len() * LANES).map(place) {
                assert_eq!(batch.strain[pack].lane(lane), [0.0; S]);
                assert_eq!(batch.cells[pack].volume[lane], 0.0);
                batch.stress[pack].set(lane, [1e9; S]);
            }
            batch.scatter(&mesh, &mut forces);
        });
        assert_eq!(visited, count);
        for (found, expected) in forces.iter().zip(&expected) {
            close([*found], [*expected]);
        }
    }

    #[test]
    fn cells_side_by_side_are_what_they_are_one_by_one() {
        check::<2, 3>();
        check::<2, 4>();
        check::<3, 6>();
    }

    #[test]
    fn shares_multiply_and_are_whole_where_nothing_weakens() {
        let mut integrity = Integrity::default();
        assert_eq!(integrity.of(3), [1.0; LANES]);
        integrity.weaken([[0.5; LANES], [0.25; LANES]].into_iter());
        integrity.weaken([[0.5; LANES], [1.0; LANES]].into_iter());
        assert_eq!([integrity.of(0)[0], integrity.of(1)[LANES - 1]], [0.25, 0.25]);
    }
}
