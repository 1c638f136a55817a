//! Sets of nodes: boundaries, or else named points.

use super::document::Document;
use crate::error::Result;
use crate::linear_algebra::tensor::in_space;
use crate::mesh::{Boundary, GlobalMesh, PointSet};

/// Makes each set of nodes a boundary of the facets whose corners it contains; without such facets, named points. Sets with the name of
/// a boundary are left out. `node` is the number of a node of the mesh, if it has a cell. Gives what the user should know.
pub(super) fn name_node_sets<const D: usize>(
    mesh: &mut GlobalMesh<D>,
    document: &Document,
    node: impl Fn(u64) -> Result<Option<u32>>,
) -> Result<Vec<String>> {
    let mut notes = Vec::new();
    let mut is_on_surface = vec![false; mesh.nodes.len()];
    mesh.facets.as_flattened().iter().for_each(|&node| is_on_surface[node as usize] = true);
    // 1 for the nodes of the set, 2 for those that belong to one of its facets.
    let mut marks = vec![0_u8; mesh.nodes.len()];
    for (name, tags) in &document.node_sets {
        let boundaries = mesh.boundaries.iter().map(|boundary| &boundary.name);
        if boundaries.chain(mesh.inner_groups.iter().map(|group| &group.name)).any(|other| other == name) {
            continue;
        }
        let nodes: Vec<Option<u32>> = tags.iter().map(|&tag| node(tag)).collect::<Result<_>>()?;
        let nodes: Vec<usize> = nodes.into_iter().flatten().map(|node| node as usize).collect();
        nodes.iter().for_each(|&node| marks[node] = 1);
        let mut facets = Vec::new();
        for (facet, corners) in (0..).zip(&mesh.facets) {
            if corners.iter().all(|&node| marks[node as usize] > 0) {
                corners.iter().for_each(|&node| marks[node as usize] = 2);
                facets.push(facet);
            }
        }
        let stray = nodes.iter().filter(|&&node| marks[node] == 1 && is_on_surface[node]).count();
        nodes.iter().for_each(|&node| marks[node] = 0);
        if !facets.is_empty() {
            if stray > 0 {
                notes.push(format!(
                    "the boundary {name} is made of the facets whose nodes are all in this set of nodes; {stray} other nodes of the set on \
                     the surface are left out"
                ));
            }
            mesh.boundaries.push(Boundary { name: name.clone(), facets });
        } else if !nodes.is_empty() {
            let places = nodes.iter().map(|&node| in_space(&mesh.nodes[node])).collect();
            mesh.point_sets.push(PointSet::new(name, places));
        }
    }
    Ok(notes)
}
