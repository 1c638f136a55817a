//! Cells by their types.

use crate::error::{Error, Result};
use crate::mesh::file::document::{Block, Document, Shape};
use std::collections::BTreeMap;

/// The arrays of cells.
pub(super) struct Cells {
    pub(super) types: Vec<i64>,
    /// The end of each cell in `nodes`.
    pub(super) ends: Vec<i64>,
    pub(super) nodes: Vec<i64>,
    /// The number of the region or boundary of each cell.
    pub(super) groups: Option<Vec<i64>>,
}

/// Pairs of nodes that are exchanged.
type Swaps = &'static [(usize, usize)];

/// The shape of a type, the number of nodes, and pairs of nodes that are exchanged in a block.
fn kind(number: i64) -> Option<(Shape, usize, Swaps)> {
    Some(match number {
        1 => (Shape::Point, 1, &[]),
        3 => (Shape::Line, 2, &[]),
        5 => (Shape::Triangle, 3, &[]),
        8 => (Shape::Quadrilateral, 4, &[(2, 3)]),
        9 => (Shape::Quadrilateral, 4, &[]),
        10 => (Shape::Tetrahedron, 4, &[]),
        11 => (Shape::Hexahedron, 8, &[(2, 3), (6, 7)]),
        12 => (Shape::Hexahedron, 8, &[]),
        13 => (Shape::Wedge, 6, &[]),
        14 => (Shape::Pyramid, 5, &[]),
        21 => (Shape::Line, 3, &[]),
        22 => (Shape::Triangle, 6, &[]),
        23 => (Shape::Quadrilateral, 8, &[]),
        24 => (Shape::Tetrahedron, 10, &[(8, 9)]),
        25 => (Shape::Hexahedron, 20, &[]),
        26 => (Shape::Wedge, 15, &[]),
        27 => (Shape::Pyramid, 13, &[]),
        28 => (Shape::Quadrilateral, 9, &[]),
        29 => (Shape::Hexahedron, 27, &[]),
        _ => return None,
    })
}

/// Adds all cells to a document, with groups named by their numbers.
pub(super) fn add(document: &mut Document, cells: &Cells) -> Result<()> {
    let mut blocks: BTreeMap<(i64, i64), Block> = BTreeMap::new();
    let mut numbers: Vec<i64> = cells.groups.iter().flatten().copied().collect();
    numbers.sort_unstable();
    numbers.dedup();
    let mut begin = 0;
    for (cell, (&number, &end)) in cells.types.iter().zip(&cells.ends).enumerate() {
        let nodes = usize::try_from(end).ok().and_then(|end| cells.nodes.get(begin..end));
        let Some(nodes) = nodes else {
            return Err(refuse(
                cell,
                format_args!("it ends at {end} of `connectivity`, which has {} numbers", cells.nodes.len()),
            ));
        };
        begin = end as usize;
        let Some((shape, count, swaps)) = kind(number) else {
            return Err(refuse(
                cell,
                format_args!(
                    "type {number} is not read: triangles (5, 22), quadrilaterals (8, 9, 23), tetrahedra (10, 24), hexahedra (11, 12, 25), \
                 wedges (13, 26) and pyramids (14, 27) are"
                ),
            ));
        };
        if nodes.len() != count {
            return Err(refuse(
                cell,
                format_args!("it has {} nodes, type {number} has {count}", nodes.len()),
            ));
        }
        let group = cells.groups.as_ref().and_then(|groups| groups.get(cell)).copied();
        let place = group.map_or(0, |group| numbers.partition_point(|other| *other < group));
        let block = || Block::new(shape, count, place as i32 + 1);
        let block = blocks.entry((number, place as i64)).or_insert_with(block);
        block.tags.push(cell as u64);
        let first = block.nodes.len();
        for &node in nodes {
            let Ok(node) = u64::try_from(node) else {
                return Err(refuse(cell, format_args!("it has the node {node}")));
            };
            block.nodes.push(node);
        }
        swaps.iter().for_each(|&(a, b)| block.nodes.swap(first + a, first + b));
    }
    let of_cells = blocks.values().map(|block| block.shape.dimension()).max().unwrap_or(0);
    for (at, number) in (1..).zip(numbers) {
        for dimension in [of_cells, of_cells.saturating_sub(1)] {
            document.names.insert((dimension, at), number.to_string());
            document.groups.insert((dimension, at as i32), vec![at]);
        }
    }
    document.blocks = blocks.into_values().collect();
    Ok(())
}

fn refuse(cell: usize, what: impl std::fmt::Display) -> Error {
    Error::Refused(format!("cell {cell}: {what}"))
}
