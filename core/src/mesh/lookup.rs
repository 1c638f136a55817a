//! Facets to which a job gives both a support and a contact.

use super::Mesh;
use super::shape::centroid;
use super::tags::place;

/// Facets of this rank that belong to a boundary with a support and to one with contact: their motion would be prescribed
/// and unknown at once.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct FacetConflicts {
    /// The boundaries of the first of them, and its position.
    pub first: String,
    /// Their number.
    pub count: usize,
}

impl<const D: usize> Mesh<D> {
    /// The facets of this rank that belong to these supports and also to these contacts.
    pub fn conflicts(&self, supports: &[&str], contacts: &[&str]) -> FacetConflicts {
        let facets = |name: &str| self.boundary(name).map_or(&[][..], |boundary| &boundary.facets);
        let mut supported_by = vec![None; self.facets.len()];
        for &name in supports {
            for &facet in facets(name) {
                supported_by[facet as usize].get_or_insert(name);
            }
        }
        let mut conflicts = FacetConflicts::default();
        for &contact in contacts {
            for &facet in facets(contact) {
                let Some(support) = supported_by[facet as usize] else { continue };
                if conflicts.count == 0 {
                    let corners = self.facet_corners(facet);
                    let names = if support == contact {
                        format!("a support and a contact both contain the boundary `{contact}`")
                    } else {
                        format!(
                            "the support on `{support}` and the contact on `{contact}` have a facet in common"
                        )
                    };
                    conflicts.first = format!("{names}: around {}", place(&centroid(&corners)));
                }
                conflicts.count += 1;
            }
        }
        conflicts
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{
        GlobalMesh,
        generate::{Diagonal, rectangle},
    };

    #[test]
    fn facets_with_support_and_contact_are_found_with_both_names() {
        let whole = rectangle([2.0, 1.0], [2, 1], Diagonal::Right, [1.0; 2]).unwrap();
        let GlobalMesh { nodes, facets, boundaries, .. } = whole;
        let mut mesh = Mesh { nodes, facets, boundaries, ..Mesh::default() };
        assert_eq!(mesh.conflicts(&["left", "top"], &["bottom", "right"]), FacetConflicts::default());
        let conflicts = mesh.conflicts(&["left", "bottom"], &["bottom"]);
        assert_eq!(
            conflicts.first,
            "a support and a contact both contain the boundary `bottom`: around (0.5, 0)"
        );
        assert_eq!(conflicts.count, 2);
        let shared = mesh.boundaries[2].facets[1];
        mesh.boundaries[0].facets.push(shared);
        let conflicts = mesh.conflicts(&["left"], &["bottom"]);
        assert!(conflicts.first.contains("support on `left` and the contact on `bottom`"), "{conflicts:?}");
        assert!(conflicts.first.ends_with("around (1.5, 0)") && conflicts.count == 1, "{conflicts:?}");
    }
}
