//! Passes over cells, a pack of them at a time: gather nodal values, let the effects work, scatter forces.
//!
//! A batch is a pack of cells of one material, so that an effect looks up its law once per batch.

use super::{Geometry, SimplexPack, kernels, kernels::Corners};
use crate::{
    linear_algebra::{
        simd::{LANES, Pack, sum},
        tensor::add_scaled,
    },
    mesh::Mesh,
};
use multiversion::multiversion;

/// The fields that a pass gathers for its effects.
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
    /// The union of both.
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

/// Nodal fields with ghosts, `D` values a node.
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

impl<'a> Nodal<'a> {
    /// The same values for all fields, where a pass reads only one of them.
    pub fn all(values: &'a [f64]) -> Self {
        Self {
            displacement: values,
            previous_displacement: values,
            velocity: values,
            previous_velocity: values,
        }
    }
}

/// The fraction of the elastic stress that each cell of a batch carries: 1 where nothing weakens it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Integrity(Option<[f64; LANES]>);

impl Integrity {
    /// The fractions of the cells.
    #[inline(always)]
    pub fn shares(&self) -> [f64; LANES] {
        self.0.unwrap_or([1.0; LANES])
    }

    /// Multiplies the fractions of the cells by these.
    pub fn weaken(&mut self, shares: [f64; LANES]) {
        let all = self.shares();
        self.0 = Some(std::array::from_fn(|lane| all[lane] * shares[lane]));
    }
}

/// A pack of cells, with their gathered inputs and the outputs that effects add to. Fields that nothing needs are absent
/// ([`Pack::ABSENT`]). A pass keeps its batch on the stack.
#[derive(Debug)]
pub struct Batch<'g, const D: usize, const S: usize> {
    /// Position among the packs of the geometry.
    pub number: usize,
    /// Position among the body's materials.
    pub material: usize,
    /// Local number of the first cell.
    pub first: usize,
    /// Number of cells.
    pub count: usize,
    /// Geometry of the cells of the batch.
    pub cells: &'g SimplexPack<D>,
    /// Strain of the displacement.
    pub strain: Pack<S>,
    /// Strain of the displacement before the step.
    pub strain_before: Pack<S>,
    /// Strain of the velocity in 1/s.
    pub strain_rate: Pack<S>,
    /// Velocity at the nodes of cells.
    pub velocity: Corners<D>,
    /// Change of the velocity over the last step at the nodes of cells.
    pub velocity_change: Corners<D>,
    /// Elastic stress `E e(u) + H` in Pa before anything weakens it; effects add to it.
    pub elastic_stress: Pack<S>,
    /// Elastic stress in Pa before the step; present in the energy balance of an implicit step.
    pub elastic_stress_before: Pack<S>,
    /// The fraction of the elastic stress that the cells carry.
    pub integrity: Integrity,
    /// Output: stress in Pa.
    pub stress: Pack<S>,
    /// Output: force in N on the nodes of cells.
    pub force: Corners<D>,
    /// Nodal values from which only strains are computed.
    corners: [Corners<D>; 2],
}

impl<'g, const D: usize, const S: usize> Batch<'g, D, S> {
    /// Visits all cells of the mesh in batches with the outputs zero; `visit` may read them afterwards.
    pub fn for_all(
        mesh: &Mesh<D>,
        geometry: &'g Geometry<D>,
        nodal: Nodal<'_>,
        needs: Needs,
        visit: impl FnMut(&mut Self),
    ) {
        Self::for_each(0..geometry.packs.len(), (mesh, geometry), nodal, needs, visit);
    }

    /// Visits the packs of cells with these numbers in the same way.
    pub fn for_each(
        numbers: impl Iterator<Item = usize>,
        (mesh, geometry): (&Mesh<D>, &'g Geometry<D>),
        nodal: Nodal<'_>,
        needs: Needs,
        mut visit: impl FnMut(&mut Self),
    ) {
        let Some(first) = geometry.packs.first() else { return };
        let mut batch = Self {
            number: 0,
            material: 0,
            first: 0,
            count: 0,
            cells: first,
            strain: Pack::ABSENT,
            strain_before: Pack::ABSENT,
            strain_rate: Pack::ABSENT,
            velocity: [Pack::ABSENT; 4],
            velocity_change: [Pack::ABSENT; 4],
            elastic_stress: Pack::ABSENT,
            elastic_stress_before: Pack::ABSENT,
            integrity: Integrity::default(),
            stress: Pack::ZERO,
            force: [Pack::ZERO; 4],
            corners: [[Pack::ZERO; 4]; 2],
        };
        for number in numbers {
            let (run, cells) = (&geometry.runs[number], &geometry.packs[number]);
            (batch.number, batch.material) = (number, run.material);
            (batch.first, batch.count) = (run.first, run.count);
            batch.cells = cells;
            batch.integrity = Integrity::default();
            gather(&mut batch, mesh, nodal, needs, geometry.packs.get(number + 1));
            visit(&mut batch);
        }
    }

    #[inline(always)]
    fn nodes<'m>(&self, mesh: &'m Mesh<D>) -> &'m [u32] {
        &mesh.cells[self.first * (D + 1)..(self.first + self.count) * (D + 1)]
    }

    /// The sum over the cells of the squares of the forces of their stress outputs beyond `before`, as far as the gradients of the nodes
    /// but the first have them.
    pub fn square_of_added_forces(&self, before: &Pack<S>) -> f64 {
        square_of_forces(self.cells, before, &self.stress)
    }

    /// Adds the force outputs and the divergence of the stress outputs to nodal forces (`D` a node, with ghosts).
    pub fn scatter(&mut self, mesh: &Mesh<D>, forces: &mut [f64]) {
        scatter(self, self.nodes(mesh), forces);
    }
}

/// Gathers what is needed, sets the outputs to zero, and prefetches the geometry of the next batch.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
fn gather<const D: usize, const S: usize>(
    batch: &mut Batch<'_, D, S>,
    mesh: &Mesh<D>,
    nodal: Nodal<'_>,
    needs: Needs,
    next: Option<&SimplexPack<D>>,
) {
    let (nodes, cells) = (batch.nodes(mesh), batch.cells);
    let [displacement, velocity] = &mut batch.corners;
    let velocity = if needs.velocity { &mut batch.velocity } else { velocity };
    if needs.strain {
        kernels::gather(nodes, nodal.displacement.as_chunks().0, displacement);
    }
    if let Some(next) = next {
        next.prefetch();
    }
    if needs.strain_rate || needs.velocity || needs.velocity_change {
        kernels::gather(nodes, nodal.velocity.as_chunks().0, velocity);
    }
    if needs.velocity_change {
        kernels::gather(nodes, nodal.previous_velocity.as_chunks().0, &mut batch.velocity_change);
    }
    // Only now: what was stored number by number is not read back at once.
    if needs.strain {
        batch.strain = kernels::strains(cells, displacement);
    }
    if needs.strain_rate {
        batch.strain_rate = kernels::strains(cells, velocity);
    }
    if needs.velocity_change {
        for (change, velocity) in batch.velocity_change.iter_mut().zip(&*velocity).take(D + 1) {
            *change = Pack::from_lanes(|lane| add_scaled(&velocity.lane(lane), -1.0, &change.lane(lane)));
        }
    }
    if needs.strain_before {
        kernels::gather(nodes, nodal.previous_displacement.as_chunks().0, displacement);
        batch.strain_before = kernels::strains(cells, displacement);
    }
    if needs.elastic_stress {
        batch.elastic_stress = Pack::ZERO;
    }
    batch.stress = Pack::ZERO;
    batch.force[..=D].fill(Pack::ZERO);
}

#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
fn square_of_forces<const D: usize, const S: usize>(
    cells: &SimplexPack<D>,
    before: &Pack<S>,
    after: &Pack<S>,
) -> f64 {
    let mut squares = [0.0; LANES];
    for lane in 0..LANES {
        let mut gradients = 0.0;
        for gradient in &cells.gradients {
            (0..D).for_each(|i| gradients += gradient.0[i][lane] * gradient.0[i][lane]);
        }
        let mut stresses = 0.0;
        for c in 0..S {
            let added = after.0[c][lane] - before.0[c][lane];
            stresses += added * added;
        }
        squares[lane] = cells.volume[lane] * cells.volume[lane] * gradients * stresses;
    }
    sum(&squares)
}

#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
fn scatter<const D: usize, const S: usize>(batch: &mut Batch<'_, D, S>, nodes: &[u32], forces: &mut [f64]) {
    kernels::add_divergence(batch.cells, &batch.stress, &mut batch.force);
    kernels::scatter(nodes, &batch.force, forces.as_chunks_mut().0);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fem::space::samples::{number, row};
    use crate::linear_algebra::tensor::{Mandel, Vector, apply, symmetric_part};

    fn close<const N: usize>(found: [f64; N], expected: [f64; N]) {
        for i in 0..N {
            assert!(
                (found[i] - expected[i]).abs() <= 1e-12 * (1.0 + expected[i].abs()),
                "{found:?} {expected:?}"
            );
        }
    }

    const ALL: Needs = Needs {
        strain: true,
        strain_before: true,
        strain_rate: true,
        velocity: true,
        velocity_change: true,
        elastic_stress: true,
    };

    fn stress_of<const S: usize>(cell: usize) -> Mandel<S> {
        std::array::from_fn(|c| number(S * cell + c))
    }

    fn force_of<const D: usize>(cell: usize, a: usize) -> Vector<D> {
        std::array::from_fn(|i| number(7 * cell + a + i))
    }

    fn check<const D: usize, const S: usize>() {
        let mesh = row::<D>();
        let (count, total) = (mesh.cell_regions.len(), mesh.nodes.len());
        let geometry = Geometry::with_materials(&mesh, |region| region);
        let values = |shift: usize| -> Vec<f64> { (0..total * D).map(|i| number(i + shift)).collect() };
        let [u, v, w] = [values(0), values(11), values(29)];
        let nodal =
            Nodal { displacement: &u, previous_displacement: &w, velocity: &v, previous_velocity: &w };
        let [mut forces, mut expected] = [vec![0.0; total * D], vec![0.0; total * D]];
        let mut visited = 0;
        Batch::<D, S>::for_all(&mesh, &geometry, nodal, ALL, |batch| {
            for lane in 0..batch.count {
                let number_of_cell = batch.first + lane;
                let (cell, nodes) = (geometry.cell(number_of_cell), mesh.cell(number_of_cell));
                let of = |all: &[f64]| -> Vec<Vector<D>> {
                    nodes.iter().map(|&n| std::array::from_fn(|i| all[n as usize * D + i])).collect()
                };
                let strain = |all: &[f64]| symmetric_part(&cell.field_gradient(&of(all)));
                close(batch.strain.lane(lane), strain(&u));
                close(batch.strain_before.lane(lane), strain(&w));
                close(batch.strain_rate.lane(lane), strain(&v));
                let stress = stress_of(number_of_cell);
                batch.stress.set(lane, stress);
                for a in 0..=D {
                    let (velocity, before) = (of(&v)[a], of(&w)[a]);
                    assert_eq!(batch.velocity[a].lane(lane), velocity);
                    let change = std::array::from_fn(|i| velocity[i] - before[i]);
                    assert_eq!(batch.velocity_change[a].lane(lane), change);
                    let force = force_of(number_of_cell, a);
                    batch.force[a].set(lane, force);
                    let inner = apply::<D, S>(&stress, &cell.gradient(a));
                    for i in 0..D {
                        expected[nodes[a] as usize * D + i] += force[i] - cell.volume * inner[i];
                    }
                }
                visited += 1;
            }
            for lane in batch.count..LANES {
                assert_eq!(batch.strain.lane(lane), [0.0; S]);
                assert_eq!(batch.cells.volume[lane], 0.0);
                batch.stress.set(lane, [1e9; S]);
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

    /// Strains of all cells and the forces of a pass over them, where the runs are cut as `material` has it; or, with
    /// `portable`, from kernels compiled for any processor.
    fn bits<const D: usize, const S: usize>(
        material: fn(usize) -> usize,
        portable: bool,
    ) -> (Vec<Mandel<S>>, Vec<f64>) {
        let mesh = row::<D>();
        let geometry = Geometry::with_materials(&mesh, material);
        let u: Vec<f64> = (0..mesh.nodes.len() * D).map(number).collect();
        let nodal =
            Nodal { displacement: &u, previous_displacement: &u, velocity: &u, previous_velocity: &u };
        let (mut strains, mut forces) = (Vec::new(), vec![0.0; u.len()]);
        Batch::<D, S>::for_all(&mesh, &geometry, nodal, ALL, |batch| {
            for lane in 0..batch.count {
                batch.stress.set(lane, stress_of(batch.first + lane));
                (0..=D).for_each(|a| batch.force[a].set(lane, force_of(batch.first + lane, a)));
            }
            let mut strain = batch.strain;
            if portable {
                let (nodes, mut corners) = (batch.nodes(&mesh), [Pack::ZERO; 4]);
                kernels::gather(nodes, u.as_chunks().0, &mut corners);
                strain = kernels::strains(batch.cells, &corners);
                kernels::add_divergence(batch.cells, &batch.stress, &mut batch.force);
                kernels::scatter(nodes, &batch.force, forces.as_chunks_mut().0);
            } else {
                batch.scatter(&mesh, &mut forces);
            }
            strains.extend((0..batch.count).map(|lane| strain.lane(lane)));
        });
        (strains, forces)
    }

    fn check_bits<const D: usize, const S: usize>() {
        let once = bits::<D, S>(|_| 0, false);
        assert_eq!(once, bits::<D, S>(|region| region, false), "cells in other lanes of other packs");
        assert_eq!(once, bits::<D, S>(|_| 0, true), "narrow vectors");
    }

    #[test]
    fn no_bit_depends_on_the_pack_of_a_cell_or_on_the_width_of_vectors() {
        check_bits::<2, 3>();
        check_bits::<2, 4>();
        check_bits::<3, 6>();
    }

    #[test]
    fn what_nobody_needs_is_absent() {
        let mesh = row::<2>();
        let geometry = Geometry::new(&mesh);
        let u = vec![1.0; mesh.nodes.len() * 2];
        let nodal =
            Nodal { displacement: &u, previous_displacement: &u, velocity: &u, previous_velocity: &u };
        let needs = Needs { strain_rate: true, ..Needs::default() };
        Batch::<2, 3>::for_all(&mesh, &geometry, nodal, needs, |batch| {
            assert!(!batch.strain_rate.is_absent());
            assert!(batch.strain.is_absent() && batch.strain_before.is_absent());
            assert!(batch.velocity[0].is_absent() && batch.velocity_change[2].is_absent());
            assert!(batch.elastic_stress.is_absent());
        });
    }

    #[test]
    fn shares_multiply_and_are_whole_where_nothing_weakens() {
        let mut integrity = Integrity::default();
        assert_eq!(integrity.shares(), [1.0; LANES]);
        integrity.weaken([0.5; LANES]);
        integrity.weaken(std::array::from_fn(|lane| if lane == 0 { 0.5 } else { 1.0 }));
        assert_eq!([0, LANES - 1].map(|lane| integrity.shares()[lane]), [0.25, 0.5]);
    }
}
