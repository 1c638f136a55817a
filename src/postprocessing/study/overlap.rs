//! The intersections of the cells of two meshes of the same body, in which the fields of both meshes are polynomials.
//!
//! Every cell of one mesh is cut by the facets of the cells of the other mesh that it intersects. The intersections are divided
//! into simplices, so that integrals over them are exact, whether or not one mesh is a refinement of the other.

use super::stored::StoredMesh;
use crate::{linear_algebra::tensor::Vector, mesh::shape::signed_measure, mesh::tree::BoxTree};

/// A point with a barycentric coordinate of smaller absolute value is on the facet.
const ON_FACET: f64 = 1e-12;
/// Pieces smaller than this fraction of their cell are neglected.
const SLIVER: f64 = 1e-13;

/// A simplex in one cell of each mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Piece<const D: usize> {
    /// Cell of the first mesh.
    pub one: u32,
    /// Cell of the second mesh.
    pub other: u32,
    /// Corners in m, of which `D + 1` are used.
    pub corners: Corners<D>,
    /// Area or volume in m^D.
    pub volume: f64,
}

/// Corners of a simplex, of which `D + 1` are used.
pub(super) type Corners<const D: usize> = [Vector<D>; 4];

/// The pieces in the cells `range` of the second mesh.
pub(super) fn overlap<const D: usize>(
    one: &StoredMesh<D>,
    other: &StoredMesh<D>,
    range: std::ops::Range<usize>,
) -> Vec<Piece<D>> {
    let tree = BoxTree::new((0..one.count()).map(|cell| bounds(&one.corners(cell)[..=D])).collect());
    let mut pieces = Vec::new();
    let mut parts = Vec::new();
    for cell in range {
        let corners = other.corners(cell);
        let smallest = SLIVER * other.geometry[cell].volume;
        tree.meeting(&bounds(&corners[..=D]), |met| {
            parts.clear();
            parts.push(corners);
            for facet in 0..=D {
                parts = parts.iter().flat_map(|part| cut(one, met as usize, facet, part)).collect();
            }
            for part in &parts {
                let volume = signed_measure(&part[..=D]).abs();
                if volume > smallest {
                    pieces.push(Piece { one: met, other: cell as u32, corners: *part, volume });
                }
            }
            false
        });
    }
    pieces
}

fn bounds<const D: usize>(corners: &[Vector<D>]) -> (Vector<D>, Vector<D>) {
    let low = std::array::from_fn(|i| corners.iter().map(|c| c[i]).fold(f64::INFINITY, f64::min));
    let high = std::array::from_fn(|i| corners.iter().map(|c| c[i]).fold(f64::NEG_INFINITY, f64::max));
    (low, high)
}

/// The part of a simplex on the inner side of the facet opposite to corner `facet` of a cell.
fn cut<const D: usize>(
    mesh: &StoredMesh<D>,
    cell: usize,
    facet: usize,
    part: &Corners<D>,
) -> Vec<Corners<D>> {
    let heights: Vec<f64> = part[..=D].iter().map(|corner| mesh.shares(cell, corner)[facet]).collect();
    if heights.iter().all(|height| *height >= -ON_FACET) {
        return vec![*part];
    }
    let (inside, outside): (Vec<usize>, Vec<usize>) = (0..=D).partition(|&a| heights[a] > ON_FACET);
    let crossing = |a: usize, b: usize| -> Vector<D> {
        let share = heights[a] / (heights[a] - heights[b].min(0.0));
        std::array::from_fn(|i| part[a][i] + share * (part[b][i] - part[a][i]))
    };
    match inside.len() {
        0 => Vec::new(),
        1 => {
            let mut left = *part;
            outside.iter().for_each(|&b| left[b] = crossing(inside[0], b));
            vec![left]
        }
        // Two of four corners: a wedge with a triangle around each of them.
        2 if D == 3 => {
            let triangle = |a: usize| [part[a], crossing(a, outside[0]), crossing(a, outside[1])];
            prism(&triangle(inside[0]), &triangle(inside[1]))
        }
        // Three of four corners: a prism between the facet and the cut.
        _ => {
            let facet: Vec<Vector<D>> = inside.iter().map(|&a| part[a]).collect();
            let picture: Vec<Vector<D>> = inside.iter().map(|&a| crossing(a, outside[0])).collect();
            prism(&facet, &picture)
        }
    }
}

/// The prism (in the plane the quadrilateral) between two lists of `D` corners as `D` simplices.
fn prism<const D: usize>(low: &[Vector<D>], high: &[Vector<D>]) -> Vec<Corners<D>> {
    let simplex = |first: usize| {
        let mut corners = [[0.0; D]; 4];
        let used = low[first..].iter().chain(&high[..=first]);
        corners.iter_mut().zip(used).for_each(|(corner, point)| *corner = *point);
        corners
    };
    (0..D).map(simplex).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::GlobalMesh;
    use crate::mesh::generate::{Diagonal, box_mesh, rectangle};

    fn stored<const D: usize>(mesh: GlobalMesh<D>) -> StoredMesh<D> {
        StoredMesh::new(mesh.nodes, mesh.cells)
    }

    fn square(cells: usize, diagonal: Diagonal) -> StoredMesh<2> {
        stored(rectangle([1.0, 1.0], [cells, cells], diagonal, [1.0; 2]).expect("mesh"))
    }

    #[test]
    fn pieces_of_a_refinement_are_its_cells() {
        let (coarse, fine) = (square(2, Diagonal::Right), square(6, Diagonal::Right));
        let pieces = overlap(&coarse, &fine, 0..fine.count());
        assert_eq!(pieces.len(), fine.count());
        assert!(pieces.iter().all(|piece| (piece.volume - 1.0 / 72.0).abs() < 1e-15));
    }

    #[test]
    fn pieces_of_any_two_meshes_fill_the_body_once() {
        let meshes = [
            square(3, Diagonal::Left),
            square(4, Diagonal::Right),
            square(5, Diagonal::Crossed),
            stored(rectangle([1.0, 1.0], [4, 7], Diagonal::Alternating, [1.7, 0.6]).expect("mesh")),
        ];
        for one in &meshes {
            for other in &meshes {
                let pieces = overlap(one, other, 0..other.count());
                let mut of_cell = vec![0.0; other.count()];
                pieces.iter().for_each(|piece| of_cell[piece.other as usize] += piece.volume);
                for (sum, cell) in of_cell.iter().zip(&other.geometry) {
                    assert!((sum - cell.volume).abs() < 1e-12 * cell.volume, "{sum} {}", cell.volume);
                }
            }
        }
    }

    #[test]
    fn pieces_of_boxes_fill_the_body_once() {
        let cube = |cells, grading| stored(box_mesh([1.0; 3], cells, grading).expect("mesh"));
        let (one, other) = (cube([2, 3, 2], [1.0; 3]), cube([3, 2, 4], [1.3, 0.8, 1.0]));
        let pieces = overlap(&one, &other, 0..other.count());
        let sum: f64 = pieces.iter().map(|piece| piece.volume).sum();
        assert!((sum - 1.0).abs() < 1e-11, "{sum}");
        for piece in pieces {
            let middle: Vector<3> =
                std::array::from_fn(|i| piece.corners.iter().map(|c| c[i]).sum::<f64>() / 4.0);
            assert!(one.shares(piece.one as usize, &middle).iter().all(|share| *share > -1e-12));
            assert!(other.shares(piece.other as usize, &middle).iter().all(|share| *share > -1e-12));
        }
    }
}
