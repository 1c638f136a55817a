//! What users read about the sides of contact between bodies: the lines of the log, and warnings.

use super::sides::{STIFFER, is_smoother};
use crate::{
    error::Result,
    fem::{
        body::Body,
        effect::Contact,
        pairs::{Edges, Exchange, Pair, PairedNode},
        state::State,
    },
    job::{self, Job, Side},
    linear_algebra::tensor::{Vector, add_scaled, dot, larger, norm},
    parallel::{agreement::Agreed, session::Session},
};
use std::collections::BTreeMap;

/// The angle in rad (10 degrees) of edges over faces whose nodes carry the law from which on the user is warned: forces along an inclined
/// face are 18 % of those across.
pub(super) const EDGE: f64 = 0.175;
/// Most times the mean pressure at the ends of a side that can carry the law.
const MANY: f64 = 3.0;

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

/// Warnings about choices that differ from those of the run from whose state this one starts, given by its contacts, each with whether its
/// sides were exchanged.
pub(super) fn warnings_of_changes<const D: usize>(
    earlier: &BTreeMap<usize, bool>,
    pairs: &[Pair<D>],
) -> Vec<String> {
    let changed = pairs
        .iter()
        .filter(|pair| earlier.get(&pair.contact).is_some_and(|earlier| *earlier != pair.exchange.is_some()));
    let words = |pair: &Pair<D>| {
        format!(
            "contact.{}: the other side carried the law in the run from which this one starts, because supports or `side` were \
             different: pressures, friction and histories of the contact start anew; give both jobs the same `side` to keep them",
            pair.contact
        )
    };
    changed.map(words).collect()
}

/// Warnings about corners, edges and ends of surfaces that lie over faces whose nodes carry the law; pairs keep whether there are ends. Collective, with the same warnings on all
/// ranks.
pub(super) fn warnings_of_edges<const D: usize, const S: usize>(
    session: &Session,
    job: &Job,
    body: &mut Body<D, S>,
) -> Result<Vec<String>, Agreed> {
    let Body { mesh, pairs, contacts, .. } = body;
    let mesh = &*mesh;
    let mut out = Vec::new();
    for pair in pairs.iter_mut().filter(|pair| pair.slides) {
        let Edges { sharpness, ends } = pair.edges(session, mesh);
        pair.has_ends = ends;
        if sharpness <= EDGE && !(ends && is_rigid(&contacts[pair.contact])) {
            continue;
        }
        let mut other = pair.clone().exchanged(Exchange::Requested);
        other.form(session, mesh, &mesh.nodes)?;
        let state = |side: &str| {
            let [own, other] = names_of_sides(job, pair);
            format!("state side = \"{side}\", unless {other} slides beyond an end of {own}")
        };
        let remedy = match (is_smoother((session, mesh), [&other, &*pair]), job.contact[pair.contact].side) {
            (false, _) => None,
            (true, Side::Auto) => Some(
                "let no support and no other contact hold their nodes, so that these carry the law".into(),
            ),
            (true, Side::On) => Some(state("against")),
            (true, Side::Against) => Some(state("on")),
        };
        let words = if sharpness > EDGE { words_of_edges } else { words_of_ends };
        out.push(words(job, pair, ("lie", remedy)));
    }
    Ok(out)
}

/// What lets the other side of a pair carry the law, if little presses at the ends of this one at the end of a run. Collective.
pub(super) fn exchange_of_sides<const D: usize, const S: usize>(
    session: &Session,
    (body, pair): (&Body<D, S>, &Pair<D>),
    state: &State,
) -> Result<Option<String>> {
    let mesh = &body.mesh;
    let seen: Vec<(usize, [f64; 2])> = {
        let velocity = session.agree(state.velocity.local())?;
        body.contacts[pair.contact].pressures(&body.seen_by_contacts(&velocity)).collect()
    };
    let pressed = seen.iter().filter(|(_, [pressure, _])| *pressure > 0.0);
    let sums = pressed.fold([0.0; 2], |[force, area], (_, [p, a])| [force + p * a, area + a]);
    let [force, area] = session.sum(sums);
    let moved = session.agree(state.displacement.local())?;
    let places: Vec<Vector<D>> = mesh
        .nodes
        .iter()
        .zip(moved.chunks_exact(D))
        .map(|(place, moved)| std::array::from_fn(|i| place[i] + moved[i]))
        .collect();
    let mut other = pair.clone().exchanged(Exchange::Requested);
    other.form(session, mesh, &places)?;
    let at_end = other.nodes.iter().filter(|node| node.meets_end);
    let own = mesh.named(session, at_end.flat_map(PairedNode::faced).map(|(own, _)| *own))?;
    let at_own = seen.iter().filter(|(node, _)| own.contains(&mesh.global_node(*node as u32)));
    let [at_own] = session.largest([at_own.map(|(_, [p, _])| *p).fold(0.0, larger)]);
    let side = if pair.exchange.is_some() { "on" } else { "against" };
    Ok((at_own * area <= MANY * force).then(|| format!("state side = \"{side}\"")))
}

/// The warning about a pair whose pressures have their centre beyond an end of the other side at the end of a run, where no surface supports
/// it: nodes beyond the end bear it. Collective, the same on all ranks.
pub(super) fn warning_of_overhang<const D: usize, const S: usize>(
    (session, job): (&Session, &Job),
    (body, pair): (&Body<D, S>, &Pair<D>),
    state: &State,
) -> Result<Option<String>> {
    let mut seen: Vec<(usize, f64)> = {
        let velocity = session.agree(state.velocity.local())?;
        let velocity = body.seen_by_contacts(&velocity);
        let pressures = body.contacts[pair.contact].pressures(&velocity);
        pressures.map(|(node, [pressure, area])| (node, pressure * area)).collect()
    };
    seen.retain(|(_, force)| *force > 0.0);
    let place = |node: usize| body.mesh.nodes[node];
    let [whole] = session.sum([seen.iter().map(|(_, force)| force).sum()]);
    let moments = seen.iter().fold([0.0; D], |sum, (node, force)| add_scaled(&sum, *force, &place(*node)));
    let centre = session.sum(moments).map(|moment| moment / whole);
    let (mut borne, mut farthest) = (0.0, 0.0);
    for (node, force) in &seen {
        let Some(beyond) = pair.node(*node).map(|node| node.beyond) else { continue };
        // From the end that is nearest to the node.
        let from_end = add_scaled(&add_scaled(&centre, -1.0, &place(*node)), 1.0, &beyond);
        if dot(&from_end, &beyond) > 0.0 {
            borne += force;
            farthest = larger(farthest, norm(&beyond));
        }
    }
    let [borne] = session.sum([borne]);
    let [farthest] = session.largest([farthest]);
    let [own, other] = names_of_sides(job, pair);
    let side = if pair.exchange.is_some() { "on" } else { "against" };
    Ok((borne > 0.0).then(|| {
        format!(
            "contact.{}: nodes of {own} up to {farthest:.2e} m beyond the end of {other} bear {:.0} % of the force, whose centre lies beyond this end: \
             the body would tip over it; state side = \"{side}\", or take smaller facets of {own} there",
            pair.contact,
            100.0 * borne / whole
        )
    }))
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

/// The warning about a pair whose nodes were pressed by corners and edges of the other side in a run, or came under its ends, given the
/// largest angle in rad of edges over them and 1 if there were ends; none if the warning before the run was the same. `remedy` finds what
/// lets the other side carry the law, on all ranks alike.
pub(super) fn warning_of_run<const D: usize>(
    job: &Job,
    (pair, contact): (&Pair<D>, &Contact<D>),
    [sharpness, ends]: [f64; 2],
    remedy: impl FnOnce() -> Result<Option<String>>,
) -> Result<Option<String>> {
    if sharpness > EDGE {
        return Ok(Some(words_of_edges(job, pair, ("pressed", None))));
    }
    if ends == 0.0 || pair.has_ends || !is_rigid(contact) {
        return Ok(None);
    }
    Ok(Some(words_of_ends(job, pair, ("came to lie", remedy()?))))
}

/// Whether the law of a contact bounds the gap: pressures jump where nodes begin to carry it.
fn is_rigid<const D: usize>(contact: &Contact<D>) -> bool {
    contact.normal.law.has_vertical_parts()
}

/// A warning about corners and edges over faces, with what they do there and what to do about it.
fn words_of_edges<const D: usize>(
    job: &Job,
    pair: &Pair<D>,
    (lie, remedy): (&str, Option<String>),
) -> String {
    let [own, other] = names_of_sides(job, pair);
    let side = if pair.exchange.is_some() { "on" } else { "against" };
    let remedy = remedy.unwrap_or_else(
        || {
            format!(
                "if {own} is flat there, state side = \"{side}\"; of two surfaces with corners, round those of {other} with a radius of more than \
                 two facets of {own}"
            )
        },
    );
    format!(
        "contact.{}: corners or edges of {other} {lie} on faces of {own}, whose nodes carry the law: as they slide, forces along these faces may \
         be wrong by a part of the pressure; {remedy}",
        pair.contact
    )
}

/// A warning about the ends of a surface over faces, with what to do about it.
fn words_of_ends<const D: usize>(job: &Job, pair: &Pair<D>, (lie, remedy): (&str, Option<String>)) -> String {
    let [own, other] = names_of_sides(job, pair);
    let worn = if job.contact[pair.contact].wear.is_some() { ", and the worn volume is wrong" } else { "" };
    let remedy = remedy.unwrap_or_else(|| {
        "let one of the two surfaces go on beyond the ends of the other, or take normal.compliance with a stiffness of about Young's modulus \
         over the size of a facet"
            .into()
    });
    format!(
        "contact.{}: ends of {other} {lie} over faces of {own}, whose nodes carry the law: as they slide, pressures of nodes near these ends may \
         be many times too large, though not the forces, whose place may be off by a facet{worn}; {remedy}",
        pair.contact
    )
}
