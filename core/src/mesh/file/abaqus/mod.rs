//! Input files of Abaqus and CalculiX (.inp).
//!
//! Read are nodes, elements, their sets, surfaces and the assignment of sections. Regions are, if each cell is in just one of them, the
//! sets of `*SOLID SECTION`, or else those of `*ELSET` if they are as many as the sets on the lines `*ELEMENT`; otherwise the sets on
//! these lines; if there are none, sets of `*ELSET` that do not overlap.
//! Boundaries are surfaces, sets of elements of the dimension of the boundary, and sets of nodes that contain all nodes of a facet.

mod boundaries;
mod elements;
mod lines;
mod model;
mod regions;
mod sets;
mod surface;

pub use model::REVOLVED;

use super::document::Document;
use crate::error::Result;
use model::Model;

/// Reads the bytes of a file.
pub(super) fn parse(bytes: &[u8]) -> Result<Document> {
    let mut model = Model::read(bytes)?;
    let dimension = model.dimension()?;
    let tags = model.sorted_tags()?;
    let node_sets = model.node_sets.resolve(&tags.nodes, "node", bytes.len())?;
    let element_sets = model.element_sets.resolve(&tags.elements, "element", bytes.len())?;
    let mut document = Document::default();
    regions::add(&mut document, &model, (&element_sets, dimension))?;
    boundaries::add(&mut document, &model, (&element_sets, &node_sets), dimension)?;
    document.notes.extend(model.notes());
    (document.node_tags, document.points) =
        (std::mem::take(&mut model.node_tags), std::mem::take(&mut model.points));
    Ok(document)
}
