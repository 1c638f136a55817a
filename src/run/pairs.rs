//! Contact between bodies: finds what boundaries face, before the body is built, and refuses what cannot be solved.

use super::parts::part_of;
use crate::{
    error::{Error, Result},
    fem::{
        body::Body,
        coupling::{Coupling, HELD_TOGETHER, ghosts_of_surfaces, needed_ghosts},
        pairs::{Pair, shares},
        space::{Held, facets},
    },
    job::{self, Job, Scalar, Sliding},
    linear_algebra::tensor::{Vector, dot, norm},
    mesh::{Mesh, other_side},
    parallel::{agreement::Agreed, exchange::gather, session::Session},
};
use std::collections::{BTreeMap, BTreeSet};

/// Component of a unit direction along a normal above which it counts as along the normal.
const ALONG: f64 = 0.5;

/// The contacts of a job between bodies; the mesh gets the ghosts that their equations need. Collective.
pub(super) fn find<const D: usize>(
    session: &Session,
    job: &Job,
    mesh: &mut Mesh<D>,
) -> Result<Vec<Pair<D>>, Agreed> {
    let mut pairs = Vec::new();
    let is_fault = |contact: &job::Contact| {
        contact.against.is_empty() && contact.on.iter().any(|name| mesh.boundary(&other_side(name)).is_some())
    };
    for (number, contact) in job.contact.iter().enumerate() {
        if is_fault(contact) {
            let on = part_of(session, mesh, ("contact", &contact.on), contact.part.as_ref())?;
            let other: Vec<String> = contact.on.iter().map(|name| other_side(name)).collect();
            let against = facets(mesh, &other);
            let mut pair =
                Pair { contact: number, on, against, slides: false, is_closed: true, nodes: Vec::new() };
            pair.join(session, mesh)?;
            pairs.push(pair);
        }
        if contact.against.is_empty() {
            continue;
        }
        let varies = contact.normal.gap().is_some_and(Scalar::depends_on_position);
        session.agree(if D == 3 && mesh.order() == 2 && varies {
            Err(Error::Refused(format!(
                "contact.{number}: a `gap` that depends on the place is not available between bodies of quadratic cells in space; use \
                 [mesh] order = 1, or give the meshes this distance"
            )))
        } else {
            Ok(())
        })?;
        let on = part_of(session, mesh, ("contact", &contact.on), contact.part.as_ref())?;
        let against = facets(mesh, &contact.against);
        let slides = contact.sliding == Sliding::Finite;
        let mut pair =
            Pair { contact: number, on, against, slides, is_closed: contact.closed, nodes: Vec::new() };
        pair.form(session, mesh, &mesh.nodes)?;
        let names = [&contact.on, &contact.against].map(|names| names.join(", "));
        let facing = pair.nodes.iter().filter(|node| !node.masters.is_empty()).count();
        session.agree(if session.total(facing) == 0 && !slides {
            Err(Error::Refused(format!(
                "contact.{number}: no part of the boundary {} faces the boundary {} along its outward normal, or they overlap by more than \
                 5 % of the size of the bodies; correct `on` or `against`, or the positions of the bodies",
                names[0], names[1]
            )))
        } else {
            Ok(())
        })?;
        pairs.push(pair);
    }
    if pairs.is_empty() {
        return Ok(pairs);
    }
    let shares = shares(mesh, &pairs);
    let global =
        |facet: &u32| mesh.facet_nodes(*facet).map(|node| mesh.global_node(node)).collect::<Vec<_>>();
    let mut slaves: BTreeSet<u32> = shares.iter().map(|share| share.slave).collect();
    let mut masters: BTreeSet<u32> = shares.iter().map(|share| share.master).collect();
    let mut ghosts = needed_ghosts(session, mesh, &shares)?;
    for pair in pairs.iter().filter(|pair| pair.slides) {
        let on: BTreeSet<u32> = pair.nodes.iter().map(|node| mesh.global_node(node.node)).collect();
        let against: BTreeSet<u32> = pair.against.iter().flat_map(global).collect();
        let without_law = pair.on.iter().flat_map(global).filter(|node| !on.contains(node));
        let others = without_law.chain(against.iter().copied()).collect();
        ghosts.extend(ghosts_of_surfaces(session, mesh, [on.iter().copied().collect(), others])?);
        slaves.extend(on);
        masters.extend(against);
    }
    refuse_chains(session, mesh, [&slaves, &masters])?;
    mesh.add_ghosts(session, ghosts)?;
    Ok(pairs)
}

/// Refuses nodes that carry the law of one pair and are on the other side of another. Collective.
fn refuse_chains<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    [slaves, masters]: [&BTreeSet<u32>; 2],
) -> Result<(), Agreed> {
    let [slaves, masters] = [slaves, masters].map(|nodes| nodes.iter().copied().collect::<Vec<_>>());
    let slaves: BTreeSet<u32> = gather(session.world(), &slaves)?.into_iter().collect();
    let masters: BTreeSet<u32> = gather(session.world(), &masters)?.into_iter().collect();
    let own = mesh.first_node as u32..(mesh.first_node + mesh.owned) as u32;
    let both = slaves.intersection(&masters).find(|node| own.contains(node));
    session.agree(match both {
        None => Ok(()),
        Some(&node) => Err(Error::Refused(format!(
            "contact: the node at {:?} m is on the side `on` of one pair of boundaries and on the side `against` of another; exchange `on` \
             and `against` in one of the tables, or exclude the facets around it by `where`",
            mesh.nodes[mesh.owned_node(node)]
        ))),
    })
}

/// The change of basis by these pairs, if there are any. Collective.
pub(super) fn coupling<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    pairs: &[Pair<D>],
    held: &Held<D>,
) -> Result<Option<Coupling<D>>, Agreed> {
    if pairs.is_empty() {
        return Ok(None);
    }
    Coupling::new(session, mesh, &shares(mesh, pairs), held).map(Some)
}

/// Refuses nodes on the side `on` of a pair that supports hold along the normal, or tangentially where friction acts, and not what they
/// face; and nodes that belong to another contact. Collective.
pub(super) fn refuse_conflicts<const D: usize, const S: usize>(
    session: &Session,
    job: &Job,
    body: &Body<D, S>,
) -> Result<(), Agreed> {
    let Body { mesh, contacts, coupling: Some(coupling), held, .. } = body else { return Ok(()) };
    let masters_of: BTreeMap<usize, &[(u32, f64)]> =
        coupling.slaves().map(|(slave, masters)| (slave as usize, masters)).collect();
    // The share of the masters that is held along a direction as well.
    let held_share = |node: usize, direction: &Vector<D>| -> f64 {
        let free = |master: u32| norm(&held.free_part(master as usize, direction)).powi(2);
        let masters = masters_of.get(&node).copied().unwrap_or(&[]);
        masters.iter().map(|(master, share)| share * (1.0 - free(*master))).sum()
    };
    let mut paired = BTreeMap::new();
    let mut conflict: Option<(usize, usize, String)> = None;
    for (number, contact) in contacts.iter().enumerate().filter(|(_, contact)| contact.is_paired()) {
        let rubs = job.contact[number].friction.is_some() || job.contact[number].adhesion.is_some();
        for (node, normal) in contact.normal_directions().filter(|(node, _)| masters_of.contains_key(node)) {
            paired.insert(node, number);
            let (frame, free) = held.frame(node);
            for direction in &frame[free..] {
                let along = dot(direction, &normal).abs();
                let (word, matters) = match along > ALONG {
                    true => ("along the normal", true),
                    false => ("along the boundary, where friction or adhesion act", rubs),
                };
                if matters && held_share(node, direction) < HELD_TOGETHER {
                    let why = format!("a support holds it {word}, and not what it faces");
                    conflict.get_or_insert((node, number, why));
                }
            }
        }
    }
    for (number, contact) in contacts.iter().enumerate() {
        let of_others = contact.nodes().filter_map(|node| Some((node, *paired.get(&node)?)));
        for (node, pair) in of_others.filter(|(_, pair)| *pair != number) {
            conflict.get_or_insert((node, pair, format!("it also belongs to contact.{number}")));
        }
    }
    session.agree(match conflict {
        None => Ok(()),
        Some((node, pair, why)) => Err(Error::Refused(format!(
            "contact.{pair}: the node at {:?} m of the boundary {} faces another body, and {why}; exchange `on` and `against`, or exclude the \
             facets around it by `where`",
            mesh.nodes[node],
            job.contact[pair].on.join(", ")
        ))),
    })
}
