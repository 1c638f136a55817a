//! Nodes and elements of version 2. It has no entities: each element has its group and its entity.

use super::cursor::{Cursor, Encoding, Least};
use super::elements::kind;
use crate::error::Result;
use crate::mesh::file::document::{Block, Document, Shape};
use std::collections::BTreeMap;

pub(super) fn read_nodes(document: &mut Document, cursor: &mut Cursor) -> Result<()> {
    let count = text_count(cursor, "the number of nodes", Least { ints: 1, sizes: 0, doubles: 3 })?;
    document.node_tags.reserve_exact(count);
    document.points.reserve_exact(count);
    for _ in 0..count {
        document.node_tags.push(cursor.natural("a node's tag")?);
        document.points.push(cursor.point()?);
    }
    Ok(())
}

/// A count, which is text also in a binary file; numbers follow after the end of its line.
fn text_count(cursor: &mut Cursor, what: &str, each: Least) -> Result<usize> {
    let Encoding::Binary { .. } = cursor.encoding else { return cursor.count(what, each) };
    let encoding = std::mem::replace(&mut cursor.encoding, Encoding::Ascii);
    let count = cursor.size(what);
    cursor.line();
    cursor.encoding = encoding;
    let count = count?;
    cursor.refuse_count_above_rest(what, count, each)
}

pub(super) fn read_elements(document: &mut Document, cursor: &mut Cursor) -> Result<()> {
    let count = text_count(cursor, "the number of elements", Least { ints: 3, sizes: 0, doubles: 0 })?;
    let is_binary = cursor.encoding != Encoding::Ascii;
    let mut blocks = Blocks::default();
    let mut held = 0;
    while held < count {
        // In a binary file the numbers of several elements follow a common head.
        let tag = if is_binary { 0 } else { cursor.natural("an element's tag")? };
        let number = cursor.int("an element type")?;
        let (shape, nodes_per_element) = kind(number).map_err(|words| cursor.refuse(words))?;
        let in_run = if is_binary { cursor.natural("the number of elements of this type")? } else { 1 };
        let attributes = cursor.natural("the number of tags of an element")?;
        let each = Least { ints: usize::from(is_binary) + nodes_per_element, ..Least::default() };
        let in_run = cursor.refuse_count_above_rest("the number of elements of this type", in_run, each)?;
        let one = Least { ints: 1, ..Least::default() };
        let attributes =
            cursor.refuse_count_above_rest("the number of tags of an element", attributes, one)?;
        held += in_run;
        if in_run == 0 || held > count {
            return Err(
                cursor.refuse(format_args!("the section contains {held} elements, {count} are announced"))
            );
        }
        for _ in 0..in_run {
            let tag = if is_binary { cursor.natural("an element's tag")? } else { tag };
            let mut group_and_entity = [0, 0];
            for at in 0..attributes {
                let attribute = cursor.int("a tag of an element")?;
                if let Some(kept) = group_and_entity.get_mut(at) {
                    *kept = attribute;
                }
            }
            let block = blocks.of(shape, nodes_per_element, group_and_entity);
            block.tags.push(tag);
            for _ in 0..nodes_per_element {
                block.nodes.push(cursor.natural("an element's node")?);
            }
        }
    }
    for ((_, _, [group, _]), block) in blocks.0 {
        if group != 0 {
            let of_entity = document.groups.entry((block.shape.dimension(), block.entity)).or_default();
            if !of_entity.contains(&group.unsigned_abs()) {
                of_entity.push(group.unsigned_abs());
            }
        }
        document.blocks.push(block);
    }
    Ok(())
}

/// Elements of one shape, group and entity.
#[derive(Default)]
struct Blocks(BTreeMap<(Shape, usize, [i32; 2]), Block>);

impl Blocks {
    fn of(&mut self, shape: Shape, nodes_per_element: usize, group_and_entity: [i32; 2]) -> &mut Block {
        let [group, entity] = group_and_entity;
        // Elements of one entity can have different groups; each of these pairs is an entity of the document.
        let is_taken = |tag: i32| {
            self.0.iter().any(|((other, _, [g, _]), block)| {
                other.dimension() == shape.dimension() && block.entity == tag && *g != group
            })
        };
        let key = (shape, nodes_per_element, group_and_entity);
        if !self.0.contains_key(&key) {
            let mut free = (1..).map(|number: i32| -number);
            let known = self.0.iter().find(|((other, _, pair), _)| {
                other.dimension() == shape.dimension() && *pair == group_and_entity
            });
            let tag = match known {
                Some((_, block)) => block.entity,
                None if is_taken(entity) => free.find(|tag| !is_taken(*tag)).unwrap_or(entity),
                None => entity,
            };
            self.0.insert(key, Block::new(shape, nodes_per_element, tag));
        }
        self.0.entry(key).or_insert_with(|| Block::new(shape, nodes_per_element, entity))
    }
}
