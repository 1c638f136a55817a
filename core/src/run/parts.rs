//! Parts of boundaries.

use crate::{
    error::{Error, Result},
    fem::{
        body::Body,
        space::{facets, spread_over_facet},
    },
    job::{Job, Scalar},
    laws::digits::Digits,
    linear_algebra::{
        petsc::DistributedVector,
        tensor::{Vector, add_scaled, larger, norm},
    },
    mesh::{Mesh, shape::facet_normal},
    parallel::{agreement::Agreed, session::Session},
};

/// Conditions are compared at this share of the way from the corners of a facet to its centre.
const INSIDE: f64 = 1e-3;

/// Share of the area of a part by which that of the facets that a support holds may differ from it.
const WRONG: f64 = 0.1;

/// Share of the area of a boundary from which on a part is all of it.
const WHOLE: f64 = 0.999;

/// Shares of a boundary up to this one are facets in its corners, whose nodes belong to other boundaries.
const NEGLIGIBLE: f64 = 0.1;

/// The facets of the boundaries of a table on this rank at whose centre the expression is not 0. Collective.
pub(super) fn part_of<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    (table, on): (&str, &[String]),
    part: Option<&Scalar>,
) -> Result<Vec<u32>, Agreed> {
    let mut facets = facets(mesh, on);
    let Some(part) = part else { return Ok(facets) };
    let refused = |words: String| {
        let on = on.join(", ");
        Err(Error::Refused(format!("{table} on {on}: `where` {words}; correct the expression")))
    };
    let value = |facet: u32| part.evaluate(0.0, &centre_of(mesh, facet));
    let wrong = facets.iter().find(|facet| value(**facet).is_nan());
    let words = |facet: &u32| refused(format!("is not a number at {:?} m", centre_of(mesh, *facet)));
    session.agree(wrong.map_or(Ok(()), words))?;
    facets.retain(|&facet| value(facet) != 0.0);
    let is_empty = session.total(facets.len()) == 0;
    session.agree(if is_empty { refused("holds at no facet of these boundaries".into()) } else { Ok(()) })?;
    Ok(facets)
}

/// Warnings of conditions on the place of loads, supports, heat and contacts that facets do not follow: these belong to a part as a whole, or
/// are held if all their nodes are. Collective, with the same warnings on all ranks.
pub(super) fn warnings<const D: usize>(session: &Session, job: &Job, mesh: &Mesh<D>) -> Vec<String> {
    let tractions = job.traction.iter().enumerate().map(|(at, t)| (format!("traction.{at}"), &t.on, &t.part));
    let supports = job.support.iter().enumerate();
    let on_areas = supports.clone().filter(|(_, support)| support.gives_way());
    let on_areas = on_areas.map(|(at, s)| (format!("support.{at}"), &s.on, &s.part));
    let flows = job.heat.iter().enumerate().map(|(at, heat)| (format!("heat.{at}"), &heat.on, &heat.part));
    let contacts = job.contact.iter().enumerate().map(|(at, c)| (format!("contact.{at}"), &c.on, &c.part));
    let mut warnings = Vec::new();
    for (table, on, part) in tractions.chain(on_areas).chain(flows).chain(contacts) {
        let Some(part) = part else { continue };
        let cut = facets(mesh, on).into_iter().filter(|facet| is_cut(mesh, *facet, part));
        let [count, area] = measured(session, mesh, cut);
        if count > 0.0 {
            warnings.push(format!(
                "{table}.where: the condition changes within {} of {}, which belong to the part if their centre does: let facets end where \
                 it changes, or refine the mesh there",
                in_words(mesh, [count, area]),
                on.join(", ")
            ));
        }
    }
    for (at, support) in supports.filter(|(_, support)| support.fix.is_some()) {
        let Some(part) = &support.part else { continue };
        let [held, meant, whole] = session.sum(held_and_meant(mesh, &support.on, part));
        // Points and edges have no facets; a condition on all of a boundary leaves nodes to other tables.
        let is_area = held > 0.0 && meant < WHOLE * whole;
        if is_area && (held - meant).abs() > WRONG * larger(held, meant) {
            let unit = unit(mesh);
            warnings.push(format!(
                "support.{at}.where: the facets of {} that it holds as a whole have {} {unit}, the part where the condition holds {} {unit}, because nodes \
                 are held alone: let nodes lie where the condition changes and hold them, too (`x < 1 + 1e-6`), or refine the mesh there",
                support.on.join(", "),
                Digits(held),
                Digits(meant)
            ));
        }
    }
    warnings
}

/// Whether an expression holds at all nodes of a facet.
pub(super) fn holds_at_nodes<const D: usize>(mesh: &Mesh<D>, facet: u32, part: &Scalar) -> bool {
    mesh.facet_nodes(facet).all(|node| part.evaluate(0.0, &mesh.nodes[node as usize]) != 0.0)
}

/// The area on this rank of the facets of boundaries at all of whose nodes an expression holds, that of the part of them where it holds, and
/// that of all.
fn held_and_meant<const D: usize>(mesh: &Mesh<D>, on: &[String], part: &Scalar) -> [f64; 3] {
    let mut sums = [0.0; 3];
    for facet in facets(mesh, on) {
        let is_held = f64::from(u8::from(holds_at_nodes(mesh, facet, part)));
        let parts = [is_held, share_where(mesh, facet, part), 1.0];
        sums.iter_mut().zip(parts).for_each(|(sum, share)| *sum += share * area_of(mesh, facet));
    }
    sums
}

/// Warnings of boundaries with heat at whose nodes other tables give the temperature. Collective, with the same warnings on all ranks.
pub(super) fn warnings_of_heat<const D: usize, const S: usize>(
    session: &Session,
    job: &Job,
    body: &Body<D, S>,
) -> Result<Vec<String>> {
    let Body { mesh, heat: Some(heat), .. } = body else { return Ok(Vec::new()) };
    // The number of the table that gives the temperature of a node, from 1 on.
    let giver = DistributedVector::ghosted(1, mesh.owned, &mesh.ghosts);
    let mut giver = session.agree(giver)?;
    {
        let mut numbers = giver.owned_mut()?;
        heat.held.iter().for_each(|(node, number)| numbers[*node as usize] = f64::from(number + 1));
    }
    giver.update_ghosts()?;
    let giver = giver.local()?;
    let mut warnings = Vec::new();
    for (at, table) in job.heat.iter().enumerate() {
        let own = (at + 1) as f64;
        let is_lost = |facet: &u32| {
            let nodes = mesh.facets[*facet as usize].iter();
            nodes.map(|node| giver[*node as usize]).all(|number| number != 0.0 && number != own)
        };
        let part = part_of(session, mesh, ("heat", &table.on), table.part.as_ref())?;
        let [_, whole] = measured(session, mesh, part.iter().copied());
        let [count, area] = measured(session, mesh, part.into_iter().filter(is_lost));
        if area > NEGLIGIBLE * whole {
            let key = table.key();
            warnings.push(format!(
                "heat.{at}.{key} has no effect on {} of {}, where another table gives the temperature of all nodes: delete one of the two, \
                 or add `where`",
                in_words(mesh, [count, area]),
                table.on.join(", ")
            ));
        }
    }
    Ok(warnings)
}

/// The number of these facets of this rank on all ranks, and their area. Collective.
fn measured<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    facets: impl Iterator<Item = u32>,
) -> [f64; 2] {
    session.sum(facets.fold([0.0; 2], |[count, area], facet| [count + 1.0, area + area_of(mesh, facet)]))
}

/// A number of facets and their area in words.
fn in_words<const D: usize>(mesh: &Mesh<D>, [count, area]: [f64; 2]) -> String {
    format!("{count} facet{} ({} {})", if count == 1.0 { "" } else { "s" }, Digits(area), unit(mesh))
}

/// The unit of the area of facets.
fn unit<const D: usize>(mesh: &Mesh<D>) -> &'static str {
    if D == 2 && !mesh.is_revolved { "m" } else { "m^2" }
}

/// Whether an expression holds at one corner of a facet and not at another one, just inside of the facet, or at one place in it and not at
/// another one.
fn is_cut<const D: usize>(mesh: &Mesh<D>, facet: u32, part: &Scalar) -> bool {
    let (corners, centre) = (mesh.facet_corners(facet), centre_of(mesh, facet));
    let holds = |corner: &Vector<D>| {
        let inward: Vector<D> = std::array::from_fn(|i| centre[i] - corner[i]);
        part.evaluate(0.0, &add_scaled(corner, INSIDE, &inward)) != 0.0
    };
    let share = share_where(mesh, facet, part);
    corners.iter().any(|corner| f64::from(u8::from(holds(corner))) != share)
}

/// The share of a facet in which an expression holds.
fn share_where<const D: usize>(mesh: &Mesh<D>, facet: u32, part: &Scalar) -> f64 {
    let corners = mesh.facet_corners(facet);
    let places = spread_over_facet::<D>();
    let place = |shares: &[f64; 4]| {
        let terms = corners.iter().zip(shares);
        terms.fold([0.0; D], |at, (corner, share)| add_scaled(&at, *share, corner))
    };
    let held = places.iter().filter(|shares| part.evaluate(0.0, &place(shares)) != 0.0);
    held.count() as f64 / places.len() as f64
}

/// The area of a facet in m^(D-1), of a body of revolution in m^2.
pub(super) fn area_of<const D: usize>(mesh: &Mesh<D>, facet: u32) -> f64 {
    norm(&facet_normal(&mesh.facet_corners(facet))) * mesh.turn(&centre_of(mesh, facet))
}

pub(super) fn centre_of<const D: usize>(mesh: &Mesh<D>, facet: u32) -> Vector<D> {
    let corners = mesh.facet_corners(facet);
    std::array::from_fn(|i| corners.iter().map(|corner| corner[i]).sum::<f64>() / D as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{fem::space::samples::row, job::Expression};

    #[test]
    fn only_conditions_that_change_within_a_facet_cut_it() {
        let mut mesh: Mesh<2> = row();
        let [a, b] = [mesh.cell(0)[0], mesh.cell(0)[1]];
        mesh.facets = vec![[a, b]];
        let [[x, _], [end, _]] = mesh.facet_corners(0);
        let at = |share: f64| x + share * (end - x);
        let cuts = |place: f64| {
            let part = Expression::parse(&format!("x < {place}")).expect("an expression");
            is_cut(&mesh, 0, &Scalar::Expression(part))
        };
        assert!(x != end && cuts(at(0.5)) && cuts(at(0.1)));
        let strip = format!("abs(x - 0.5*({x} + {end})) < 0.2*abs({end} - {x})");
        let strip = Scalar::Expression(Expression::parse(&strip).expect("an expression"));
        assert!(is_cut(&mesh, 0, &strip), "between its ends");
        assert!((share_where(&mesh, 0, &strip) - 0.4).abs() < 0.07);
        assert!(!cuts(at(0.0)) && !cuts(at(1.0)) && !cuts(at(2.0)), "at its ends or beside it");
    }
}
