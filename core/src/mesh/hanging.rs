//! Hanging nodes: nodes on the surface of one cell that belong to another.

use super::GlobalMesh;
use super::shape::longest_edge;
use super::surface_names::SurfaceNames;
use super::tags::{Tags, place};
use super::tree::BoxTree;
use crate::error::{Error, Result};
use crate::linear_algebra::tensor::{Vector, add_scaled, dot, norm};

/// Distance from a facet, as a fraction of its longest edge, below which a node lies on the facet.
const TOUCHING: f64 = 1e-8;

/// Refuses a node in the interior of a boundary edge or face to which it does not belong.
///
/// If cells do not share complete facets, both sides are boundary facets, so that only these need to be searched.
pub(super) fn refuse_hanging_nodes<const D: usize>(
    mesh: &GlobalMesh<D>,
    names: &SurfaceNames,
    tags: &Tags,
) -> Result<()> {
    let boxes = (0..mesh.facets.len()).map(|facet| {
        let corners = mesh.facet_corners(facet);
        let margin = TOUCHING * longest_edge(&corners);
        let (mut low, mut high) = (corners[0], corners[0]);
        for corner in &corners {
            low = std::array::from_fn(|i| low[i].min(corner[i]));
            high = std::array::from_fn(|i| high[i].max(corner[i]));
        }
        (low.map(|x| x - margin), high.map(|x| x + margin))
    });
    let tree = BoxTree::new(boxes.collect());
    let mut seen = vec![false; mesh.nodes.len()];
    for &node in mesh.facets.iter().flatten() {
        if std::mem::replace(&mut seen[node as usize], true) {
            continue;
        }
        let point = &mesh.nodes[node as usize];
        let mut carrier = 0;
        let hangs = tree.around(point, |facet| {
            carrier = facet as usize;
            let nodes = &mesh.facets[carrier];
            !nodes.contains(&node)
                && around(point, &mesh.facet_corners(carrier)).is_some_and(|corners| {
                    let near = nodes.iter().zip(corners).filter(|(_, is_near)| *is_near);
                    !names.is_of_another_surface(node, carrier, near.map(|(near, _)| *near))
                })
        });
        if hangs {
            return Err(Error::Refused(format!(
                "{} at {} is a hanging node on {} of {}. Mesh both sides so that they share their nodes \
                 there; if two bodies touch there, give the boundary of each a name of its own",
                tags.node(node as usize),
                place(point),
                if D == 2 { "an edge" } else { "a face" },
                tags.cell(mesh.facet_cells[carrier] as usize)
            )));
        }
    }
    Ok(())
}

/// If a point lies on a facet, away from its corners, for each corner whether it bounds the facet or edge on which the point lies.
fn around<const D: usize>(point: &Vector<D>, corners: &[Vector<D>; D]) -> Option<[bool; D]> {
    let length = longest_edge(corners);
    let edge = |i: usize| add_scaled(&corners[i], -1.0, &corners[0]);
    let offset = add_scaled(point, -1.0, &corners[0]);
    let mut share = [0.0; D];
    let a = edge(1);
    if D == 2 {
        share[1] = dot(&offset, &a) / dot(&a, &a);
    } else {
        let b = edge(2);
        let (aa, ab, bb) = (dot(&a, &a), dot(&a, &b), dot(&b, &b));
        let determinant = aa * bb - ab * ab;
        share[1] = (bb * dot(&offset, &a) - ab * dot(&offset, &b)) / determinant;
        share[2] = (aa * dot(&offset, &b) - ab * dot(&offset, &a)) / determinant;
    }
    share[0] = 1.0 - share[1..].iter().sum::<f64>();
    let mut distance = offset;
    for (i, share) in share.iter().enumerate().skip(1) {
        distance = add_scaled(&distance, -share, &edge(i));
    }
    let touches =
        norm(&distance) <= TOUCHING * length && share.iter().all(|s| (-TOUCHING..1.0 - TOUCHING).contains(s));
    touches.then(|| share.map(|s| s > TOUCHING))
}
