//! The names of the boundaries of nodes and facets.

use super::GlobalMesh;
use std::collections::BTreeSet;

/// The named boundaries of each node and of each facet. Two bodies, or the sides of a crack, may touch where their boundaries have names of
/// their own.
pub(super) struct SurfaceNames {
    of_nodes: Vec<BTreeSet<usize>>,
    of_facets: Vec<BTreeSet<usize>>,
}

impl SurfaceNames {
    pub(super) fn of<const D: usize>(mesh: &GlobalMesh<D>) -> Self {
        let mut of_nodes = vec![BTreeSet::new(); mesh.nodes.len()];
        let mut of_facets = vec![BTreeSet::new(); mesh.facets.len()];
        for (name, boundary) in mesh.boundaries.iter().enumerate() {
            for &facet in &boundary.facets {
                of_facets[facet as usize].insert(name);
                mesh.facets[facet as usize].iter().for_each(|&node| {
                    of_nodes[node as usize].insert(name);
                });
            }
        }
        Self { of_nodes, of_facets }
    }

    /// Whether nodes at the same place are those of two surfaces.
    pub(super) fn are_of_two_surfaces(&self, a: u32, b: u32) -> bool {
        differ(&self.of_nodes[a as usize], &self.of_nodes[b as usize])
    }

    /// Whether a node on a facet, on its part between these of its nodes, is one of another surface: that part may be an edge of the
    /// facet and of a boundary.
    pub(super) fn is_of_another_surface(
        &self,
        node: u32,
        facet: usize,
        between: impl Iterator<Item = u32>,
    ) -> bool {
        let of_node = &self.of_nodes[node as usize];
        let shared = between.map(|near| self.of_nodes[near as usize].clone()).reduce(|a, b| &a & &b);
        differ(of_node, &self.of_facets[facet]) || shared.is_some_and(|shared| differ(of_node, &shared))
    }
}

/// Whether each is on a boundary that the other is not on; both may be on one of all bodies.
fn differ(a: &BTreeSet<usize>, b: &BTreeSet<usize>) -> bool {
    !a.is_subset(b) && !b.is_subset(a)
}
