//! Which side of contact between bodies carries the law, and where supports prevent that.

use super::materials::Materials;
use crate::{
    error::Result,
    fem::{
        coupling::{HELD_TOGETHER, Inclined, held_share, is_held},
        effect::Supports,
        pairs::{Edges, Exchange, Pair, PairedNode},
        space::{Held, facets, longest_side},
    },
    job::{self, Job, Side},
    laws::material::Material,
    linear_algebra::{
        petsc::DistributedVector,
        tensor::{Vector, add_scaled, dot, larger, norm},
    },
    mesh::{Mesh, other_side},
    parallel::{agreement::Agreed, session::Session},
};
use std::collections::{BTreeMap, BTreeSet};

/// Component of a unit direction along the normal of the law above which it counts as along the normal.
const ALONG: f64 = 0.1;
/// The same for the normal of the facets, which turns into a plane of symmetry; a share of the body's size that is a rounding error.
const ROUNDING: f64 = 1e-6;
/// Length of the free part of a unit direction below which a node is held nearly along it.
const NEARLY_HELD: f64 = 0.5;
/// The angle in rad (3 degrees) of edges over faces whose nodes carry the law from which on the other side may have to carry it.
const SHARP: f64 = 0.052;

/// How many times as stiff as the other a body is whose nodes should not carry the law, whatever the meshes: the stress of a stiff body
/// hardly follows the nodes of a soft one that it faces, so that Newton's method would find contact and friction node by node.
pub(super) const STIFFER: f64 = 100.0;

/// The choice of the sides that carry the laws of a job's contacts between bodies, with all on which it depends. All methods are collective.
pub(super) struct Sides<'a, const D: usize> {
    pub(super) session: &'a Session,
    pub(super) job: &'a Job,
    pub(super) mesh: &'a Mesh<D>,
    materials: &'a Materials,
    /// The contacts that another run had from whose state this one starts, each with whether its sides were exchanged.
    earlier: &'a BTreeMap<usize, bool>,
    /// What supports hold on this rank.
    held: Held<D>,
}

impl<'a, const D: usize> Sides<'a, D> {
    pub(super) fn of(
        session: &'a Session,
        job: &'a Job,
        (mesh, materials): (&'a Mesh<D>, &'a Materials),
        earlier: &'a BTreeMap<usize, bool>,
    ) -> Result<Self, Agreed> {
        let mut sides = Self { session, job, mesh, materials, earlier, held: Held::default() };
        let ignores_supports = |contact: &job::Contact| contact.side != Side::Auto && !rubs(contact);
        if job.contact.iter().all(|contact| contact.against.is_empty() || ignores_supports(contact)) {
            return Ok(sides);
        }
        let layout = session.agree(DistributedVector::ghosted(D, mesh.owned, &mesh.ghosts))?;
        sides.held = session.agree(Supports::of_body(session, mesh, &job.support, &layout))?.held;
        Ok(sides)
    }

    /// Settles the sides of pairs that were formed each for itself, where several meet. Each step keeps what the steps before it have chosen
    /// where it can: no node carries the law of one contact and is faced in another one; those that face the nodes of another pair let
    /// these carry both laws; facets that carry the laws of several contacts face the bodies of all; and what is left of nodes that belong
    /// to several contacts, or that supports hold such that friction cannot act, is left to their neighbours.
    pub(super) fn settle(&self, pairs: &mut [Pair<D>]) -> Result<(), Agreed> {
        self.untangle(pairs)?;
        self.follow(pairs)?;
        self.share(pairs)?;
        self.leave_shared_nodes(pairs)?;
        self.leave_inclined_nodes(pairs)
    }

    /// Finds what the nodes of a pair face, on the side of the job's choice.
    pub(super) fn form(&self, pair: Pair<D>) -> Result<Pair<D>, Agreed> {
        let Self { session, job, mesh, .. } = *self;
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
        let is_held =
            |pair: &Pair<D>| -> Result<bool, Agreed> { Ok(session.total(self.conflicts(pair)?.len()) > 0) };
        if is_held(&first)? {
            let other = formed(first.clone().exchanged(Exchange::Held))?;
            return Ok(if is_held(&other)? { first } else { other });
        }
        if earlier.is_some() {
            return Ok(first);
        }
        if first.slides {
            let other = formed(first.clone().exchanged(Exchange::Sharper))?;
            if is_smoother((session, mesh), [&first, &other]) {
                return Ok(first);
            }
            if !is_held(&other)? && is_smoother((session, mesh), [&other, &first]) {
                return Ok(other);
            }
        }
        let size = longest_side(session, &mesh.nodes);
        let overlaps = |pair: &Pair<D>| !pair.slides && overlap(session, pair) > ROUNDING * size;
        if overlaps(&first) {
            let other = formed(first.clone().exchanged(Exchange::Sharper))?;
            if !is_held(&other)? && !overlaps(&other) {
                return Ok(other);
            }
        }
        let [own, faced] = [&first.on, &first.against].map(|facets| self.stiffness(facets));
        let reason = if own > STIFFER * faced {
            Some(Exchange::Stiffer)
        } else if faced > STIFFER * own {
            None
        } else {
            is_coarser(session, mesh, &first)?.then_some(Exchange::Coarser)
        };
        if let Some(reason) = reason
            && !self.meets_another(&first)?
        {
            let other = formed(first.clone().exchanged(reason))?;
            let is_worse = is_held(&other)? || overlaps(&other) && !overlaps(&first);
            return Ok(if is_worse { first } else { other });
        }
        Ok(first)
    }

    /// The mean Young's modulus in Pa of the cells of these facets of all ranks, of orthotropic ones the largest; NaN where a cell has none.
    fn stiffness(&self, facets: &[u32]) -> f64 {
        let Self { session, mesh, materials, .. } = *self;
        let modulus = |facet: &u32| {
            let cell = mesh.facet_cells[*facet as usize] as usize;
            let Material { elasticity, orthotropic, .. } = &materials.all[materials.of_cell(mesh, cell)];
            let isotropic = elasticity.as_ref().map(|law| law.youngs_modulus);
            let largest =
                || orthotropic.as_ref().map(|law| law.youngs_moduli.iter().copied().fold(0.0, f64::max));
            isotropic.or_else(largest).unwrap_or(f64::NAN)
        };
        let [sum, count] = session.sum([facets.iter().map(modulus).sum(), facets.len() as f64]);
        sum / count
    }

    /// Exchanges the sides of pairs whose choice is free where nodes would carry the law of one contact and be faced in another one.
    fn untangle(&self, pairs: &mut [Pair<D>]) -> Result<(), Agreed> {
        let mut least = self.tangled(pairs)?;
        for at in 0..pairs.len() {
            if least == 0 {
                continue;
            }
            let Some(other) = self.exchanged(&pairs[at], Exchange::Faced)? else { continue };
            let kept = std::mem::replace(&mut pairs[at], other);
            let left = self.tangled(pairs)?;
            if left < least { least = left } else { pairs[at] = kept }
        }
        Ok(())
    }

    /// Exchanges the sides of pairs whose choice is free and some of whose nodes face those that carry the law of another pair, where supports
    /// allow it: the facets of the latter can then face the bodies of both.
    fn follow(&self, pairs: &mut [Pair<D>]) -> Result<(), Agreed> {
        let Self { session, mesh, .. } = *self;
        // An exchange may let others follow.
        let mut at = 0;
        while at < pairs.len() {
            let pair = &pairs[at];
            at += 1;
            if !self.is_free(pair) || pair.exchange.is_some() {
                continue;
            }
            let faced = pair.faced(session, mesh)?;
            let mut shared = 0;
            for other in pairs.iter().filter(|other| other.contact != pair.contact) {
                if meet(session, &other.on, &pair.against) {
                    shared += other.carrying(mesh).intersection(&faced).count();
                }
            }
            if session.total(shared) > 0
                && let Some(other) = self.exchanged(pair, Exchange::Faced)?
            {
                pairs[at - 1] = other;
                at = 0;
            }
        }
        Ok(())
    }

    /// Whether the sides of a pair may be exchanged.
    fn is_free(&self, pair: &Pair<D>) -> bool {
        let contact = &self.job.contact[pair.contact];
        let earlier = self.earlier.get(&pair.contact);
        let was_other = earlier.is_none_or(|exchanged| *exchanged != pair.exchange.is_some());
        contact.side == Side::Auto && !contact.against.is_empty() && was_other
    }

    /// A pair with its sides exchanged for this reason, if the choice is free and supports allow it, where the law allows it by leaving what
    /// they hold to neighbours.
    pub(super) fn exchanged(&self, pair: &Pair<D>, why: Exchange) -> Result<Option<Pair<D>>, Agreed> {
        let Self { session, mesh, .. } = *self;
        if !self.is_free(pair) {
            return Ok(None);
        }
        let mut other = pair.clone().exchanged(why);
        other.lawless.clear();
        other.form(session, mesh, &mesh.nodes)?;
        let held = self.conflicts(&other)?;
        let is_held = session.total(held.len()) > 0;
        let leaves = self.job.contact[pair.contact].is_without_scale();
        if is_held && leaves {
            other.leave(session, mesh, held)?;
        }
        let facing = other.nodes.iter().filter(|node| !node.masters.is_empty()).count();
        let is_left = is_held && (!leaves || session.total(usize::from(other.is_bare)) > 0);
        Ok((session.total(facing) > 0 && !is_left).then_some(other))
    }

    /// The nodes owned here whose law supports prevent, by global numbers.
    fn conflicts(&self, pair: &Pair<D>) -> Result<BTreeSet<u32>, Agreed> {
        let rubs = rubs(&self.job.contact[pair.contact]);
        self.nodes_where(pair, |node, facing| conflict(node, &self.held, rubs, facing).is_some())
    }

    /// The nodes owned here of which [`slides_with_masters`] holds, by global numbers.
    pub(super) fn inclined(&self, pair: &Pair<D>) -> Result<BTreeSet<u32>, Agreed> {
        self.nodes_where(pair, |node, facing| slides_with_masters(node, &self.held, facing))
    }

    /// The nodes owned here of which this holds, by global numbers, given with each node the shares of what it faces, each with the length of
    /// the free part of a direction there.
    fn nodes_where(
        &self,
        pair: &Pair<D>,
        holds: impl Fn(&PairedNode<D>, &dyn Fn(&Vector<D>) -> Vec<(f64, f64)>) -> bool,
    ) -> Result<BTreeSet<u32>, Agreed> {
        let Self { session, mesh, .. } = *self;
        let masters = pair.nodes.iter().flat_map(PairedNode::faced).map(|(master, _)| *master);
        let directions = mesh.ask_owners(session, masters, |node| {
            let (frame, free) = self.held.frame(mesh.owned_node(node));
            frame[free..].as_flattened().to_vec()
        })?;
        let facing = |node: &PairedNode<D>, direction: &Vector<D>| {
            let free = |master: &u32| {
                let held = directions[master].as_chunks::<D>().0.iter();
                norm(&held.fold(*direction, |left, held| add_scaled(&left, -dot(held, direction), held)))
            };
            node.faced().map(|(master, share)| (*share, free(master))).collect()
        };
        let found = pair.nodes.iter().filter(|node| holds(node, &|direction| facing(node, direction)));
        Ok(found.map(|node| mesh.global_node(node.node)).collect())
    }

    /// The number of nodes that carry the law of one pair and are faced in another one, where the law does not leave them to their neighbours.
    fn tangled(&self, pairs: &[Pair<D>]) -> Result<usize, Agreed> {
        let Self { session, mesh, job, .. } = *self;
        if pairs.len() < 2 {
            return Ok(0);
        }
        let (mut carrying, mut faced) = (Vec::new(), Vec::new());
        for pair in pairs {
            carrying.push(pair.carrying(mesh));
            faced.push(pair.faced(session, mesh)?);
        }
        let of_pair = |at: usize| {
            let others = faced.iter().enumerate().filter(|(other, _)| *other != at);
            others.map(|(_, faced)| carrying[at].intersection(faced).count()).sum::<usize>()
        };
        let leaves = |at: &usize| job.contact[pairs[*at].contact].is_without_scale();
        Ok(session.total((0..pairs.len()).filter(|at| !leaves(at)).map(of_pair).sum()))
    }

    /// Whether another contact has nodes of either side of a pair.
    fn meets_another(&self, pair: &Pair<D>) -> Result<bool, Agreed> {
        let Self { session, mesh, job, .. } = *self;
        let own = mesh.named(session, mesh.nodes_of_facets(pair.on.iter().chain(&pair.against)))?;
        let others = job.contact.iter().enumerate().filter(|(number, _)| *number != pair.contact);
        let names: Vec<String> = others
            .flat_map(|(_, other)| {
                let faults = other.on.iter().map(|name| other_side(name));
                other.on.iter().chain(&other.against).cloned().chain(faults)
            })
            .collect();
        let others = mesh.named(session, mesh.nodes_of_facets(&facets(mesh, &names)))?;
        Ok(session.total(others.intersection(&own).count()) > 0)
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

/// Whether a sliding of the other body moves a node along the boundary or opens it, because supports hold the node along a direction that is
/// inclined to the boundary, and not all that it faces, given as for [`conflict`].
pub(super) fn slides_with_masters<const D: usize>(
    node: &PairedNode<D>,
    held: &Held<D>,
    facing: impl Fn(&Vector<D>) -> Vec<(f64, f64)>,
) -> bool {
    node.inclination(held).is_some_and(|Inclined { held, .. }| {
        let size = norm(&held);
        facing(&held.map(|x| x / size)).iter().any(|(share, free)| share.abs() > ROUNDING && !is_held(*free))
    })
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
    // Where a free motion opens a flat boundary, what supports hold does not matter to the pressure.
    if !rubs && node.inclination(held).is_some() {
        return None;
    }
    let normal = node.point(held).normal;
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

/// Whether the first of a pair and its exchange is the better choice where bodies slide: its nodes face the other side, and no edges that are
/// half as sharp as those over the faces of the second one; or, where neither has sharper ones, no end of the other side, and the second does.
/// Collective.
pub(super) fn is_smoother<const D: usize>(
    (session, mesh): (&Session, &Mesh<D>),
    pairs: [&Pair<D>; 2],
) -> bool {
    let facing = pairs[0].nodes.iter().filter(|node| !node.masters.is_empty()).count();
    let [own, other] = pairs.map(|pair| pair.edges(session, mesh));
    let is_sharper = |one: Edges, than: Edges| one.sharpness > SHARP && 2.0 * than.sharpness < one.sharpness;
    let ends_less = other.ends && !own.ends && !is_sharper(own, other);
    session.total(facing) > 0 && (is_sharper(other, own) || ends_less)
}

/// By how much in m the undeformed bodies overlap at most, as the nodes of a pair see it: of bodies that only touch, where corners or edges of the
/// other side lie over its facets. Collective.
fn overlap<const D: usize>(session: &Session, pair: &Pair<D>) -> f64 {
    let facing = pair.nodes.iter().filter(|node| !node.masters.is_empty());
    let [most] = session.largest([facing.map(|node| -node.distance).fold(0.0, larger)]);
    most
}

/// Whether the nodes of a pair face more than twice as many nodes as they are, in space more than four times as many. Collective.
fn is_coarser<const D: usize>(session: &Session, mesh: &Mesh<D>, pair: &Pair<D>) -> Result<bool, Agreed> {
    let facing = pair.nodes.iter().filter(|node| !node.masters.is_empty());
    let slaves = session.total(facing.count());
    let masters = pair.nodes.iter().flat_map(PairedNode::faced).map(|(master, _)| *master);
    let masters = session.total(mesh.named(session, masters)?.len());
    Ok(masters > (1 << (D - 1)) * slaves)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ANGLES: [f64; 4] = [0.0, 1.0, 5.0, 20.0];

    fn at(degrees: f64) -> Vector<2> {
        [degrees.to_radians().cos(), degrees.to_radians().sin()]
    }

    /// A node with this normal of a surface that is curved there, or not, which is held at the first angle to x and faces one that is held at
    /// the second one.
    fn found(
        (normal, is_curved): (Vector<2>, bool),
        [own, other]: [f64; 2],
        rubs: bool,
    ) -> Option<&'static str> {
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
            meets_end: false,
            beyond: [0.0; 2],
            curvature: if is_curved { 1.0 } else { 0.0 },
        };
        conflict(&node, &held, rubs, |direction| vec![(1.0, norm(&held.free_part(1, direction)))])
    }

    #[test]
    fn a_known_velocity_is_relative_to_one_along_the_same_direction_or_does_not_matter() {
        let differ = Some("supports hold it and what it faces along directions that differ");
        for degrees in ANGLES {
            let expected = if degrees == 0.0 { None } else { differ };
            // With friction it matters whichever of both is oblique.
            assert_eq!(found(([0.0, -1.0], true), [degrees, 0.0], true), expected, "{degrees}");
            assert_eq!(found(([0.0, -1.0], true), [0.0, degrees], true), expected, "{degrees}");
            assert_eq!(found(([0.0, -1.0], true), [degrees; 2], true), None, "{degrees}");
            // Without it, what is held along the boundary does not matter, and what has a part along the normal does.
            assert_eq!(found(([0.0, -1.0], true), [0.0, degrees], false), None, "{degrees}");
            assert_eq!(found(([0.0, -1.0], true), [degrees, 0.0], false), expected, "{degrees}");
            assert_eq!(found(([-1.0, 0.0], true), [degrees, 0.0], false), expected, "{degrees}");
            // Unless the boundary is flat: a free motion then opens it.
            assert_eq!(found(([0.0, -1.0], false), [degrees, 0.0], false), None, "{degrees}");
            assert_eq!(found(([0.0, -1.0], false), [degrees, 0.0], true), expected, "{degrees}");
        }
        let alone = "a support holds it along the normal, and not what it faces";
        assert_eq!(found(([-1.0, 0.0], true), [0.0, 90.0], false), Some(alone));
        let along =
            "a support holds it along the boundary, where friction or adhesion act, and not what it faces";
        assert_eq!(found(([0.0, -1.0], true), [0.0, 90.0], true), Some(along));
        assert_eq!(found(([0.0, -1.0], true), [0.0, 90.0], false), None);
    }

    #[test]
    fn velocities_are_relative_where_supports_are_not_refused() {
        for degrees in ANGLES {
            let mut held = Held::<2>::from(vec![false; 4]);
            held.hold(1, [at(degrees)].into_iter());
            let free = norm(&held.free_part(1, &at(0.0)));
            assert_eq!(
                is_held(free),
                found(([0.0, -1.0], true), [0.0, degrees], true).is_none(),
                "{degrees}"
            );
        }
    }
}
