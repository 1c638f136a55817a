//! Triangles on a rectangle with its low corner in the origin.

use super::{Grading, countable, grading::axis, room};
use crate::error::Result;
use crate::mesh::{Boundary, GlobalMesh};

/// How each quadrilateral of the grid is cut into triangles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Diagonal {
    /// From the lower left to the upper right corner.
    Right,
    /// From the upper left to the lower right corner.
    Left,
    /// Right and left in turn, like a chessboard; right in the lower left corner.
    Alternating,
    /// Both, meeting in an extra node in the middle: four triangles.
    Crossed,
}

/// A rectangle `[0, size[0]] x [0, size[1]]` (m) of `cells` quadrilaterals along x and y, each cut by `diagonal`.
///
/// Grid lines lie as `grading` says for each axis; a number is a power toward the low end.
/// Nodes are numbered row by row, x fastest; crossed middles follow the row of nodes below them.
/// The boundaries are `left`, `right`, `bottom` and `top`; the region is `body`.
pub fn rectangle(
    size: [f64; 2],
    cells: [usize; 2],
    diagonal: Diagonal,
    grading: [impl Into<Grading>; 2],
) -> Result<GlobalMesh<2>> {
    let grading: [Grading; 2] = grading.map(Into::into);
    let [nx, ny] = cells;
    let crossed = diagonal == Diagonal::Crossed;
    let per_cell = if crossed { 4 } else { 2 };
    let grid = nx.checked_mul(ny);
    let corners = nx.checked_add(1).zip(ny.checked_add(1)).and_then(|(a, b)| a.checked_mul(b));
    let middles = if crossed { grid } else { Some(0) };
    let (node_count, cell_count) = countable(
        corners.zip(middles).and_then(|(a, b)| a.checked_add(b)),
        grid.and_then(|g| g.checked_mul(per_cell)),
        2,
    )?;
    let xs = axis("x", size[0], nx, grading[0])?;
    let ys = axis("y", size[1], ny, grading[1])?;

    let mut nodes = room(node_count)?;
    for j in 0..=ny {
        nodes.extend(xs.iter().map(|&x| [x, ys[j]]));
        if crossed && j < ny {
            nodes.extend(xs.windows(2).map(|x| [0.5 * (x[0] + x[1]), 0.5 * (ys[j] + ys[j + 1])]));
        }
    }

    let row = nx + 1 + if crossed { nx } else { 0 };
    let node = |i: usize, j: usize| (j * row + i) as u32;
    let leans_right = |i: usize, j: usize| match diagonal {
        Diagonal::Right => true,
        Diagonal::Left => false,
        _ => (i + j).is_multiple_of(2),
    };
    let mut triangles = room(3 * cell_count)?;
    for j in 0..ny {
        for i in 0..nx {
            let (a, b, c, d) = (node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1));
            if crossed {
                let m = node(nx + 1 + i, j);
                triangles.extend_from_slice(&[a, b, m, b, c, m, c, d, m, d, a, m]);
            } else if leans_right(i, j) {
                triangles.extend_from_slice(&[a, b, c, a, c, d]);
            } else {
                triangles.extend_from_slice(&[a, b, d, b, c, d]);
            }
        }
    }

    // The triangle of a quadrilateral that holds its left, right, bottom or top edge.
    let behind = |side: usize, i: usize, j: usize| {
        let triangle = match (crossed, side) {
            (true, LEFT) => 3,
            (true, RIGHT) => 1,
            (true, BOTTOM) | (false, BOTTOM) => 0,
            (true, _) => 2,
            (false, LEFT) => leans_right(i, j) as usize,
            (false, RIGHT) => !leans_right(i, j) as usize,
            (false, _) => 1,
        };
        ((j * nx + i) * per_cell + triangle) as u32
    };
    let mut mesh = GlobalMesh {
        nodes,
        cells: triangles,
        cell_regions: vec![0; cell_count],
        regions: vec!["body".into()],
        ..GlobalMesh::default()
    };
    for (side, name) in ["left", "right", "bottom", "top"].into_iter().enumerate() {
        let first = mesh.facets.len() as u32;
        for k in 0..if side < BOTTOM { ny } else { nx } {
            let (facet, i, j) = match side {
                LEFT => ([node(0, k + 1), node(0, k)], 0, k),
                RIGHT => ([node(nx, k), node(nx, k + 1)], nx - 1, k),
                BOTTOM => ([node(k, 0), node(k + 1, 0)], k, 0),
                _ => ([node(k + 1, ny), node(k, ny)], k, ny - 1),
            };
            mesh.facets.push(facet);
            mesh.facet_cells.push(behind(side, i, j));
        }
        mesh.boundaries
            .push(Boundary { name: name.into(), facets: (first..mesh.facets.len() as u32).collect() });
    }
    Ok(mesh)
}

const LEFT: usize = 0;
const RIGHT: usize = 1;
const BOTTOM: usize = 2;
