//! Blocks side by side in one mesh.

use super::{Grid, grid::refuse_large, limits::countable};
use crate::{
    error::{Error, Result},
    job::{boundary_of_block, region_of_block},
    mesh::{
        GlobalMesh, Names,
        piece::{Offsets, Piece},
    },
};

/// Blocks that share no nodes, numbered one after the other.
///
/// The side `left` of the block `pad` is the boundary `pad.left`, and its cells are the region `pad`; a block without a name has the
/// names of its grid.
#[derive(Debug, Clone)]
pub struct Blocks<const D: usize, G> {
    blocks: Vec<(Option<String>, G)>,
}

impl<const D: usize, G: Grid<D>> Blocks<D, G> {
    /// Grids with their names; refused if ids can't count their nodes, cells or regions.
    pub fn new(blocks: Vec<(Option<String>, G)>) -> Result<Self> {
        let blocks = Self { blocks };
        countable(blocks.counts(), u32::MAX as usize, u32::MAX as usize)?;
        if blocks.blocks.len() > usize::from(u16::MAX) {
            let count = blocks.blocks.len();
            return Err(Error::Refused(format!("{count} blocks: at most {} are possible", u16::MAX)));
        }
        Ok(blocks)
    }

    fn grids(&self) -> impl Iterator<Item = &G> {
        self.blocks.iter().map(|(_, grid)| grid)
    }

    /// Numbers of nodes and cells of the whole mesh.
    pub fn counts(&self) -> [Option<usize>; 2] {
        [0, 1].map(|which| self.grids().try_fold(0_usize, |sum, grid| sum.checked_add(grid.counts()[which]?)))
    }

    /// Names of regions and boundaries.
    pub fn names(&self) -> Names {
        let mut names = Names::default();
        for (name, grid) in &self.blocks {
            let name = name.as_deref();
            names.regions.push(region_of_block(name).to_owned());
            names.boundaries.extend(grid.sides().iter().map(|side| boundary_of_block(name, side)));
        }
        names
    }

    /// The whole mesh; refused if METIS could not partition it.
    pub fn whole(&self) -> Result<GlobalMesh<D>> {
        refuse_large::<D>(self.counts())?;
        self.joined(|grid| grid.whole_piece().map(Some))?.into_whole(self.names())
    }

    /// The part of a rank: its part of each block. Blocks of fewer bricks than ranks are those of the first ranks; the largest block
    /// is refused then.
    pub fn part(&self, rank: usize, ranks: usize) -> Result<Piece<D>> {
        let bricks = |grid: &G| grid.bricks().iter().product::<usize>();
        let most = self.grids().map(bricks).max();
        self.joined(|grid| {
            let parts = if Some(bricks(grid)) == most { ranks } else { ranks.min(bricks(grid)) };
            if rank < parts { grid.part(rank, parts).map(Some) } else { Ok(None) }
        })
    }

    /// The pieces of the blocks as one piece.
    fn joined(&self, piece_of: impl Fn(&G) -> Result<Option<Piece<D>>>) -> Result<Piece<D>> {
        let mut all = Piece::default();
        let mut before = Offsets::default();
        for grid in self.grids() {
            match piece_of(grid)? {
                // A single block is not copied.
                Some(piece) if before.regions == 0 => all = piece,
                Some(piece) => all.append(piece, before),
                None => {}
            }
            // `new` has refused numbers above 32 bits.
            let [nodes, cells] = grid.counts().map(|count| count.unwrap_or(usize::MAX) as u32);
            before = Offsets {
                nodes: before.nodes + nodes,
                cells: before.cells + cells,
                facets: before.facets + grid.facet_count() as u32,
                regions: before.regions + 1,
                boundaries: before.boundaries + grid.sides().len() as u32,
            };
        }
        Ok(all)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::generate::{Cuboid, Diagonal, Rectangle, rectangle};
    use std::collections::HashSet;

    /// Three rectangles: the second touches the first, the third is a single one apart.
    fn flat() -> Blocks<2, Rectangle> {
        let block = |name: &str, corner: [f64; 2], cells: [usize; 2], diagonal: Diagonal| {
            let grid =
                Rectangle::new([2.0, 1.0], cells, diagonal, [1.5, 1.0]).and_then(|grid| grid.at(corner));
            (Some(name.to_owned()), grid.expect("a grid"))
        };
        let blocks = vec![
            block("low", [0.0, 0.0], [4, 3], Diagonal::Crossed),
            block("high", [0.0, 1.0], [4, 2], Diagonal::Left),
            block("far", [5.0, -7.0], [1, 1], Diagonal::Right),
        ];
        Blocks::new(blocks).expect("blocks")
    }

    fn solid() -> Blocks<3, Cuboid> {
        let block = |name: &str, corner: [f64; 3], cells: [usize; 3]| {
            let grid = Cuboid::new([1.0; 3], cells, [1.0; 3]).and_then(|grid| grid.at(corner));
            (Some(name.to_owned()), grid.expect("a grid"))
        };
        Blocks::new(vec![block("a", [0.0; 3], [2, 1, 3]), block("b", [0.0, 1.0, 0.0], [2, 2, 2])])
            .expect("blocks")
    }

    #[test]
    fn a_block_without_a_name_is_its_grid() {
        let grid = Rectangle::new([2.0, 1.0], [5, 4], Diagonal::Crossed, [1.5, 1.0]).expect("a grid");
        let one = Blocks::new(vec![(None, grid.clone())]).expect("a block");
        assert!(one.whole().expect("whole") == grid.whole().expect("whole"));
        assert_eq!(one.names(), grid.names());
        for rank in 0..3 {
            assert!(one.part(rank, 3).expect("a part") == grid.part(rank, 3).expect("a part"));
        }
    }

    #[test]
    fn blocks_keep_their_cells_and_share_no_nodes_where_they_touch() {
        let mesh = flat().whole().expect("whole");
        assert_eq!(mesh.regions, ["low", "high", "far"]);
        let names: Vec<&str> = mesh.boundaries.iter().map(|boundary| &*boundary.name).collect();
        assert_eq!(names[..5], ["low.left", "low.right", "low.bottom", "low.top", "high.left"]);
        let alone = rectangle([2.0, 1.0], [4, 2], Diagonal::Left, [1.5, 1.0]).expect("alone");
        let (nodes, cells) = (5 * 4 + 12, 48);
        for (cell, here) in (cells..).take(alone.cell_count()).enumerate() {
            assert_eq!(mesh.cell_regions[here], 1);
            assert_eq!(mesh.cell(here), alone.cell(cell).iter().map(|node| node + nodes).collect::<Vec<_>>());
        }
        let places = |name: &str| {
            let boundary = mesh.boundaries.iter().find(|boundary| boundary.name == name).expect(name);
            let nodes = boundary.facets.iter().flat_map(|&facet| mesh.facets[facet as usize]);
            nodes.collect::<HashSet<u32>>()
        };
        let (under, over) = (places("low.top"), places("high.bottom"));
        assert!(under.is_disjoint(&over) && under.len() == 5 && over.len() == 5);
        let at = |node: &u32| mesh.nodes[*node as usize];
        assert!(under.iter().all(|node| over.iter().any(|other| at(node) == at(other))), "they touch");
        let area = |region: u16| {
            let cells = (0..mesh.cell_count()).filter(|&cell| mesh.cell_regions[cell] == region);
            cells.map(|cell| mesh.measure(cell)).sum::<f64>()
        };
        assert!((0..3).all(|region| (area(region) - 2.0).abs() < 1e-12));
        assert_eq!(mesh.nodes.last(), Some(&[7.0, -6.0]));
    }

    /// Compares the parts with the whole.
    fn parts_make_the_whole<const D: usize, G: Grid<D>>(blocks: &Blocks<D, G>, parts: usize) {
        let whole = blocks.whole().expect("whole");
        let pieces: Vec<Piece<D>> =
            (0..parts).map(|rank| blocks.part(rank, parts).expect("a part")).collect();
        assert!(pieces.iter().all(|piece| !piece.cell_ids.is_empty()));
        assert!(pieces.iter().all(|piece| piece.check(parts, &blocks.names()).is_ok()));
        assert_eq!(pieces.iter().map(|piece| piece.cell_ids.len()).sum::<usize>(), whole.cell_count());
        let digest = |pieces: &[Piece<D>]| {
            let digests = pieces.iter().enumerate().map(|(rank, piece)| piece.digest(rank, &blocks.names()));
            digests.fold(0_u64, u64::wrapping_add)
        };
        assert_eq!(digest(&pieces), digest(&[blocks.part(0, 1).expect("all")]));
        assert!(Piece::merged(&pieces).into_whole(blocks.names()).expect("merged") == whole);
    }

    #[test]
    fn the_parts_of_blocks_make_the_whole_also_where_a_block_has_fewer_bricks_than_ranks() {
        (1..=7).for_each(|parts| parts_make_the_whole(&flat(), parts));
        (1..=7).for_each(|parts| parts_make_the_whole(&solid(), parts));
        let words = flat().part(0, 13).expect_err("too many ranks").to_string();
        assert!(words.contains("the grid has 12 bricks, fewer than the 13 ranks"), "{words}");
    }

    #[test]
    fn blocks_that_together_exceed_the_ids_are_refused() {
        let grid = Cuboid::new([1.0; 3], [700, 1000, 1000], [1.0; 3]).expect("4.2e9 cells");
        assert!(Blocks::new(vec![(Some("a".into()), grid.clone())]).is_ok());
        let two = vec![(Some("a".into()), grid.clone()), (Some("b".into()), grid)];
        let words = Blocks::new(two).map(drop).expect_err("too many").to_string();
        assert!(words.contains("8400000000 cells"), "{words}");
        let one = Rectangle::new([1.0; 2], [1, 1], Diagonal::Right, [1.0; 2]).expect("a grid");
        let words = Blocks::new(vec![(None, one); 65536]).map(drop).expect_err("too many").to_string();
        assert!(words.contains("65536 blocks: at most 65535"), "{words}");
    }
}
