//! Volumes and shape function gradients of cells, computed once.
//!
//! Stresses live at points: one in a linear cell, several in a quadratic one. A point has the geometry of a linear cell, see
//! [`super::quadratic`].
//!
//! The cells of a body of revolution are rings: volumes are those of the whole turn, and the hoop strain `u_r / r` at a point is a
//! multiple of the radial displacements at the corners of its linear cell.

use super::{
    quadratic::{MOST_NODES, node_count, place_in_cell, values},
    quadrature::{CENTROID, MOST_POINTS, cell_rule, fine_cell_rule},
};
use crate::{
    linear_algebra::{
        simd::{LANES, Pack, prefetch},
        tensor::{Mandel, Vector, component, dot, symmetric_part},
    },
    mesh::{
        Mesh,
        shape::{self, linear_at},
    },
};

/// One linear cell, or a point of a quadratic one: its volume and the gradients of its linear shape functions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Simplex<const D: usize> {
    /// Area or volume in m^D; of a point its quadrature weight.
    pub volume: f64,
    /// Gradients in 1/m of the shape functions of the cell's nodes 1 to D; that of node 0 is minus their sum.
    pub gradients: [Vector<D>; D],
    /// In a body of revolution the hoop strain in 1/m of a radial displacement of 1 m at each corner; zeros elsewhere.
    pub hoop: [f64; 3],
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
        Self { volume: shape::signed_measure(corners), gradients: dual_basis(&edges), hoop: [0.0; 3] }
    }

    /// The ring of the cell, given the place of its point in barycentric coordinates, the point's distance from the axis in m and the
    /// measure of what turns there.
    fn revolved(self, place: &[f64], radius: f64, turn: f64) -> Self {
        let hoop = std::array::from_fn(|a| place[a] / radius);
        Self { volume: turn * self.volume, hoop, ..self }
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

    /// Strain of the field with these values at the corners.
    #[inline(always)]
    pub fn strain<const S: usize>(&self, nodal: &[Vector<D>]) -> Mandel<S> {
        let mut out = symmetric_part(&self.field_gradient(nodal));
        if S == 4 {
            out[2] = self.hoop.iter().zip(nodal).map(|(hoop, value)| hoop * value[0]).sum();
        }
        out
    }

    /// Forces in N on the corners that a stress in Pa resists, the transpose of [`Simplex::strain`].
    #[inline(always)]
    pub fn forces<const S: usize>(&self, stress: &Mandel<S>) -> [Vector<D>; 4] {
        let mut inner = [[0.0; D]; D];
        for (c, value) in stress.iter().enumerate() {
            let (i, j, factor) = component::<S>(c);
            if i < D && j < D {
                inner[i][j] = self.volume * value / factor;
                inner[j][i] = inner[i][j];
            }
        }
        let mut out = [[0.0; D]; 4];
        for (a, force) in out.iter_mut().enumerate().take(D + 1) {
            let gradient = self.gradient(a);
            *force = std::array::from_fn(|i| dot(&inner[i], &gradient));
            if S == 4 {
                force[0] += self.volume * stress[2] * self.hoop[a];
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

    /// The cell of a lane, in a body that is not one of revolution.
    #[inline(always)]
    pub fn simplex(&self, lane: usize) -> Simplex<D> {
        let gradients = self.gradients.map(|gradient| gradient.lane(lane));
        Simplex { volume: self.volume[lane], gradients, hoop: [0.0; 3] }
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

/// Writes a number for each cell, batch by batch.
fn fill(
    runs: &[CellRun],
    points: usize,
    batches: &mut Vec<[f64; LANES]>,
    value: impl Fn(usize, usize, usize) -> f64,
) {
    batches.clear();
    for run in runs {
        for point in 0..points {
            let mut of_batch = [0.0; LANES];
            (0..run.count).for_each(|lane| of_batch[lane] = value(run.material, run.first + lane, point));
            batches.push(of_batch);
        }
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
    /// The pack of each run; where cells are curved, those of each point, run by run.
    pub packs: Vec<SimplexPack<D>>,
    /// All cells in the order of the mesh, split where the material changes: the batches of every pass.
    pub runs: Vec<CellRun>,
    /// Hoop strains of unit displacements for each of these packs; present in a body of revolution.
    hoops: Vec<Pack<3>>,
    /// Points in a cell.
    points: usize,
    /// Weights of the fine rule in each run; present where cells are curved or rings.
    fine_weights: Vec<[[f64; LANES]; MOST_POINTS]>,
    /// The strains without stress for each batch; empty: none.
    free_strains: Vec<[f64; LANES]>,
    /// Temperatures in K for each batch; empty: no law depends on them.
    temperatures: Vec<[f64; LANES]>,
}

/// What the integrals of products of shape functions of a pack of cells need.
#[derive(Debug, Clone, Copy)]
pub enum CellShape<'g> {
    /// Linear shape functions.
    Linear,
    /// Quadratic shape functions and straight sides.
    Straight,
    /// Quadratic shape functions and curved sides, or a ring: weights in m^D of the points of the fine rule.
    Curved(&'g [[f64; LANES]; MOST_POINTS]),
    /// A ring with linear shape functions, with the same weights.
    LinearRing(&'g [[f64; LANES]; MOST_POINTS]),
}

impl CellShape<'_> {
    /// Whether the shape functions are linear.
    #[inline(always)]
    pub fn is_linear(&self) -> bool {
        matches!(self, Self::Linear | Self::LinearRing(_))
    }

    /// Number of nodes of a cell.
    #[inline(always)]
    pub fn nodes<const D: usize>(&self) -> usize {
        if self.is_linear() { D + 1 } else { node_count::<D>() }
    }

    /// The functions of these nodes at a place in barycentric coordinates.
    #[inline(always)]
    pub fn values<const D: usize>(&self, place: &[f64; 4]) -> [f64; MOST_NODES] {
        if !self.is_linear() {
            return values(D + 1, place);
        }
        let mut out = [0.0; MOST_NODES];
        out[..=D].copy_from_slice(&place[..=D]);
        out
    }
}

/// One cell with all its points.
#[derive(Debug, Clone, Copy)]
pub struct Cell<'g, const D: usize> {
    geometry: &'g Geometry<D>,
    run: usize,
    lane: usize,
}

impl<'g, const D: usize> Cell<'g, D> {
    /// Its shape, with weights by lane.
    #[inline(always)]
    pub fn shape(self) -> CellShape<'g> {
        self.geometry.shape(self.run)
    }

    /// The index of its material.
    #[inline(always)]
    pub fn material(self) -> usize {
        self.geometry.runs[self.run].material
    }

    /// Its lane in the weights of its shape.
    #[inline(always)]
    pub fn lane(self) -> usize {
        self.lane
    }

    /// A point of the cell: its weight, and the gradients there.
    #[inline(always)]
    pub fn point(self, point: usize) -> Simplex<D> {
        self.geometry.simplex(self.run, point, self.lane)
    }

    /// Number of its points.
    #[inline(always)]
    pub fn points(self) -> usize {
        self.geometry.points
    }

    /// The whole cell in one: its volume, and the gradients of the linear functions of its corners; of a curved cell those at its
    /// first point.
    #[inline(always)]
    pub fn whole(self) -> Simplex<D> {
        let first = self.point(0);
        if self.shape().is_linear() {
            return first;
        }
        Simplex { volume: (0..self.points()).map(|q| self.point(q).volume).sum(), ..first }
    }
}

impl<const D: usize> Geometry<D> {
    /// The geometry of all cells of a body of one material.
    pub fn new(mesh: &Mesh<D>) -> Self {
        Self::with_materials(mesh, |_| 0)
    }

    /// The geometry of all cells of the mesh; `material` gives the material of a region of the mesh.
    pub fn with_materials(mesh: &Mesh<D>, material: impl Fn(usize) -> usize) -> Self {
        Self::by_cells(mesh, |cell| {
            mesh.cell_regions.get(cell).map_or(0, |&region| material(usize::from(region)))
        })
    }

    /// The geometry of all cells of the mesh; `material` gives the material of a cell by its local number.
    pub fn by_cells(mesh: &Mesh<D>, material: impl Fn(usize) -> usize) -> Self {
        let mut runs: Vec<CellRun> = Vec::new();
        for cell in 0..mesh.cells.len() / (D + 1) {
            let material = material(cell);
            match runs.last_mut() {
                Some(run) if run.material == material && run.count < LANES => run.count += 1,
                _ => runs.push(CellRun { first: cell, count: 1, material }),
            }
        }
        let points = if mesh.order() == 1 { 1 } else { cell_rule::<D>().len() };
        let share = 1.0 / points as f64;
        let pack_of = |run: &CellRun, simplex: &dyn Fn(usize) -> Simplex<D>| {
            let mut pack = SimplexPack::EMPTY;
            (0..run.count).for_each(|lane| pack.set(lane, &simplex(run.first + lane)));
            pack
        };
        if !(mesh.is_curved || mesh.is_revolved) {
            let simplex = |cell: usize| {
                let whole = Simplex::new(&mesh.corners(cell)[..=D]);
                if points == 1 { whole } else { Simplex { volume: share * whole.volume, ..whole } }
            };
            let packs = runs.iter().map(|run| pack_of(run, &simplex)).collect();
            return Self {
                packs,
                runs,
                hoops: Vec::new(),
                points,
                fine_weights: Vec::new(),
                free_strains: Vec::new(),
                temperatures: Vec::new(),
            };
        }
        let at = |cell: usize, place: &[f64; 4], weight: f64| {
            let nodes: Vec<Vector<D>> = mesh.cell_nodes(cell).map(|n| mesh.nodes[n as usize]).collect();
            let is_linear = mesh.order() == 1;
            let simplex = if is_linear {
                Simplex::new(&nodes)
            } else {
                Simplex::new(&linear_at(D + 1, place, &nodes)[..=D])
            };
            let simplex = Simplex { volume: weight * simplex.volume, ..simplex };
            if !mesh.is_revolved {
                return simplex;
            }
            let middle = place_in_cell(mesh, cell, place);
            simplex.revolved(place, middle[0], mesh.turn(&middle))
        };
        let rule = if points == 1 { CENTROID } else { cell_rule::<D>() };
        let (mut packs, mut hoops, mut fine_weights) = (Vec::new(), Vec::new(), Vec::new());
        for run in &runs {
            for (place, weight) in rule {
                packs.push(pack_of(run, &|cell| at(cell, place, *weight)));
                if mesh.is_revolved {
                    let mut hoop = Pack::ZERO;
                    (0..run.count).for_each(|lane| hoop.set(lane, at(run.first + lane, place, *weight).hoop));
                    hoops.push(hoop);
                }
            }
            let mut weights = [[0.0; LANES]; MOST_POINTS];
            for (weights, (place, weight)) in weights.iter_mut().zip(fine_cell_rule::<D>()) {
                for lane in 0..run.count {
                    weights[lane] = at(run.first + lane, place, *weight).volume;
                }
            }
            fine_weights.push(weights);
        }
        Self { packs, runs, hoops, points, fine_weights, free_strains: Vec::new(), temperatures: Vec::new() }
    }

    /// Points in a cell, at which stresses live.
    #[inline(always)]
    pub fn points(&self) -> usize {
        self.points
    }

    /// Points of the cells of this rank.
    pub fn point_count(&self) -> usize {
        self.runs.last().map_or(0, |run| run.first + run.count) * self.points
    }

    /// Bytes that are kept.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.packs[..])
            + size_of_val(&self.runs[..])
            + size_of_val(&self.hoops[..])
            + size_of_val(&self.fine_weights[..])
            + size_of_val(&self.free_strains[..])
            + size_of_val(&self.temperatures[..])
    }

    /// Sets the strain that each cell has without stress, alike along all axes, given a cell's material, its local number and the number of
    /// its point.
    pub fn set_free_strains(&mut self, strain: impl Fn(usize, usize, usize) -> f64) {
        fill(&self.runs, self.points, &mut self.free_strains, strain);
    }

    /// Sets the temperature in K of each cell, in the same way.
    pub fn set_temperatures(&mut self, temperature: impl Fn(usize, usize, usize) -> f64) {
        fill(&self.runs, self.points, &mut self.temperatures, temperature);
    }

    /// The temperatures in K of a batch, where laws depend on them.
    #[inline(always)]
    pub(super) fn temperature(&self, batch: usize) -> Option<&[f64; LANES]> {
        self.temperatures.get(batch)
    }

    /// The strains without stress of a batch, if there are any.
    #[inline(always)]
    pub(super) fn free_strain(&self, batch: usize) -> Option<&[f64; LANES]> {
        self.free_strains.get(batch)
    }

    /// The geometry of a run of cells at a point.
    #[inline(always)]
    pub(super) fn pack(&self, run: usize, point: usize) -> &SimplexPack<D> {
        if self.fine_weights.is_empty() { &self.packs[run] } else { &self.packs[run * self.points + point] }
    }

    /// The hoop strains of unit displacements at the corners of these cells, in a body of revolution.
    #[inline(always)]
    pub(super) fn hoop(&self, run: usize, point: usize) -> Option<&Pack<3>> {
        self.hoops.get(run * self.points + point)
    }

    #[inline(always)]
    fn simplex(&self, run: usize, point: usize, lane: usize) -> Simplex<D> {
        let plain = self.pack(run, point).simplex(lane);
        self.hoop(run, point).map_or(plain, |hoop| Simplex { hoop: hoop.lane(lane), ..plain })
    }

    /// The shape of the cells of a run.
    #[inline(always)]
    pub(super) fn shape(&self, run: usize) -> CellShape<'_> {
        match self.fine_weights.get(run) {
            None if self.points == 1 => CellShape::Linear,
            None => CellShape::Straight,
            Some(weights) if self.points == 1 => CellShape::LinearRing(weights),
            Some(weights) => CellShape::Curved(weights),
        }
    }

    /// The whole cell of this local number, see [`Cell::whole`].
    #[inline]
    pub fn cell(&self, number: usize) -> Simplex<D> {
        self.cell_at(number).whole()
    }

    /// A cell by its number, with its shape.
    pub fn cell_at(&self, number: usize) -> Cell<'_, D> {
        let run = self.run_of(number);
        Cell { geometry: self, run, lane: number - self.runs[run].first }
    }

    /// The cell of a point by its number, the place of the point in the cell, and its geometry. Points are numbered in the order in
    /// which a pass visits them.
    #[inline]
    pub fn point(&self, number: usize) -> (usize, usize, Simplex<D>) {
        let at = self.run_of(number / self.points);
        let run = &self.runs[at];
        let within = number - run.first * self.points;
        let (point, lane) =
            if self.points == 1 { (0, within) } else { (within / run.count, within % run.count) };
        (run.first + lane, point, self.simplex(at, point, lane))
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
    pub fn cells(&self) -> impl Iterator<Item = Cell<'_, D>> {
        let cell = |(run, lane)| Cell { geometry: self, run, lane };
        let runs = self.runs.iter().enumerate();
        runs.flat_map(|(at, run)| (0..run.count).map(move |lane| (at, lane))).map(cell)
    }

    /// All cells in the order of the mesh, each in one, see [`Cell::whole`].
    pub fn iter(&self) -> impl Iterator<Item = Simplex<D>> {
        self.cells().map(Cell::whole)
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
    fn the_work_of_the_forces_of_a_stress_is_that_of_the_stress() {
        let corners = [[0.1, 0.2], [1.0, 0.1], [0.2, 1.3]];
        let cell = Simplex::new(&corners).revolved(&[0.2, 0.3, 0.5], 0.42, 2.6);
        let (moved, stress) = ([[0.1, -0.3], [0.4, 0.2], [-0.7, 0.6]], [3.0, -1.0, 5.0, 2.0]);
        let forces = cell.forces(&stress);
        let work: f64 = moved.iter().zip(&forces).map(|(u, force)| dot(u, force)).sum();
        let expected = cell.volume * dot(&stress, &cell.strain(&moved));
        assert!((work - expected).abs() < 1e-14 * expected.abs(), "{work} {expected}");
        // A body on which only the hoop stress acts is pushed away from the axis.
        let total: f64 = cell.forces(&[0.0, 0.0, 1.0, 0.0]).iter().map(|force| force[0]).sum();
        assert!((total - cell.volume / 0.42).abs() < 1e-14 * total, "{total}");
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
