//! Volumes and shape function gradients of cells, computed once.

use super::BATCH;
use crate::{
    mesh::{Mesh, shape},
    tensor::Vector,
};

/// One cell: its volume and the gradients of its shape functions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Simplex<const D: usize> {
    /// Area or volume in m^D.
    pub volume: f64,
    /// Gradients in 1/m of the shape functions of the cell's nodes 1 to D; that of node 0 is minus their sum.
    pub gradients: [Vector<D>; D],
}

impl<const D: usize> Simplex<D> {
    /// From the corner coordinates of the `D + 1` nodes.
    pub fn new(corners: &[Vector<D>]) -> Self {
        let mut edges = [[0.0; D]; D];
        for a in 0..D {
            for i in 0..D {
                edges[a][i] = corners[a + 1][i] - corners[0][i];
            }
        }
        Self { volume: shape::signed_measure(corners), gradients: dual_basis(&edges) }
    }

    /// Gradient of the shape function of local node `a`.
    #[inline(always)]
    pub fn gradient(&self, a: usize) -> Vector<D> {
        if a > 0 {
            return self.gradients[a - 1];
        }
        let mut sum = [0.0; D];
        for gradient in &self.gradients {
            for i in 0..D {
                sum[i] -= gradient[i];
            }
        }
        sum
    }

    /// Gradient `d u_i / d x_j` of the field with these nodal values.
    #[inline(always)]
    pub fn field_gradient(&self, nodal: &[Vector<D>]) -> [[f64; D]; D] {
        let mut out = [[0.0; D]; D];
        for a in 0..D {
            for i in 0..D {
                let difference = nodal[a + 1][i] - nodal[0][i];
                for j in 0..D {
                    out[i][j] += difference * self.gradients[a][j];
                }
            }
        }
        out
    }
}

/// The vectors `g_a` with `g_a . e_b = 1` if `a = b`, else 0.
fn dual_basis<const D: usize>(edges: &[[f64; D]; D]) -> [[f64; D]; D] {
    let mut out = [[0.0; D]; D];
    if D == 2 {
        let det = edges[0][0] * edges[1][1] - edges[0][1] * edges[1][0];
        (out[0][0], out[0][1]) = (edges[1][1] / det, -edges[1][0] / det);
        (out[1][0], out[1][1]) = (-edges[0][1] / det, edges[0][0] / det);
    } else {
        let cross = |a: usize, b: usize, i: usize| {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            edges[a][j] * edges[b][k] - edges[a][k] * edges[b][j]
        };
        let det: f64 = (0..D).map(|i| edges[0][i] * cross(1, 2, i)).sum();
        for a in 0..D {
            for i in 0..D {
                out[a][i] = cross((a + 1) % 3, (a + 2) % 3, i) / det;
            }
        }
    }
    out
}

/// Cells of one material that follow each other, at most a batch of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CellRun {
    /// Local number of the first cell.
    pub first: usize,
    /// Number of cells.
    pub count: usize,
    /// Position among the body's materials.
    pub material: usize,
}

/// The cells of a rank.
#[derive(Debug, Clone, PartialEq)]
pub struct Geometry<const D: usize> {
    /// One a cell, in the order of the mesh.
    pub cells: Vec<Simplex<D>>,
    /// All cells in their order, cut where the material changes: the batches of every pass.
    pub runs: Vec<CellRun>,
}

impl<const D: usize> Geometry<D> {
    /// Measures every cell of a body of one material.
    pub fn new(mesh: &Mesh<D>) -> Self {
        Self::with_materials(mesh, |_| 0)
    }

    /// Measures every cell of the mesh; `material` tells that of a region of the mesh.
    pub fn with_materials(mesh: &Mesh<D>, material: impl Fn(usize) -> usize) -> Self {
        let cells: Vec<Simplex<D>> = mesh
            .cells
            .chunks_exact(D + 1)
            .map(|nodes| {
                let mut corners = [[0.0; D]; 4];
                for (corner, &node) in corners.iter_mut().zip(nodes) {
                    *corner = mesh.nodes[node as usize];
                }
                Simplex::new(&corners[..=D])
            })
            .collect();
        let mut runs: Vec<CellRun> = Vec::new();
        for cell in 0..cells.len() {
            let material = mesh.cell_regions.get(cell).map_or(0, |&region| material(usize::from(region)));
            match runs.last_mut() {
                Some(run) if run.material == material && run.count < BATCH => run.count += 1,
                _ => runs.push(CellRun { first: cell, count: 1, material }),
            }
        }
        Self { cells, runs }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gradients_of_an_affine_field_are_exact() {
        let corners = [[0.1, 0.2, 0.3], [1.0, 0.1, 0.0], [0.2, 1.3, 0.1], [0.0, 0.3, 0.9]];
        let matrix = [[1.0, 2.0, 3.0], [-4.0, 5.0, 6.0], [0.5, -8.0, 9.0]];
        let nodal: Vec<Vector<3>> = corners
            .iter()
            .map(|x| std::array::from_fn(|i| (0..3).map(|j| matrix[i][j] * x[j]).sum()))
            .collect();
        let gradient = Simplex::new(&corners).field_gradient(&nodal);
        for i in 0..3 {
            for j in 0..3 {
                assert!((gradient[i][j] - matrix[i][j]).abs() < 1e-13);
            }
        }
    }

    #[test]
    fn cells_are_visited_in_runs_of_one_material_and_of_at_most_a_batch() {
        let cell_regions: Vec<u16> = (0..BATCH + 5).map(|cell| u16::from((3..5).contains(&cell))).collect();
        let mesh = Mesh::<2> {
            nodes: vec![[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]],
            cells: [0, 1, 2].repeat(cell_regions.len()),
            cell_regions,
            ..Mesh::default()
        };
        let runs = |geometry: Geometry<2>| -> Vec<(usize, usize, usize)> {
            geometry.runs.iter().map(|run| (run.first, run.count, run.material)).collect()
        };
        let two = runs(Geometry::with_materials(&mesh, |region| 1 - region));
        assert_eq!(two, [(0, 3, 1), (3, 2, 0), (5, BATCH, 1)]);
        assert_eq!(runs(Geometry::new(&mesh)), [(0, BATCH, 0), (BATCH, 5, 0)]);
    }

    #[test]
    fn the_unit_triangle_has_the_textbook_gradients() {
        let cell = Simplex::new(&[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]);
        assert_eq!(cell.volume, 0.5);
        assert_eq!([0, 1, 2].map(|a| cell.gradient(a)), [[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]]);
    }
}
