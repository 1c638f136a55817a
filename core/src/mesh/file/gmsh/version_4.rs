//! Entities, nodes and elements of the versions 4.0 and 4.1. Partitions are ignored: their entities have the groups of those that they
//! are parts of.

use super::cursor::{Cursor, Least};
use super::elements::kind;
use crate::error::{Error, Result};
use crate::mesh::file::document::{Block, Document};
use std::collections::{BTreeMap, BTreeSet};

/// The order of the numbers, which differs between the versions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Layout {
    /// 4.0.
    Old,
    /// 4.1.
    New,
}

/// The partitions of a mesh.
#[derive(Debug, Default)]
pub(super) struct Parts {
    announced: usize,
    of_entities: BTreeMap<(usize, i32), Vec<i32>>,
}

impl Parts {
    /// Refuses a file with the cells of some partitions only.
    pub(super) fn refuse_incomplete(&self, document: &Document) -> Result<()> {
        if self.announced == 0 {
            return Ok(());
        }
        let dimension = document.dimension()?;
        let cells = document.blocks.iter().filter(|b| b.shape.dimension() == dimension && !b.tags.is_empty());
        let of_cells = cells.filter_map(|block| self.of_entities.get(&(dimension, block.entity)));
        let found: BTreeSet<i32> = of_cells.flatten().copied().collect();
        if found.len() < self.announced {
            return Err(Error::Refused(format!(
                "the file has cells of {} of the {} partitions of a mesh: save the whole mesh in one file (Gmsh: \
                 Mesh.PartitionSplitMeshFiles = 0, or Mesh > Unpartition)",
                found.len(),
                self.announced
            )));
        }
        Ok(())
    }
}

/// Numbers of the items of a section that are counted before they are read.
fn counts(cursor: &mut Cursor, layout: Layout, more: Least) -> Result<[usize; 4]> {
    let doubles = |dimension| bounds(layout, dimension);
    let point = Least { ints: 1 + more.ints, sizes: 1 + more.sizes, doubles: doubles(0) };
    let other = Least { ints: 1 + more.ints, sizes: 2 + more.sizes, doubles: doubles(1) };
    Ok([
        cursor.count("the number of points", point)?,
        cursor.count("the number of curves", other)?,
        cursor.count("the number of surfaces", other)?,
        cursor.count("the number of volumes", other)?,
    ])
}

/// Coordinates that place an entity.
fn bounds(layout: Layout, dimension: usize) -> usize {
    if dimension == 0 && layout == Layout::New { 3 } else { 6 }
}

pub(super) fn read_entities(document: &mut Document, cursor: &mut Cursor, layout: Layout) -> Result<()> {
    let counts = counts(cursor, layout, Least::default())?;
    for (dimension, count) in counts.into_iter().enumerate() {
        for _ in 0..count {
            let tag = cursor.int("an entity's tag")?;
            let groups = read_groups(cursor, layout, dimension)?;
            if !groups.is_empty() {
                document.groups.entry((dimension, tag)).or_default().extend(groups);
            }
        }
    }
    Ok(())
}

/// The groups of an entity, between its bounds and its boundary.
fn read_groups(cursor: &mut Cursor, layout: Layout, dimension: usize) -> Result<Vec<u32>> {
    for _ in 0..bounds(layout, dimension) {
        cursor.double("an entity's bounds")?;
    }
    let one = Least { ints: 1, ..Least::default() };
    let count = cursor.count("the number of physical groups", one)?;
    let mut groups = Vec::with_capacity(count);
    for _ in 0..count {
        groups.push(cursor.int("a physical group")?.unsigned_abs());
    }
    if dimension > 0 {
        for _ in 0..cursor.count("the number of bounding entities", one)? {
            cursor.int("a bounding entity")?;
        }
    }
    Ok(groups)
}

pub(super) fn read_partitioned_entities(
    document: &mut Document,
    cursor: &mut Cursor,
    (layout, parts): (Layout, &mut Parts),
) -> Result<()> {
    parts.announced = cursor.count("the number of partitions", Least::default())?;
    let ghost = Least { ints: 2, ..Least::default() };
    for _ in 0..cursor.count("the number of ghost entities", ghost)? {
        cursor.int("a ghost entity")?;
        cursor.int("a partition")?;
    }
    let counts = counts(cursor, layout, Least { ints: 2, sizes: 1, doubles: 0 })?;
    for (dimension, count) in counts.into_iter().enumerate() {
        for _ in 0..count {
            let tag = cursor.int("an entity's tag")?;
            let parent_dimension = cursor.int("the dimension of the parent entity")?;
            let parent = cursor.int("the parent entity")?;
            let one = Least { ints: 1, ..Least::default() };
            for _ in 0..cursor.count("the number of partitions of an entity", one)? {
                let part = cursor.int("a partition")?;
                parts.of_entities.entry((dimension, tag)).or_default().push(part);
            }
            let mut groups = read_groups(cursor, layout, dimension)?;
            if groups.is_empty() && usize::try_from(parent_dimension) == Ok(dimension) {
                groups = document.groups.get(&(dimension, parent)).cloned().unwrap_or_default();
            }
            if !groups.is_empty() {
                document.groups.insert((dimension, tag), groups);
            }
        }
    }
    Ok(())
}

/// A tag of a node or an element.
fn tag(cursor: &mut Cursor, layout: Layout, what: &str) -> Result<u64> {
    match layout {
        Layout::New => cursor.size(what),
        Layout::Old => cursor.natural(what),
    }
}

/// The dimension and the tag of an entity.
fn entity(cursor: &mut Cursor, layout: Layout) -> Result<(usize, i32)> {
    if layout == Layout::Old {
        let tag = cursor.int("an entity's tag")?;
        return Ok((cursor.dimension()?, tag));
    }
    Ok((cursor.dimension()?, cursor.int("an entity's tag")?))
}

/// The least numbers for tags and coordinates.
fn least(layout: Layout, tags: usize, doubles: usize) -> Least {
    match layout {
        Layout::New => Least { ints: 0, sizes: tags, doubles },
        Layout::Old => Least { ints: tags, sizes: 0, doubles },
    }
}

/// The number of blocks and the number of their items.
fn totals(
    cursor: &mut Cursor,
    layout: Layout,
    (blocks, items): (&str, &str),
    each: Least,
) -> Result<[usize; 2]> {
    let totals = [cursor.count(blocks, Least { ints: 3, sizes: 1, doubles: 0 })?, cursor.count(items, each)?];
    if layout == Layout::New {
        cursor.size("the smallest tag")?;
        cursor.size("the largest tag")?;
    }
    Ok(totals)
}

pub(super) fn read_nodes(document: &mut Document, cursor: &mut Cursor, layout: Layout) -> Result<()> {
    let each = least(layout, 1, 3);
    let words = ("the number of node blocks", "the number of nodes");
    let [blocks, total] = totals(cursor, layout, words, each)?;
    document.node_tags.reserve_exact(total);
    document.points.reserve_exact(total);
    for _ in 0..blocks {
        let (dimension, _) = entity(cursor, layout)?;
        let parametric = match cursor.int("the parametric flag")? {
            0 => 0,
            1 => dimension,
            other => {
                return Err(cursor.refuse(format_args!("the parametric flag is {other}: 0 or 1 is expected")));
            }
        };
        let count = cursor.count("the number of nodes of this block", each)?;
        if count > total - document.points.len() {
            return Err(
                cursor.refuse(format_args!("the blocks contain more nodes than the {total} announced"))
            );
        }
        // In 4.1 the tags of a block come before its coordinates.
        let ahead = if layout == Layout::New { count } else { 0 };
        for _ in 0..ahead {
            document.node_tags.push(tag(cursor, layout, "a node's tag")?);
        }
        for _ in 0..count {
            if layout == Layout::Old {
                document.node_tags.push(tag(cursor, layout, "a node's tag")?);
            }
            document.points.push(cursor.point()?);
            for _ in 0..parametric {
                cursor.double("a parametric coordinate")?;
            }
        }
    }
    let held = document.points.len();
    if held != total {
        return Err(cursor.refuse(format_args!("the blocks contain {held} nodes, {total} are announced")));
    }
    Ok(())
}

pub(super) fn read_elements(document: &mut Document, cursor: &mut Cursor, layout: Layout) -> Result<()> {
    let words = ("the number of element blocks", "the number of elements");
    let [blocks, total] = totals(cursor, layout, words, least(layout, 2, 0))?;
    let mut held = 0;
    for _ in 0..blocks {
        let (dimension, entity) = entity(cursor, layout)?;
        let number = cursor.int("an element type")?;
        let (shape, nodes_per_element) = kind(number).map_err(|words| cursor.refuse(words))?;
        if shape.dimension() != dimension {
            return Err(cursor.refuse(format_args!(
                "element type {number} does not belong on an entity of dimension {dimension}"
            )));
        }
        let each = least(layout, 1 + nodes_per_element, 0);
        let count = cursor.count("the number of elements of this block", each)?;
        held += count;
        let mut block = Block::new(shape, nodes_per_element, entity);
        block.tags.reserve_exact(count);
        block.nodes.reserve_exact(count * nodes_per_element);
        for _ in 0..count {
            block.tags.push(tag(cursor, layout, "an element's tag")?);
            for _ in 0..nodes_per_element {
                block.nodes.push(tag(cursor, layout, "an element's node")?);
            }
        }
        document.blocks.push(block);
    }
    if held != total {
        return Err(cursor.refuse(format_args!("the blocks contain {held} elements, {total} are announced")));
    }
    Ok(())
}
