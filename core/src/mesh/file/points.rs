//! Named points and curves: physical groups of a dimension below that of boundaries.

use super::document::Document;
use crate::{
    error::Result,
    linear_algebra::tensor::{Vector, in_space},
    mesh::{GlobalMesh, PointSet, midpoint},
};
use std::collections::BTreeMap;

/// Finds the nodes of the physical points and, in space, curves that have a name. Nodes without a cell are left out. `node` is the
/// number of a node of the mesh, if it has a cell, and `middle` the place of the node on an edge of second order between two nodes.
pub(super) fn name_points<const D: usize>(
    mesh: &mut GlobalMesh<D>,
    document: &Document,
    node: impl Fn(u64, u64) -> Result<Option<u32>>,
    middle: impl Fn(u64, u64, [&Vector<D>; 2]) -> Result<Vector<D>>,
) -> Result<()> {
    let mut sets: BTreeMap<&str, Vec<[f64; 3]>> = BTreeMap::new();
    for block in document.blocks.iter().filter(|block| block.shape.dimension() < D - 1) {
        let dimension = block.shape.dimension();
        let groups = document.groups.get(&(dimension, block.entity)).into_iter().flatten();
        let names: Vec<&String> =
            groups.filter_map(|&group| document.names.get(&(dimension, group))).collect();
        if names.is_empty() {
            continue;
        }
        let mut places = Vec::new();
        for (element, tags) in block.elements() {
            let corners = tags[..=dimension].iter().map(|&tag| node(tag, element));
            let corners: Option<Vec<u32>> = corners.collect::<Result<_>>()?;
            let Some(corners) = corners else { continue };
            let corners: Vec<&Vector<D>> = corners.iter().map(|&node| &mesh.nodes[node as usize]).collect();
            places.extend(corners.iter().map(|place| in_space(*place)));
            if let &[a, b] = corners.as_slice() {
                let side = match tags.get(2) {
                    Some(&tag) if mesh.is_second_order => middle(tag, element, [a, b])?,
                    _ => midpoint(a, b),
                };
                places.push(in_space(&side));
            }
        }
        for name in names {
            sets.entry(name).or_default().extend(&places);
        }
    }
    let sets = sets.into_iter().filter(|(_, places)| !places.is_empty());
    mesh.point_sets = sets.map(|(name, places)| PointSet::new(name, places)).collect();
    Ok(())
}
