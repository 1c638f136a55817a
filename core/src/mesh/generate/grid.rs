//! Grids of bricks divided into simplices: generated as a whole, or in parts by the ranks that need them.

use super::limits::countable;
use crate::{
    error::{Error, Result},
    mesh::{GlobalMesh, Names, piece::Piece},
};
use std::ops::Range;

/// The definition of a generated mesh.
pub trait Grid<const D: usize> {
    /// Bricks along each axis.
    fn bricks(&self) -> [usize; D];

    /// Numbers of nodes and cells of the whole mesh, below 2^32.
    fn counts(&self) -> [Option<usize>; 2];

    /// Names of the low and the high side of each axis.
    fn sides(&self) -> &'static [&'static str];

    /// The cells of the bricks in `range` with their nodes and facets. `owner` returns the owner of a node at a corner of bricks,
    /// given its position in the grid and its id, and the owner of nodes inside bricks (`None`).
    fn piece(
        &self,
        range: &[Range<usize>; D],
        owner: &dyn Fn(Option<[usize; D]>, u32) -> u32,
    ) -> Result<Piece<D>>;

    /// Number of facets on the surface: one (triangles) or two (tetrahedra) for each brick at a side.
    fn facet_count(&self) -> usize {
        let bricks = self.bricks();
        let all: usize = bricks.iter().product();
        bricks.iter().map(|along| 2 * (D - 1) * (all / along)).sum()
    }

    /// Names of region and boundaries.
    fn names(&self) -> Names {
        let boundaries = self.sides().iter().map(|&side| side.to_owned()).collect();
        Names { regions: vec!["body".into()], boundaries, ..Names::default() }
    }

    /// The whole mesh in a piece.
    fn whole_piece(&self) -> Result<Piece<D>> {
        self.piece(&self.bricks().map(|count| 0..count), &|_, _| 0)
    }

    /// The whole mesh; refused if METIS could not partition it.
    fn whole(&self) -> Result<GlobalMesh<D>> {
        refuse_large::<D>(self.counts())?;
        self.whole_piece()?.into_whole(self.names())
    }

    /// The part of a rank: a box of bricks, of nearly equal size for all ranks. Nodes shared by several parts are assigned
    /// alternately to the lowest and the highest of them.
    fn part(&self, rank: usize, ranks: usize) -> Result<Piece<D>> {
        let parts = Bisection::new(self.bricks(), ranks)?;
        let own = parts.range(rank);
        let inside = |at: &[usize; D]| (0..D).all(|a| own[a].start < at[a] && at[a] < own[a].end);
        let owner = |corner: Option<[usize; D]>, id: u32| match corner {
            Some(at) if !inside(&at) => {
                let around = parts.around(at);
                let between = if id % 2 == 1 { around.max() } else { around.min() };
                between.unwrap_or(rank) as u32
            }
            _ => rank as u32,
        };
        self.piece(&own, &owner)
    }
}

/// Refuses numbers of nodes and cells that METIS could not partition.
pub(super) fn refuse_large<const D: usize>(counts: [Option<usize>; 2]) -> Result<()> {
    countable(counts, i32::MAX as usize, i32::MAX as usize / (D + 1))
}

/// Distribution of bricks by recursive bisection of the longest side of boxes.
pub(super) struct Bisection<const D: usize> {
    bricks: [usize; D],
    parts: usize,
}

impl<const D: usize> Bisection<D> {
    /// Refused if there are fewer bricks than parts.
    pub(super) fn new(bricks: [usize; D], parts: usize) -> Result<Self> {
        let count: usize = bricks.iter().product();
        if count < parts {
            return Err(Error::Refused(format!(
                "the grid has {count} bricks, fewer than the {parts} ranks: run on at most {count} ranks, refine the mesh, or use partition = \"metis\", which splits bricks"
            )));
        }
        Ok(Self { bricks, parts })
    }

    /// The box of a part.
    pub(super) fn range(&self, part: usize) -> [Range<usize>; D] {
        self.descend(|_, _, first_high| part < first_high).1
    }

    /// The part of a brick.
    pub(super) fn part_of(&self, brick: [usize; D]) -> usize {
        self.descend(|axis, cut, _| brick[axis] < cut).0
    }

    /// The parts of the bricks around a corner.
    fn around(&self, corner: [usize; D]) -> impl Iterator<Item = usize> {
        (0..1_usize << D).filter_map(move |which| {
            let mut brick = corner;
            for (a, place) in brick.iter_mut().enumerate() {
                *place = place.checked_sub(which >> a & 1).filter(|&place| place < self.bricks[a])?;
            }
            Some(self.part_of(brick))
        })
    }

    /// Follows the bisection to one part and its box; `low` selects the low side, given the axis, the position of the cut and the
    /// first part of the high side.
    fn descend(&self, low: impl Fn(usize, usize, usize) -> bool) -> (usize, [Range<usize>; D]) {
        let mut range = self.bricks.map(|count| 0..count);
        let (mut first, mut parts) = (0, self.parts);
        while parts > 1 {
            let axis = (0..D).max_by_key(|&a| range[a].len()).unwrap_or(0);
            let (length, bricks) = (range[axis].len(), range.iter().map(Range::len).product::<usize>());
            let half = parts / 2;
            let layers = ((2 * length * half + parts) / (2 * parts)).clamp(1, length - 1);
            let low_bricks = bricks / length * layers;
            // Each side needs a brick for each of its parts.
            let fewest = parts.saturating_sub(bricks - low_bricks).max(1);
            let half = half.clamp(fewest, low_bricks.min(parts - 1));
            let cut = range[axis].start + layers;
            if low(axis, cut, first + half) {
                (range[axis].end, parts) = (cut, half);
            } else {
                (range[axis].start, first, parts) = (cut, first + half, parts - half);
            }
        }
        (first, range)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::generate::{Cuboid, Diagonal, Grading, Rectangle, Toward};
    use std::collections::BTreeMap;

    /// Compares the parts of a grid with the whole grid.
    fn parts_make_the_whole<const D: usize>(grid: &impl Grid<D>, parts: usize) {
        let whole = grid.whole().unwrap();
        let pieces: Vec<Piece<D>> = (0..parts).map(|rank| grid.part(rank, parts).unwrap()).collect();
        assert_eq!(pieces.iter().map(|p| p.cell_ids.len()).sum::<usize>(), whole.cell_count());
        assert!(Piece::merged(&pieces).into_whole(grid.names()).unwrap() == whole);

        let mut around: BTreeMap<u32, (Vec<u32>, Vec<u32>)> = BTreeMap::new();
        for (rank, piece) in pieces.iter().enumerate() {
            assert!(piece.node_ids.is_sorted_by(|a, b| a < b) && piece.cell_ids.is_sorted_by(|a, b| a < b));
            let mut touched = vec![false; piece.node_ids.len()];
            piece.cells.iter().for_each(|&node| touched[node as usize] = true);
            assert!(touched.iter().all(|&t| t), "every node is one of a cell");
            for (id, owner) in piece.node_ids.iter().zip(&piece.owners) {
                let entry = around.entry(*id).or_default();
                entry.0.push(rank as u32);
                entry.1.push(*owner);
            }
        }
        for (id, (ranks, owners)) in around {
            assert!(owners.iter().all(|owner| *owner == owners[0]), "all agree on the owner of {id}");
            let rule = if id % 2 == 1 { ranks.iter().max() } else { ranks.iter().min() };
            assert_eq!(Some(&owners[0]), rule, "node {id} in parts {ranks:?}");
        }
    }

    #[test]
    fn the_parts_of_a_rectangle_make_the_whole_and_agree_on_owners() {
        for diagonal in [Diagonal::Right, Diagonal::Left, Diagonal::Alternating, Diagonal::Crossed] {
            for cells in [[5, 7], [1, 9], [8, 3]] {
                let both = Grading { power: 1.5, toward: Toward::Both };
                let grid = Rectangle::new([2.0, 1.0], cells, diagonal, [both, Grading::from(1.0)]).unwrap();
                (1..=7).for_each(|parts| parts_make_the_whole(&grid, parts));
            }
        }
    }

    #[test]
    fn the_parts_of_a_box_make_the_whole_and_agree_on_owners() {
        for cells in [[3, 4, 5], [1, 1, 8], [4, 2, 2]] {
            let grid = Cuboid::new([2.0, 1.0, 3.0], cells, [1.0, 2.0, 0.5]).unwrap();
            (1..=7).for_each(|parts| parts_make_the_whole(&grid, parts));
        }
    }

    #[test]
    fn any_number_of_parts_gets_bricks_and_large_grids_are_balanced() {
        for parts in 1..=24 {
            let bisection = Bisection::new([4, 6], parts).unwrap();
            let mut seen = vec![0; parts];
            for brick in (0..24).map(|b| [b % 4, b / 4]) {
                let part = bisection.part_of(brick);
                assert!((0..2).all(|a| bisection.range(part)[a].contains(&brick[a])));
                seen[part] += 1;
            }
            assert!(seen.iter().all(|&bricks| bricks > 0), "{parts}: {seen:?}");
        }
        // What is left is a layer of bricks more or less.
        for (parts, bound) in
            [(2, 1.001), (3, 1.01), (5, 1.01), (7, 1.01), (12, 1.03), (100, 1.06), (1000, 1.2)]
        {
            let bisection = Bisection::new([100, 100, 100], parts).unwrap();
            let largest =
                (0..parts).map(|p| bisection.range(p).iter().map(Range::len).product::<usize>()).max();
            let imbalance = largest.unwrap() as f64 * parts as f64 / 1e6;
            assert!(imbalance < bound, "{parts}: {imbalance}");
        }
        assert!(Bisection::new([4, 6], 25).err().unwrap().to_string().contains("at most 24 ranks"));
    }

    #[test]
    fn parts_may_count_to_the_end_of_32_bits_and_the_whole_may_not() {
        let grid = Cuboid::new([1.0; 3], [890, 890, 890], [1.0; 3]).unwrap();
        assert!(grid.whole().unwrap_err().to_string().contains("and 536870911 cells"));
        let part = grid.part(999_999, 1_000_000).unwrap();
        assert!(part.cell_ids.len() < 10_000 && *part.cell_ids.last().unwrap() == 6 * 890_u32.pow(3) - 1);
        let error = Cuboid::new([1.0; 3], [900, 900, 900], [1.0; 3]).unwrap_err().to_string();
        assert!(error.contains("4374000000 cells") && error.contains("4294967295 cells"), "{error}");
    }
}
