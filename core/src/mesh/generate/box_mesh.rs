//! Tetrahedra in a box.

use super::limits::{countable, room};
use super::{
    Grading, Grid,
    grading::{axis, moved, refuse_flat},
};
use crate::error::Result;
use crate::mesh::{GlobalMesh, piece::Piece};
use std::ops::Range;

/// The orders in which the six Kuhn tetrahedra of a cell walk along the axes, from the low corner to the high one.
const WALKS: [[usize; 3]; 6] = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [1, 0, 2], [2, 1, 0]];

/// The walks from this one on are odd permutations: their tetrahedra swap the middle nodes to be positive.
const FIRST_ODD: usize = 3;

/// A box of bricks along x, y and z, each cut into the six Kuhn tetrahedra around its diagonal from the low corner to the high
/// corner; its corner with the smallest coordinates is the origin, or where [`Self::at`] moves it.
///
/// Nodes are numbered lexicographically, x fastest, then y. The boundaries are `left`, `right` (x), `front`, `back`
/// (y), `bottom` and `top` (z); the region is `body`.
#[derive(Debug, Clone)]
pub struct Cuboid {
    lines: [Vec<f64>; 3],
}

/// As [`Cuboid::new`], whole.
pub fn box_mesh(
    size: [f64; 3],
    cells: [usize; 3],
    grading: [impl Into<Grading>; 3],
) -> Result<GlobalMesh<3>> {
    Cuboid::new(size, cells, grading)?.whole()
}

fn counts(bricks: [usize; 3]) -> [Option<usize>; 2] {
    let product = |more: usize| {
        bricks.iter().try_fold(1usize, |product, number| product.checked_mul(number.checked_add(more)?))
    };
    [product(1), product(0).and_then(|bricks| bricks.checked_mul(6))]
}

/// Numbers of nodes on so many bricks.
struct Numbering {
    strides: [u32; 3],
}

impl Numbering {
    fn new(bricks: [usize; 3]) -> Self {
        Self { strides: [1, (bricks[0] + 1) as u32, ((bricks[0] + 1) * (bricks[1] + 1)) as u32] }
    }

    fn corner(&self, at: [usize; 3]) -> u32 {
        (0..3).map(|a| at[a] as u32 * self.strides[a]).sum()
    }

    /// The nodes of a walk from the low corner of a brick.
    fn path(&self, walk: usize) -> [u32; 4] {
        let [a, b, c] = WALKS[walk].map(|axis| self.strides[axis]);
        [0, a, a + b, a + b + c]
    }

    fn tetrahedron(&self, walk: usize) -> [u32; 4] {
        let [p, q, r, s] = self.path(walk);
        if walk < FIRST_ODD { [p, q, r, s] } else { [p, r, q, s] }
    }

    /// The two triangles of a brick on a side, each with the walk of its tetrahedron. On the low side, a walk leaves the plane in
    /// its last leg; on the high side, it reaches the plane in its first leg.
    fn halves(&self, axis: usize, high: bool) -> Vec<(usize, [u32; 3])> {
        let on_side = (0..6).filter(|&walk| WALKS[walk][if high { 0 } else { 2 }] == axis);
        let triangle = |walk: usize| {
            let [p, q, r, s] = self.path(walk);
            let [a, b, c] = if high { [q, r, s] } else { [p, r, q] };
            (walk, if walk >= FIRST_ODD { [a, c, b] } else { [a, b, c] })
        };
        on_side.map(triangle).collect()
    }
}

fn brick_number(at: [usize; 3], bricks: [usize; 3]) -> usize {
    (at[2] * bricks[1] + at[1]) * bricks[0] + at[0]
}

impl Cuboid {
    /// A box of `cells` bricks. `grading` determines the grid planes of each axis; a number is an exponent toward the low end.
    pub fn new(size: [f64; 3], cells: [usize; 3], grading: [impl Into<Grading>; 3]) -> Result<Self> {
        countable(counts(cells), u32::MAX as usize, u32::MAX as usize)?;
        let [x, y, z] = grading.map(Into::into);
        let lines = [
            axis("x", size[0], cells[0], x)?,
            axis("y", size[1], cells[1], y)?,
            axis("z", size[2], cells[2], z)?,
        ];
        Ok(Self { lines: refuse_flat(lines)? })
    }

    /// The box with its corner with the smallest coordinates here (m).
    pub fn at(self, corner: [f64; 3]) -> Result<Self> {
        Ok(Self { lines: moved(self.lines, corner)? })
    }

    fn add_facets(&self, piece: &mut Piece<3>, range: &[Range<usize>; 3], local: &Numbering) {
        let whole = self.bricks();
        let own = [0, 1, 2].map(|a| range[a].len());
        let mut first = 0;
        for side in 0..6 {
            let (axis, high) = (side / 2, side % 2 == 1);
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let (slow, fast) = (u.max(v), u.min(v));
            let place = if high { whole[axis] - 1 } else { 0 };
            let halves = local.halves(axis, high);
            for q in range[slow].clone().filter(|_| range[axis].contains(&place)) {
                for p in range[fast].clone() {
                    let mut at = [place; 3];
                    (at[slow], at[fast]) = (q, p);
                    let at = [0, 1, 2].map(|a| at[a] - range[a].start);
                    let low = local.corner(at);
                    for (half, (walk, triangle)) in halves.iter().enumerate() {
                        piece.named.push([side as u32, piece.facets.len() as u32]);
                        piece.facet_ids.push((first + 2 * (q * whole[fast] + p) + half) as u32);
                        piece.facets.push(triangle.map(|offset| low + offset));
                        piece.facet_cells.push((6 * brick_number(at, own) + walk) as u32);
                    }
                }
            }
            first += 2 * whole[slow] * whole[fast];
        }
    }
}

impl Grid<3> for Cuboid {
    fn bricks(&self) -> [usize; 3] {
        [0, 1, 2].map(|a| self.lines[a].len() - 1)
    }

    fn counts(&self) -> [Option<usize>; 2] {
        counts(self.bricks())
    }

    fn sides(&self) -> &'static [&'static str] {
        &["left", "right", "front", "back", "bottom", "top"]
    }

    fn piece(
        &self,
        range: &[Range<usize>; 3],
        owner: &dyn Fn(Option<[usize; 3]>, u32) -> u32,
    ) -> Result<Piece<3>> {
        let own = [0, 1, 2].map(|a| range[a].len());
        let (whole, local) = (Numbering::new(self.bricks()), Numbering::new(own));
        let node_count: usize = own.iter().map(|n| n + 1).product();
        let cell_count = 6 * own.iter().product::<usize>();
        let mut piece = Piece {
            node_ids: room(node_count)?,
            owners: room(node_count)?,
            nodes: room(node_count)?,
            cell_ids: room(cell_count)?,
            cells: room(4 * cell_count)?,
            cell_regions: vec![0; cell_count],
            ..Piece::default()
        };
        for k in range[2].start..=range[2].end {
            for j in range[1].start..=range[1].end {
                for i in range[0].start..=range[0].end {
                    let id = whole.corner([i, j, k]);
                    piece.node_ids.push(id);
                    piece.owners.push(owner(Some([i, j, k]), id));
                    piece.nodes.push([self.lines[0][i], self.lines[1][j], self.lines[2][k]]);
                }
            }
        }
        let offsets: Vec<[u32; 4]> = (0..6).map(|walk| local.tetrahedron(walk)).collect();
        for k in range[2].clone() {
            for j in range[1].clone() {
                for i in range[0].clone() {
                    let first = 6 * brick_number([i, j, k], self.bricks()) as u32;
                    let low = local.corner([i - range[0].start, j - range[1].start, k - range[2].start]);
                    piece.cell_ids.extend(first..first + 6);
                    for tetrahedron in &offsets {
                        piece.cells.extend(tetrahedron.map(|offset| low + offset));
                    }
                }
            }
        }
        self.add_facets(&mut piece, range, &local);
        Ok(piece)
    }
}
