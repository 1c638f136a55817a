//! Parts of boundaries.

use crate::{
    error::{Error, Result},
    fem::space::facets,
    job::{Job, Scalar},
    laws::digits::Digits,
    linear_algebra::tensor::{Vector, add_scaled, norm},
    mesh::{Mesh, shape::facet_normal},
    parallel::{agreement::Agreed, session::Session},
};

/// Conditions are compared at this share of the way from the corners of a facet to its centre.
const INSIDE: f64 = 1e-3;

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

/// Warnings of conditions on the place of loads and supports that facets do not follow: these belong to a part as a whole. Collective, with
/// the same warnings on all ranks.
pub(super) fn warnings<const D: usize>(session: &Session, job: &Job, mesh: &Mesh<D>) -> Vec<String> {
    let tractions = job.traction.iter().enumerate().map(|(at, t)| (format!("traction.{at}"), &t.on, &t.part));
    let supports = job.support.iter().enumerate();
    let on_areas = supports.filter(|(_, support)| support.gives_way());
    let supports = on_areas.map(|(at, s)| (format!("support.{at}"), &s.on, &s.part));
    let mut warnings = Vec::new();
    for (table, on, part) in tractions.chain(supports) {
        let Some(part) = part else { continue };
        let areas: Vec<f64> = facets(mesh, on)
            .into_iter()
            .filter(|facet| is_cut(mesh, *facet, part))
            .map(|facet| area_of(mesh, facet))
            .collect();
        let count = session.total(areas.len());
        let [area] = session.sum([areas.iter().sum()]);
        if count > 0 {
            let (facets, unit) = (
                if count == 1 { "facet" } else { "facets" },
                if D == 2 && !mesh.is_revolved { "m" } else { "m^2" },
            );
            warnings.push(format!(
                "{table}.where: the condition changes within {count} {facets} of {}, {} {unit} in all, which belong to the part if their \
                 centre does: let facets end where it changes, or refine the mesh there",
                on.join(", "),
                Digits(area)
            ));
        }
    }
    warnings
}

/// Whether an expression holds at one corner of a facet and not at another one, just inside of the facet.
fn is_cut<const D: usize>(mesh: &Mesh<D>, facet: u32, part: &Scalar) -> bool {
    let (corners, centre) = (mesh.facet_corners(facet), centre_of(mesh, facet));
    let holds = |corner: &Vector<D>| {
        let inward: Vector<D> = std::array::from_fn(|i| centre[i] - corner[i]);
        part.evaluate(0.0, &add_scaled(corner, INSIDE, &inward)) != 0.0
    };
    let first = holds(&corners[0]);
    corners.iter().any(|corner| holds(corner) != first)
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
        assert!(!cuts(at(0.0)) && !cuts(at(1.0)) && !cuts(at(2.0)), "at its ends or beside it");
    }
}
