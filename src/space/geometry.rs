//! Volumes and shape function gradients of cells, computed once.

use super::BATCH;
use crate::{
    lanes::{LANES, Pack, place, prefetch},
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

/// Cells side by side; where there are fewer than lanes, the others have no volume and no gradients.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SimplexPack<const D: usize> {
    /// Areas or volumes in m^D.
    pub volume: [f64; LANES],
    /// Gradients in 1/m, as those of a [`Simplex`].
    pub gradients: [Pack<D>; D],
}

impl<const D: usize> SimplexPack<D> {
    const EMPTY: Self = Self { volume: [0.0; LANES], gradients: [Pack::ZERO; D] };

    /// The cell of a lane.
    #[inline(always)]
    pub fn simplex(&self, lane: usize) -> Simplex<D> {
        Simplex { volume: self.volume[lane], gradients: self.gradients.map(|gradient| gradient.lane(lane)) }
    }

    fn set(&mut self, lane: usize, cell: &Simplex<D>) {
        self.volume[lane] = cell.volume;
        self.gradients.iter_mut().zip(&cell.gradients).for_each(|(all, one)| all.set(lane, *one));
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
    /// Position of its first pack of cells among those of the geometry.
    pub pack: usize,
}

impl CellRun {
    /// Number of its packs of cells.
    #[inline]
    pub fn packs(&self) -> usize {
        self.count.div_ceil(LANES)
    }
}

/// The cells of a rank.
#[derive(Debug, Clone, PartialEq)]
pub struct Geometry<const D: usize> {
    /// The packs of all runs: each run begins with one of its own.
    pub packs: Vec<SimplexPack<D>>,
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
        let mut runs: Vec<CellRun> = Vec::new();
        for cell in 0..mesh.cells.len() / (D + 1) {
            let material = mesh.cell_regions.get(cell).map_or(0, |&region| material(usize::from(region)));
            match runs.last_mut() {
                Some(run) if run.material == material && run.count < BATCH => run.count += 1,
                last => {
                    let pack = last.map_or(0, |run| run.pack + run.packs());
                    runs.push(CellRun { first: cell, count: 1, material, pack });
                }
            }
        }
        let mut packs = vec![SimplexPack::EMPTY; runs.last().map_or(0, |run| run.pack + run.packs())];
        for run in &runs {
            for at in 0..run.count {
                let mut corners = [[0.0; D]; 4];
                for (corner, &node) in corners.iter_mut().zip(mesh.cell(run.first + at)) {
                    *corner = mesh.nodes[node as usize];
                }
                let (pack, lane) = place(at);
                packs[run.pack + pack].set(lane, &Simplex::new(&corners[..=D]));
            }
        }
        Self { packs, runs }
    }

    /// The packs of a run.
    #[inline]
    pub fn of_run(&self, run: &CellRun) -> &[SimplexPack<D>] {
        &self.packs[run.pack..][..run.packs()]
    }

    /// Asks for the packs of a run, which are soon needed.
    #[inline]
    pub fn prefetch(&self, run: &CellRun) {
        for cells in self.of_run(run) {
            prefetch(&cells.volume);
            cells.gradients.iter().for_each(|gradient| prefetch(gradient.0.as_flattened()));
        }
    }

    /// The cell of this local number.
    #[inline]
    pub fn cell(&self, number: usize) -> Simplex<D> {
        let run = &self.runs[self.runs.partition_point(|run| run.first + run.count <= number)];
        let (pack, lane) = place(number - run.first);
        self.packs[run.pack + pack].simplex(lane)
    }

    /// All cells in the order of the mesh.
    pub fn iter(&self) -> impl Iterator<Item = Simplex<D>> {
        self.runs.iter().flat_map(|run| self.cells_of(run))
    }

    /// The cells of a run in the order of the mesh.
    pub fn cells_of(&self, run: &CellRun) -> impl Iterator<Item = Simplex<D>> {
        let packs = self.of_run(run);
        (0..run.count).map(|at| packs[place(at).0].simplex(place(at).1))
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
        let geometry = Geometry::with_materials(&mesh, |region| 1 - region);
        assert_eq!([0, 1, 2].map(|run| geometry.runs[run].pack), [0, 1, 2]);
        assert_eq!(geometry.packs.len(), 2 + BATCH / LANES);
        assert!(geometry.iter().all(|cell| cell.volume == 0.5) && geometry.iter().count() == BATCH + 5);
        assert_eq!(geometry.cell(4), Simplex::new(&mesh.nodes));
        assert_eq!(
            geometry.packs.iter().map(|pack| pack.volume.iter().sum::<f64>()).sum::<f64>(),
            0.5 * (BATCH + 5) as f64
        );
        let two = runs(geometry);
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
