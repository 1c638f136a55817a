//! Choice of the unknown at the points: the parameter of the law's graph or the velocity.

use super::{Contact, point::Unknown};
use crate::{
    error::{Error, Result},
    linear_algebra::tensor::{Vector, dot, dual_basis, outside},
    mesh::Mesh,
};
use std::collections::{BTreeMap, BTreeSet};

/// Cosine below which directions at a node count as orthogonal.
const ORTHOGONAL: f64 = 1e-9;
/// Sine below which the angle between a direction at a node and the span of the others is too small.
const INDEPENDENT: f64 = 0.02;
/// Cosine of 40 degrees, the angle by which facets of a smooth boundary turn at most.
const SMOOTH: f64 = 0.766;

/// Tells points how their normals are directed to the motion of the obstacle, and lets held nodes stop obstacles that forces move. Gives
/// each node of a smooth boundary to one contact, and each edge to the friction of one boundary. Where directions at a node are not
/// orthogonal, selects their dual basis or, for smooth laws without friction, the velocity as the unknown. Refuses laws with vertical parts
/// at Gauss points.
pub fn choose_unknowns<const D: usize>(contacts: &mut [Contact<D>], mesh: &Mesh<D>) -> Result<()> {
    give_nodes_to_one_contact(contacts);
    for contact in &mut *contacts {
        let Some((direction, _)) = contact.obstacle.translation() else { continue };
        contact
            .normal
            .points
            .iter_mut()
            .for_each(|point| point.along_obstacle = dot(&point.normal, direction));
    }
    let stopping =
        |contact: &&mut Contact<D>| contact.normal.law.has_vertical_parts() && contact.obstacle.moves();
    for point in contacts.iter_mut().filter(stopping).flat_map(|contact| &mut contact.normal.points) {
        if point.unknown == Unknown::Held {
            point.unknown = Unknown::Stop;
            (point.direction, point.dual) = (point.normal, point.normal);
        }
    }
    let mut around: BTreeMap<usize, Vec<(usize, usize)>> = BTreeMap::new();
    for (number, contact) in contacts.iter().enumerate() {
        if contact.normal.needs_ghosts {
            if contact.normal.law.has_vertical_parts() || contact.normal.law.depends_on_displacement() {
                return Err(Error::Refused(
                    "contact at Gauss points requires a normal law that depends on the velocity and has no jumps: use quadrature = \"nodal\"".into(),
                ));
            }
            continue;
        }
        for (at, point) in
            contact.normal.points.iter().enumerate().filter(|(_, p)| p.unknown == Unknown::Parameter)
        {
            around.entry(point.node()).or_default().push((number, at));
        }
    }
    for &(number, at) in around.values().filter(|places| places.len() == 1).flatten() {
        contacts[number].normal.points[at].turns = contacts[number].is_paired;
    }
    for &(number, at) in around.values().filter(|places| places.len() > 1).flatten() {
        contacts[number].normal.points[at].edge = None;
    }
    keep_tangents_free_of_normals(contacts, &around);
    let with_friction = give_edges_to_one_friction(contacts);
    for (node, places) in around.into_iter().filter(|(_, places)| places.len() > 1) {
        let direction = |&(number, at): &(usize, usize)| contacts[number].normal.points[at].direction;
        let skew = (1..places.len()).any(|i| {
            places[..i].iter().any(|other| dot(&direction(other), &direction(&places[i])).abs() > ORTHOGONAL)
        });
        if !skew {
            continue;
        }
        let is_sharp = places.iter().any(|&(number, _)| {
            contacts[number].normal.law.has_vertical_parts() || contacts[number].obstacle.is_driven()
        });
        if is_sharp || with_friction.contains(&node) {
            let directions: Vec<Vector<D>> = places.iter().map(direction).collect();
            let Some(dual) = dual_basis(&directions, INDEPENDENT) else {
                let place = mesh.nodes[node];
                return Err(Error::Refused(format!(
                    "contact at {place:?} m: friction or a law with jumps or constraints acts on boundaries whose normals there depend on \
                     each other, so that their pressures are not determined; leave one of the boundaries out of contact, or exclude \
                     the facets around by `where`"
                )));
            };
            places
                .iter()
                .zip(dual)
                .for_each(|(&(number, at), dual)| contacts[number].normal.points[at].dual = dual);
            contacts[places[0].0].edges.push(places);
            continue;
        }
        places
            .into_iter()
            .for_each(|(number, at)| contacts[number].normal.points[at].unknown = Unknown::Velocity);
    }
    Ok(())
}

/// Sets the motions that points on vertical parts of their graphs hold at edges, where the normals are not orthogonal: a basis of the
/// span of the normals of these points.
pub fn set_walls<const D: usize>(contacts: &mut [Contact<D>]) {
    for owner in 0..contacts.len() {
        for edge in 0..contacts[owner].edges.len() {
            let (mut known, mut count) = ([[0.0; D]; D], 0);
            for place in 0..contacts[owner].edges[edge].len() {
                let (number, at) = contacts[owner].edges[edge][place];
                let point = &mut contacts[number].normal.points[at];
                if point.theta == 0.0
                    && let Some(wall) = outside(&point.direction, &known[..count], INDEPENDENT)
                {
                    (point.wall, known[count]) = (wall, wall);
                    count += 1;
                }
            }
        }
    }
}

/// Friction at an edge acts along the direction that is tangential to every contact boundary there.
fn keep_tangents_free_of_normals<const D: usize>(
    contacts: &mut [Contact<D>],
    around: &BTreeMap<usize, Vec<(usize, usize)>>,
) {
    let normal =
        |&(number, at): &(usize, usize)| ((number, at), contacts[number].normal.points[at].direction);
    let normals: BTreeMap<usize, Vec<_>> =
        around.iter().map(|(&node, places)| (node, places.iter().map(normal).collect())).collect();
    for (number, contact) in contacts.iter_mut().enumerate() {
        let Some(friction) = &mut contact.friction else { continue };
        for point in &mut friction.points {
            let own = (number, point.at);
            let others = normals.get(&point.node()).into_iter().flatten();
            others.filter(|(at, _)| *at != own).for_each(|(_, direction)| point.remove_direction(direction));
        }
        friction.points.retain(|point| point.all > 0);
    }
}

/// Leaves each edge to the friction of the boundary that has the larger part of a node there, because along one direction only one friction
/// can act; of equal parts their normals decide, so that the order of the tables does not matter. Returns the nodes with friction.
fn give_edges_to_one_friction<const D: usize>(contacts: &mut [Contact<D>]) -> BTreeSet<usize> {
    let mut strongest: BTreeMap<usize, ((usize, usize), f64, Vector<D>)> = BTreeMap::new();
    for (number, contact) in contacts.iter().enumerate() {
        for point in contact.friction.iter().flat_map(|friction| &friction.points) {
            let this = ((number, point.at), point.weight, contact.normal.points[point.at].normal);
            let best = strongest.entry(point.node()).or_insert(this);
            let comes_first = is_larger(point.weight, best.1)
                || (!is_larger(best.1, point.weight) && is_before(&this.2, &best.2));
            if comes_first {
                *best = this;
            }
        }
    }
    for (number, contact) in contacts.iter_mut().enumerate() {
        if let Some(friction) = &mut contact.friction {
            friction.points.retain(|point| strongest[&point.node()].0 == (number, point.at));
        }
    }
    strongest.into_keys().collect()
}

/// Gives each node at which two contacts meet on a smooth boundary, with its whole weight, to the contact that has the larger part of it.
fn give_nodes_to_one_contact<const D: usize>(contacts: &mut [Contact<D>]) {
    let mut kept: BTreeMap<usize, Vec<(usize, usize)>> = BTreeMap::new();
    let mut given = vec![BTreeSet::new(); contacts.len()];
    for number in 0..contacts.len() {
        let nodal =
            if contacts[number].normal.needs_ghosts { 0 } else { contacts[number].normal.points.len() };
        for at in 0..nodal {
            let point = &contacts[number].normal.points[at];
            let (normal, weight) = (point.normal, point.weight);
            let here = kept.entry(point.node()).or_default();
            let meets = |&(other, at): &(usize, usize)| {
                other != number && dot(&contacts[other].normal.points[at].normal, &normal) > SMOOTH
            };
            let Some(place) = here.iter().position(meets) else {
                here.push((number, at));
                continue;
            };
            let (other, other_at) = here[place];
            let other_weight = contacts[other].normal.points[other_at].weight;
            if is_larger(weight, other_weight) {
                here[place] = (number, at);
                contacts[number].add_weight(at, other_weight);
                given[other].insert(other_at);
            } else {
                contacts[other].add_weight(other_at, weight);
                given[number].insert(at);
            }
        }
    }
    contacts.iter_mut().zip(&given).for_each(|(contact, given)| contact.remove_points(given));
}

/// Whether a weight is larger by more than rounding, which differs between partitions of the mesh.
fn is_larger(weight: f64, other: f64) -> bool {
    weight > other * (1.0 + 1e-9)
}

/// Whether the first component in which two normals differ by more than rounding is smaller in the first one.
fn is_before<const D: usize>(normal: &Vector<D>, other: &Vector<D>) -> bool {
    normal.iter().zip(other).find(|(a, b)| (*a - *b).abs() > ORTHOGONAL).is_some_and(|(a, b)| a < b)
}
