//! At which points the parameter of the law's graph can be the unknown.

use super::{Contact, point::Unknown};
use crate::{
    error::{Error, Result},
    mesh::Mesh,
    tensor::dot,
};
use std::collections::BTreeMap;

/// Cosine below which directions at a node count as orthogonal.
const ORTHOGONAL: f64 = 1e-9;

/// Decides at which points the unknown is the velocity, because directions at a node are not orthogonal; refuses laws
/// with vertical parts there and at Gauss points.
pub fn choose_unknowns<const D: usize>(contacts: &mut [Contact<D>], mesh: &Mesh<D>) -> Result<()> {
    let mut around: BTreeMap<usize, Vec<(usize, usize)>> = BTreeMap::new();
    for (number, contact) in contacts.iter().enumerate() {
        if contact.needs_ghosts {
            if contact.law.has_vertical_parts() || contact.law.depends_on_displacement() {
                return Err(Error::Refused(
                    "contact at Gauss points needs a law of the velocity without jumps: use quadrature = \"nodal\"".into(),
                ));
            }
            continue;
        }
        for (at, point) in contact.points.iter().enumerate().filter(|(_, p)| p.unknown == Unknown::Parameter)
        {
            around.entry(point.node()).or_default().push((number, at));
        }
    }
    for (node, places) in around.into_iter().filter(|(_, places)| places.len() > 1) {
        let direction = |&(number, at): &(usize, usize)| contacts[number].points[at].direction;
        let skew = (1..places.len()).any(|i| {
            places[..i].iter().any(|other| dot(&direction(other), &direction(&places[i])).abs() > ORTHOGONAL)
        });
        if !skew {
            continue;
        }
        for (number, at) in places {
            if contacts[number].law.has_vertical_parts() {
                return Err(Error::Refused(format!(
                    "contact at {:?} m: boundaries meet at an angle that is not square, and a law with jumps or \
                     constraints acts there; round the edge with facets that turn by less than 40 degrees each, or leave \
                     one of the boundaries out of contact",
                    mesh.nodes[node]
                )));
            }
            contacts[number].points[at].unknown = Unknown::Velocity;
        }
    }
    Ok(())
}
