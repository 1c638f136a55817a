//! Volumes and shape function gradients of cells, computed once.

use crate::{
    linear_algebra::{
        simd::{LANES, Pack, prefetch},
        tensor::Vector,
    },
    mesh::{Mesh, shape},
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

/// A pack of cells, one in each lane; lanes without a cell have zero volume and zero gradients.
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

    /// Prefetches the pack.
    #[inline(always)]
    pub(super) fn prefetch(&self) {
        prefetch(&self.volume);
        self.gradients.iter().for_each(Pack::prefetch);
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

/// Consecutive cells of one material, at most one pack.
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
    /// The pack of each run.
    pub packs: Vec<SimplexPack<D>>,
    /// All cells in the order of the mesh, split where the material changes: the batches of every pass.
    pub runs: Vec<CellRun>,
}

impl<const D: usize> Geometry<D> {
    /// The geometry of all cells of a body of one material.
    pub fn new(mesh: &Mesh<D>) -> Self {
        Self::with_materials(mesh, |_| 0)
    }

    /// The geometry of all cells of the mesh; `material` gives the material of a region of the mesh.
    pub fn with_materials(mesh: &Mesh<D>, material: impl Fn(usize) -> usize) -> Self {
        let mut runs: Vec<CellRun> = Vec::new();
        for cell in 0..mesh.cells.len() / (D + 1) {
            let material = mesh.cell_regions.get(cell).map_or(0, |&region| material(usize::from(region)));
            match runs.last_mut() {
                Some(run) if run.material == material && run.count < LANES => run.count += 1,
                _ => runs.push(CellRun { first: cell, count: 1, material }),
            }
        }
        let measure = |run: &CellRun| {
            let mut pack = SimplexPack::EMPTY;
            for lane in 0..run.count {
                pack.set(lane, &Simplex::new(&mesh.corners(run.first + lane)[..=D]));
            }
            pack
        };
        Self { packs: runs.iter().map(measure).collect(), runs }
    }

    /// The cell of this local number.
    #[inline]
    pub fn cell(&self, number: usize) -> Simplex<D> {
        let run = self.run_of(number);
        self.packs[run].simplex(number - self.runs[run].first)
    }

    /// The run of a cell. Runs have at most as many cells as a pack has lanes, so that the search starts at `cell / LANES`; where all
    /// runs are full it ends there.
    #[inline]
    fn run_of(&self, cell: usize) -> usize {
        let least = cell / LANES;
        let behind = |run: &CellRun| run.first + run.count <= cell;
        least + if behind(&self.runs[least]) { self.runs[least..].partition_point(behind) } else { 0 }
    }

    /// All cells in the order of the mesh.
    pub fn iter(&self) -> impl Iterator<Item = Simplex<D>> {
        let packs = self.runs.iter().zip(&self.packs);
        packs.flat_map(|(run, pack)| (0..run.count).map(|lane| pack.simplex(lane)))
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
    fn cells_are_kept_in_runs_of_one_material_and_of_at_most_a_pack() {
        let cell_regions: Vec<u16> =
            (0..2 * LANES + 5).map(|cell| u16::from((3..5).contains(&cell))).collect();
        let mesh = Mesh::<2> {
            nodes: (0..=LANES + 8).flat_map(|i| [[i as f64, 0.0], [i as f64, 1.0 + i as f64]]).collect(),
            cells: (0..cell_regions.len() as u32).flat_map(|cell| [cell, cell + 2, cell + 1]).collect(),
            cell_regions,
            ..Mesh::default()
        };
        let runs = |geometry: &Geometry<2>| -> Vec<(usize, usize, usize)> {
            geometry.runs.iter().map(|run| (run.first, run.count, run.material)).collect()
        };
        let two = Geometry::with_materials(&mesh, |region| 1 - region);
        let rest = 5 + LANES;
        assert_eq!(runs(&two), [(0, 3, 1), (3, 2, 0), (5, LANES, 1), (rest, LANES, 1)]);
        let one = Geometry::new(&mesh);
        assert_eq!(runs(&one), [(0, LANES, 0), (LANES, LANES, 0), (2 * LANES, 5, 0)]);
        assert_eq!([two.packs.len(), one.packs.len()], [4, 3]);
        assert_eq!(one.packs[2].volume[5..], [0.0; LANES - 5]);
        let measured = |number: usize| {
            let corners: Vec<[f64; 2]> =
                mesh.cell(number).iter().map(|&node| mesh.nodes[node as usize]).collect();
            Simplex::new(&corners)
        };
        for geometry in [two, one] {
            assert_eq!(geometry.iter().count(), 2 * LANES + 5);
            for (number, cell) in geometry.iter().enumerate() {
                assert_eq!(cell, measured(number));
                assert_eq!(geometry.cell(number), cell);
            }
        }
    }

    #[test]
    fn the_unit_triangle_has_the_textbook_gradients() {
        let cell = Simplex::new(&[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]);
        assert_eq!(cell.volume, 0.5);
        assert_eq!([0, 1, 2].map(|a| cell.gradient(a)), [[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]]);
    }
}
