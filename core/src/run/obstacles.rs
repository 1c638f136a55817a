//! The position of a body relative to its obstacles: warnings about that at the start and about contacts that are not as they seem, and
//! the gaps of all contacts.

use super::{
    inside::{Inside, nodes_of_bodies},
    loads::words_of_part,
    side_words::{exchange_of_sides, warning_of_overhang, warning_of_run},
    steps::shortest_step,
};
use crate::{
    error::Result,
    fem::{
        body::Body,
        effect::{Closeness, Contact, EJECTED, Ejection, Friction, Gaps, OVERRUN, tangents},
        pairs::pair_of,
        space::{axis, longest_side, surface_means},
        state::State,
    },
    job::{self, Job, Scalar, Sliding},
    laws::{contact::Gap, digits::Digits},
    linear_algebra::tensor::{Vector, add_scaled, larger, norm},
    mesh::{Mesh, shape::facet_normal},
    parallel::{agreement::Agreed, session::Session},
};
use serde::Serialize;
use std::collections::BTreeSet;

/// A length of the free part of a normal below this is a rounding error.
const FREE: f64 = 1e-9;
/// A support holds a direction of which it takes more than this share.
const HELD_ALONG: f64 = 1e-3;
/// Initial penetration, as a share of the body's size, above which a warning is given.
const TOO_DEEP: f64 = 0.01;

/// The slip between bodies, as a share of the size of a facet, beyond which they no longer act on the surface that they face.
const LARGEST_SLIP: f64 = 0.5;
/// The change of gaps by motions along an obstacle, as a share of the spread of the normal displacements of the boundary or under pressure, and the inclination
/// in rad of the resultant of the pressures that comes with it, above which a warning is given.
const LARGEST_SHIFT: f64 = 0.1;
const LARGEST_INCLINATION: f64 = 0.01;
/// The angle in rad between a boundary and a plane above which a warning is given: the tangential force of a frictionless plane is then
/// missing, more than 3 % of the pressure. Of a body that only friction holds along the boundary, it is this share of the angle of friction,
/// and without friction rounding.
const TILTED: f64 = 2.0 * std::f64::consts::PI / 180.0;
const TILTED_BESIDE_FRICTION: f64 = 0.1;
const LEAST_TILT: f64 = 1e-3;
/// Times of a run at which planes are compared with the boundary.
const TIMES: u32 = 16;
/// The angle in rad between facets and their mean at a corner from which on a boundary turns there, and the inverse of the share of such
/// nodes from which on it is meant to be round: at nodes on edges facets do not turn.
const TURNING: f64 = 1e-3;
const SHARE_OF_CORNERS: usize = 8;
/// A node of the surface that is this many times as deep in an obstacle as any point of a contact is beside the contacts.
const SUNKEN: f64 = 2.0;
/// A depth of this share of the body's size is rounding.
const ROUNDING: f64 = 1e-9;

/// A warning about nodes that slide along a curved obstacle, and that a support moves: where the obstacle is inclined there, the law cannot
/// act on the prescribed part of the motion. Collective.
fn warning_of_moved_nodes<const D: usize, const S: usize>(
    session: &Session,
    body: &Body<D, S>,
    (number, contact): (usize, &Contact<D>),
    on: &str,
) -> Option<String> {
    if !contact.follows_surface || matches!(contact.obstacle.gap, Gap::Plane(_)) {
        return None;
    }
    let is_moved = |node: &usize| {
        let motion = body.support_motion.as_ref();
        let moves = motion.is_some_and(|motion| (0..D).any(|i| motion.moves(*node, &axis(i))));
        moves && (0..D).any(|i| norm(&body.held.free_part(*node, &axis(i))) > FREE)
    };
    let count = session.total(contact.normal.nodes().filter(is_moved).count());
    (count > 0).then(|| {
        format!(
            "contact.{number}: a support moves {count} node{} of the boundary {on}, which slides along a curved obstacle: steps fail once the \
             obstacle is inclined there to the direction of the support; exclude them by the `where` of the contact",
            if count == 1 { "" } else { "s" }
        )
    })
}

/// Warnings about contacts that can never close because the body lies behind the obstacle, and about bodies that start inside of
/// one. Collective, with the same warnings on all ranks.
pub(super) fn warnings<const D: usize, const S: usize>(
    session: &Session,
    job: &Job,
    body: &Body<D, S>,
    state: &State,
) -> Result<Vec<String>> {
    let absolute = session.agree(state.displacement.local())?;
    let displacement = body.seen_by_contacts(&absolute);
    let size = longest_side(session, &body.mesh.nodes);
    let mut out = Vec::new();
    for (number, (contact, table)) in body.contacts.iter().zip(&job.contact).enumerate() {
        if !contact.normal.law.depends_on_displacement() {
            continue;
        }
        let deepest = -gaps_of_all(session, contact, 0.0, &displacement).smallest;
        let on = table.on.join(", ");
        if contact.is_paired {
            let other = table.against.join(", ");
            // The state of another run may press on a law that gives way.
            let has_state = job.initial.as_ref().is_some_and(|initial| initial.from.is_some());
            let is_interference = !has_state || contact.normal.law.has_vertical_parts();
            if deepest > ROUNDING * size && !table.closed && is_interference {
                out.push(format!(
                    "contact.{number}: the boundary {on} starts up to {deepest:.3e} m inside {other}, which presses them apart: if they are \
                     curved and fit each other, or have corners, facets overlap where bodies only touch (use closed = true, refine the \
                     boundaries, or let corners belong to `on`); otherwise it is an interference"
                ));
            }
            continue;
        }
        if !contact.follows_surface {
            out.extend(warning_of_tilt(session, job, body, number)?);
        }
        out.extend(warning_of_moved_nodes(session, body, (number, contact), &on));
        out.extend(warning_of_straight_edges(session, &body.mesh, (number, contact), &on)?);
        let ejected = Ejected::of(job, contact, deepest).filter(|ejected| ejected.strain > EJECTED);
        let is_deep = deepest > TOO_DEEP * size;
        if ejected.is_some() || is_deep {
            let share = format!(", {:.1} % of the body's size", 100.0 * deepest / size);
            let ejects = ejected.map_or_else(
                || {
                    "the first steps will eject the body; correct the gap, the obstacle or [initial] displacement"
                        .into()
                },
                |ejected| ejected.words(job),
            );
            out.push(format!(
                "contact.{number}: the boundary {on} starts up to {deepest:.3e} m inside its obstacle{}: {ejects}",
                if is_deep { share } else { String::new() }
            ));
        }
        let inside = Inside::new(&body.mesh, contact, (0.0, TOO_DEEP * size), &absolute);
        if deepest > ROUNDING * size || inside.deepest(session) <= TOO_DEEP * size {
            continue;
        }
        // Other bodies may be anywhere.
        let [least, most] = inside.depths_of_own(session, body)?;
        if most <= TOO_DEEP * size {
            continue;
        }
        if least < -ROUNDING * size {
            out.push(format!(
                "contact.{number}: the obstacle lies inside the body, up to {most:.3e} m deep, where the boundary {on} does not touch it: \
                 correct position, size or motion of the obstacle"
            ));
            continue;
        }
        let remedy = match contact.obstacle.gap {
            Gap::Sphere(_) => "check `hollow`, which states whether the body is inside the sphere",
            Gap::Shape(_) => {
                "the distance must be positive outside of the obstacle: reverse the sign of `distance`, or the orientation of \
                 the triangles of `surface`"
            }
            _ => "reverse the plane's `normal`: it must point out of the obstacle toward the body",
        };
        out.push(format!(
            "contact.{number}: the body lies behind its obstacle, so that the boundary {on} can never touch it; {remedy}"
        ));
    }
    Ok(out)
}

/// The remedy of a law that takes up an overlap.
const COMPLIANT: &str =
    "normal.compliance, with which the energy is that of its springs, the same for all cells and steps";

/// What the first step does to a boundary that starts inside of its obstacle.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Ejected {
    /// The shortest step of the run in s.
    step: f64,
    /// The velocity in m/s at which this step takes it out.
    speed: f64,
    /// The strain of the body by that, or of the cells at the boundary where these have no mass.
    strain: f64,
    /// Whether they have none.
    has_layer: bool,
}

impl Ejected {
    /// That of a boundary that starts this deep in m inside of its obstacle, if its constraint ejects it.
    fn of<const D: usize>(job: &Job, contact: &Contact<D>, overlap: f64) -> Option<Self> {
        let wave_speed = contact.wave_speed.filter(|_| overlap > 0.0)?;
        let step = shortest_step(job);
        let speed = overlap / step;
        let strain = contact.layer.map_or(speed / wave_speed, |layer| overlap / layer);
        Some(Self { step, speed, strain, has_layer: contact.layer.is_some() })
    }

    /// What it does and what helps.
    fn words(self, job: &Job) -> String {
        let Self { step, speed, strain, has_layer } = self;
        let key = if job.time.adaptive.is_some() { "[time.adaptive] smallest_step" } else { "[time] step" };
        let from = match job.initial.as_ref().is_some_and(|initial| initial.from.is_some()) {
            true => "the law of the run before let it in, this one does not; keep that law, or ",
            false => "",
        };
        if has_layer {
            return format!(
                "the cells there, which have no mass, are strained by {} at once, and the energy of this, which grows as they become smaller, \
                 throws the body off; {from}correct the gap, the obstacle or [initial] displacement, or take {COMPLIANT}",
                rounded(strain)
            );
        }
        format!(
            "a step of {step} s ejects it at {} m/s, which strains the body by {} and adds energy that grows as the square of this speed; \
             {from}correct the gap, the obstacle or [initial] displacement, or take a {key} of {} s or more, or {COMPLIANT}",
            rounded(speed),
            rounded(strain),
            rounded(step * strain / EJECTED)
        )
    }
}

/// A number with two digits.
fn rounded(number: f64) -> String {
    Digits(format!("{number:.1e}").parse().unwrap_or(number)).to_string()
}

/// A warning about a plane to which no part of the boundary is parallel at some time of a run: all of it is inclined to one side. On a round
/// boundary the smallest angle may be that of the nodes next to the place that is parallel to the plane. Collective.
fn warning_of_tilt<const D: usize, const S: usize>(
    session: &Session,
    job: &Job,
    body: &Body<D, S>,
    number: usize,
) -> Result<Option<String>, Agreed> {
    let contact = &body.contacts[number];
    let [angle, time] = (0..=TIMES)
        .map(|at| {
            let time = job.time.end * f64::from(at) / f64::from(TIMES);
            let [least, most] = contact.tilts(time);
            let [least, most] = session.largest([-least, most]);
            [if most + least < -2.0 * least { -least } else { 0.0 }, time]
        })
        .fold([0.0; 2], |most, found| if found[0].is_finite() && found[0] > most[0] { found } else { most });
    // Equal on all ranks.
    if angle <= LEAST_TILT {
        return Ok(None);
    }
    let friction = contact.friction.as_ref().map_or(0.0, Friction::coefficient_at_rest);
    let slides = slides_freely(session, body, number)?;
    let limit = if slides { (TILTED_BESIDE_FRICTION * friction).clamp(LEAST_TILT, TILTED) } else { TILTED };
    let beside = match slides && friction > 0.0 && friction.is_finite() {
        true => format!(", {} times what friction can hold", rounded(angle.tan() / friction)),
        false => String::new(),
    };
    Ok((angle > limit).then(|| {
        let degrees = angle.to_degrees();
        format!(
            "contact.{number}: the plane in front of the boundary {} is inclined to it by {degrees:.*} degrees or more at t = {time} s: contact \
             acts along the normals of the undeformed body, so that no force pushes the body down this slope{beside}; use sliding = \
             \"finite\", or incline the body and [gravity] instead of the plane",
            job.contact[number].on.join(", "),
            if degrees < 1.0 { 2 } else { 1 }
        )
    }))
}

/// Whether neither supports nor other contacts hold the body along a boundary with a contact. Collective.
fn slides_freely<const D: usize, const S: usize>(
    session: &Session,
    body: &Body<D, S>,
    number: usize,
) -> Result<bool, Agreed> {
    let contact = &body.contacts[number];
    let own: BTreeSet<usize> = nodes_of_bodies(session, body, contact)?.into_iter().collect();
    let springs = body.elastic_support.points.iter().map(|elastic| elastic.point.node as usize);
    let others = body.contacts.iter().enumerate().filter(|(at, _)| *at != number);
    let others = others.flat_map(|(_, other)| other.normal.nodes());
    let beside = springs.chain(others).filter(|node| own.contains(node)).count();
    let mut normal = [0.0; 3];
    for point in contact.normal.boundary().surface_points() {
        (0..D).for_each(|i| normal[i] += point.weight * point.normal[i]);
    }
    let normal = session.sum(normal);
    let along: Vec<Vector<D>> = tangents(&std::array::from_fn(|i| normal[i] / norm(&normal))).collect();
    let is_held = |node: &&usize| {
        let taken = |tangent: &Vector<D>| add_scaled(tangent, -1.0, &body.held.free_part(**node, tangent));
        along.iter().any(|tangent| norm(&taken(tangent)) > HELD_ALONG)
    };
    Ok(session.total(beside + own.iter().filter(is_held).count()) == 0)
}

/// A warning about quadratic cells with straight edges along a boundary that is meant to be round, before an obstacle that is round: nodes
/// on edges lie beside the arc through the corners. Collective.
fn warning_of_straight_edges<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    (number, contact): (usize, &Contact<D>),
    on: &str,
) -> Result<Option<String>, Agreed> {
    let is_round = matches!(contact.obstacle.gap, Gap::Sphere(_) | Gap::Shape(_));
    if mesh.order() == 1 || !is_round || session.total(usize::from(mesh.is_curved)) > 0 {
        return Ok(None);
    }
    let of_facet = |facet: u32| {
        let normal = facet_normal(&mesh.facet_corners(facet));
        let measure = norm(&normal);
        let size = if D == 2 { measure } else { (2.0 * measure).sqrt() };
        std::array::from_fn(|i| if i < 3 { normal.get(i).map_or(0.0, |n| n / measure) } else { size })
    };
    let points = surface_means(session, mesh, &contact.facets, of_facet)?;
    let turns = || {
        let turn = |[x, y, z, size]: [f64; 4]| [norm(&[x, y, z]).min(1.0).acos(), size];
        points.iter().map(move |(_, means)| turn(*means)).filter(|[angle, _]| *angle > TURNING)
    };
    let [beside] = session.largest([turns().map(|[angle, size]| 0.25 * angle * size).fold(0.0, larger)]);
    let [turning, all] = [turns().count(), points.len()].map(|count| session.total(count));
    Ok((turning > 0 && SHARE_OF_CORNERS * turning >= all).then(|| {
        format!(
            "contact.{number}: the quadratic cells along {on} have straight edges, whose middle nodes lie up to {beside:.1e} m beside the \
             arc through their ends: a round obstacle touches the others first, and pressures are uneven; generate curved cells (Gmsh: \
             Mesh.ElementOrder = 2), or take [mesh] order = 1"
        )
    }))
}

/// The gaps of a contact that depends on them. Names are those of `solver check --json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct ContactGaps {
    /// The boundaries.
    on: Vec<String>,
    /// The condition for their facets, if the contact is on a part of them.
    #[serde(rename = "where", skip_serializing_if = "Option::is_none")]
    part: Option<Scalar>,
    /// Smallest and largest gap in m; absent if the normal of no point meets the obstacle.
    range: Option<[f64; 2]>,
    /// What the first step does to points that start inside.
    #[serde(skip)]
    ejected: Option<Ejected>,
    /// All points, and those whose normal does not meet the obstacle.
    points: usize,
    points_without_obstacle: usize,
}

impl ContactGaps {
    /// As a line for the terminal.
    pub(super) fn line(&self) -> String {
        let on = self.on.join(", ") + &words_of_part(self.part.as_ref());
        let Some([smallest, largest]) = self.range.map(|range| range.map(Digits)) else {
            return format!("gap        {on}: no obstacle along the normal of any point");
        };
        let without = match self.points_without_obstacle {
            0 => String::new(),
            count => format!("; no obstacle along the normals of {count} of {} points", self.points),
        };
        let inside = self.ejected.map_or_else(String::new, |Ejected { step, speed, .. }| {
            format!(
                "; points with negative gaps start inside the obstacle, which a step of {step} s leaves at up to {} m/s",
                rounded(speed)
            )
        });
        format!("gap        {on}: {smallest} m to {largest} m{without}{inside}")
    }
}

/// The gaps of all contacts that depend on them, at the start. Collective.
pub(super) fn gaps<const D: usize, const S: usize>(
    session: &Session,
    job: &Job,
    body: &Body<D, S>,
    state: &State,
) -> Result<Vec<ContactGaps>> {
    let displacement = session.agree(state.displacement.local())?;
    let displacement = body.seen_by_contacts(&displacement);
    let size = longest_side(session, &body.mesh.nodes);
    let contacts = body.contacts.iter().zip(&job.contact);
    let gaps = contacts.filter(|(contact, _)| contact.normal.law.depends_on_displacement()).map(
        |(contact, table)| {
            let Gaps { smallest, largest, without } =
                gaps_of_all(session, contact, state.time, &displacement);
            ContactGaps {
                on: table.on.clone(),
                part: table.part.clone(),
                range: (smallest <= largest).then_some([smallest, largest]),
                ejected: Ejected::of(job, contact, -smallest).filter(|_| -smallest > ROUNDING * size),
                points: session.total(contact.normal.boundary().count()),
                points_without_obstacle: without,
            }
        },
    );
    Ok(gaps.collect())
}

/// The gaps of a contact on all ranks. Collective.
fn gaps_of_all<const D: usize>(
    session: &Session,
    contact: &Contact<D>,
    time: f64,
    displacement: &[f64],
) -> Gaps {
    let Gaps { smallest, largest, without } = contact.gaps(time, displacement);
    let [nearest, farthest] = session.largest([-smallest, largest]);
    Gaps { smallest: -nearest, largest: farthest, without: session.total(without) }
}

/// Warnings about nodes that supports hold inside of an obstacle, where constraints have no contact force, about obstacles that leapt, and, after
/// the last step, about contacts that have never touched. Collective, with the same warnings on all ranks.
pub(super) fn warnings_of_run<const D: usize, const S: usize>(
    session: &Session,
    job: &Job,
    body: &Body<D, S>,
    state: &State,
    has_ended: bool,
) -> Result<Vec<String>> {
    let absolute = session.agree(state.displacement.local())?;
    let displacement = body.seen_by_contacts(&absolute);
    let size = longest_side(session, &body.mesh.nodes);
    let is_worn = job.contact.iter().any(|table| table.wear.is_some());
    let closeness: Vec<Closeness> =
        body.contacts.iter().map(|contact| contact.closeness.of_all(session)).collect();
    let of_contacts = closeness.iter().fold(0.0, |most, of| larger(most, larger(of.penetration, of.held)));
    let mut out = Vec::new();
    for (number, (contact, table)) in body.contacts.iter().zip(&job.contact).enumerate() {
        let Closeness {
            penetration,
            held,
            slip,
            sharpness,
            ends,
            leap,
            moved,
            shift,
            shift_to_spread,
            inclination,
            ejection,
        } = closeness[number];
        let on = table.on.join(", ");
        if slip > LARGEST_SLIP && table.sliding == Sliding::Small {
            out.push(format!(
                "contact.{number}: the boundary {on} slid up to {slip:.2} times the size of a facet along {} while it pressed on it: nodes \
                 still act on the surface that they faced at the start; use sliding = \"finite\"",
                table.against.join(", ")
            ));
        }
        if let Some(pair) = pair_of(&body.pairs, number).filter(|pair| pair.slides) {
            let remedy = || exchange_of_sides(session, (body, pair), state);
            out.extend(warning_of_run(job, (pair, contact), [sharpness, ends], remedy)?);
        }
        if let Some(pair) = pair_of(&body.pairs, number).filter(|_| has_ended) {
            out.extend(warning_of_overhang((session, job), (body, pair), state)?);
        }
        if !contact.normal.law.depends_on_displacement() {
            continue;
        }
        if held > OVERRUN * size {
            out.push(format!(
                "contact.{number}: the obstacle moved up to {held:.3e} m beyond nodes of the boundary {on} that a support holds along \
                 the normal: a constraint has no contact force at these nodes, and contact forces do not include what the support would \
                 have to carry; let the contact end before the support (key `where`), or stop the obstacle earlier"
            ));
        }
        if shift_to_spread > LARGEST_SHIFT || inclination > LARGEST_INCLINATION {
            let remedy = if table.adhesion.is_none() && table.memory.is_none() {
                "use sliding = \"finite\""
            } else {
                "move the obstacle in place of the body"
            };
            out.push(format!(
                "contact.{number}: the boundary {on} moved up to {moved:.3e} m along its obstacle while it pressed on it, which changes \
                 distances between them by up to {shift:.3e} m: gaps and normals are those of the undeformed body, without these changes{}; {remedy}",
                if inclination > LARGEST_INCLINATION {
                    format!(", and the resultant of the pressures is inclined by up to {inclination:.2e} rad")
                } else {
                    String::new()
                }
            ));
        }
        let Ejection { strain, overlap, time } = ejection;
        if strain > EJECTED {
            out.push(format!(
                "contact.{number}: in the step to t = {time} s {} leapt {overlap:.3e} m into the boundary {on}, and ejected it within \
                 this step, which strains the body by {} and adds energy that grows as the square of the overlap over the step; let the \
                 gap close in a time that steps resolve, or take longer steps, or {COMPLIANT}",
                faced(table),
                rounded(strain)
            ));
        }
        if leap > size {
            out.push(format!(
                "contact.{number}: the obstacle that a force moves leapt by {leap:.3e} m in one step, more than the size of the body, \
                 {size:.3e} m: steps that long don't resolve its motion; take a smaller [time] step, or correct its force or its mass"
            ));
        }
        let touched = larger(penetration, held) >= -ROUNDING * size;
        if !has_ended || state.step == 0 {
            continue;
        }
        let least = TOO_DEEP * size;
        let inside = Inside::new(&body.mesh, contact, (state.time, least), &absolute);
        if touched && !is_worn {
            let deepest = inside.deepest_of_surface(session, body)?;
            if deepest > least + SUNKEN * of_contacts {
                out.push(format!(
                    "contact.{number}: at the end facets beside the boundary {on} lie up to {deepest:.3e} m inside its obstacle, which acts on \
                     that boundary alone: let the contact be `on` them, too (facets that belong to no boundary need a name in the mesh), or move \
                     the obstacle away from them"
                ));
            }
        }
        // Bonds carry forces across a gap.
        if !touched && table.adhesion.is_none() {
            let Gaps { smallest, .. } = gaps_of_all(session, contact, state.time, &displacement);
            let nearest = match larger(penetration, held) {
                f64::NEG_INFINITY => {
                    "no obstacle was along the normal of any of its points after any step".into()
                }
                most => format!("the smallest gap after any step was {:.3e} m", -most),
            };
            let last = if smallest.is_finite() {
                format!(", at the end it is {smallest:.3e} m")
            } else {
                String::new()
            };
            let last = match inside.depths_of_own(session, body)? {
                [out, depth] if out < -ROUNDING * size && depth > least => {
                    format!("{last}, at the end it lies inside the body, up to {depth:.3e} m deep")
                }
                _ => last,
            };
            out.push(format!(
                "contact.{number}: the boundary {on} never touched {}: {nearest}{last}; if it should have, check position, size \
                 and motion of both, and their units",
                faced(table)
            ));
        }
    }
    Ok(out)
}

/// What the boundary of a contact faces.
fn faced(table: &job::Contact) -> String {
    match table.against.join(", ") {
        none if none.is_empty() => "its obstacle".into(),
        other => other,
    }
}
