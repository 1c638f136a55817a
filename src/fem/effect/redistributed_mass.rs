//! Mass of contact boundaries that is moved to the other nodes of their cells.
//!
//! In the kinetic energy of a cell, the velocity at a node without mass is replaced by the mean velocity of the cell's other nodes:
//! `M' = T^T M T`, with `T` the identity but for the rows of nodes without mass. The total mass, and so the momentum of a rigid
//! translation, stay the same. Without inertia, the pressure of a boundary that meets an obstacle is that of the stress behind the
//! boundary: no kinetic energy is lost in the impact, and no impulse makes the pressure oscillate. (H. B. Khenous, P. Laborde, Y.
//! Renard, European Journal of Mechanics A 27, 2008; C. Hager, S. Hueber, B. Wohlmuth, Int. J. Numer. Meth. Eng. 73, 2008.)

use crate::{fem::space::CellMatrix, mesh::Mesh};

/// What the redistribution changes in the mass matrix, for the cells of this rank at the boundaries without mass.
#[derive(Debug, Clone, PartialEq)]
pub struct RedistributedMass<const D: usize> {
    cells: Vec<Change>,
    /// Whether the mass is taken from each local node.
    is_massless: Vec<bool>,
    /// A cell that keeps its mass, because it is to be taken from all of its nodes.
    pub keeps_mass: Option<usize>,
}

/// The change of the mass matrix of a cell.
#[derive(Debug, Clone, PartialEq)]
struct Change {
    cell: usize,
    nodes: Vec<u32>,
    /// `T^T M T - M`, in kg, row by row.
    entries: Vec<f64>,
}

impl<const D: usize> RedistributedMass<D> {
    /// Takes the mass from those local nodes for which `is_massless` holds; `add_mass` adds the mass matrix of a cell, given its number. A
    /// cell that has no other nodes keeps its mass.
    pub fn new(
        mesh: &Mesh<D>,
        is_massless: Vec<bool>,
        mut add_mass: impl FnMut(usize, &mut CellMatrix<D>),
    ) -> Self {
        let mut matrix = CellMatrix::new(mesh);
        let mut cells = Vec::new();
        let mut keeps_mass = None;
        for cell in 0..mesh.cell_count() {
            let nodes: Vec<u32> = mesh.cell_nodes(cell).collect();
            let of_cell: Vec<bool> = nodes.iter().map(|node| is_massless[*node as usize]).collect();
            let others = of_cell.iter().filter(|massless| !**massless).count();
            if others == 0 {
                keeps_mass = Some(cell);
            }
            if others == 0 || others == nodes.len() {
                continue;
            }
            matrix.clear();
            add_mass(cell, &mut matrix);
            let mass = |a: usize, b: usize| matrix.blocks[a][b][0][0];
            cells.push(Change { cell, entries: change(&of_cell, mass), nodes });
        }
        Self { cells, is_massless, keeps_mass }
    }

    /// Whether the mass is taken from a local node.
    pub fn is_massless(&self, node: usize) -> bool {
        self.is_massless[node]
    }

    /// Adds `factor` times the change of the mass matrix times the nodal values that `x` gives to `forces`; both with ghosts.
    pub fn add_product(&self, factor: f64, x: impl Fn(usize) -> f64, forces: &mut [f64]) {
        for Change { nodes, entries, .. } in &self.cells {
            for (row, entries) in nodes.iter().zip(entries.chunks_exact(nodes.len())) {
                for (column, entry) in nodes.iter().zip(entries) {
                    for i in 0..D {
                        forces[*row as usize * D + i] += factor * entry * x(*column as usize * D + i);
                    }
                }
            }
        }
    }

    /// The change of `w . M w` for the nodal values that `w` gives, with ghosts.
    pub fn square(&self, w: impl Fn(usize) -> f64) -> f64 {
        let mut sum = 0.0;
        for Change { nodes, entries, .. } in &self.cells {
            for (row, entries) in nodes.iter().zip(entries.chunks_exact(nodes.len())) {
                for (column, entry) in nodes.iter().zip(entries) {
                    sum += (0..D)
                        .map(|i| entry * w(*row as usize * D + i) * w(*column as usize * D + i))
                        .sum::<f64>();
                }
            }
        }
        sum
    }

    /// Adds `factor` times the change to the matrix of a cell.
    pub fn add_to_cell(&self, cell: usize, factor: f64, matrix: &mut CellMatrix<D>) {
        let Ok(at) = self.cells.binary_search_by_key(&cell, |change| change.cell) else { return };
        let Change { nodes, entries, .. } = &self.cells[at];
        matrix.add_scalar(|a, b| factor * entries[a * nodes.len() + b]);
    }
}

/// `T^T M T - M`, row by row.
fn change(is_massless: &[bool], mass: impl Fn(usize, usize) -> f64) -> Vec<f64> {
    let count = is_massless.len();
    let share = 1.0 / is_massless.iter().filter(|massless| !**massless).count() as f64;
    // `T`: the share of node `b` in the velocity that node `a` has in the kinetic energy.
    let t = |a: usize, b: usize| match (is_massless[a], is_massless[b]) {
        (false, _) => f64::from(u8::from(a == b)),
        (true, false) => share,
        (true, true) => 0.0,
    };
    let all = |i: usize, j: usize| {
        (0..count)
            .flat_map(|a| (0..count).map(move |b| (a, b)))
            .map(|(a, b)| t(a, i) * mass(a, b) * t(b, j))
            .sum::<f64>()
    };
    (0..count * count).map(|at| all(at / count, at % count) - mass(at / count, at % count)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fem::space::{
        Geometry,
        samples::{number, quadratic, row},
    };

    #[test]
    fn a_triangle_passes_the_mass_of_a_corner_to_the_others() {
        let twelfths = |a: usize, b: usize| if a == b { 2.0 } else { 1.0 };
        let found = change(&[true, false, false], twelfths);
        let expected = [-2.0, -1.0, -1.0, -1.0, 1.5, 1.5, -1.0, 1.5, 1.5];
        assert!(
            found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-15),
            "{found:?}"
        );
    }

    /// Nodes without mass resist no acceleration, and the others resist a rigid translation as before.
    fn check<const D: usize>(mesh: &Mesh<D>) {
        let geometry = Geometry::new(mesh);
        let is_massless: Vec<bool> = (0..mesh.nodes.len()).map(|node| node % (D + 2) == 0).collect();
        let add_mass = |cell: usize, matrix: &mut CellMatrix<D>| matrix.add_mass(geometry.cell_at(cell), 1.7);
        let redistributed = RedistributedMass::new(mesh, is_massless.clone(), add_mass);
        let times_mass = |x: &[f64]| {
            let mut force = vec![0.0; x.len()];
            let mut matrix = CellMatrix::new(mesh);
            for cell in 0..mesh.cell_count() {
                matrix.clear();
                add_mass(cell, &mut matrix);
                redistributed.add_to_cell(cell, 1.0, &mut matrix);
                for (a, row) in mesh.cell_nodes(cell).enumerate() {
                    for (b, column) in mesh.cell_nodes(cell).enumerate() {
                        for i in 0..D {
                            force[row as usize * D + i] +=
                                matrix.blocks[a][b][i][i] * x[column as usize * D + i];
                        }
                    }
                }
            }
            force
        };
        let close = |a: f64, b: f64| (a - b).abs() < 1e-11 * (1.0 + b.abs());
        let x: Vec<f64> = (0..mesh.nodes.len() * D).map(number).collect();
        let force = times_mass(&x);
        let massless = is_massless.iter().zip(force.chunks_exact(D)).filter(|(massless, _)| **massless);
        assert!(
            massless.clone().count() > 3 && massless.flat_map(|(_, force)| force).all(|f| close(*f, 0.0))
        );
        let mut product = vec![0.0; x.len()];
        redistributed.add_product(1.0, |at| x[at], &mut product);
        let square: f64 = product.iter().zip(&x).map(|(a, b)| a * b).sum();
        let found = redistributed.square(|at| x[at]);
        assert!(close(found, square) && square != 0.0, "{found} instead of {square}");
        let ones = vec![1.0; x.len()];
        let mass: f64 = geometry.iter().map(|cell| 1.7 * cell.volume * D as f64).sum();
        assert!(close(times_mass(&ones).iter().sum(), mass));
    }

    #[test]
    fn nodes_without_mass_resist_no_acceleration() {
        check(&row::<2>());
        check(&row::<3>());
        check(&quadratic(row::<2>(), 0.0));
        check(&quadratic(row::<3>(), 0.03));
    }
}
