//! Divides quadrilaterals, pyramids, wedges and hexahedra into simplices.
//!
//! A facet with four corners is divided by the diagonal through its corner with the smallest tag, so that the two cells at the facet
//! divide it in the same way (Dompierre, Labbé, Vallet, Camarero 2002, "How to subdivide pyramids, prisms and hexahedra into
//! tetrahedra"). A cell is divided into the tetrahedra between its corner with the smallest tag and the triangles of the facets that do
//! not contain this corner: the diagonals of the other facets begin at the corner. A hexahedron gives 6 tetrahedra, a wedge 3, a
//! pyramid 2.

use super::document::{Block, Document, Shape};
use crate::error::{Error, Result};
use std::collections::HashMap;

/// What the note about cells that were split adds, for runs with linear cells.
pub const ADVICE: &str = ": linear ones resist bending too much, quadratic ones ([mesh] order = 2) do not";

/// Divides all elements that are no simplices; notes how many cells were divided. If a cell is divided, the others lose the nodes on
/// their edges.
pub(super) fn into_simplices(document: &mut Document) -> Result<()> {
    let dimension = document.dimension()?;
    let whole = |block: &&Block| block.shape.dimension() == dimension && !block.shape.is_simplex();
    let is_divided = document.blocks.iter().any(|block| whole(&block) && !block.tags.is_empty());
    if is_divided && dimension == 3 {
        refuse_other_diagonals(document)?;
    }
    let mut divided: Vec<(Shape, usize)> = Vec::new();
    let (mut simplices, mut has_lost_nodes) = (0, false);
    for block in &mut document.blocks {
        let (shape, cells) = (block.shape, block.tags.len());
        let is_cell = shape.dimension() == dimension;
        has_lost_nodes |= is_divided && is_cell && cells > 0 && block.nodes_per_element > shape.corners();
        if !shape.is_simplex() {
            *block = divide(block)?;
            if is_cell && cells > 0 {
                add(&mut divided, shape, cells);
                simplices += block.tags.len();
            }
        } else if is_divided {
            *block = corners_of(block);
        }
    }
    if is_divided {
        let pieces = if dimension == 2 { Shape::Triangle } else { Shape::Tetrahedron };
        let were = if divided.iter().map(|(_, cells)| cells).sum::<usize>() == 1 { "was" } else { "were" };
        divided.sort_unstable();
        let counts: Vec<String> = divided.iter().rev().map(|&(shape, cells)| counted(shape, cells)).collect();
        document.notes.push(format!(
            "{} {were} split into {}{ADVICE}",
            list(&counts),
            counted(pieces, simplices)
        ));
    }
    if has_lost_nodes {
        document.notes.push(
            "the cells are of second order and some were split: all are used by their corners, joined by straight edges; curvature is \
             dropped. Mesh curved bodies with triangles or tetrahedra of second order"
                .into(),
        );
    }
    Ok(())
}

/// `64 hexahedra`.
fn counted(shape: Shape, count: usize) -> String {
    let [one, several] = shape.words();
    format!("{count} {}", if count == 1 { one } else { several })
}

/// `a, b and c`.
fn list(words: &[String]) -> String {
    match words {
        [all @ .., last] if !all.is_empty() => format!("{} and {last}", all.join(", ")),
        _ => words.concat(),
    }
}

fn add(counts: &mut Vec<(Shape, usize)>, shape: Shape, more: usize) {
    match counts.iter_mut().find(|(other, _)| *other == shape) {
        Some((_, count)) => *count += more,
        None => counts.push((shape, more)),
    }
}

/// The elements of a block without nodes other than corners.
fn corners_of(block: &Block) -> Block {
    let corners = block.shape.corners();
    let nodes = block.elements().flat_map(|(_, nodes)| &nodes[..corners]).copied().collect();
    Block { tags: block.tags.clone(), nodes, ..Block::new(block.shape, corners, block.entity) }
}

/// The simplices of all elements of a block, with the tags of their elements.
fn divide(block: &Block) -> Result<Block> {
    let shape = block.shape;
    let simplex = if shape.dimension() == 2 { Shape::Triangle } else { Shape::Tetrahedron };
    let mut out = Block::new(simplex, simplex.corners(), block.entity);
    for (element, nodes) in block.elements() {
        let nodes = &nodes[..shape.corners()];
        refuse_collapsed(shape, element, nodes)?;
        let before = out.nodes.len();
        if shape.dimension() == 2 {
            triangles(nodes, |triangle| out.nodes.extend(triangle));
        } else {
            let first = nodes.iter().copied().min().unwrap_or(0);
            for facet in shape.facets() {
                let corners: Vec<u64> = facet.iter().map(|&corner| nodes[corner]).collect();
                if !corners.contains(&first) {
                    triangles(&corners, |[a, b, c]| out.nodes.extend([first, a, b, c]));
                }
            }
        }
        let more = (out.nodes.len() - before) / simplex.corners();
        out.tags.extend(std::iter::repeat_n(element, more));
    }
    Ok(out)
}

/// The triangles of a facet or plane element with three or four corners, which begin at the corner with the smallest tag.
fn triangles(corners: &[u64], mut give: impl FnMut([u64; 3])) {
    let (count, first) = (corners.len(), smallest(corners));
    for second in 1..count - 1 {
        give([first, first + second, first + second + 1].map(|at| corners[at % count]));
    }
}

/// The position of the corner with the smallest tag.
fn smallest(corners: &[u64]) -> usize {
    (0..corners.len()).min_by_key(|&at| corners[at]).unwrap_or(0)
}

/// Refuses a facet with four corners on one side and two triangles on the other side, if these have the other diagonal.
fn refuse_other_diagonals(document: &Document) -> Result<()> {
    let cells =
        || document.blocks.iter().filter(|block| block.shape.dimension() == 3 && !block.tags.is_empty());
    let facets = |corners: usize| {
        cells().flat_map(move |block| {
            let facets = block.shape.facets().iter().filter(move |facet| facet.len() == corners);
            facets.flat_map(|facet| {
                block.elements().map(|(element, nodes)| {
                    (facet.iter().map(|&corner| nodes[corner]).collect::<Vec<u64>>(), element)
                })
            })
        })
    };
    if facets(3).next().is_none() {
        return Ok(());
    }
    let sorted = |corners: &[u64]| {
        let mut corners = corners.to_vec();
        corners.sort_unstable();
        corners
    };
    let mut single: HashMap<Vec<u64>, (Vec<u64>, u64)> = HashMap::new();
    for (corners, element) in facets(4) {
        let key = sorted(&corners);
        if single.remove(&key).is_none() {
            single.insert(key, (corners, element));
        }
    }
    let mut others: HashMap<Vec<u64>, u64> = HashMap::new();
    for (corners, element) in single.into_values() {
        let first = smallest(&corners);
        let [a, b, c, d] = [0, 1, 2, 3].map(|at| corners[(first + at) % 4]);
        others.extend([[a, b, d], [b, c, d]].map(|triangle| (sorted(&triangle), element)));
    }
    match facets(3).find_map(|(corners, element)| Some((*others.get(&sorted(&corners))?, element))) {
        None => Ok(()),
        Some((whole, element)) => Err(Error::Refused(format!(
            "element {whole} has a facet with four corners where element {element} has a triangle: the two sides would divide the facet \
             by different diagonals. Mesh with pyramids between hexahedra and tetrahedra"
        ))),
    }
}

fn refuse_collapsed(shape: Shape, element: u64, nodes: &[u64]) -> Result<()> {
    match nodes.iter().enumerate().find(|(at, node)| nodes[..*at].contains(node)) {
        None => Ok(()),
        Some((_, node)) => Err(Error::Refused(format!(
            "element {element}, a {}, has the node {node} twice: it is degenerate. Write it as a cell with fewer corners (a wedge, a \
             pyramid, a tetrahedron or a triangle)",
            shape.words()[0]
        ))),
    }
}
