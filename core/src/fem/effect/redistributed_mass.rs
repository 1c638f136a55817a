//! Mass of contact boundaries that cells in the interior carry.
//!
//! In the kinetic energy the cells at these boundaries move as continuations of their carriers, see [`super::carriers`]: `M' = M - M_K + E^T
//! M_K E` with the mass matrix `M_K` of a cell at the boundary and the velocities `E v` at its nodes. Total mass, first moments and moments
//! of inertia stay the same, and loads in these cells act as `E^T f`, so that the weight is that of the mass. Without inertia, the pressure
//! of a boundary that meets an obstacle is that of the stress behind the boundary: no kinetic energy is lost in the impact, and no impulse
//! makes the pressure oscillate. (H. B. Khenous, P. Laborde, Y. Renard, European Journal of Mechanics A 27, 2008; C. Hager, S. Hueber,
//! B. Wohlmuth, Int. J. Numer. Meth. Eng. 73, 2008.)

use super::carriers::Carriers;
use crate::{
    error::Result,
    fem::space::CellMatrix,
    linear_algebra::{petsc::DistributedVector, tensor::Vector},
    mesh::Mesh,
    parallel::session::Session,
};
use std::collections::BTreeMap;

/// What the redistribution changes in the mass matrix, for the cells of this rank.
#[derive(Debug)]
pub struct RedistributedMass<const D: usize> {
    cells: Vec<Change>,
    /// Whether each local node is without mass.
    is_massless: Vec<bool>,
    /// A cell that keeps its mass, because the mass is to be taken from all nodes of its body.
    pub keeps_mass: Option<usize>,
    carriers: Carriers<D>,
}

/// The change of the mass matrix of a cell.
#[derive(Debug, Clone, PartialEq)]
struct Change {
    cell: usize,
    nodes: Vec<u32>,
    /// In kg, row by row.
    entries: Vec<f64>,
}

impl<const D: usize> RedistributedMass<D> {
    /// Takes the mass from those local nodes for which `is_massless` holds; `add_mass` adds the mass matrix of a cell, given its number. A
    /// body without other nodes keeps its mass. `layout` is a vector with ghosts. Collective.
    pub fn new(
        session: &Session,
        mesh: &Mesh<D>,
        is_massless: &[bool],
        layout: &DistributedVector,
        mut add_mass: impl FnMut(usize, &mut CellMatrix<D>),
    ) -> Result<Self> {
        let carriers = Carriers::new(session, mesh, is_massless, layout)?;
        let mut cells: BTreeMap<usize, Change> = BTreeMap::new();
        let mut matrix = CellMatrix::new(mesh);
        let mut taken = Vec::with_capacity(carriers.moved().count());
        let mass = |cell: usize| {
            matrix.clear();
            add_mass(cell, &mut matrix);
            let count = matrix.nodes();
            let entries: Vec<f64> =
                (0..count * count).map(|at| matrix.blocks[at / count][at % count][0][0]).collect();
            let nodes = mesh.cell_nodes(cell).collect();
            taken.push(Change { cell, nodes, entries: entries.iter().map(|entry| -entry).collect() });
            entries
        };
        carriers.move_mass(mesh, mass, |cell, corners, received| {
            let change = cells.entry(cell).or_insert_with(|| {
                let nodes: Vec<u32> = mesh.cell_nodes(cell).collect();
                Change { cell, entries: vec![0.0; nodes.len() * nodes.len()], nodes }
            });
            let at: Vec<usize> = corners
                .iter()
                .filter_map(|corner| change.nodes.iter().position(|node| node == corner))
                .collect();
            for (row, received) in at.iter().zip(received.chunks_exact(at.len())) {
                for (column, received) in at.iter().zip(received) {
                    change.entries[row * change.nodes.len() + column] += received;
                }
            }
        })?;
        for Change { cell, nodes, entries } in taken {
            let change = cells.entry(cell).or_insert_with(|| Change {
                cell,
                entries: vec![0.0; entries.len()],
                nodes,
            });
            change.entries.iter_mut().zip(entries).for_each(|(sum, entry)| *sum += entry);
        }
        let cells: Vec<Change> = cells.into_values().collect();

        let mut is_moved = vec![false; mesh.cell_count()];
        carriers.moved().for_each(|cell| is_moved[cell] = true);
        let keeping: Vec<usize> = (0..mesh.cell_count()).filter(|cell| !is_moved[*cell]).collect();
        let keeps_mass = keeping
            .iter()
            .copied()
            .find(|cell| mesh.cell_nodes(*cell).any(|node| is_massless[node as usize]));
        let mut has_mass = layout.like()?;
        {
            let mut values = has_mass.local_mut()?;
            values.fill(0.0);
            let of_cells = keeping.iter().flat_map(|cell| mesh.cell_nodes(*cell));
            let of_carriers = carriers.carriers().flat_map(|(_, corners)| corners).copied();
            of_cells.chain(of_carriers).for_each(|node| values[node as usize * D] = 1.0);
        }
        has_mass.add_ghosts_to_owners()?;
        has_mass.update_ghosts()?;
        let is_massless = has_mass.local()?.iter().step_by(D).map(|mark| *mark == 0.0).collect();
        Ok(Self { cells, is_massless, keeps_mass, carriers })
    }

    /// Forgets the loads taken so far.
    pub fn restart_loads(&self) {
        self.carriers.restart_forces();
    }

    /// Takes the load in N on a local node of a cell, if others carry the mass of the cell; gives whether they do.
    pub fn take_load(&self, mesh: &Mesh<D>, cell: usize, node: u32, load: &Vector<D>) -> bool {
        self.carriers.take_force(mesh, cell, node, load)
    }

    /// Adds the loads taken to the forces (with ghosts) on the nodes that carry the mass. Collective.
    pub fn add_loads(&self, mesh: &Mesh<D>, forces: &mut DistributedVector) -> Result<()> {
        let mut forces = forces.local_mut()?;
        self.carriers.move_forces(mesh, |node, force| {
            forces[node as usize * D..][..D].iter_mut().zip(force).for_each(|(sum, force)| *sum += force);
        })
    }

    /// Whether a local node is without mass.
    pub fn is_massless(&self, node: usize) -> bool {
        self.is_massless[node]
    }

    /// Visits the entries of the change of the mass matrix, each with its row and column, local nodes.
    fn visit(&self, mut visit: impl FnMut([usize; 2], f64)) {
        for Change { nodes, entries, .. } in &self.cells {
            for (row, entries) in nodes.iter().zip(entries.chunks_exact(nodes.len())) {
                let columns = nodes.iter().zip(entries);
                columns.for_each(|(column, entry)| visit([*row as usize, *column as usize], *entry));
            }
        }
    }

    /// Adds `factor` times the change of the mass matrix times the nodal values that `x` gives to `forces`; both with ghosts.
    pub fn add_product(&self, factor: f64, x: impl Fn(usize) -> f64, forces: &mut [f64]) {
        self.visit(|[row, column], entry| {
            (0..D).for_each(|i| forces[row * D + i] += factor * entry * x(column * D + i));
        });
    }

    /// The change of `w . M w` for the nodal values that `w` gives, with ghosts.
    pub fn square(&self, w: impl Fn(usize) -> f64) -> f64 {
        let mut sum = 0.0;
        self.visit(|[row, column], entry| {
            sum += (0..D).map(|i| entry * w(row * D + i) * w(column * D + i)).sum::<f64>();
        });
        sum
    }

    /// Adds `factor` times the change to the matrix of a cell.
    pub fn add_to_cell(&self, cell: usize, factor: f64, matrix: &mut CellMatrix<D>) {
        let Ok(at) = self.cells.binary_search_by_key(&cell, |change| change.cell) else { return };
        let Change { nodes, entries, .. } = &self.cells[at];
        matrix.add_scalar(|a, b| factor * entries[a * nodes.len() + b]);
    }
}
