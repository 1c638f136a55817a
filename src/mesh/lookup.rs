//! Facets that a job claims twice.

use super::Mesh;
use super::shape::centroid;
use super::tags::place;

/// Facets of this rank that belong to a boundary with a support and to one with contact: their motion would be prescribed
/// and unknown at once.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Claims {
    /// Who claims the first of them, and where.
    pub first: String,
    /// How many there are.
    pub count: usize,
}

impl<const D: usize> Mesh<D> {
    /// What these supports and contacts both claim, as far as it is here.
    pub fn claimed_twice(&self, supports: &[&str], contacts: &[&str]) -> Claims {
        let facets = |name: &str| self.boundary(name).map_or(&[][..], |boundary| &boundary.facets);
        let mut supported_by = vec![None; self.facets.len()];
        for &name in supports {
            for &facet in facets(name) {
                supported_by[facet as usize].get_or_insert(name);
            }
        }
        let mut claims = Claims::default();
        for &contact in contacts {
            for &facet in facets(contact) {
                let Some(support) = supported_by[facet as usize] else { continue };
                if claims.count == 0 {
                    let corners = self.facet_corners(facet);
                    let names = if support == contact {
                        format!("a support and a contact both contain the boundary `{contact}`")
                    } else {
                        format!(
                            "the support on `{support}` and the contact on `{contact}` have a facet in common"
                        )
                    };
                    claims.first = format!("{names}: around {}", place(&centroid(&corners)));
                }
                claims.count += 1;
            }
        }
        claims
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
        assert_eq!(mesh.claimed_twice(&["left", "top"], &["bottom", "right"]), Claims::default());
        let claims = mesh.claimed_twice(&["left", "bottom"], &["bottom"]);
        assert_eq!(
            claims.first,
            "a support and a contact both contain the boundary `bottom`: around (0.5, 0)"
        );
        assert_eq!(claims.count, 2);
        let shared = mesh.boundaries[2].facets[1];
        mesh.boundaries[0].facets.push(shared);
        let claims = mesh.claimed_twice(&["left"], &["bottom"]);
        assert!(claims.first.contains("support on `left` and the contact on `bottom`"), "{claims:?}");
        assert!(claims.first.ends_with("around (1.5, 0)") && claims.count == 1, "{claims:?}");
    }
}
