//! The areas on which tractions act, and tractions that act on supports alone.

use crate::{
    fem::{body::Body, space::facet_points},
    job::{Job, Scalar},
    laws::digits::Digits,
    linear_algebra::tensor::norm,
    parallel::session::Session,
};
use serde::Serialize;

/// Times of a run at which tractions are compared with supports.
const TIMES: u32 = 16;
/// A free share of forces below this is a rounding error.
const FREE: f64 = 1e-9;

/// Warnings about tractions along directions that supports hold at all their nodes. Collective, with the same warnings on all ranks.
pub(super) fn warnings<const D: usize, const S: usize>(
    session: &Session,
    job: &Job,
    body: &Body<D, S>,
) -> Vec<String> {
    let mut out = Vec::new();
    for (number, (traction, table)) in body.load.tractions.iter().zip(&job.traction).enumerate() {
        let mut mine = [0.0; 2];
        let mut values = table.value.iter().chain(&table.pressure);
        let last = if values.any(Scalar::depends_on_time) { TIMES } else { 0 };
        for at in 0..=last {
            let time = job.time.end * f64::from(at) / f64::from(TIMES);
            // A step at which the traction is no number ends the run with the reason.
            let _ = traction.forces(&body.mesh, time, |node, force| {
                mine[0] += norm(&force);
                mine[1] += norm(&body.held.free_part(node as usize, &force));
            });
        }
        let [all, free] = session.sum(mine);
        if all > 0.0 && free <= FREE * all {
            out.push(format!(
                "traction.{number}: supports hold the boundary {} in every direction in which it acts, so that nothing but their forces \
                 changes: to load the body, take these directions from the supports (`fix`, `on` or `where`)",
                table.on.join(", ")
            ));
        }
    }
    out
}

/// The part of the boundary that a traction loads. Names are those of `solver check --json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct LoadedArea {
    /// The boundaries.
    on: Vec<String>,
    /// The condition for their facets, if only a part of them is loaded.
    #[serde(rename = "where", skip_serializing_if = "Option::is_none")]
    part: Option<Scalar>,
    /// Facets that are loaded.
    facets: usize,
    /// In m^2, in the plane in m; of a body of revolution that of the whole turn.
    area: f64,
    /// Whether the area is a length.
    #[serde(skip)]
    is_length: bool,
}

impl LoadedArea {
    /// As a line for the terminal.
    pub(super) fn line(&self) -> String {
        let part = words_of_part(self.part.as_ref());
        let unit = if self.is_length { "m" } else { "m^2" };
        let (on, area, facets) = (self.on.join(", "), Digits(self.area), self.facets);
        format!(
            "traction   {on}{part}: {area} {unit} in {facets} facet{}",
            if facets == 1 { "" } else { "s" }
        )
    }
}

/// The condition for the facets or nodes of a part of boundaries, if there is one, behind their names.
pub(super) fn words_of_part(part: Option<&Scalar>) -> String {
    match part {
        None => String::new(),
        Some(Scalar::Number(number)) => format!(" where {number}"),
        Some(Scalar::Expression(expression)) => format!(" where {}", expression.text()),
    }
}

/// The loaded areas of all tractions of a job. Collective.
pub(super) fn areas<const D: usize, const S: usize>(
    session: &Session,
    job: &Job,
    body: &Body<D, S>,
) -> Vec<LoadedArea> {
    let tables = job.traction.iter().zip(&body.load.tractions);
    tables
        .map(|(table, traction)| {
            let facets = traction.facets.iter();
            let weights =
                facets.flat_map(|&facet| facet_points(&body.mesh, facet).1).map(|point| point.weight);
            let [area] = session.sum([weights.sum()]);
            LoadedArea {
                on: table.on.clone(),
                part: table.part.clone(),
                facets: session.total(traction.facets.len()),
                area,
                is_length: D == 2 && !body.mesh.is_revolved,
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::Expression;

    #[test]
    fn a_line_has_the_condition_the_area_with_its_unit_and_the_facets() {
        let part = Expression::parse("x > 0.5").map(Scalar::Expression).ok();
        let on = || vec!["top".to_owned(), "left".to_owned()];
        let half = LoadedArea { on: on(), part, facets: 3, area: 0.6, is_length: true };
        assert_eq!(half.line(), "traction   top, left where x > 0.5: 0.6 m in 3 facets");
        let whole = LoadedArea { on: on(), part: None, facets: 1, area: 2.0 / 3.0, is_length: false };
        assert_eq!(whole.line(), "traction   top, left: 0.666667 m^2 in 1 facet");
    }
}
