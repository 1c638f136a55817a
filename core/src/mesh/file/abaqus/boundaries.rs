//! Named parts of the boundary.

use super::elements::facet;
use super::lines::{refuse, short};
use super::model::{Model, Run};
use super::sets::{Resolved, find, shown};
use super::surface::{Facets, Surface};
use crate::error::Result;
use crate::mesh::file::document::{Block, Document, Shape};
use std::collections::HashMap;

/// Where an element is: its run and its position there.
type Places = HashMap<u64, (usize, usize)>;

/// Adds the boundaries of a model to a document: surfaces, sets of elements below the dimension of the cells, sets of nodes.
pub(super) fn add(
    document: &mut Document,
    model: &Model,
    (element_sets, node_sets): (&[Resolved], &[Resolved]),
    dimension: usize,
) -> Result<()> {
    let mut places = Places::new();
    if !model.surfaces.is_empty() || model.runs.iter().any(|run| run.kind.shape.dimension() < dimension) {
        for (number, run) in model.runs.iter().enumerate() {
            places.extend(run.tags.iter().enumerate().map(|(at, &tag)| (tag, (number, at))));
        }
    }
    let mut groups = Groups { document, next: 1 };
    let mut taken: Vec<String> = Vec::new();
    for surface in &model.surfaces {
        let blocks = blocks(surface, (model, &places), (element_sets, dimension))?;
        groups.add(surface.name.text.clone(), blocks);
        taken.push(surface.name.text.clone());
    }
    for set in element_sets {
        for below in 0..dimension {
            let blocks = lower(set, (model, &places), below);
            if !blocks.is_empty() && !is_in(&taken, &set.name.text) {
                groups.add(shown(&set.name, element_sets), blocks);
                taken.push(set.name.text.clone());
            }
        }
    }
    for set in node_sets.iter().filter(|set| !set.numbers.is_empty()) {
        let name = shown(&set.name, node_sets);
        if !is_in(&taken, &name) {
            document.node_sets.push((name, set.numbers.clone()));
        }
    }
    Ok(())
}

fn is_in(names: &[String], name: &str) -> bool {
    names.iter().any(|other| other.eq_ignore_ascii_case(name))
}

struct Groups<'a> {
    document: &'a mut Document,
    next: u32,
}

impl Groups<'_> {
    /// Adds blocks of one dimension as a group of their own.
    fn add(&mut self, name: String, blocks: Vec<Block>) {
        let Some(first) = blocks.first() else { return };
        let dimension = first.shape.dimension();
        self.document.names.insert((dimension, self.next), name);
        self.document.groups.insert((dimension, self.next as i32), vec![self.next]);
        for block in blocks {
            self.document.blocks.push(Block { entity: self.next as i32, ..block });
        }
        self.next += 1;
    }
}

/// The facets of a surface, in blocks of one shape.
fn blocks(
    surface: &Surface,
    (model, places): (&Model, &Places),
    (sets, dimension): (&[Resolved], usize),
) -> Result<Vec<Block>> {
    let mut blocks = Vec::new();
    for Facets { of, label } in &surface.facets {
        let one: Vec<u64> = of.text.parse().into_iter().collect();
        let tags = if one.is_empty() { &find(sets, of, "element")?.numbers } else { &one };
        for &tag in tags {
            let Some(&(run, at)) = places.get(&tag) else {
                return Err(refuse(
                    of.line,
                    format_args!("element {tag} has no facets, or the file does not contain it"),
                ));
            };
            let run = &model.runs[run];
            let nodes = &run.nodes[at * run.kind.nodes..(at + 1) * run.kind.nodes];
            let shape = run.kind.shape;
            let corners: Vec<u64> = if shape.dimension() + 1 == dimension {
                nodes[..shape.corners()].to_vec()
            } else {
                let Some(corners) = facet(shape, label).filter(|_| shape.dimension() == dimension) else {
                    let words =
                        format!("element {tag}, a {}, has no facet `{}`", shape.words()[0], short(label));
                    return Err(refuse(of.line, words));
                };
                corners.iter().map(|&corner| nodes[corner]).collect()
            };
            let shape = match corners.len() {
                2 => Shape::Line,
                3 => Shape::Triangle,
                _ => Shape::Quadrilateral,
            };
            push(&mut blocks, (shape, corners.len()), tag, &corners);
        }
    }
    Ok(blocks)
}

/// The elements of a set with this dimension, in blocks of one shape.
fn lower(set: &Resolved, (model, places): (&Model, &Places), dimension: usize) -> Vec<Block> {
    let mut blocks = Vec::new();
    for tag in &set.numbers {
        let run = |&(run, at): &(usize, usize)| (&model.runs[run], at);
        let found: Option<(&Run, usize)> = places.get(tag).map(run);
        if let Some((run, at)) = found.filter(|(run, _)| run.kind.shape.dimension() == dimension) {
            let nodes = &run.nodes[at * run.kind.nodes..(at + 1) * run.kind.nodes];
            push(&mut blocks, (run.kind.shape, run.kind.nodes), *tag, nodes);
        }
    }
    blocks
}

fn push(blocks: &mut Vec<Block>, (shape, count): (Shape, usize), tag: u64, nodes: &[u64]) {
    let same = |block: &Block| block.shape == shape && block.nodes_per_element == count;
    let at = blocks.iter().position(same).unwrap_or(blocks.len());
    if at == blocks.len() {
        blocks.push(Block::new(shape, count, 0));
    }
    blocks[at].tags.push(tag);
    blocks[at].nodes.extend(nodes);
}
