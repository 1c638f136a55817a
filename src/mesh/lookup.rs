//! Boundaries by the names jobs use.

use super::shape::centroid;
use super::tags::place;
use super::{Boundary, GlobalMesh, Mesh};
use crate::error::{Error, Result};

impl<const D: usize> GlobalMesh<D> {
    /// The boundary with this name; otherwise the nearest name and all there are.
    pub fn boundary(&self, name: &str) -> Result<&Boundary> {
        self.boundaries.iter().find(|boundary| boundary.name == name).ok_or_else(|| {
            unknown("boundary", name, self.boundaries.iter().map(|boundary| boundary.name.as_str()))
        })
    }

    /// The position in `regions` of the region with this name; otherwise the nearest name and all there are.
    pub fn region(&self, name: &str) -> Result<u16> {
        self.regions
            .iter()
            .position(|region| region == name)
            .map(|at| at as u16)
            .ok_or_else(|| unknown("region", name, self.regions.iter().map(String::as_str)))
    }
}

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
                    let corners = self.facets[facet as usize].map(|node| self.nodes[node as usize]);
                    let names = if support == contact {
                        format!("a support and a contact both claim the boundary `{contact}`")
                    } else {
                        format!(
                            "the support on `{support}` and the contact on `{contact}` both claim a facet"
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

fn unknown<'a>(kind: &str, name: &str, known: impl Iterator<Item = &'a str>) -> Error {
    let known: Vec<&str> = known.collect();
    if known.is_empty() {
        return Error::Refused(format!(
            "the mesh has no {kind} `{name}`: it names none at all. Give its facets physical groups in Gmsh"
        ));
    }
    let nearest = known
        .iter()
        .map(|candidate| (strsim::normalized_damerau_levenshtein(name, candidate), candidate))
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .filter(|(likeness, _)| *likeness >= 0.5)
        .map(|(_, candidate)| format!(" Did you mean `{candidate}`?"));
    Error::Refused(format!(
        "the mesh has no {kind} `{name}`.{} It has: {}",
        nearest.unwrap_or_default(),
        known.join(", ")
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::generate::{Diagonal, rectangle};

    #[test]
    fn a_misspelt_boundary_gets_the_nearest_name_and_the_list() {
        let mesh = rectangle([1.0, 1.0], [2, 2], Diagonal::Right, [1.0; 2]).unwrap();
        assert_eq!(mesh.boundary("top").unwrap().name, "top");
        let error = mesh.boundary("botom").unwrap_err().to_string();
        assert!(error.contains("Did you mean `bottom`? It has: left, right, bottom, top"), "{error}");
        let error = mesh.boundary("xyz").unwrap_err().to_string();
        assert!(!error.contains("Did you mean"), "{error}");
        assert_eq!(mesh.region("body").unwrap(), 0);
        assert!(
            mesh.region("bodi").unwrap_err().to_string().contains("no region `bodi`. Did you mean `body`?")
        );
    }

    #[test]
    fn a_mesh_without_names_says_so() {
        let mut mesh = rectangle([1.0, 1.0], [1, 1], Diagonal::Right, [1.0; 2]).unwrap();
        mesh.boundaries.clear();
        assert!(mesh.boundary("left").unwrap_err().to_string().contains("names none at all"));
    }

    #[test]
    fn facets_with_support_and_contact_are_found_with_both_names() {
        let whole = rectangle([2.0, 1.0], [2, 1], Diagonal::Right, [1.0; 2]).unwrap();
        let GlobalMesh { nodes, facets, boundaries, .. } = whole;
        let mut mesh = Mesh { nodes, facets, boundaries, ..Mesh::default() };
        assert_eq!(mesh.claimed_twice(&["left", "top"], &["bottom", "right"]), Claims::default());
        let claims = mesh.claimed_twice(&["left", "bottom"], &["bottom"]);
        assert_eq!(claims.first, "a support and a contact both claim the boundary `bottom`: around (0.5, 0)");
        assert_eq!(claims.count, 2);
        let shared = mesh.boundaries[2].facets[1];
        mesh.boundaries[0].facets.push(shared);
        let claims = mesh.claimed_twice(&["left"], &["bottom"]);
        assert!(claims.first.contains("support on `left` and the contact on `bottom`"), "{claims:?}");
        assert!(claims.first.ends_with("around (1.5, 0)") && claims.count == 1, "{claims:?}");
    }
}
