//! The visible part of a body: all cells in 2D, or a solid from a fixed oblique direction.

use crate::io::output::field_snapshot::Snapshot;
use std::collections::BTreeMap;

/// Direction toward the viewer of a solid from the front right and above (x to the right, y away, z up).
const TOWARD_VIEWER: [f64; 3] = [0.48, -0.74, 0.47];
/// Direction toward the light.
const TOWARD_LIGHT: [f64; 3] = [0.35, -0.6, 0.72];

/// A triangle of the body that may be visible.
#[derive(Debug, Clone, Copy)]
pub struct Face {
    /// Its nodes; for a solid counterclockwise as seen from outside.
    pub nodes: [u32; 3],
    /// Its cell.
    pub cell: u32,
    /// Whether each of its edges, from a node to the next, lies inside a cell of the file, which the drawing has divided.
    pub is_inside: [bool; 3],
}

/// The faces of a body: its cells in 2D, its surface in 3D.
pub fn faces(snapshot: &Snapshot) -> Vec<Face> {
    if snapshot.dimension() == 2 {
        let of_part = |cell: usize| match (snapshot.parts, cell % 4) {
            (4, 0) => [false, true, false],
            (4, 1) => [false, false, true],
            (4, 2) => [true, false, false],
            (4, _) => [true; 3],
            _ => [false; 3],
        };
        let face = |(cell, n): (usize, &[u32])| Face {
            nodes: [n[0], n[1], n[2]],
            cell: cell as u32,
            is_inside: of_part(cell),
        };
        return snapshot.cells().enumerate().map(face).collect();
    }
    let mut sides: Vec<([u32; 3], u32, u8)> = Vec::with_capacity(snapshot.cells.len());
    for (cell, nodes) in snapshot.cells().enumerate() {
        for opposite in 0..4 {
            let mut key = [0; 3];
            let others = (0..4).filter(|corner| *corner != opposite);
            others.zip(&mut key).for_each(|(corner, node)| *node = nodes[corner]);
            key.sort_unstable();
            sides.push((key, cell as u32, opposite as u8));
        }
    }
    sides.sort_unstable();
    let alone = sides.chunk_by(|a, b| a.0 == b.0).filter(|same| same.len() == 1);
    alone.map(|same| outward(snapshot, same[0])).collect()
}

/// The edges of a 2D body that belong to one cell only, joined to lines: nodes in order; the first node of a closed line is
/// repeated at its end.
pub fn outline(snapshot: &Snapshot) -> Vec<Vec<u32>> {
    let mut edges: Vec<[u32; 2]> = Vec::with_capacity(snapshot.cells.len());
    for n in snapshot.cells() {
        edges.extend([[n[0], n[1]], [n[1], n[2]], [n[2], n[0]]].map(|[a, b]| [a.min(b), a.max(b)]));
    }
    edges.sort_unstable();
    let alone = edges.chunk_by(|a, b| a == b).filter(|same| same.len() == 1).map(|same| same[0]);
    let mut next: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for [a, b] in alone {
        next.entry(a).or_default().push(b);
        next.entry(b).or_default().push(a);
    }
    let mut lines = Vec::new();
    while let Some((&start, _)) = next.first_key_value() {
        let mut line = vec![start];
        let mut node = start;
        while let Some(follower) = next.get_mut(&node).and_then(Vec::pop) {
            if let Some(back) = next.get_mut(&follower) {
                back.retain(|other| *other != node);
            }
            line.push(follower);
            node = follower;
        }
        if line.len() > 1 {
            lines.push(line);
        } else {
            next.remove(&start);
        }
    }
    lines
}

/// Outward unit normals at boundary nodes: the mean over the facets between these nodes, weighted by their size.
pub fn normals(snapshot: &Snapshot, nodes: &[usize]) -> Vec<[f64; 3]> {
    let mut sums: BTreeMap<u32, [f64; 3]> = nodes.iter().map(|node| (*node as u32, [0.0; 3])).collect();
    for (facet, normal) in facets(snapshot) {
        if facet.iter().all(|node| sums.contains_key(node)) {
            for node in facet {
                let sum = sums.entry(node).or_default();
                *sum = std::array::from_fn(|i| sum[i] + normal[i]);
            }
        }
    }
    nodes.iter().map(|node| unit(sums[&(*node as u32)])).collect()
}

/// The nodes of each facet of the surface, with its outward normal; the length of the normal is in proportion to the facet's size.
pub fn facets(snapshot: &Snapshot) -> Vec<(Vec<u32>, [f64; 3])> {
    let at = |node: u32| snapshot.nodes[node as usize];
    if snapshot.dimension() == 2 {
        let mut edges: Vec<([u32; 2], u32)> = Vec::with_capacity(snapshot.cells.len());
        for n in snapshot.cells() {
            let sides = [[n[0], n[1], n[2]], [n[1], n[2], n[0]], [n[2], n[0], n[1]]];
            edges.extend(sides.map(|[a, b, opposite]| ([a.min(b), a.max(b)], opposite)));
        }
        edges.sort_unstable();
        let alone = edges.chunk_by(|a, b| a.0 == b.0).filter(|same| same.len() == 1);
        let of_edge = |same: &[([u32; 2], u32)]| {
            let ([a, b], opposite) = same[0];
            let [along, inward] = [minus(at(b), at(a)), minus(at(opposite), at(a))];
            let normal = [along[1], -along[0], 0.0];
            (vec![a, b], if dot(normal, inward) > 0.0 { normal.map(|c| -c) } else { normal })
        };
        return alone.map(of_edge).collect();
    }
    let of_face = |face: Face| {
        let [a, b, c] = face.nodes.map(at);
        (face.nodes.to_vec(), cross(minus(b, a), minus(c, a)))
    };
    faces(snapshot).into_iter().map(of_face).collect()
}

fn outward(snapshot: &Snapshot, (key, cell, opposite): ([u32; 3], u32, u8)) -> Face {
    let at = |node: u32| snapshot.nodes[node as usize];
    let [a, b, c] = key.map(at);
    let inside = at(snapshot.cells[cell as usize * 4 + opposite as usize]);
    let normal = cross(minus(b, a), minus(c, a));
    let nodes = if dot(normal, minus(inside, a)) > 0.0 { [key[0], key[2], key[1]] } else { key };
    Face { nodes, cell, is_inside: [false; 3] }
}

/// The axis along which the faces between these points have the largest projection: the largest component of their summed area
/// vector.
pub fn widest_along(points: &[[f64; 3]], faces: &[u32]) -> usize {
    let mut area = [0.0; 3];
    for face in faces.chunks_exact(3) {
        let [a, b, c] = [0, 1, 2].map(|n| points[face[n] as usize]);
        let normal = cross(minus(b, a), minus(c, a));
        area = std::array::from_fn(|i| area[i] + normal[i]);
    }
    (0..3).max_by(|a, b| area[*a].abs().total_cmp(&area[*b].abs())).unwrap_or(2)
}

/// Projection of points of the body into the picture plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum View {
    /// x to the right, y up.
    Plane,
    /// Oblique, without perspective: the unit vector toward the viewer.
    Oblique([f64; 3]),
}

impl View {
    /// The view of a body of this dimension: of a solid from the front right and above.
    pub(super) fn of(snapshot: &Snapshot) -> Self {
        if snapshot.dimension() == 2 { Self::Plane } else { Self::Oblique(unit(TOWARD_VIEWER)) }
    }

    /// The view that shows a side with this outward normal, if this view does not.
    pub(super) fn of_hidden_side(self, normal: [f64; 3]) -> Option<Self> {
        let Self::Oblique(toward) = self else { return None };
        let seen = dot(toward, normal);
        (seen < 0.2).then(|| {
            // The mirror image where it sees the side well, otherwise more from its front.
            let along = if seen < -0.4 { -2.0 * seen } else { 0.6 - seen };
            Self::Oblique(unit(std::array::from_fn(|i| toward[i] + along * normal[i])))
        })
    }

    /// Coordinates to the right, upwards, and toward the viewer.
    pub(super) fn project(self, point: [f64; 3]) -> [f64; 3] {
        match self {
            Self::Plane => point,
            Self::Oblique(toward) => {
                let right = unit(cross([0.0, 0.0, 1.0], toward));
                [dot(right, point), dot(cross(toward, right), point), dot(toward, point)]
            }
        }
    }

    /// Intensity of light on a face with these corners, from 0 to 1; none if it faces away from the viewer.
    pub(super) fn light(self, [a, b, c]: [[f64; 3]; 3]) -> Option<f64> {
        let Self::Oblique(toward) = self else { return Some(1.0) };
        let normal = unit(cross(minus(b, a), minus(c, a)));
        let is_seen = dot(normal, toward) > 0.0;
        // The light moves with the viewer.
        let lit = if toward[2] < 0.0 { [1.0, 1.0, -1.0] } else { [1.0; 3] };
        let light: [f64; 3] = std::array::from_fn(|i| lit[i] * TOWARD_LIGHT[i]);
        is_seen.then(|| 0.78 + 0.22 * dot(normal, unit(light)).max(0.0))
    }

    /// From where a solid is seen, in words.
    pub(super) fn words(self) -> Option<String> {
        let Self::Oblique(toward) = self else { return None };
        let sides = [["the left", "the right"], ["the front", "the back"], ["below", "above"]];
        let seen = (0..3).filter(|&axis| toward[axis].abs() > 0.2);
        let words: Vec<&str> = seen.map(|axis| sides[axis][usize::from(toward[axis] > 0.0)]).collect();
        Some(words.join(", "))
    }
}

/// The unit vector of the mean of these vectors; none if they cancel each other.
pub fn mean_direction(vectors: &[[f64; 3]]) -> Option<[f64; 3]> {
    let sum: [f64; 3] = std::array::from_fn(|i| vectors.iter().map(|vector| vector[i]).sum());
    (dot(sum, sum).sqrt() > 0.2 * vectors.len() as f64).then(|| unit(sum))
}

pub(super) fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| a[i] - b[i])
}

/// The scalar product.
pub fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| a[i] * b[i]).sum()
}

pub(super) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3])
}

/// The vector of length 1 in this direction.
pub fn unit(a: [f64; 3]) -> [f64; 3] {
    let size = dot(a, a).sqrt();
    a.map(|x| x / size)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two tetrahedra with a common face.
    fn pair() -> Snapshot {
        let nodes = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0, 1.0]];
        Snapshot { nodes, cells: vec![0, 1, 2, 3, 1, 2, 3, 4], corners: 4, ..Snapshot::default() }
    }

    #[test]
    fn the_surface_leaves_out_what_two_cells_share_and_looks_outwards() {
        let body = pair();
        let surface = faces(&body);
        assert_eq!(surface.len(), 6);
        let middle = [0.4, 0.4, 0.4];
        for face in surface {
            let [a, b, c] = face.nodes.map(|n| body.nodes[n as usize]);
            assert!(dot(cross(minus(b, a), minus(c, a)), minus(middle, a)) < 0.0, "{face:?} looks inwards");
        }
    }

    #[test]
    fn normals_are_means_over_the_facets_between_the_nodes() {
        let square = Snapshot {
            nodes: vec![[0.0; 3], [2.0, 0.0, 0.0], [2.0, 1.0, 0.0], [0.0, 1.0, 0.0]],
            cells: vec![0, 1, 2, 0, 2, 3],
            corners: 3,
            ..Snapshot::default()
        };
        assert_eq!(normals(&square, &[0, 1]), [[0.0, -1.0, 0.0]; 2]);
        let corner = normals(&square, &[0, 1, 2])[1];
        assert!((corner[0] - 0.2f64.sqrt()).abs() < 1e-15 && (corner[1] + 0.8f64.sqrt()).abs() < 1e-15);
        assert_eq!(normals(&pair(), &[0, 1, 2]), [[0.0, 0.0, -1.0]; 3]);
    }

    #[test]
    fn the_oblique_view_shows_the_front_right_and_top_and_keeps_up_upwards() {
        let view = View::of(&pair());
        let face = |a: [f64; 3], b: [f64; 3]| view.light([[0.0; 3], a, b]);
        let (x, y, z) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
        assert!(face(x, y).is_some() && face(y, z).is_some() && face(x, z).is_some(), "top, right, front");
        assert!(face(y, x).is_none() && face(z, y).is_none() && face(z, x).is_none(), "bottom, left, back");
        let [right, up, _] = view.project(z);
        assert!(right.abs() < 1e-12 && up > 0.5);
        assert!(view.project(x)[0] > 0.5);
        assert_eq!(view.words().expect("words"), "the right, the front, above");
    }

    #[test]
    fn a_hidden_side_is_seen_in_a_view_of_its_own_with_up_upwards() {
        let view = View::of(&pair());
        for normal in [[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] {
            let other = view.of_hidden_side(normal).expect("hidden");
            let View::Oblique(toward) = other else { panic!("oblique") };
            assert!(dot(toward, normal) > 0.35, "{normal:?} {toward:?}");
            assert!(other.project([0.0, 0.0, 1.0])[1] > 0.3);
        }
        for normal in [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]] {
            assert_eq!(view.of_hidden_side(normal), None);
        }
        assert_eq!(View::Plane.of_hidden_side([0.0, -1.0, 0.0]), None);
        assert_eq!(mean_direction(&[[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]), None);
        assert_eq!(mean_direction(&[[2.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), Some([1.0, 0.0, 0.0]));
    }

    #[test]
    fn a_gutter_is_seen_widest_from_above() {
        let points = [
            [-1.0, 0.0, 1.0],
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 1.0],
            [-1.0, 0.2, 1.0],
            [0.0, 0.2, 0.0],
            [1.0, 0.2, 1.0],
        ];
        assert_eq!(widest_along(&points, &[0, 1, 4, 0, 4, 3, 1, 2, 5, 1, 5, 4]), 2);
    }

    #[test]
    fn the_outline_of_two_triangles_is_their_square() {
        let square = Snapshot {
            nodes: vec![[0.0; 3]; 4],
            cells: vec![0, 1, 2, 0, 2, 3],
            corners: 3,
            ..Snapshot::default()
        };
        let lines = outline(&square);
        assert!(lines == [[0, 3, 2, 1, 0]] || lines == [[0, 1, 2, 3, 0]], "{lines:?}");
    }
}
