//! Passes over cells, a pack of them at a time: gather nodal values, let the effects work, scatter forces.
//!
//! A batch is a pack of cells of one material, so that an effect looks up its law once per batch. Quadratic cells are visited once for
//! each of their points: a batch then holds one point of each of its cells, and what effects call a cell is such a point.

use super::{
    CellShape, Geometry, SimplexPack, kernels, kernels::NodalPacks, quadratic::node_count,
    quadrature::cell_rule,
};
use crate::{
    linear_algebra::{
        simd::{LANES, Pack, sum},
        tensor::{add_scaled, component},
    },
    mesh::Mesh,
};
use multiversion::multiversion;

/// The fields that a pass gathers for its effects.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Needs {
    /// Strain of the displacement beyond that without stress.
    pub strain: bool,
    /// Whether strains are whole ones, with that without stress.
    pub whole_strain: bool,
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
            whole_strain: self.whole_strain || other.whole_strain,
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
    /// Position among all batches of a pass.
    pub number: usize,
    /// Position among the body's materials.
    pub material: usize,
    /// Local number of the first cell.
    pub first_cell: usize,
    /// Number of cells.
    pub count: usize,
    /// The point of each of these cells.
    pub point: usize,
    /// Number of the point of the first cell among all points of this rank; those of the other cells follow.
    pub first_point: usize,
    /// Shape of the cells of the batch.
    pub shape: CellShape<'g>,
    /// Geometry of the cells of the batch; volumes are the weights of the point.
    pub cells: &'g SimplexPack<D>,
    /// Hoop strains of unit displacements at the corners of the cells, in a body of revolution.
    hoop: Option<&'g Pack<3>>,
    /// Temperatures in K of the cells at the start of the step, where laws depend on them.
    pub temperature: Option<&'g [f64; LANES]>,
    /// Strain of the displacement, as all strains beyond that without stress.
    pub strain: Pack<S>,
    /// Strain of the displacement before the step.
    pub strain_before: Pack<S>,
    /// Strain of the velocity in 1/s.
    pub strain_rate: Pack<S>,
    /// Velocity at the nodes of cells.
    pub velocity: NodalPacks<D>,
    /// Change of the velocity over the last step at the nodes of cells.
    pub velocity_change: NodalPacks<D>,
    /// Elastic stress `E e(u) + H` in Pa before anything weakens it; effects add to it.
    pub elastic_stress: Pack<S>,
    /// Elastic stress in Pa before the step; present in the energy balance of an implicit step.
    pub elastic_stress_before: Pack<S>,
    /// The fraction of the elastic stress that the cells carry.
    pub integrity: Integrity,
    /// Output: stress in Pa.
    pub stress: Pack<S>,
    /// Output: force in N on the nodes of cells.
    pub force: NodalPacks<D>,
    /// Nodal values from which only strains are computed: displacement, velocity, displacement before the step.
    nodal: [NodalPacks<D>; 3],
    /// Whether there are forces at points before this one that have not been added to those of nodes.
    holds_forces: bool,
}

/// Nodal values, and what batches need of them.
#[derive(Clone, Copy)]
pub struct Inputs<'a> {
    /// The values.
    pub nodal: Nodal<'a>,
    /// What is needed.
    pub needs: Needs,
}

impl<'g, const D: usize, const S: usize> Batch<'g, D, S> {
    /// Visits all points of the cells of the mesh in batches with the outputs zero; `visit` may read them afterwards. Forces on nodes
    /// are zero at the first point of cells, and kept for the others.
    pub fn for_all(
        mesh: &Mesh<D>,
        geometry: &'g Geometry<D>,
        nodal: Nodal<'_>,
        needs: Needs,
        visit: impl FnMut(&mut Self),
    ) {
        Self::for_each(0..geometry.runs.len(), mesh, geometry, Inputs { nodal, needs }, visit);
    }

    /// Visits the runs of cells with these numbers in the same way.
    pub fn for_each(
        numbers: impl Iterator<Item = usize>,
        mesh: &Mesh<D>,
        geometry: &'g Geometry<D>,
        Inputs { nodal, needs }: Inputs<'_>,
        mut visit: impl FnMut(&mut Self),
    ) {
        let Some(first) = geometry.packs.first() else { return };
        let mut batch = Self {
            number: 0,
            material: 0,
            first_cell: 0,
            count: 0,
            point: 0,
            first_point: 0,
            shape: CellShape::Linear,
            cells: first,
            hoop: None,
            temperature: None,
            strain: Pack::ABSENT,
            strain_before: Pack::ABSENT,
            strain_rate: Pack::ABSENT,
            velocity: [Pack::ABSENT; _],
            velocity_change: [Pack::ABSENT; _],
            elastic_stress: Pack::ABSENT,
            elastic_stress_before: Pack::ABSENT,
            integrity: Integrity::default(),
            stress: Pack::ZERO,
            force: [Pack::ZERO; _],
            nodal: [[Pack::ZERO; _]; 3],
            holds_forces: false,
        };
        let points = geometry.points();
        for number in numbers {
            let run = &geometry.runs[number];
            batch.material = run.material;
            (batch.first_cell, batch.count) = (run.first, run.count);
            batch.shape = geometry.shape(number);
            for point in 0..points {
                (batch.number, batch.point) = (number * points + point, point);
                batch.first_point = run.first * points + point * run.count;
                batch.cells = geometry.pack(number, point);
                batch.hoop = geometry.hoop(number, point);
                batch.temperature = geometry.temperature(batch.number);
                batch.integrity = Integrity::default();
                if points == 1 {
                    gather(&mut batch, mesh, nodal, needs, geometry.packs.get(number + 1));
                } else {
                    gather_at_point(&mut batch, mesh, nodal, needs);
                }
                if let Some(free) = geometry.free_strain(batch.number).filter(|_| !needs.whole_strain) {
                    batch.subtract_free_strain(free, needs);
                }
                visit(&mut batch);
            }
        }
    }

    /// Leaves what strains are beyond those without stress, which are alike along all axes.
    fn subtract_free_strain(&mut self, free: &[f64; LANES], needs: Needs) {
        for (strain, _) in [(&mut self.strain, needs.strain), (&mut self.strain_before, needs.strain_before)]
            .into_iter()
            .filter(|(_, is_there)| *is_there)
        {
            for c in (0..S).filter(|c| component::<S>(*c).0 == component::<S>(*c).1) {
                (0..LANES).for_each(|lane| strain.0[c][lane] -= free[lane]);
            }
        }
    }

    #[inline(always)]
    fn nodes<'m>(&self, mesh: &'m Mesh<D>) -> &'m [u32] {
        &mesh.cells[self.first_cell * (D + 1)..(self.first_cell + self.count) * (D + 1)]
    }

    /// Local nodes on the edges of the cells.
    #[inline(always)]
    fn midsides<'m>(&self, mesh: &'m Mesh<D>) -> &'m [u32] {
        let count = D * (D + 1) / 2;
        &mesh.midsides[self.first_cell * count..(self.first_cell + self.count) * count]
    }

    /// The sum over the cells of the squares of the forces of their stress outputs beyond `before`, as far as the gradients of the nodes
    /// but the first have them.
    pub fn square_of_added_forces(&self, before: &Pack<S>) -> f64 {
        square_of_forces(self.cells, before, &self.stress)
    }

    /// Adds the force outputs and the divergence of the stress outputs to nodal forces (`D` a node, with ghosts). Once called at a
    /// point of cells, it must be called at their last one, see [`Batch::holds_forces`].
    pub fn scatter(&mut self, mesh: &Mesh<D>, forces: &mut [f64]) {
        if self.shape.is_linear() {
            return scatter(self, self.nodes(mesh), forces);
        }
        add_forces_at_point(self);
        self.holds_forces = self.point + 1 < cell_rule::<D>().len();
        if !self.holds_forces {
            scatter_all(self, mesh, forces);
        }
    }

    /// Whether forces at points before this one have not been added to those of nodes.
    pub fn holds_forces(&self) -> bool {
        self.holds_forces
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
    let (nodes, cells, hoop) = (batch.nodes(mesh), batch.cells, batch.hoop);
    let [displacement, velocity, _] = &mut batch.nodal;
    let velocity = if needs.velocity { &mut batch.velocity } else { velocity };
    if needs.strain {
        kernels::gather(D + 1, nodes, nodal.displacement.as_chunks().0, displacement);
    }
    if let Some(next) = next {
        next.prefetch();
    }
    if needs.strain_rate || needs.velocity || needs.velocity_change {
        kernels::gather(D + 1, nodes, nodal.velocity.as_chunks().0, velocity);
    }
    if needs.velocity_change {
        kernels::gather(D + 1, nodes, nodal.previous_velocity.as_chunks().0, &mut batch.velocity_change);
    }
    // Only now: what was stored number by number is not read back at once.
    if needs.strain {
        batch.strain = kernels::strains(cells, hoop, &displacement[..]);
    }
    if needs.strain_rate {
        batch.strain_rate = kernels::strains(cells, hoop, &velocity[..]);
    }
    if needs.velocity_change {
        for (change, velocity) in batch.velocity_change.iter_mut().zip(&*velocity).take(D + 1) {
            *change = Pack::from_lanes(|lane| add_scaled(&velocity.lane(lane), -1.0, &change.lane(lane)));
        }
    }
    if needs.strain_before {
        kernels::gather(D + 1, nodes, nodal.previous_displacement.as_chunks().0, displacement);
        batch.strain_before = kernels::strains(cells, hoop, &displacement[..]);
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
    kernels::add_divergence(batch.cells, batch.hoop, &batch.stress, &mut batch.force);
    kernels::scatter(D + 1, nodes, &batch.force, forces.as_chunks_mut().0);
}

/// What [`gather`] does, for one point of quadratic cells; nodal values are gathered at their first point.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
fn gather_at_point<const D: usize, const S: usize>(
    batch: &mut Batch<'_, D, S>,
    mesh: &Mesh<D>,
    nodal: Nodal<'_>,
    needs: Needs,
) {
    let (corners, midsides) = (batch.nodes(mesh), batch.midsides(mesh));
    let gather = |values: &[f64], packs: &mut NodalPacks<D>| {
        let values = values.as_chunks().0;
        kernels::gather(D + 1, corners, values, packs);
        kernels::gather(D * (D + 1) / 2, midsides, values, &mut packs[D + 1..]);
    };
    let [displacement, velocity, before] = &mut batch.nodal;
    let velocity = if needs.velocity { &mut batch.velocity } else { velocity };
    if batch.point == 0 {
        if needs.strain {
            gather(nodal.displacement, displacement);
        }
        if needs.strain_before {
            gather(nodal.previous_displacement, before);
        }
        if needs.strain_rate || needs.velocity || needs.velocity_change {
            gather(nodal.velocity, velocity);
        }
        if needs.velocity_change {
            gather(nodal.previous_velocity, &mut batch.velocity_change);
            for (change, velocity) in batch.velocity_change.iter_mut().zip(&*velocity).take(node_count::<D>())
            {
                *change = Pack::from_lanes(|lane| add_scaled(&velocity.lane(lane), -1.0, &change.lane(lane)));
            }
        }
        batch.force.fill(Pack::ZERO);
    }
    let (place, _) = &cell_rule::<D>()[batch.point];
    let (cells, hoop) = (batch.cells, batch.hoop);
    let strains = |nodal: &NodalPacks<D>| {
        let mut corners = kernels::linear_at(place, nodal);
        if hoop.is_some() {
            kernels::add_offsets(place, nodal, &mut corners);
        }
        kernels::strains(cells, hoop, &corners)
    };
    if needs.strain {
        batch.strain = strains(displacement);
    }
    if needs.strain_before {
        batch.strain_before = strains(before);
    }
    if needs.strain_rate {
        batch.strain_rate = strains(velocity);
    }
    if needs.elastic_stress {
        batch.elastic_stress = Pack::ZERO;
    }
    batch.stress = Pack::ZERO;
}

/// Adds the divergence of the stress at a point of quadratic cells to the forces on their nodes.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
fn add_forces_at_point<const D: usize, const S: usize>(batch: &mut Batch<'_, D, S>) {
    let mut corners = [Pack::ZERO; 4];
    kernels::add_divergence(batch.cells, batch.hoop, &batch.stress, &mut corners);
    let (place, _) = &cell_rule::<D>()[batch.point];
    kernels::add_nodal_forces(place, &corners, &mut batch.force);
    if batch.hoop.is_some() {
        kernels::add_offset_forces(place, &corners, &mut batch.force);
    }
}

/// Adds the forces on the nodes of quadratic cells to those of the body.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
fn scatter_all<const D: usize, const S: usize>(
    batch: &mut Batch<'_, D, S>,
    mesh: &Mesh<D>,
    forces: &mut [f64],
) {
    let forces = forces.as_chunks_mut().0;
    kernels::scatter(D + 1, batch.nodes(mesh), &batch.force, forces);
    kernels::scatter(D * (D + 1) / 2, batch.midsides(mesh), &batch.force[D + 1..], forces);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fem::space::samples::{number, quadratic, revolved, row};
    use crate::linear_algebra::tensor::{Mandel, Vector, apply, symmetric_part};
    use crate::mesh::shape::linear_at;

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
        whole_strain: false,
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
                let number_of_cell = batch.first_cell + lane;
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
                batch.stress.set(lane, stress_of(batch.first_cell + lane));
                (0..=D).for_each(|a| batch.force[a].set(lane, force_of(batch.first_cell + lane, a)));
            }
            let mut strain = batch.strain;
            if portable {
                let (nodes, mut corners) = (batch.nodes(&mesh), [Pack::ZERO; 4]);
                kernels::gather(D + 1, nodes, u.as_chunks().0, &mut corners);
                strain = kernels::strains(batch.cells, batch.hoop, &corners);
                kernels::add_divergence(batch.cells, batch.hoop, &batch.stress, &mut batch.force);
                kernels::scatter(D + 1, nodes, &batch.force, forces.as_chunks_mut().0);
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

    /// Strains of a quadratic field are exact at points where sides are straight, those of a linear field also where they are
    /// curved; and the power of the forces of any stress is minus the integral of stress times strain rate.
    fn check_quadratic<const D: usize, const S: usize>(bend: f64) {
        let mesh = quadratic(row::<D>(), bend);
        let geometry = Geometry::with_materials(&mesh, |region| region);
        let second = if bend == 0.0 { 0.3 } else { 0.0 };
        let field = |x: &Vector<D>| -> Vector<D> {
            std::array::from_fn(|i| {
                let linear: f64 = (0..D).map(|j| number(5 * i + j) * x[j]).sum();
                linear + second * x[i] * x[(i + 1) % D] - second * x[(i + 1) % D].powi(2)
            })
        };
        let gradient = |x: &Vector<D>| -> [[f64; D]; D] {
            std::array::from_fn(|i| {
                std::array::from_fn(|j| {
                    let next = (i + 1) % D;
                    let mut slope = number(5 * i + j);
                    slope += if j == i { second * x[next] } else { 0.0 };
                    slope + if j == next { second * (x[i] - 2.0 * x[next]) } else { 0.0 }
                })
            })
        };
        let u: Vec<f64> = mesh.nodes.iter().flat_map(field).collect();
        let v: Vec<f64> = (0..u.len()).map(number).collect();
        let nodal =
            Nodal { displacement: &u, previous_displacement: &u, velocity: &v, previous_velocity: &u };
        let (mut forces, mut power, mut visited) = (vec![0.0; u.len()], 0.0, 0);
        Batch::<D, S>::for_all(&mesh, &geometry, nodal, ALL, |batch| {
            for lane in 0..batch.count {
                let cell = batch.first_cell + lane;
                let nodes: Vec<Vector<D>> = mesh.cell_nodes(cell).map(|n| mesh.nodes[n as usize]).collect();
                let shares = crate::fem::space::values(D + 1, &cell_rule::<D>()[batch.point].0);
                let place =
                    nodes.iter().zip(shares).fold([0.0; D], |sum, (x, share)| add_scaled(&sum, share, x));
                let expected: Mandel<S> = symmetric_part(&gradient(&place));
                for (found, expected) in batch.strain.lane(lane).into_iter().zip(expected) {
                    assert!((found - expected).abs() < 1e-10 * (1.0 + expected.abs()), "{found} {expected}");
                }
                assert_eq!(batch.strain_before.lane(lane), batch.strain.lane(lane));
                let number_of_point = batch.first_point + lane;
                assert_eq!(geometry.point(number_of_point), (cell, batch.point, batch.cells.simplex(lane)),);
                let stress = stress_of(number_of_point);
                batch.stress.set(lane, stress);
                let rate = batch.strain_rate.lane(lane);
                let product: f64 = stress.iter().zip(rate).map(|(s, e)| s * e).sum();
                power -= batch.cells.volume[lane] * product;
                visited += 1;
                for (a, node) in mesh.cell_nodes(cell).enumerate() {
                    let at = node as usize * D;
                    assert_eq!(batch.velocity[a].lane(lane)[..], v[at..at + D]);
                    let change: Vec<f64> = (at..at + D).map(|i| v[i] - u[i]).collect();
                    assert_eq!(batch.velocity_change[a].lane(lane)[..], change);
                }
            }
            assert_eq!(batch.holds_forces(), batch.point > 0);
            batch.scatter(&mesh, &mut forces);
        });
        assert_eq!(visited, geometry.point_count());
        let work: f64 = forces.iter().zip(&v).map(|(f, v)| f * v).sum();
        assert!((work - power).abs() < 1e-10 * power.abs().max(1.0), "{work} {power}");
        assert!(forces.chunks(D).map(|f| f[0]).sum::<f64>().abs() < 1e-9, "no net force");
    }

    #[test]
    fn quadratic_cells_are_exact_for_what_they_can_represent() {
        check_quadratic::<2, 3>(0.0);
        check_quadratic::<2, 4>(0.02);
        check_quadratic::<3, 6>(0.0);
        check_quadratic::<3, 6>(0.02);
    }

    /// In rings the hoop strain is `u_r / r`, volumes are those of the whole turn, and the power of the forces of any stress is minus the
    /// integral of stress times strain rate.
    fn check_rings(mesh: Mesh<2>) {
        let geometry = Geometry::new(&mesh);
        let is_linear = mesh.order() == 1;
        let field = |[r, y]: &[f64; 2]| [0.7 * r + 0.2 + if is_linear { 0.0 } else { 0.1 * r * y }, *y];
        let u: Vec<f64> = mesh.nodes.iter().flat_map(field).collect();
        let v: Vec<f64> = (0..u.len()).map(number).collect();
        let nodal =
            Nodal { displacement: &u, previous_displacement: &v, velocity: &v, previous_velocity: &v };
        let (mut forces, mut power, mut volume) = (vec![0.0; u.len()], 0.0, 0.0);
        Batch::<2, 4>::for_all(&mesh, &geometry, nodal, ALL, |batch| {
            for lane in 0..batch.count {
                let cell = batch.first_cell + lane;
                let rule = if is_linear { crate::fem::space::quadrature::CENTROID } else { cell_rule::<2>() };
                let place = crate::fem::space::place_in_cell(&mesh, cell, &rule[batch.point].0);
                let ([radial, _], strain) = (field(&place), batch.strain.lane(lane));
                let straight = if mesh.is_curved { 0.02 } else { 1e-11 };
                assert!((strain[2] - radial / place[0]).abs() < straight, "{strain:?} {place:?}");
                let stress = stress_of(batch.first_point + lane);
                batch.stress.set(lane, stress);
                let rate = batch.strain_rate.lane(lane);
                assert_eq!(rate, batch.strain_before.lane(lane));
                power -= batch.cells.volume[lane] * stress.iter().zip(rate).map(|(s, e)| s * e).sum::<f64>();
                volume += batch.cells.volume[lane];
            }
            batch.scatter(&mesh, &mut forces);
        });
        let work: f64 = forces.iter().zip(&v).map(|(f, v)| f * v).sum();
        assert!((work - power).abs() < 1e-11 * power.abs(), "{work} {power}");
        // The first theorem of Pappus and Guldinus.
        if !mesh.is_curved {
            let ring = |cell: usize| {
                let corners = &mesh.corners(cell)[..3];
                let middle = corners.iter().map(|corner| corner[0]).sum::<f64>() / 3.0;
                std::f64::consts::TAU * middle * crate::mesh::shape::signed_measure(corners)
            };
            let expected: f64 = (0..mesh.cell_count()).map(ring).sum();
            assert!((volume - expected).abs() < 1e-12 * expected.abs(), "{volume} {expected}");
        }
    }

    #[test]
    fn cells_of_a_body_of_revolution_are_rings() {
        check_rings(revolved(row()));
        check_rings(revolved(quadratic(row(), 0.0)));
        check_rings(revolved(quadratic(row(), 0.02)));
    }

    #[test]
    fn a_curved_side_adds_two_thirds_of_its_height_times_its_length() {
        let mut mesh = Mesh::<2> {
            nodes: vec![[0.0, 0.0], [4.0, 0.0], [0.0, 3.0], [2.0, -0.6], [2.0, 1.5], [0.0, 1.5]],
            cells: vec![0, 1, 2],
            midsides: vec![3, 4, 5],
            cell_regions: vec![0],
            is_curved: true,
            ..Mesh::default()
        };
        let area = |mesh: &Mesh<2>| Geometry::new(mesh).cell(0).volume;
        assert!((area(&mesh) - (6.0 + 2.0 / 3.0 * 4.0 * 0.6)).abs() < 1e-14);
        mesh.nodes[3][1] = 0.0;
        assert!((area(&mesh) - 6.0).abs() < 1e-14);
        mesh.is_curved = false;
        let geometry = Geometry::new(&mesh);
        assert!((geometry.cell(0).volume - 6.0).abs() < 1e-14 && geometry.packs.len() == 1);
        let corners = linear_at(3, &[0.2, 0.3, 0.5], &mesh.nodes);
        let edge = add_scaled(&corners[1], -1.0, &corners[0]);
        close(edge, [4.0, 0.0]);
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
