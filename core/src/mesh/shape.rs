//! Measures of simplices and facets.

use super::GlobalMesh;
use crate::linear_algebra::tensor::{Vector, add_scaled, norm};

/// The facet of a positively oriented cell opposite to its node `opposite`, its normal pointing outward.
#[inline]
pub(super) fn facet_of<const D: usize>(cell: &[u32], opposite: usize) -> [u32; D] {
    const TRIANGLE: [[usize; 2]; 3] = [[1, 2], [2, 0], [0, 1]];
    const TETRAHEDRON: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];
    std::array::from_fn(|i| match D {
        2 => cell[TRIANGLE[opposite][i]],
        _ => cell[TETRAHEDRON[opposite][i]],
    })
}

/// The corners of each edge of a cell, in the order in which VTK stores the nodes on the edges of quadratic cells (types 22 and 24).
#[inline]
pub fn edges_of_cell<const D: usize>() -> &'static [[usize; 2]] {
    const EDGES: [[usize; 2]; 6] = [[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]];
    &EDGES[..if D == 2 { 3 } else { 6 }]
}

/// The values at the corners of the linear function with the gradient that the quadratic function with these nodal values has at a point in
/// barycentric coordinates, of a simplex with so many corners; of places the corners of the linear cell whose map has the same
/// Jacobian there. Nodes are the corners, then those on the edges in the order of [`edges_of_cell`].
pub fn linear_at<const M: usize>(corners: usize, place: &[f64], nodal: &[[f64; M]]) -> [[f64; M]; 4] {
    let edges = &edges_of_cell::<3>()[..corners * (corners - 1) / 2];
    let mut out = [[0.0; M]; 4];
    for i in 0..corners {
        out[i] = nodal[i].map(|value| (4.0 * place[i] - 1.0) * value);
    }
    for (value, &[i, j]) in nodal[corners..].iter().zip(edges) {
        for k in 0..M {
            out[i][k] += 4.0 * place[j] * value[k];
            out[j][k] += 4.0 * place[i] * value[k];
        }
    }
    out
}

/// The smallest and the largest measure of the tangent cells of a quadratic cell at its nodes, the middles of its facets and its
/// centre: equal if edges are straight with nodes at their midpoints; the smallest is negative if the cell is folded.
pub fn tangent_measures<const D: usize>(nodes: &[Vector<D>]) -> [f64; 2] {
    let mut places = vec![[0.0; 4]; 0];
    for corners in 1..1_u8 << (D + 1) {
        let share = 1.0 / f64::from(corners.count_ones());
        places.push(std::array::from_fn(|a| if corners >> a & 1 == 1 { share } else { 0.0 }));
    }
    let measures = places.iter().map(|place| signed_measure(&linear_at(D + 1, place, nodes)[..=D]));
    measures.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], measure| {
        [if measure >= low { low } else { measure }, if measure <= high { high } else { measure }]
    })
}

/// Signed measure of the simplex spanned by `D + 1` corners: area in m² or volume in m³, positive when the corners
/// are positively oriented.
#[inline]
pub fn signed_measure<const D: usize>(corners: &[Vector<D>]) -> f64 {
    let edge = |i: usize| add_scaled(&corners[i], -1.0, &corners[0]);
    let (a, b) = (edge(1), edge(2));
    match D {
        2 => 0.5 * (a[0] * b[1] - a[1] * b[0]),
        _ => {
            let c = edge(3);
            (a[0] * (b[1] * c[2] - b[2] * c[1])
                + a[1] * (b[2] * c[0] - b[0] * c[2])
                + a[2] * (b[0] * c[1] - b[1] * c[0]))
                / 6.0
        }
    }
}

/// The outward normal of a facet, its length the facet's measure (m or m²).
#[inline]
pub fn facet_normal<const D: usize>(corners: &[Vector<D>; D]) -> Vector<D> {
    let a = add_scaled(&corners[1], -1.0, &corners[0]);
    let mut normal = [0.0; D];
    if D == 2 {
        (normal[0], normal[1]) = (a[1], -a[0]);
    } else {
        let b = add_scaled(&corners[2], -1.0, &corners[0]);
        for (i, component) in normal.iter_mut().enumerate() {
            let (j, k) = ((i + 1) % D, (i + 2) % D);
            *component = 0.5 * (a[j] * b[k] - a[k] * b[j]);
        }
    }
    normal
}

/// The mean of points (m).
pub fn centroid<const D: usize>(points: &[Vector<D>]) -> Vector<D> {
    let share = 1.0 / points.len() as f64;
    points.iter().fold([0.0; D], |sum, point| add_scaled(&sum, share, point))
}

/// The longest edge between any two of the corners (m).
pub(super) fn longest_edge<const D: usize>(corners: &[Vector<D>]) -> f64 {
    edges(corners).fold(0.0, f64::max)
}

/// Shape quality of a simplex: `D` times the inradius over the circumradius, 1 for the regular simplex and toward 0
/// for a degenerate one.
pub fn quality<const D: usize>(corners: &[Vector<D>]) -> f64 {
    let measure = signed_measure(corners).abs();
    let local: Vec<u32> = (0..=D as u32).collect();
    let surface: f64 = (0..=D)
        .map(|opposite| norm(&facet_normal(&facet_of::<D>(&local, opposite).map(|i| corners[i as usize]))))
        .sum();
    let inradius = D as f64 * measure / surface;
    let length = |i: usize, j: usize| norm(&add_scaled(&corners[i], -1.0, &corners[j]));
    let circumradius = if D == 2 {
        length(0, 1) * length(1, 2) * length(2, 0) / (4.0 * measure)
    } else {
        // Crelle: the products of opposite edges are the sides of a triangle of area 6 V R.
        let sides = [length(0, 1) * length(2, 3), length(0, 2) * length(1, 3), length(0, 3) * length(1, 2)];
        let half = 0.5 * sides.iter().sum::<f64>();
        (half * sides.iter().map(|side| half - side).product::<f64>()).max(0.0).sqrt() / (6.0 * measure)
    };
    let quality = D as f64 * inradius / circumradius;
    if quality.is_finite() { quality.clamp(0.0, 1.0) } else { 0.0 }
}

fn edges<const D: usize>(corners: &[Vector<D>]) -> impl Iterator<Item = f64> {
    (0..corners.len())
        .flat_map(move |i| (0..i).map(move |j| norm(&add_scaled(&corners[i], -1.0, &corners[j]))))
}

impl<const D: usize> GlobalMesh<D> {
    /// Number of cells.
    pub fn cell_count(&self) -> usize {
        self.cells.len() / (D + 1)
    }

    /// The node ids of a cell.
    #[inline]
    pub fn cell(&self, cell: usize) -> &[u32] {
        &self.cells[cell * (D + 1)..(cell + 1) * (D + 1)]
    }

    /// The corners of a cell; only the first `D + 1` of the four are meant.
    #[inline]
    pub fn corners(&self, cell: usize) -> [Vector<D>; 4] {
        let ids = self.cell(cell);
        std::array::from_fn(|i| self.nodes[ids[i.min(D)] as usize])
    }

    /// The nodes of a curved cell: its corners, then the nodes on its edges.
    pub(super) fn curved_nodes(&self, cell: usize) -> Vec<Vector<D>> {
        let edges = edges_of_cell::<D>().len();
        let corners = self.cell(cell).iter().map(|&node| self.nodes[node as usize]);
        corners.chain(self.curved[cell * edges..(cell + 1) * edges].iter().copied()).collect()
    }

    /// Signed area (m²) or volume (m³) of a cell.
    #[inline]
    pub fn measure(&self, cell: usize) -> f64 {
        signed_measure(&self.corners(cell)[..=D])
    }

    /// Centroid of a cell (m).
    pub fn centroid(&self, cell: usize) -> Vector<D> {
        centroid(&self.corners(cell)[..=D])
    }

    /// The corners of a facet (m).
    pub fn facet_corners(&self, facet: usize) -> [Vector<D>; D] {
        self.facets[facet].map(|node| self.nodes[node as usize])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_regular_simplex_has_quality_one_and_a_sliver_almost_none() {
        let h = 3f64.sqrt() / 2.0;
        assert!((quality(&[[0.0, 0.0], [1.0, 0.0], [0.5, h]]) - 1.0).abs() < 1e-14);
        let regular = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
        assert!((quality(&regular) - 1.0).abs() < 1e-14);
        assert!(quality(&[[0.0, 0.0], [1.0, 0.0], [0.5, 1e-3]]) < 0.01);
        assert_eq!(quality(&[[0.0, 0.0], [1.0, 0.0], [0.5, 0.0]]), 0.0);
        let flat = [[0.0, 0.0, 0.0], [1.0, 0.0, 1e-4], [1.0, 1.0, 0.0], [0.0, 1.0, 1e-4]];
        assert!(quality(&flat) < 0.01);
        // Right isosceles: inradius (2 - √2)/2, circumradius √2/2.
        let right = quality(&[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]);
        assert!((right - 2.0 * (2.0 - 2f64.sqrt()) / 2f64.sqrt()).abs() < 1e-14);
    }

    #[test]
    fn facets_of_a_positive_cell_face_away_from_the_opposite_node() {
        let triangle = [[0.1, 0.0], [1.0, 0.2], [0.3, 1.0]];
        assert!(signed_measure(&triangle) > 0.0);
        outward(&triangle);
        let tetrahedron = [[0.1, 0.0, 0.0], [1.0, 0.2, 0.1], [0.3, 1.0, 0.0], [0.2, 0.1, 0.9]];
        assert!(signed_measure(&tetrahedron) > 0.0);
        outward(&tetrahedron);
    }

    #[test]
    fn tangents_of_a_quadratic_cell_are_those_of_its_map() {
        // x = a + 2b, y = b + b²: the area element is 2 (1 + 2b) times that of the unit triangle.
        let map = |[a, b]: [f64; 2]| [2.0 * b + a, b + b * b];
        let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
        let middles = edges_of_cell::<2>().iter().map(|&[a, b]| centroid(&[corners[a], corners[b]]));
        let nodes: Vec<Vector<2>> = corners.into_iter().chain(middles).map(map).collect();
        let measure = |b: f64| signed_measure(&linear_at(3, &[0.7 - b, 0.3, b], &nodes)[..3]);
        assert!((measure(0.4) - 0.5 * 1.8).abs() < 1e-15 && (measure(0.0) - 0.5).abs() < 1e-15);
        let [low, high] = tangent_measures(&nodes);
        assert!((low - 0.5).abs() < 1e-15 && (high - 1.5).abs() < 1e-15);
        let mut folded = nodes;
        folded[3][1] = 0.6;
        assert!(tangent_measures(&folded)[0] < 0.0);
    }

    fn outward<const D: usize>(corners: &[Vector<D>]) {
        let ids: Vec<u32> = (0..=D as u32).collect();
        for opposite in 0..=D {
            let facet = facet_of::<D>(&ids, opposite).map(|i| corners[i as usize]);
            let away = add_scaled(&centroid(&facet), -1.0, &corners[opposite]);
            let product = crate::linear_algebra::tensor::dot(&facet_normal(&facet), &away);
            assert!((product - D as f64 * signed_measure(corners)).abs() < 1e-14);
        }
    }
}
