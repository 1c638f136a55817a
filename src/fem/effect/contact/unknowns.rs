//! Choice of the unknown at the points: the parameter of the law's graph or the velocity.

use super::{Contact, point::Unknown};
use crate::{
    error::{Error, Result},
    linear_algebra::tensor::dot,
    mesh::Mesh,
};
use std::collections::{BTreeMap, BTreeSet};

/// Cosine below which directions at a node count as orthogonal.
const ORTHOGONAL: f64 = 1e-9;
/// Cosine of 40 degrees, the angle by which facets of a smooth boundary turn at most.
const SMOOTH: f64 = 0.766;

/// Selects the velocity as the unknown at points where directions at a node are not orthogonal; refuses laws
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
    keep_tangents_free_of_normals(contacts, &around);
    let with_friction = refuse_shared_tangents(contacts, mesh)?;
    for (node, places) in around.into_iter().filter(|(_, places)| places.len() > 1) {
        let direction = |&(number, at): &(usize, usize)| contacts[number].points[at].direction;
        let skew = (1..places.len()).any(|i| {
            places[..i].iter().any(|other| dot(&direction(other), &direction(&places[i])).abs() > ORTHOGONAL)
        });
        if !skew {
            continue;
        }
        let is_sharp = places.iter().any(|&(number, _)| contacts[number].law.has_vertical_parts());
        let acting = match (with_friction.contains(&node), is_sharp) {
            (true, _) => "friction acts",
            (_, true) => "a law with jumps or constraints acts",
            _ => "",
        };
        if !acting.is_empty() {
            let is_smooth = (1..places.len()).any(|i| {
                places[..i].iter().any(|other| dot(&direction(other), &direction(&places[i])) > SMOOTH)
            });
            let (meeting, remedy) = if is_smooth {
                (
                    "two [[contact]] tables meet on a smooth boundary",
                    "leave a facet between them out of both, or use one table",
                )
            } else {
                (
                    "boundaries meet at an angle other than 90 degrees",
                    "round the edge with facets that turn by less than 40 degrees each, or leave one of the boundaries out of contact",
                )
            };
            let place = mesh.nodes[node];
            return Err(Error::Refused(format!(
                "contact at {place:?} m: {meeting}, and {acting} there; {remedy}"
            )));
        }
        places.into_iter().for_each(|(number, at)| contacts[number].points[at].unknown = Unknown::Velocity);
    }
    Ok(())
}

/// Friction at an edge acts along the direction that is tangential to every contact boundary there.
fn keep_tangents_free_of_normals<const D: usize>(
    contacts: &mut [Contact<D>],
    around: &BTreeMap<usize, Vec<(usize, usize)>>,
) {
    let normal = |&(number, at): &(usize, usize)| ((number, at), contacts[number].points[at].direction);
    let normals: BTreeMap<usize, Vec<_>> =
        around.iter().map(|(&node, places)| (node, places.iter().map(normal).collect())).collect();
    for (number, contact) in contacts.iter_mut().enumerate() {
        let Some(friction) = &mut contact.friction else { continue };
        for point in &mut friction.points {
            let own = (number, point.at);
            let others = normals.get(&point.node()).into_iter().flatten();
            others.filter(|(at, _)| *at != own).for_each(|(_, direction)| point.remove_direction(direction));
        }
        friction.keep_points_with_tangents();
    }
}

/// The nodes with friction; along one direction friction of one boundary only can act.
fn refuse_shared_tangents<const D: usize>(
    contacts: &[Contact<D>],
    mesh: &Mesh<D>,
) -> Result<BTreeSet<usize>> {
    let mut nodes = BTreeSet::new();
    let frictions = contacts.iter().filter_map(|contact| contact.friction.as_ref());
    for point in frictions.flat_map(|friction| &friction.points) {
        if !nodes.insert(point.node()) {
            return Err(Error::Refused(format!(
                "friction at {:?} m: two boundaries with friction meet at an edge there, and both would act along it; give \
                 friction to one of them only, or round the edge",
                mesh.nodes[point.node()]
            )));
        }
    }
    Ok(nodes)
}
