//! Which side of contact between bodies carries the law, and where supports prevent that.

use super::materials::Materials;
use crate::{
    error::Result,
    fem::{
        coupling::{HELD_TOGETHER, held_share},
        effect::Supports,
        pairs::{Exchange, Pair, PairedNode},
        space::{Held, facets},
    },
    job::{self, Job, Side},
    laws::material::Material,
    linear_algebra::{
        petsc::DistributedVector,
        tensor::{Vector, add_scaled, dot, norm},
    },
    mesh::{Mesh, other_side},
    parallel::{agreement::Agreed, exchange::gather, session::Session},
};
use std::collections::{BTreeMap, BTreeSet};

/// Component of a unit direction along the normal of the law above which it counts as along the normal.
const ALONG: f64 = 0.1;
/// The same for the normal of the facets, which turns into a plane of symmetry.
const ROUNDING: f64 = 1e-6;
/// Length of the free part of a unit direction below which a node is held nearly along it.
const NEARLY_HELD: f64 = 0.5;
/// The angle in rad (3 degrees) of edges over faces whose nodes carry the law from which on the other side may have to carry it.
const SHARP: f64 = 0.052;
/// The same (10 degrees) from which on the user is warned: forces along an inclined face are 18 % of those across.
pub(super) const EDGE: f64 = 0.175;

/// How many times as stiff as the other a body is whose nodes should not carry the law, whatever the meshes: the stress of a stiff body
/// hardly follows the nodes of a soft one that it faces, so that Newton's method would find contact and friction node by node.
const STIFFER: f64 = 100.0;

/// What the choice of a side depends on besides the meshes of both.
#[derive(Debug)]
pub(super) struct Circumstances<'a, const D: usize> {
    /// What supports hold on this rank.
    held: Held<D>,
    /// The directions in which they hold nodes of pairs on all ranks, orthonormal, by global numbers.
    directions: BTreeMap<u32, Vec<Vector<D>>>,
    materials: &'a Materials,
    /// The contacts that another run had from whose state this one starts, each with whether its sides were exchanged.
    earlier: BTreeMap<usize, bool>,
}

impl<'a, const D: usize> Circumstances<'a, D> {
    /// Those of the contacts of a job between bodies. Collective.
    pub(super) fn of(
        session: &Session,
        job: &Job,
        (mesh, materials): (&Mesh<D>, &'a Materials),
        earlier: BTreeMap<usize, bool>,
    ) -> Result<Self, Agreed> {
        if job.contact.iter().all(|contact| contact.against.is_empty() || contact.side != Side::Auto) {
            return Ok(Self { held: Held::default(), directions: BTreeMap::new(), materials, earlier });
        }
        let layout = session.agree(DistributedVector::ghosted(D, mesh.owned, &mesh.ghosts))?;
        let held = session.agree(Supports::of_body(session, mesh, &job.support, &layout))?.held;
        let names = job.contact.iter().flat_map(|contact| contact.on.iter().chain(&contact.against));
        let nodes: BTreeSet<u32> =
            facets(mesh, names).into_iter().flat_map(|facet| mesh.facet_nodes(facet)).collect();
        let mut records = Vec::new();
        for node in nodes {
            let (frame, free) = held.frame(node as usize);
            for direction in &frame[free..] {
                records.push(f64::from(mesh.global_node(node)));
                records.extend(direction);
            }
        }
        let mut directions: BTreeMap<u32, Vec<Vector<D>>> = BTreeMap::new();
        for record in gather(session.world(), &records)?.chunks_exact(1 + D) {
            let of_node = directions.entry(record[0] as u32).or_default();
            let direction = std::array::from_fn(|i| record[1 + i]);
            // Each rank that has the node tells the same.
            if !of_node.contains(&direction) {
                of_node.push(direction);
            }
        }
        Ok(Self { held, directions, materials, earlier })
    }

    /// Finds what the nodes of a pair face, on the side of the job's choice. Collective.
    pub(super) fn form(
        &self,
        session: &Session,
        mesh: &Mesh<D>,
        job: &Job,
        pair: Pair<D>,
    ) -> Result<Pair<D>, Agreed> {
        let contact = &job.contact[pair.contact];
        let formed = |mut pair: Pair<D>| -> Result<Pair<D>, Agreed> {
            pair.form(session, mesh, &mesh.nodes)?;
            Ok(pair)
        };
        match contact.side {
            Side::On => return formed(pair),
            Side::Against => return formed(pair.exchanged(Exchange::Requested)),
            Side::Auto => {}
        }
        let earlier = self.earlier.get(&pair.contact).copied();
        let first = formed(match earlier {
            Some(true) => pair.exchanged(Exchange::Continued),
            _ => pair,
        })?;
        let is_held = |pair: &Pair<D>| session.total(self.conflicts(mesh, contact, pair).len()) > 0;
        if is_held(&first) {
            let other = formed(first.clone().exchanged(Exchange::Held))?;
            return Ok(if is_held(&other) { first } else { other });
        }
        if earlier.is_some() {
            return Ok(first);
        }
        let sharpness = first.sharpness(session, mesh);
        if first.slides && sharpness > SHARP {
            let other = formed(first.clone().exchanged(Exchange::Sharper))?;
            if !is_held(&other) && is_blunter((session, mesh), &other, sharpness) {
                return Ok(other);
            }
        }
        let [own, faced] = [&first.on, &first.against].map(|facets| self.stiffness(session, mesh, facets));
        let reason = if own > STIFFER * faced {
            Some(Exchange::Stiffer)
        } else if faced > STIFFER * own {
            None
        } else {
            is_coarser(session, &first)?.then_some(Exchange::Coarser)
        };
        if let Some(reason) = reason
            && !meets_another(session, mesh, job, &first)?
        {
            let other = formed(first.clone().exchanged(reason))?;
            let is_sharp =
                || first.slides && is_blunter((session, mesh), &first, other.sharpness(session, mesh));
            return Ok(if is_held(&other) || is_sharp() { first } else { other });
        }
        Ok(first)
    }

    /// The mean Young's modulus in Pa of the cells of these facets of all ranks, of orthotropic ones the largest; NaN where a cell has none.
    /// Collective.
    fn stiffness(&self, session: &Session, mesh: &Mesh<D>, facets: &[u32]) -> f64 {
        let modulus = |facet: &u32| {
            let cell = mesh.facet_cells[*facet as usize] as usize;
            let Material { elasticity, orthotropic, .. } =
                &self.materials.all[self.materials.of_cell(mesh, cell)];
            let isotropic = elasticity.as_ref().map(|law| law.youngs_modulus);
            let largest =
                || orthotropic.as_ref().map(|law| law.youngs_moduli.iter().copied().fold(0.0, f64::max));
            isotropic.or_else(largest).unwrap_or(f64::NAN)
        };
        let [sum, count] = session.sum([facets.iter().map(modulus).sum(), facets.len() as f64]);
        sum / count
    }

    /// Exchanges the sides of pairs whose choice is free where nodes would carry the law of one contact and be faced in another one.
    /// Collective.
    pub(super) fn untangle(
        &self,
        session: &Session,
        mesh: &Mesh<D>,
        job: &Job,
        pairs: &mut [Pair<D>],
    ) -> Result<(), Agreed> {
        let mut least = tangled(session, mesh, job, pairs)?;
        for at in 0..pairs.len() {
            let contact = &job.contact[pairs[at].contact];
            if least == 0 {
                continue;
            }
            let exchanged = self.exchanged(session, (mesh, contact), (&pairs[at], Exchange::Faced))?;
            let Some(other) = exchanged else { continue };
            let kept = std::mem::replace(&mut pairs[at], other);
            let left = tangled(session, mesh, job, pairs)?;
            if left < least { least = left } else { pairs[at] = kept }
        }
        Ok(())
    }

    /// Exchanges the sides of pairs whose choice is free and some of whose nodes face those that carry the law of another pair, where supports
    /// allow it: the facets of the latter can then face the bodies of both. Collective.
    pub(super) fn follow(
        &self,
        session: &Session,
        mesh: &Mesh<D>,
        job: &Job,
        pairs: &mut [Pair<D>],
    ) -> Result<(), Agreed> {
        // An exchange may let others follow.
        let mut at = 0;
        while at < pairs.len() {
            let pair = &pairs[at];
            at += 1;
            let contact = &job.contact[pair.contact];
            if !self.is_free(contact, pair) || pair.exchange.is_some() {
                continue;
            }
            let [_, faced] = pair.nodes_of_all(session, mesh)?;
            let mut is_faced = false;
            for other in pairs.iter().filter(|other| other.contact != pair.contact) {
                if meet(session, &other.on, &pair.against) {
                    let [own, _] = other.nodes_of_all(session, mesh)?;
                    is_faced |= own.intersection(&faced).next().is_some();
                }
            }
            if is_faced
                && let Some(other) = self.exchanged(session, (mesh, contact), (pair, Exchange::Faced))?
            {
                pairs[at - 1] = other;
                at = 0;
            }
        }
        Ok(())
    }

    /// Whether the sides of a pair may be exchanged.
    fn is_free(&self, contact: &job::Contact, pair: &Pair<D>) -> bool {
        let earlier = self.earlier.get(&pair.contact);
        let was_other = earlier.is_none_or(|exchanged| *exchanged != pair.exchange.is_some());
        contact.side == Side::Auto && !contact.against.is_empty() && was_other
    }

    /// A pair with its sides exchanged for this reason, if the choice is free and supports allow it, where the law allows it by leaving what
    /// they hold to neighbours. Collective.
    pub(super) fn exchanged(
        &self,
        session: &Session,
        (mesh, contact): (&Mesh<D>, &job::Contact),
        (pair, why): (&Pair<D>, Exchange),
    ) -> Result<Option<Pair<D>>, Agreed> {
        if !self.is_free(contact, pair) {
            return Ok(None);
        }
        let mut other = pair.clone().exchanged(why);
        other.lawless.clear();
        other.form(session, mesh, &mesh.nodes)?;
        let held = self.conflicts(mesh, contact, &other);
        let is_held = session.total(held.len()) > 0;
        if is_held && contact.is_without_scale() {
            other.lawless = gather(session.world(), &held)?.into_iter().collect();
            other.form(session, mesh, &mesh.nodes)?;
        }
        let facing = other.nodes.iter().filter(|node| !node.masters.is_empty()).count();
        let is_left = is_held && (other.lawless.is_empty() || session.total(usize::from(other.is_bare)) > 0);
        Ok((session.total(facing) > 0 && !is_left).then_some(other))
    }

    /// The nodes owned here whose law supports prevent, by global numbers.
    fn conflicts(&self, mesh: &Mesh<D>, contact: &job::Contact, pair: &Pair<D>) -> Vec<u32> {
        let free = |master: &u32, direction: &Vector<D>| -> f64 {
            let held = self.directions.get(master).into_iter().flatten();
            norm(&held.fold(*direction, |left, held| add_scaled(&left, -dot(held, direction), held)))
        };
        let nodes = pair.nodes.iter().filter(|node| {
            let facing = |direction: &Vector<D>| -> Vec<(f64, f64)> {
                node.faced().map(|(master, share)| (*share, free(master, direction))).collect()
            };
            conflict(node, &self.held, rubs(contact), facing).is_some()
        });
        nodes.map(|node| mesh.global_node(node.node)).collect()
    }

    /// What the user should know about a choice that differs from that of the run from whose state this one starts.
    pub(super) fn warnings(&self, pairs: &[Pair<D>]) -> Vec<String> {
        let changed = pairs.iter().filter(|pair| {
            self.earlier.get(&pair.contact).is_some_and(|earlier| *earlier != pair.exchange.is_some())
        });
        let words = |pair: &Pair<D>| {
            format!(
                "contact.{}: the other side carried the law in the run from which this one starts, because supports or `side` were \
                 different: pressures, friction and histories of the contact start anew; give both jobs the same `side` to keep them",
                pair.contact
            )
        };
        changed.map(words).collect()
    }
}

/// Whether two lists of facets, ascending, have any in common. Collective.
pub(super) fn meet(session: &Session, one: &[u32], other: &[u32]) -> bool {
    session.total(one.iter().filter(|facet| other.binary_search(facet).is_ok()).count()) > 0
}

/// Whether the law of a contact depends on velocities or displacements along the boundary.
pub(super) fn rubs(contact: &job::Contact) -> bool {
    contact.friction.is_some() || contact.adhesion.is_some()
}

/// Why supports prevent the law at a node that faces another body, given for a direction the shares of what it faces with the lengths of
/// the free parts of the direction there. A known velocity must be relative to known ones.
pub(super) fn conflict<const D: usize>(
    node: &PairedNode<D>,
    held: &Held<D>,
    rubs: bool,
    facing: impl Fn(&Vector<D>) -> Vec<(f64, f64)>,
) -> Option<&'static str> {
    if node.masters.is_empty() {
        return None;
    }
    let normal = held.whole(node.point()).normal;
    let (frame, free) = held.frame(node.node as usize);
    frame[free..].iter().find_map(|direction| {
        let facing = facing(direction);
        if held_share(facing.iter().copied()) >= HELD_TOGETHER {
            return None;
        }
        let nearly: f64 = facing.iter().filter(|(_, free)| *free < NEARLY_HELD).map(|(share, _)| share).sum();
        let is_oblique = nearly >= HELD_TOGETHER;
        let is_along = dot(direction, &normal).abs() > ALONG;
        let is_turned = is_oblique && dot(direction, &node.normal).abs() > ROUNDING;
        (is_along || rubs || is_turned).then_some(match (is_oblique, is_along) {
            (true, _) => "supports hold it and what it faces along directions that differ",
            (_, true) => "a support holds it along the normal, and not what it faces",
            _ => {
                "a support holds it along the boundary, where friction or adhesion act, and not what it faces"
            }
        })
    })
}

/// Whether nodes of a pair face the other side, and edges that are less than half as sharp as these, given by their angle in rad.
/// Collective.
fn is_blunter<const D: usize>((session, mesh): (&Session, &Mesh<D>), pair: &Pair<D>, sharpness: f64) -> bool {
    let facing = pair.nodes.iter().filter(|node| !node.masters.is_empty()).count();
    session.total(facing) > 0 && sharpness > SHARP && 2.0 * pair.sharpness(session, mesh) < sharpness
}

/// Warnings about corners and edges that lie over faces whose nodes carry the law. Collective, with the same warnings on all ranks.
pub(super) fn warnings_of_edges<const D: usize>(
    session: &Session,
    job: &Job,
    mesh: &Mesh<D>,
    pairs: &[Pair<D>],
) -> Result<Vec<String>, Agreed> {
    let mut out = Vec::new();
    for pair in pairs.iter().filter(|pair| pair.slides) {
        let sharpness = pair.sharpness(session, mesh);
        if sharpness <= EDGE {
            continue;
        }
        let mut other = pair.clone().exchanged(Exchange::Requested);
        other.form(session, mesh, &mesh.nodes)?;
        let remedy = match (is_blunter((session, mesh), &other, sharpness), job.contact[pair.contact].side) {
            (false, _) => None,
            (true, Side::Auto) => {
                Some("let no support and no other contact hold their nodes, so that these carry the law")
            }
            (true, _) => Some("delete `side`"),
        };
        out.push(words_of_edges(job, pair, ("lie", remedy)));
    }
    Ok(out)
}

/// Warnings about wear that stays with the nodes of the other body, and about facets of which contacts leave all nodes without a law.
/// Collective, with the same warnings on all ranks.
pub(super) fn warnings_of_carriers<const D: usize>(
    session: &Session,
    job: &Job,
    pairs: &[Pair<D>],
) -> Vec<String> {
    let mut out = Vec::new();
    for pair in pairs {
        let [own, other] = names_of_sides(job, pair);
        if let Some(reason) =
            pair.exchange.filter(|_| pair.slides && job.contact[pair.contact].wear.is_some())
        {
            let remedy = match reason {
                Exchange::Held => format!("let no support hold nodes of {other}"),
                Exchange::Requested => "delete `side`".into(),
                _ => "state side = \"on\"".into(),
            };
            out.push(format!(
                "contact.{}: nodes of {own} carry the law and keep the wear, so that {own} wears, not {other}: {remedy}",
                pair.contact
            ));
        }
        if session.total(usize::from(pair.is_bare)) > 0 {
            out.push(format!(
                "contact.{}: facets of {own} that face {other} carry no law, because all their nodes belong to other contacts, too, so that \
                 pressures beside them may be wrong by half; give contacts that meet there one table with on = [...], or let nodes of {own} \
                 lie where they meet",
                pair.contact
            ));
        }
    }
    out
}

/// The warning about a pair whose nodes were pressed by corners and edges of the other side in a run.
pub(super) fn pressed_by_edge<const D: usize>(job: &Job, pair: &Pair<D>) -> String {
    words_of_edges(job, pair, ("pressed", None))
}

/// A warning about corners and edges over faces, with what they do there and what to do about it.
fn words_of_edges<const D: usize>(job: &Job, pair: &Pair<D>, (lie, remedy): (&str, Option<&str>)) -> String {
    let [own, other] = names_of_sides(job, pair);
    let side = if pair.exchange.is_some() { "on" } else { "against" };
    let remedy = remedy.map_or_else(
        || {
            format!(
                "if {own} is flat there, state side = \"{side}\"; of two surfaces with corners, round those of {other} with a radius of more than \
                 two facets of {own}"
            )
        },
        Into::into,
    );
    format!(
        "contact.{}: corners or edges of {other} {lie} on faces of {own}, whose nodes carry the law: as they slide, forces along these faces may \
         be wrong by a part of the pressure; {remedy}",
        pair.contact
    )
}

/// Whether the nodes of a pair face more than twice as many nodes as they are, in space more than four times as many. Collective.
fn is_coarser<const D: usize>(session: &Session, pair: &Pair<D>) -> Result<bool, Agreed> {
    let facing = pair.nodes.iter().filter(|node| !node.masters.is_empty());
    let slaves = session.total(facing.count());
    let own: BTreeSet<u32> =
        pair.nodes.iter().flat_map(PairedNode::faced).map(|(master, _)| *master).collect();
    let own: Vec<u32> = own.into_iter().collect();
    let masters: BTreeSet<u32> = gather(session.world(), &own)?.into_iter().collect();
    Ok(masters.len() > (1 << (D - 1)) * slaves)
}

/// The number of nodes that carry the law of one pair and are faced in another one, where the law does not leave them to their neighbours.
/// Collective.
fn tangled<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    job: &Job,
    pairs: &[Pair<D>],
) -> Result<usize, Agreed> {
    if pairs.len() < 2 {
        return Ok(0);
    }
    let (mut carrying, mut faced) = (Vec::new(), Vec::new());
    for pair in pairs {
        let [own, other] = pair.nodes_of_all(session, mesh)?;
        carrying.push(own);
        faced.push(other);
    }
    let of_pair = |at: usize| {
        let others = faced.iter().enumerate().filter(|(other, _)| *other != at);
        others.map(|(_, faced)| carrying[at].intersection(faced).count()).sum::<usize>()
    };
    let leaves = |at: &usize| job.contact[pairs[*at].contact].is_without_scale();
    Ok((0..pairs.len()).filter(|at| !leaves(at)).map(of_pair).sum())
}

/// Whether another contact has nodes of either side of a pair. Collective.
fn meets_another<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    job: &Job,
    pair: &Pair<D>,
) -> Result<bool, Agreed> {
    let nodes_of = |facets: &[u32]| -> Vec<u32> {
        let nodes = facets.iter().flat_map(|facet| mesh.facet_nodes(*facet));
        nodes.map(|node| mesh.global_node(node)).collect()
    };
    let own = [nodes_of(&pair.on), nodes_of(&pair.against)].concat();
    let own: BTreeSet<u32> = gather(session.world(), &own)?.into_iter().collect();
    let others = job.contact.iter().enumerate().filter(|(number, _)| *number != pair.contact);
    let names: Vec<String> = others
        .flat_map(|(_, other)| {
            let faults = other.on.iter().map(|name| other_side(name));
            other.on.iter().chain(&other.against).cloned().chain(faults)
        })
        .collect();
    let others = nodes_of(&facets(mesh, &names));
    Ok(session.total(others.iter().filter(|node| own.contains(node)).count()) > 0)
}

/// The boundaries of a pair at whose nodes the law acts, and those that they face.
pub(super) fn names_of_sides<const D: usize>(job: &Job, pair: &Pair<D>) -> [String; 2] {
    let job::Contact { on, against, .. } = &job.contact[pair.contact];
    if pair.exchange.is_some() { [against, on] } else { [on, against] }.map(|names| names.join(", "))
}

/// The lines of the log about exchanged sides.
pub(super) fn lines<const D: usize>(job: &Job, pairs: &[Pair<D>]) -> Vec<String> {
    let line = |pair: &Pair<D>| {
        let job::Contact { on, against, .. } = &job.contact[pair.contact];
        let [on, against] = [on, against].map(|names| names.join(", "));
        let why = match pair.exchange? {
            Exchange::Requested => "as `side` states".into(),
            Exchange::Continued => "as in the run from which this one starts".into(),
            Exchange::Held => format!("because supports hold nodes of {on}"),
            Exchange::Sharper => format!("because its corners or edges lie over {on}"),
            Exchange::Coarser => format!("because the mesh of {on} is coarser"),
            Exchange::Stiffer => format!("because {on} is more than {STIFFER} times as stiff"),
            Exchange::Faced => format!("because {on} is faced in another contact"),
            Exchange::Shared => format!("because all nodes of {on} belong to other contacts, too"),
        };
        Some(format!("contact    contact.{}: nodes of {against} carry the law, {why}", pair.contact))
    };
    pairs.iter().filter_map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fem::coupling::is_held;

    const ANGLES: [f64; 4] = [0.0, 1.0, 5.0, 20.0];

    fn at(degrees: f64) -> Vector<2> {
        [degrees.to_radians().cos(), degrees.to_radians().sin()]
    }

    /// A node with this normal that is held at the first angle to x and faces one that is held at the second one.
    fn found(normal: Vector<2>, [own, other]: [f64; 2], rubs: bool) -> Option<&'static str> {
        let mut held = Held::from(vec![false; 4]);
        held.hold(0, [at(own)].into_iter());
        held.hold(1, [at(other)].into_iter());
        let masters = vec![(1, 1.0)];
        let node = PairedNode {
            node: 0,
            normal,
            weight: 1.0,
            distance: 0.0,
            masters,
            neighbours: Vec::new(),
            stretch: 1.0,
            sharpness: 0.0,
        };
        conflict(&node, &held, rubs, |direction| vec![(1.0, norm(&held.free_part(1, direction)))])
    }

    #[test]
    fn a_known_velocity_is_relative_to_one_along_the_same_direction_or_does_not_matter() {
        let differ = Some("supports hold it and what it faces along directions that differ");
        for degrees in ANGLES {
            let expected = if degrees == 0.0 { None } else { differ };
            // With friction it matters whichever of both is oblique.
            assert_eq!(found([0.0, -1.0], [degrees, 0.0], true), expected, "{degrees}");
            assert_eq!(found([0.0, -1.0], [0.0, degrees], true), expected, "{degrees}");
            assert_eq!(found([0.0, -1.0], [degrees; 2], true), None, "{degrees}");
            // Without it, what is held along the boundary does not matter, and what has a part along the normal does.
            assert_eq!(found([0.0, -1.0], [0.0, degrees], false), None, "{degrees}");
            assert_eq!(found([0.0, -1.0], [degrees, 0.0], false), expected, "{degrees}");
            assert_eq!(found([-1.0, 0.0], [degrees, 0.0], false), expected, "{degrees}");
        }
        let alone = "a support holds it along the normal, and not what it faces";
        assert_eq!(found([-1.0, 0.0], [0.0, 90.0], false), Some(alone));
        let along =
            "a support holds it along the boundary, where friction or adhesion act, and not what it faces";
        assert_eq!(found([0.0, -1.0], [0.0, 90.0], true), Some(along));
        assert_eq!(found([0.0, -1.0], [0.0, 90.0], false), None);
    }

    #[test]
    fn velocities_are_relative_where_supports_are_not_refused() {
        for degrees in ANGLES {
            let mut held = Held::<2>::from(vec![false; 4]);
            held.hold(1, [at(degrees)].into_iter());
            let free = norm(&held.free_part(1, &at(0.0)));
            assert_eq!(is_held(free), found([0.0, -1.0], [0.0, degrees], true).is_none(), "{degrees}");
        }
    }
}
