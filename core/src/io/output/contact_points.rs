//! States of contact points for fields and profiles.

use super::{
    faced_points::{FacedPoint, Given, faced_points},
    output_field::Converged,
};
use crate::{
    error::Result,
    fem::{
        effect::{Contact, Moment, PointState, Quantity, SurfaceForce},
        space::{SurfacePoint, corner_means, omits_corners},
    },
    linear_algebra::tensor::{Vector, dot, larger, norm},
    mesh::shape::facet_normal,
    parallel::exchange::exchange_lists,
};
use std::{cmp::Ordering, collections::BTreeSet};

/// Values of a state that corners have as means, vectors as in space.
const VALUES: usize = 15;
/// Pressures and normals that differ by a smaller share are the same: the rest is rounding, which depends on the partition.
const SAME: f64 = 1e-9;
/// Cosine of the angle up to which two normals at a node are those of one face.
const SAME_FACE: f64 = 0.7;

/// The states of the nodal points of all contacts at the nodes of this rank, those of a node together, in the order of
/// their normals: neither the order of the tables of the job nor the partition matters. Nodes of the other side of contact between bodies
/// have means of those that face them, with opposite tractions and sliding velocities. Corners where no law acts
/// have the means of the points at the midpoints of edges around, a mean for each face of the body, and their own distance from an obstacle.
/// Collective.
pub(super) fn contact_points<const D: usize, const S: usize>(
    at: Converged<'_, D, S>,
) -> Result<Vec<(usize, PointState<D>)>> {
    let Some(traction) = &at.state.contact_traction else { return Ok(Vec::new()) };
    let contacts = || at.body.contacts.iter().enumerate().filter(|(_, contact)| !contact.normal.needs_ghosts);
    let mut points: Vec<(usize, PointState<D>)> = Vec::new();
    let mut given: Vec<Given<VALUES>> = Vec::new();
    let mut visit_all = || {
        let (displacement, velocity) = (at.state.displacement.local()?, at.state.velocity.local()?);
        let [displacement, velocity] =
            [&displacement, &velocity].map(|values| at.body.seen_by_contacts(values));
        let nodal = [&*displacement, &*velocity, &*traction.owned()?];
        contacts().try_for_each(|(number, contact)| {
            contact.states(at.state.time, nodal, |node, state| {
                points.push((node, state));
                if contact.is_paired {
                    given.push(Given { contact: number, node, values: values_of(&state) });
                }
            })
        })
    };
    let visited = visit_all();
    at.session.agree(visited)?;
    points.sort_by(in_order);
    // Where a node has a law of its own on the same face, this is what acts there.
    let is_new = |(node, faced): &(usize, PointState<D>)| {
        let on_face = |state: &PointState<D>| dot(&state.normal, &faced.normal) > SAME_FACE;
        !points_at(&points, *node).any(on_face)
    };
    let faced: Vec<_> = faced_points(at, &given)?
        .into_iter()
        .map(|of_point| {
            (of_point.point.node as usize, faced_state(&of_point, at.body.held.whole(of_point.point).normal))
        })
        .filter(is_new)
        .collect();
    points.extend(faced);
    points.sort_by(in_order);
    let others = at.body.pairs.iter().flat_map(|pair| &pair.against);
    let facets: Vec<u32> =
        contacts().flat_map(|(_, contact)| &contact.facets).chain(others).copied().collect();
    let of_midside = |node: u32, normal: &Vector<D>| {
        let along = |state: &&PointState<D>| dot(&state.normal, normal);
        points_at(&points, node as usize).max_by(|a, b| along(a).total_cmp(&along(b))).map(values_of)
    };
    let corners = corner_means(at.session, &at.body.mesh, &facets, of_midside)?;
    let displacement = at.session.agree(at.state.displacement.local())?;
    let obstacles = obstacles_at_corners(at)?;
    for (point, values) in corners {
        let normal = at.body.held.whole(point).normal;
        let node = point.node as usize;
        let near =
            obstacles.iter().filter(|(other, _, facing)| *other == node && dot(facing, &normal) > SAME_FACE);
        let place = (at.body.mesh.nodes[node], normal);
        let own = displacement[node * D..].first_chunk().unwrap_or(&[0.0; D]);
        let gaps =
            near.filter_map(|(_, contact, _)| at.body.contacts[*contact].gap_at(place, at.state.time, own));
        let state = state_of(&values);
        let gap = gaps.min_by(f64::total_cmp).unwrap_or(state.gap);
        points.push((node, PointState { normal, gap, ..state }));
    }
    points.sort_by(in_order);
    Ok(points)
}

/// The owned corners of facets before obstacles where no law acts, each with the contact and the unit normal of the facet. Collective.
fn obstacles_at_corners<const D: usize, const S: usize>(
    at: Converged<'_, D, S>,
) -> Result<Vec<(usize, usize, Vector<D>)>> {
    let mesh = &at.body.mesh;
    if !omits_corners(mesh) {
        return Ok(Vec::new());
    }
    let mut records = vec![Vec::new(); at.session.ranks()];
    let before_obstacles = at.body.contacts.iter().enumerate().filter(|(_, contact)| !contact.is_paired);
    for (number, facet) in before_obstacles
        .flat_map(|(number, contact)| contact.facets.iter().map(move |facet| (number, *facet)))
    {
        let normal = facet_normal(&mesh.facet_corners(facet));
        for corner in mesh.facets[facet as usize].map(|node| mesh.global_node(node)) {
            let record = &mut records[mesh.owner(corner)];
            record.extend([f64::from(corner), number as f64]);
            record.extend(normal.map(|n| n / norm(&normal)));
        }
    }
    let records = exchange_lists(at.session.world(), &records)?;
    let of_record = |record: &[f64]| {
        let normal = std::array::from_fn(|i| record[i + 2]);
        (mesh.owned_node(record[0] as u32), record[1] as usize, normal)
    };
    Ok(records.chunks_exact(D + 2).map(of_record).collect())
}

/// The states at a node, of points in the order of their nodes.
fn points_at<const D: usize>(
    points: &[(usize, PointState<D>)],
    node: usize,
) -> impl Iterator<Item = &PointState<D>> {
    let first = points.partition_point(|(other, _)| *other < node);
    points[first..].iter().take_while(move |(other, _)| *other == node).map(|(_, state)| state)
}

/// The state of a point on the other side of a contact between bodies.
fn faced_state<const D: usize>(
    FacedPoint { of_forces, of_places, .. }: &FacedPoint<D, VALUES>,
    normal: Vector<D>,
) -> PointState<D> {
    let [forces, places]: [PointState<D>; 2] = [of_forces, of_places].map(state_of);
    let opposite = |vector: Vector<D>| vector.map(|x| 0.0 - x);
    PointState {
        normal,
        pressure: forces.pressure,
        friction: opposite(forces.friction),
        direction: opposite(places.direction),
        sliding: opposite(places.sliding),
        ..places
    }
}

/// The state that counts of those at a node: the one with the largest pressure, or the first.
pub(super) fn largest<const D: usize>(of_node: &[(usize, PointState<D>)]) -> &PointState<D> {
    let larger = |best: &PointState<D>, other: &PointState<D>| {
        other.pressure.abs() > best.pressure.abs() * (1.0 + SAME)
    };
    let states = of_node.iter().map(|(_, state)| state);
    states.fold(&of_node[0].1, |best, other| if larger(best, other) { other } else { best })
}

/// Fills a history of contact points, given at the owned nodes, at corners where no law acts: with the
/// largest of the means of the faces there. Collective.
pub(super) fn fill_corners<const D: usize, const S: usize>(
    at: Converged<'_, D, S>,
    quantity: Quantity,
    values: &mut [f64],
) -> Result<()> {
    let keeps = |contact: &&Contact<D>| {
        let kept = contact.histories().filter_map(|store| store.values(Moment::Last));
        kept.into_iter().any(|history| history.quantity == quantity)
    };
    let others = at.body.pairs.iter().filter(|pair| keeps(&&at.body.contacts[pair.contact]));
    let facets = at.body.contacts.iter().filter(keeps).flat_map(|contact| &contact.facets);
    let facets: Vec<u32> = facets.chain(others.flat_map(|pair| &pair.against)).copied().collect();
    let of_midside = |node: u32, _: &Vector<D>| Some([values[node as usize]]);
    for (point, [mean]) in corner_means(at.session, &at.body.mesh, &facets, of_midside)? {
        let value = &mut values[point.node as usize];
        *value = larger(*value, mean);
    }
    Ok(())
}

/// Fills a history of contact points, given at the owned nodes, at those of the other side of contact between bodies, which have no value
/// of their own: with means of the nodes that face them. Collective.
pub(super) fn fill_faced<const D: usize, const S: usize>(
    at: Converged<'_, D, S>,
    values: &mut [f64],
) -> Result<()> {
    let nodes = at
        .body
        .pairs
        .iter()
        .flat_map(|pair| pair.nodes.iter().map(|node| (pair.contact, node.node as usize)));
    let given: Vec<Given<1>> =
        nodes.map(|(contact, node)| Given { contact, node, values: [values[node]] }).collect();
    let with_law: BTreeSet<usize> =
        at.body.contacts.iter().flat_map(|contact| contact.normal.nodes()).collect();
    for FacedPoint { point, of_places: [mean], .. } in faced_points(at, &given)? {
        let node = point.node as usize;
        if !with_law.contains(&node) {
            values[node] = larger(values[node], mean);
        }
    }
    Ok(())
}

/// The tractions of effects at the surface, such as bonds, on what the body touches, `D` values for each owned node, with means at
/// corners and on the other side of contact between bodies as in [`contact_points`]; `None` without such effects, on all ranks alike.
/// Collective.
pub(super) fn further_tractions<const D: usize, const S: usize>(
    at: Converged<'_, D, S>,
) -> Result<Option<Vec<f64>>> {
    if at.body.surface_effects.is_empty() {
        return Ok(None);
    }
    let (mesh, mut forces) = (&at.body.mesh, Vec::new());
    at.session.agree(at.body.write_surface_forces(at.state, &mut forces))?;
    let mut values = vec![0.0; mesh.owned * D];
    let mut given: Vec<Given<D>> = Vec::new();
    for SurfaceForce { contact, node, weight, force } in forces.iter().filter(|force| force.weight > 0.0) {
        let traction: Vector<D> = force.map(|force| -force / weight);
        let target = &mut values[*node as usize * D..][..D];
        (0..D).for_each(|i| target[i] += traction[i]);
        if at.body.contacts[*contact].is_paired {
            given.push(Given { contact: *contact, node: *node as usize, values: traction });
        }
    }
    for FacedPoint { point, of_forces, .. } in faced_points(at, &given)? {
        let target = &mut values[point.node as usize * D..][..D];
        (0..D).for_each(|i| target[i] -= of_forces[i]);
    }
    let others = at.body.pairs.iter().flat_map(|pair| &pair.against);
    let facets = at.body.contacts.iter().flat_map(|contact| &contact.facets).chain(others);
    let facets: Vec<u32> = facets.copied().collect();
    let of_midside = |node: u32, _: &Vector<D>| Some(std::array::from_fn(|i| values[node as usize * D + i]));
    let corners: Vec<(SurfacePoint<D>, Vector<D>)> = corner_means(at.session, mesh, &facets, of_midside)?;
    for (point, mean) in corners {
        values[point.node as usize * D..][..D].copy_from_slice(&mean);
    }
    Ok(Some(values))
}

fn in_order<const D: usize>(a: &(usize, PointState<D>), b: &(usize, PointState<D>)) -> Ordering {
    let rounded = |x: &f64| (x / SAME).round();
    let pairs = a.1.normal.iter().zip(&b.1.normal);
    let by_normal = pairs.map(|(x, y)| rounded(x).total_cmp(&rounded(y))).find(|order| order.is_ne());
    a.0.cmp(&b.0).then(by_normal.unwrap_or(Ordering::Equal))
}

fn values_of<const D: usize>(state: &PointState<D>) -> [f64; VALUES] {
    let mut out = [0.0; VALUES];
    let rubs = f64::from(u8::from(state.sticks.is_some()));
    let sticks = f64::from(u8::from(state.sticks == Some(true)));
    out[..5].copy_from_slice(&[state.pressure, state.gap, state.branch as f64, rubs, sticks]);
    for (at, vector) in [state.direction, state.sliding, state.friction].iter().enumerate() {
        out[5 + 3 * at..][..D].copy_from_slice(vector);
    }
    out[14] = state.slip;
    out
}

/// The state with such means: on the nearest branch, and sticking if the greater part sticks.
fn state_of<const D: usize>(values: &[f64; VALUES]) -> PointState<D> {
    let [pressure, gap, branch, rubs, sticks, ..] = *values;
    let vector = |at: usize| std::array::from_fn(|i| values[5 + 3 * at + i]);
    PointState {
        normal: [0.0; D],
        direction: vector(0),
        pressure,
        gap,
        branch: branch.round() as usize,
        sticks: (rubs > 0.0).then_some(sticks >= 0.5 * rubs),
        sliding: vector(1),
        friction: vector(2),
        slip: values[14],
    }
}
