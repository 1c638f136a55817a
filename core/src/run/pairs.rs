//! Contact between bodies: finds what boundaries face, before the body is built, and refuses what cannot be solved.

use super::{
    materials::Materials,
    parts::part_of,
    side_words::names_of_sides,
    sides::{Sides, conflict, rubs, slides_with_masters},
};
use crate::{
    error::{Error, Result},
    fem::{
        body::Body,
        coupling::{Coupling, ghosts_of_surfaces, needed_ghosts},
        effect::{Carried, HeldNode},
        pairs::{Pair, PairedNode, inclined, is_exchanged, pair_of, shares},
        space::{Held, axis, facets},
    },
    job::{self, Job, Side, Sliding},
    linear_algebra::tensor::{Vector, norm},
    mesh::{Mesh, other_side},
    parallel::{agreement::Agreed, exchange::gather, session::Session},
};
use std::collections::{BTreeMap, BTreeSet};

/// The contacts of a job between bodies, with the side of each that carries the law; the mesh gets the ghosts that their equations need.
/// `earlier` has the contacts of the run from whose state this one starts, each with whether its sides were exchanged. Collective.
pub(super) fn find<const D: usize>(
    session: &Session,
    job: &Job,
    mesh: &mut Mesh<D>,
    (materials, earlier): (&Materials, &BTreeMap<usize, bool>),
) -> Result<Vec<Pair<D>>, Agreed> {
    let mut pairs = Vec::new();
    let sides = Sides::of(session, job, (&*mesh, materials), earlier)?;
    let is_fault = |contact: &job::Contact| {
        contact.against.is_empty() && contact.on.iter().any(|name| mesh.boundary(&other_side(name)).is_some())
    };
    for (number, contact) in job.contact.iter().enumerate() {
        if is_fault(contact) {
            let on = part_of(session, mesh, ("contact", &contact.on), contact.part.as_ref())?;
            let other: Vec<String> = contact.on.iter().map(|name| other_side(name)).collect();
            let against = facets(mesh, &other);
            let mut pair = Pair { is_closed: true, ..Pair::of(number, [on, against]) };
            pair.join(session, mesh)?;
            pairs.push(pair);
        }
        if contact.against.is_empty() {
            continue;
        }
        let on = part_of(session, mesh, ("contact", &contact.on), contact.part.as_ref())?;
        let against = facets(mesh, &contact.against);
        refuse_joined(session, mesh, (number, contact), [&on, &against])?;
        let slides = contact.sliding == Sliding::Finite;
        let pair = Pair { slides, is_closed: contact.closed, ..Pair::of(number, [on, against]) };
        let pair = sides.form(pair)?;
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
    sides.settle(&mut pairs)?;
    let shares = shares(mesh, &pairs);
    let mut slaves: BTreeSet<u32> = shares.iter().map(|share| share.slave).collect();
    let mut masters: BTreeSet<u32> = shares.iter().map(|share| share.master).collect();
    let mut ghosts = needed_ghosts(session, mesh, &shares)?;
    for pair in pairs.iter().filter(|pair| pair.slides) {
        let on = pair.carrying(mesh);
        let against: BTreeSet<u32> = mesh.nodes_of_facets(&pair.against).collect();
        let without_law = mesh.nodes_of_facets(&pair.on).filter(|node| !on.contains(node));
        let others = without_law.chain(against.iter().copied()).collect();
        ghosts.extend(ghosts_of_surfaces(session, mesh, (on.clone(), others))?);
        // Nodes that leave their part of the surface to neighbours for the time being carry no law.
        let beside = pair.nodes.iter().flat_map(|node| node.neighbours.iter().copied());
        let beside = mesh.named(session, beside)?;
        slaves.extend(on.difference(&beside));
        masters.extend(against);
    }
    refuse_chains(session, job, mesh, [slaves, masters])?;
    mesh.add_ghosts(session, ghosts)?;
    Ok(pairs)
}

/// Refuses a contact between these facets where bodies share a node: they are joined there. Facets of one body may meet. Collective.
fn refuse_joined<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    (number, contact): (usize, &job::Contact),
    sides: [&[u32]; 2],
) -> Result<(), Agreed> {
    let nodes_of = |facets: &[u32]| mesh.named(session, mesh.nodes_of_facets(facets));
    let shared = &nodes_of(sides[0])? & &nodes_of(sides[1])?;
    if session.total(shared.len()) == 0 {
        return Ok(());
    }
    let bodies = mesh.bodies(session)?;
    // The bodies that have the nodes owned here on either side.
    let bodies_on = |facets: &[u32]| -> Result<BTreeMap<u32, BTreeSet<u64>>, Agreed> {
        let told = facets.iter().flat_map(|&facet| {
            let body = bodies.of_cell[mesh.facet_cells[facet as usize] as usize];
            mesh.facet_nodes(facet).map(move |node| (mesh.global_node(node), [f64::from(body)]))
        });
        let mut found: BTreeMap<u32, BTreeSet<u64>> = BTreeMap::new();
        for (node, [body]) in mesh.tell_owners(session, told)? {
            found.entry(node).or_default().insert(body as u64);
        }
        Ok(found)
    };
    let [on, against] = [bodies_on(sides[0])?, bodies_on(sides[1])?];
    let joined = on.iter().find(|(node, bodies)| {
        against.get(node).is_some_and(|others| others.len() > 1 || bodies.len() > 1 || *bodies != others)
    });
    session.agree(match joined {
        None => Ok(()),
        Some((node, _)) => Err(Error::Refused(format!(
            "contact.{number}: the boundaries {} and {} share the node at {:?} m: the bodies are joined there; write the mesh with separate \
             nodes",
            contact.on.join(", "),
            contact.against.join(", "),
            mesh.nodes[mesh.owned_node(*node)]
        ))),
    })
}

/// Why a node of two contacts is refused.
const ALSO: &str = "it also belongs to contact.";
const OR_EXCLUDE: &str = "or exclude the facets around it by `where`";
/// What to do about a node of two contacts.
const SHARED: &str = "use `unilateral` with the friction `coulomb` or `tresca`, without wear, adhesion and memory, which leave such nodes to \
                      their neighbours, or exclude the facets around it by the `where` of one of the tables";

/// The same, given the contacts, where all have such laws.
fn remedy_of_shared(job: &Job) -> &'static str {
    let mut pairs = job.contact.iter().filter(|contact| !contact.against.is_empty());
    if pairs.all(job::Contact::is_without_scale) {
        "give contacts that meet there one table with several boundaries in `on` or `against`, or exclude the facets around it by the `where` \
         of one of the tables"
    } else {
        SHARED
    }
}

/// The same for parts of a fault, whose nodes have no neighbours to which they could be left.
const PARTS_OF_A_FAULT: &str = "give the parts of the fault one table with a friction coefficient that is a formula of the place, such as \
                                friction.expression.coefficient = \"if(x < 1, 0.3, 0.6)\"";

/// Refuses nodes that carry the law of one pair and are on the other side of another. Collective.
fn refuse_chains<const D: usize>(
    session: &Session,
    job: &Job,
    mesh: &Mesh<D>,
    [slaves, masters]: [BTreeSet<u32>; 2],
) -> Result<(), Agreed> {
    let (slaves, masters) = (mesh.named(session, slaves)?, mesh.named(session, masters)?);
    session.agree(match slaves.intersection(&masters).next() {
        None => Ok(()),
        Some(&node) => Err(Error::Refused(format!(
            "contact: the node at {:?} m carries the law of one contact between bodies, and another one has it on the other side; {}{}",
            mesh.nodes[mesh.owned_node(node)],
            // Otherwise all sides have been tried.
            if job.contact.iter().any(|contact| contact.side != Side::Auto) { "delete `side`, " } else { "" },
            remedy_of_shared(job)
        ))),
    })
}

/// The change of basis by these pairs, if there are any.
pub(super) fn coupling<const D: usize>(
    mesh: &Mesh<D>,
    pairs: &[Pair<D>],
    held: &Held<D>,
) -> Option<Coupling<D>> {
    (!pairs.is_empty()).then(|| Coupling::new(mesh, (&shares(mesh, pairs), inclined(pairs, held)), held))
}

/// The shares of the masters that a node of a pair faces on the other side, each with the length of the free part of a direction there.
fn faced_along<const D: usize, const S: usize>(
    body: &Body<D, S>,
    (node, masters): (&PairedNode<D>, &[(u32, f64)]),
    direction: &Vector<D>,
) -> Vec<(f64, f64)> {
    let free = |master: u32| norm(&body.held.free_part(master as usize, direction));
    let faced = masters.iter().filter(|(master, _)| !node.is_beside(body.mesh.global_node(*master)));
    faced.map(|(master, share)| (*share, free(*master))).collect()
}

/// Warns of nodes with friction or adhesion that supports hold along a direction which is inclined to the boundary, and not all that they face:
/// a sliding of the other body there is none of their motions, and meets no resistance. Collective.
pub(super) fn warnings_of_inclined_supports<const D: usize, const S: usize>(
    session: &Session,
    job: &Job,
    body: &Body<D, S>,
) -> Vec<String> {
    let Body { coupling: Some(coupling), held, pairs, .. } = body else { return Vec::new() };
    let masters_of: BTreeMap<u32, &[(u32, f64)]> = coupling.slaves().collect();
    let slides = |node: &&PairedNode<D>| {
        let masters = masters_of.get(&node.node).copied().unwrap_or(&[]);
        slides_with_masters(node, held, |direction| faced_along(body, (node, masters), direction))
    };
    let of_pair = |pair: &Pair<D>| {
        let count = session.total(pair.nodes.iter().filter(slides).count());
        (count > 0 && rubs(&job.contact[pair.contact])).then(|| {
            format!(
                "contact.{}: supports hold {count} nodes of {} along a direction that is inclined to it, and not all that they face of {} there: \
                 friction and adhesion do not act at these nodes on what slides along this direction; use meshes of both sides that fit along \
                 this edge, supports at right angles to the boundary, or hold neither side there",
                pair.contact,
                names_of_sides(job, pair)[0],
                names_of_sides(job, pair)[1],
            )
        })
    };
    pairs.iter().filter_map(of_pair).collect()
}

/// In how many ways supports may hold the nodes of bodies that they carry.
const MOST_WAYS: usize = 256;

/// Lets contacts between bodies know the supports that carry these, if any move in time. Collective.
pub(super) fn set_carried<const D: usize, const S: usize>(
    session: &Session,
    body: &mut Body<D, S>,
) -> Result<(), Agreed> {
    let Body { mesh, held, support_motion: Some(motion), contacts, pairs, .. } = body else { return Ok(()) };
    if pairs.is_empty() || !motion.values().iter().any(|prescribed| prescribed.value.depends_on_time()) {
        return Ok(());
    }
    let bodies = mesh.bodies(session)?;
    // For each way to hold nodes of a body: its number, and the parts with numbers of what they prescribe, 1 for rest and 0 for no part.
    let mut ways: BTreeSet<Vec<u64>> = BTreeSet::new();
    for (node, number) in bodies.of_nodes(mesh).into_iter().enumerate().take(mesh.owned) {
        let Some(number) = number.filter(|_| held.free_count(node) < D && ways.len() <= MOST_WAYS) else {
            continue;
        };
        let (frame, free) = held.frame(node);
        let mut parts: Vec<_> = motion.parts(node).collect();
        if parts.is_empty() {
            parts.extend(frame[free..].iter().map(|direction| (*direction, *direction, None)));
        }
        let mut way = vec![0.0; 1 + D * (2 * D + 1)];
        way[0] = f64::from(number);
        for ((direction, dual, value), place) in parts.into_iter().zip(way[1..].chunks_exact_mut(2 * D + 1)) {
            place[..D].copy_from_slice(&direction);
            place[D..2 * D].copy_from_slice(&dual);
            place[2 * D] = value.map_or(1.0, |number| 2.0 + number as f64);
        }
        ways.insert(way.into_iter().map(|x| (x + 0.0).to_bits()).collect());
    }
    let own: Vec<f64> = ways.into_iter().flatten().map(f64::from_bits).collect();
    let ways = gather(session.world(), &own)?;
    if ways.len() > MOST_WAYS * (1 + D * (2 * D + 1)) {
        return Ok(());
    }
    let held_nodes = |number: u32| -> Vec<HeldNode<D>> {
        let of_body = ways.chunks_exact(1 + D * (2 * D + 1)).filter(|way| way[0] == f64::from(number));
        let vector = |part: &[f64]| -> Vector<D> { std::array::from_fn(|i| part[i]) };
        let node = |way: &[f64]| {
            let parts = way[1..].chunks_exact(2 * D + 1).filter(|part| part[2 * D] > 0.0);
            let value = |number: f64| motion.value((number as usize).checked_sub(2)?).cloned();
            HeldNode(parts.map(|part| (vector(part), vector(&part[D..]), value(part[2 * D]))).collect())
        };
        of_body.map(node).collect()
    };
    for pair in pairs {
        let mut numbers = [Vec::new(), Vec::new()];
        for (numbers, facets) in numbers.iter_mut().zip([&pair.on, &pair.against]) {
            let own: BTreeSet<u32> = facets
                .iter()
                .map(|facet| bodies.of_cell[mesh.facet_cells[*facet as usize] as usize])
                .collect();
            let own: Vec<u32> = own.into_iter().collect();
            let all: BTreeSet<u32> = gather(session.world(), &own)?.into_iter().collect();
            numbers.extend(all);
        }
        if let [[one], [other]] = numbers.each_ref().map(Vec::as_slice)
            && one != other
        {
            contacts[pair.contact].carried = Some(Carried([*one, *other].map(&held_nodes)));
        }
    }
    Ok(())
}

/// Warns of faults that end at supports which hold nodes of both sides: they stay together there. Collective.
pub(super) fn warnings_of_held_faults<const D: usize, const S: usize>(
    session: &Session,
    job: &Job,
    body: &Body<D, S>,
) -> Result<Vec<String>, Agreed> {
    let mesh = &body.mesh;
    let moves = |node: usize| {
        body.support_motion.as_ref().is_some_and(|motion| (0..D).any(|i| motion.moves(node, &axis(i))))
    };
    let rests = |node: usize| body.held.free_count(node) == 0 && !moves(node);
    let mut out = Vec::new();
    for pair in body.pairs.iter().filter(|pair| job.contact[pair.contact].against.is_empty()) {
        let twins_rest = |node: &&PairedNode<D>| {
            let twins = node.masters.iter().map(|(twin, _)| mesh.local_node(*twin));
            rests(node.node as usize) && twins.into_iter().all(|twin| twin.is_some_and(rests))
        };
        let held = pair.nodes.iter().filter(twins_rest).map(|node| node.node);
        let records: Vec<f64> = held
            .flat_map(|node| [f64::from(mesh.global_node(node))].into_iter().chain(mesh.nodes[node as usize]))
            .collect();
        let records = gather(session.world(), &records)?;
        let Some(first) = records.chunks_exact(D + 1).next() else { continue };
        let nodes: BTreeSet<u32> = records.chunks_exact(D + 1).map(|record| record[0] as u32).collect();
        let holds = |name: &String| {
            let facets = mesh.boundary(name).map_or(&[][..], |boundary| &boundary.facets);
            let mut at = facets.iter().flat_map(|facet| mesh.facet_nodes(*facet));
            session.total(usize::from(at.any(|node| nodes.contains(&mesh.global_node(node))))) > 0
        };
        let supports = job.support.iter().filter(|support| support.fix.is_some());
        let mut names: Vec<&String> = supports.flat_map(|support| &support.on).collect();
        names.sort();
        names.dedup();
        names.retain(|name| holds(name));
        let names: Vec<&str> = names.into_iter().map(String::as_str).collect();
        out.push(format!(
            "contact.{}: the fault {} ends at the support on {}, which holds nodes of both its sides, as at {:?} m: there it can neither slip \
             nor open, and the fault beside it bears less than it would; let the support end before the fault (key `where`)",
            pair.contact,
            job.contact[pair.contact].on.join(", "),
            names.join(", "),
            &first[1..]
        ));
    }
    Ok(out)
}

/// Refuses nodes on the side `on` of a pair that supports hold along the normal, or tangentially where friction acts, and not what they
/// face; and nodes that belong to another contact. Collective.
pub(super) fn refuse_conflicts<const D: usize, const S: usize>(
    session: &Session,
    job: &Job,
    body: &Body<D, S>,
) -> Result<(), Agreed> {
    let Body { mesh, contacts, coupling: Some(coupling), held, pairs, .. } = body else { return Ok(()) };
    let masters_of: BTreeMap<u32, &[(u32, f64)]> = coupling.slaves().collect();
    let mut paired = BTreeMap::new();
    let mut found: Option<(usize, usize, String)> = None;
    for pair in pairs {
        let rubs = rubs(&job.contact[pair.contact]);
        for node in pair.nodes.iter().filter(|node| !node.masters.is_empty()) {
            if let Some(other) = paired.insert(node.node as usize, pair.contact) {
                found.get_or_insert((node.node as usize, pair.contact, format!("{ALSO}{other}")));
            }
            let masters = masters_of.get(&node.node).copied().unwrap_or(&[]);
            let facing = |direction: &Vector<D>| faced_along(body, (node, masters), direction);
            if let Some(why) = conflict(node, held, rubs, facing) {
                found.get_or_insert((node.node as usize, pair.contact, why.into()));
            }
        }
    }
    for (number, contact) in contacts.iter().enumerate() {
        let of_others = contact.normal.nodes().filter_map(|node| Some((node, *paired.get(&node)?)));
        for (node, pair) in of_others.filter(|(_, pair)| *pair != number) {
            found.get_or_insert((node, pair, format!("{ALSO}{number}")));
        }
    }
    session.agree(match found {
        None => Ok(()),
        Some((node, pair, why)) => {
            let contact = &job.contact[pair];
            let remedy = match (contact.side, is_exchanged(pairs, pair)) {
                _ if why.starts_with(ALSO) && contact.against.is_empty() => PARTS_OF_A_FAULT.into(),
                _ if why.starts_with(ALSO) => remedy_of_shared(job).into(),
                (Side::Auto, _) => format!("hold both bodies there in the same directions, or none of them, {OR_EXCLUDE}"),
                (_, true) => format!("delete `side`, {OR_EXCLUDE}"),
                (_, false) => format!("delete `side`, or exchange `on` and `against`, {OR_EXCLUDE}"),
            };
            Err(Error::Refused(format!(
                "contact.{pair}: the node at {:?} m of the boundary {} faces another body, and {why}; {remedy}",
                mesh.nodes[node],
                pair_of(pairs, pair).map_or_else(|| contact.on.join(", "), |pair| names_of_sides(job, pair)[0].clone())
            )))
        }
    })
}
