//! Contact between bodies: finds what boundaries face, before the body is built, and refuses what cannot be solved.

use super::build::part_of;
use crate::{
    error::{Error, Result},
    fem::{
        coupling::{Coupling, needed_ghosts},
        effect::Contact,
        pairs::{PairedNode, paired_nodes, refuse_chains, shares},
        space::{Held, facets},
    },
    job::Job,
    mesh::Mesh,
    parallel::{agreement::Agreed, session::Session},
};
use std::collections::BTreeMap;

/// For each contact of a job the nodes owned here that face another body, if it is against one; the mesh gets the ghosts that their
/// equations need. Collective.
pub(super) fn find<const D: usize>(
    session: &Session,
    job: &Job,
    mesh: &mut Mesh<D>,
) -> Result<Vec<Option<Vec<PairedNode<D>>>>, Agreed> {
    let mut all = Vec::new();
    for (number, contact) in job.contact.iter().enumerate() {
        if contact.against.is_empty() {
            all.push(None);
            continue;
        }
        let on = part_of(session, mesh, ("contact", &contact.on), contact.part.as_ref())?;
        let found = paired_nodes(session, mesh, &on, &facets(mesh, &contact.against))?;
        let names = [&contact.on, &contact.against].map(|names| names.join(", "));
        session.agree(if session.total(found.len()) == 0 {
            Err(Error::Refused(format!(
                "contact.{number}: no part of the boundary {} faces the boundary {} along its outward normal; correct `on` or `against`, or \
                 the positions of the bodies",
                names[0], names[1]
            )))
        } else {
            Ok(())
        })?;
        all.push(Some(found));
    }
    let pairs: Vec<_> = all.iter().flatten().flat_map(|nodes| shares(mesh, nodes)).collect();
    if all.iter().any(Option::is_some) {
        refuse_chains(session, mesh, &pairs)?;
        let ghosts = needed_ghosts(session, mesh, &pairs)?;
        mesh.add_ghosts(session, ghosts)?;
    }
    Ok(all)
}

/// The change of basis by these pairs, if there are any. Collective.
pub(super) fn coupling<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    paired: &[Option<Vec<PairedNode<D>>>],
    held: &Held<D>,
) -> Result<Option<Coupling<D>>, Agreed> {
    if paired.iter().all(Option::is_none) {
        return Ok(None);
    }
    let mut pairs: Vec<_> = paired.iter().flatten().flat_map(|nodes| shares(mesh, nodes)).collect();
    pairs.sort_by_key(|pair| pair.slave);
    Coupling::new(session, mesh, &pairs, held).map(Some)
}

/// Refuses nodes on the side `on` of a pair that supports hold along the normal, or that belong to another contact. Collective.
pub(super) fn refuse_conflicts<const D: usize>(
    session: &Session,
    job: &Job,
    mesh: &Mesh<D>,
    contacts: &[Contact<D>],
) -> Result<(), Agreed> {
    let mut paired = BTreeMap::new();
    let mut conflict = None;
    for (number, contact) in contacts.iter().enumerate().filter(|(_, contact)| contact.is_paired()) {
        if let Some(node) = contact.first_held_node() {
            conflict.get_or_insert((node, number, "a support holds it along the normal".to_owned()));
        }
        paired.extend(contact.nodes().map(|node| (node, number)));
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
