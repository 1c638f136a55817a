//! Triangles on a rectangle.

use super::limits::{countable, room};
use super::{
    Grading, Grid,
    grading::{axis, moved, refuse_flat},
};
use crate::error::Result;
use crate::mesh::{GlobalMesh, piece::Piece};
use std::ops::Range;

pub use crate::job::Diagonal;

/// A rectangle of quadrilaterals along x and y, each cut into triangles; its lower left corner is the origin, or where [`Self::at`]
/// moves it.
///
/// Nodes are numbered row by row, x fastest; the centre nodes of crossed diagonals follow the row of nodes below them. The
/// boundaries are `left`, `right`, `bottom` and `top`; the region is `body`.
#[derive(Debug, Clone)]
pub struct Rectangle {
    lines: [Vec<f64>; 2],
    diagonal: Diagonal,
}

/// As [`Rectangle::new`], whole.
pub fn rectangle(
    size: [f64; 2],
    cells: [usize; 2],
    diagonal: Diagonal,
    grading: [impl Into<Grading>; 2],
) -> Result<GlobalMesh<2>> {
    Rectangle::new(size, cells, diagonal, grading)?.whole()
}

const LEFT: usize = 0;
const RIGHT: usize = 1;
const BOTTOM: usize = 2;

fn counts([nx, ny]: [usize; 2], diagonal: Diagonal) -> [Option<usize>; 2] {
    let grid = nx.checked_mul(ny);
    let corners = nx.checked_add(1).zip(ny.checked_add(1)).and_then(|(a, b)| a.checked_mul(b));
    let (middles, each) = if diagonal == Diagonal::Crossed { (grid, 4) } else { (Some(0), 2) };
    let nodes = corners.zip(middles).and_then(|(a, b)| a.checked_add(b));
    [nodes, grid.and_then(|grid| grid.checked_mul(each))]
}

/// Numbers of nodes and triangles on so many quadrilaterals.
struct Numbering {
    cells: [usize; 2],
    crossed: bool,
}

impl Numbering {
    fn corner(&self, [i, j]: [usize; 2]) -> u32 {
        let row = self.cells[0] + 1 + if self.crossed { self.cells[0] } else { 0 };
        (j * row + i) as u32
    }

    fn middle(&self, [i, j]: [usize; 2]) -> u32 {
        self.corner([self.cells[0] + 1 + i, j])
    }

    fn triangle(&self, [i, j]: [usize; 2], which: usize) -> u32 {
        ((j * self.cells[0] + i) * if self.crossed { 4 } else { 2 } + which) as u32
    }
}

impl Rectangle {
    /// A rectangle of `cells` quadrilaterals, each cut by `diagonal`.
    ///
    /// `grading` determines the grid lines of each axis; a number is an exponent toward the low end.
    pub fn new(
        size: [f64; 2],
        cells: [usize; 2],
        diagonal: Diagonal,
        grading: [impl Into<Grading>; 2],
    ) -> Result<Self> {
        countable(counts(cells, diagonal), u32::MAX as usize, u32::MAX as usize)?;
        let [along_x, along_y] = grading.map(Into::into);
        let lines = [axis("x", size[0], cells[0], along_x)?, axis("y", size[1], cells[1], along_y)?];
        Ok(Self { lines: refuse_flat(lines)?, diagonal })
    }

    /// The rectangle with its lower left corner here (m).
    pub fn at(self, corner: [f64; 2]) -> Result<Self> {
        Ok(Self { lines: moved(self.lines, corner)?, ..self })
    }

    fn crossed(&self) -> bool {
        self.diagonal == Diagonal::Crossed
    }

    fn has_right_diagonal(&self, [i, j]: [usize; 2]) -> bool {
        match self.diagonal {
            Diagonal::Right => true,
            Diagonal::Left => false,
            _ => (i + j).is_multiple_of(2),
        }
    }

    /// The triangle of a quadrilateral that contains its left, right, bottom or top edge.
    fn triangle_at_side(&self, side: usize, at: [usize; 2]) -> usize {
        match (self.crossed(), side) {
            (true, LEFT) => 3,
            (true, RIGHT) => 1,
            (true, BOTTOM) | (false, BOTTOM) => 0,
            (true, _) => 2,
            (false, LEFT) => self.has_right_diagonal(at) as usize,
            (false, RIGHT) => !self.has_right_diagonal(at) as usize,
            (false, _) => 1,
        }
    }

    fn add_facets(&self, piece: &mut Piece<2>, range: &[Range<usize>; 2], local: &Numbering) {
        let whole = self.bricks();
        let mut first = 0;
        for side in 0..4 {
            let (across, along) = (side / 2, 1 - side / 2);
            let place = if side % 2 == 0 { 0 } else { whole[across] - 1 };
            for k in range[along].clone().filter(|_| range[across].contains(&place)) {
                let mut at = [k; 2];
                at[across] = place;
                let [i, j] = std::array::from_fn(|a| at[a] - range[a].start);
                let [a, b] = match side {
                    LEFT => [[i, j + 1], [i, j]],
                    RIGHT => [[i + 1, j], [i + 1, j + 1]],
                    BOTTOM => [[i, j], [i + 1, j]],
                    _ => [[i + 1, j + 1], [i, j + 1]],
                };
                piece.named.push([side as u32, piece.facets.len() as u32]);
                piece.facet_ids.push((first + k) as u32);
                piece.facets.push([local.corner(a), local.corner(b)]);
                piece.facet_cells.push(local.triangle([i, j], self.triangle_at_side(side, at)));
            }
            first += whole[along];
        }
    }
}

impl Grid<2> for Rectangle {
    fn bricks(&self) -> [usize; 2] {
        [self.lines[0].len() - 1, self.lines[1].len() - 1]
    }

    fn counts(&self) -> [Option<usize>; 2] {
        counts(self.bricks(), self.diagonal)
    }

    fn sides(&self) -> &'static [&'static str] {
        &["left", "right", "bottom", "top"]
    }

    fn piece(
        &self,
        range: &[Range<usize>; 2],
        owner: &dyn Fn(Option<[usize; 2]>, u32) -> u32,
    ) -> Result<Piece<2>> {
        let crossed = self.crossed();
        let whole = Numbering { cells: self.bricks(), crossed };
        let local = Numbering { cells: [range[0].len(), range[1].len()], crossed };
        let quads = local.cells[0] * local.cells[1];
        let (node_count, cell_count) =
            (local.corner([0, local.cells[1] + 1]) as usize, quads * if crossed { 4 } else { 2 });
        let [xs, ys] = &self.lines;
        let mut piece = Piece {
            node_ids: room(node_count)?,
            owners: room(node_count)?,
            nodes: room(node_count)?,
            cell_ids: room(cell_count)?,
            cells: room(3 * cell_count)?,
            cell_regions: vec![0; cell_count],
            ..Piece::default()
        };
        let mut node = |id: u32, corner: Option<[usize; 2]>, point: [f64; 2]| {
            piece.node_ids.push(id);
            piece.owners.push(owner(corner, id));
            piece.nodes.push(point);
        };
        for j in range[1].start..=range[1].end {
            for i in range[0].start..=range[0].end {
                node(whole.corner([i, j]), Some([i, j]), [xs[i], ys[j]]);
            }
            for i in range[0].clone().filter(|_| crossed && j < range[1].end) {
                let middle = [0.5 * (xs[i] + xs[i + 1]), 0.5 * (ys[j] + ys[j + 1])];
                node(whole.middle([i, j]), None, middle);
            }
        }
        for j in range[1].clone() {
            for i in range[0].clone() {
                let [x, y] = [i - range[0].start, j - range[1].start];
                let [a, b, c, d] =
                    [[x, y], [x + 1, y], [x + 1, y + 1], [x, y + 1]].map(|at| local.corner(at));
                let first = whole.triangle([i, j], 0);
                if crossed {
                    let m = local.middle([x, y]);
                    piece.cell_ids.extend(first..first + 4);
                    piece.cells.extend_from_slice(&[a, b, m, b, c, m, c, d, m, d, a, m]);
                } else {
                    piece.cell_ids.extend(first..first + 2);
                    let right = self.has_right_diagonal([i, j]);
                    piece.cells.extend(if right { [a, b, c, a, c, d] } else { [a, b, d, b, c, d] });
                }
            }
        }
        self.add_facets(&mut piece, range, &local);
        Ok(piece)
    }
}
