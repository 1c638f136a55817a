//! Formulas of the place that change within cells and facets, where they are evaluated at points alone.

use super::parts::part_of;
use crate::{
    fem::{
        body::Body,
        effect::Traction,
        space::{cell_rule, evenly_spread, fine_cell_rule},
    },
    job::{Job, Scalar},
    linear_algebra::tensor::{add_scaled, larger, norm},
    parallel::{agreement::Agreed, session::Session},
};

/// Times of a run at which formulas of time are looked at.
const TIMES: u32 = 4;
/// Share of a quantity by which its values at the points of cells may differ from its means over them.
const WRONG: f64 = 0.1;
/// Parts of each edge of a cell that are looked at; fewer where a mesh has more cells.
const PARTS: [usize; 3] = [12, 8, 4];
/// The most places on all ranks.
const MOST_PLACES: usize = 1_000_000;
/// The most components of a quantity: those of a stress.
const COMPONENTS: usize = 6;

/// A place in a cell by the shares of its corners, with its weight in the mean over the cell.
type Point = ([f64; 4], f64);

/// A quantity that cells see at these points only.
struct Seen<'a> {
    name: String,
    values: Vec<&'a Scalar>,
    points: &'a [Point],
}

/// Warnings about what a job gives by formulas of the place that cells or facets do not resolve. Collective, with the same warnings on all
/// ranks.
pub(super) fn warnings<const D: usize, const S: usize>(
    session: &Session,
    job: &Job,
    body: &Body<D, S>,
) -> Result<Vec<String>, Agreed> {
    let rule = if body.mesh.order() == 1 { cell_rule::<D>() } else { fine_cell_rule::<D>() };
    let (centre, nodes) = (vec![centre_of_all::<D>()], at_nodes::<D>(body.mesh.order()));
    let of_stress = if body.mesh.order() == 1 { &centre[..] } else { cell_rule::<D>() };
    let mut all = Vec::new();
    for (number, force) in job.body_force.iter().enumerate() {
        let name = format!("body_force.{number}");
        all.push(Seen { name, values: force.value.iter().collect(), points: rule });
    }
    if let Some(gravity) = &job.gravity {
        all.push(Seen {
            name: "gravity".into(),
            values: gravity.acceleration.iter().collect(),
            points: rule,
        });
    }
    if let Some(initial) = &job.initial {
        for (key, value) in [("displacement", &initial.displacement), ("velocity", &initial.velocity)] {
            let values = value.iter().flatten().collect();
            all.push(Seen { name: format!("initial.{key}"), values, points: &nodes });
        }
        if let Some(stress) = &initial.stress {
            let values = vec![&stress.xx, &stress.yy, &stress.zz, &stress.xy, &stress.yz, &stress.xz];
            all.push(Seen { name: "initial.stress".into(), values, points: of_stress });
        }
    }
    all.retain(|seen| seen.values.iter().any(|value| value.depends_on_position()));
    let mut out = Vec::new();
    let mut warn = |name: &str, [what, remedy]: [&str; 2], mine: [f64; 3]| {
        let [error, seen, means] = session.sum(mine);
        let size = larger(seen, means);
        if error > WRONG * size {
            out.push(format!(
                "{name}: {what} are too large for it: by its values at their points it differs by {:.0} % from its means over them; refine \
                 {remedy}",
                100.0 * error / size
            ));
        }
    };
    if !all.is_empty() {
        let cells = session.total(body.mesh.cell_count());
        let places = |parts: &usize| evenly_spread(D + 1, *parts);
        let is_fitting = |places: &Vec<[f64; 4]>| cells * places.len() <= MOST_PLACES;
        let places = PARTS.iter().map(places).find(is_fitting).unwrap_or_else(|| places(&2));
        let weight = 1.0 / places.len() as f64;
        let places: Vec<Point> = places.into_iter().map(|place| (place, weight)).collect();
        for seen in &all {
            let words = ["cells", "the mesh where it changes"];
            warn(&seen.name, words, error_in_cells(job, body, seen, &places));
        }
    }
    let mut on_facets = |name: String, on: &[String], load: &Traction| {
        let mut mine = [0.0; 3];
        for time in times(job, &load.value.iter().chain(&load.pressure).collect::<Vec<_>>()) {
            // A step at which the load is no number ends the run with the reason.
            if let Ok([error, means]) = load.error_of_rule(&body.mesh, time) {
                (mine[0], mine[2]) = (mine[0] + error, mine[2] + means);
            }
            let _ = load.forces(&body.mesh, time, |_, force| mine[1] += norm(&force));
        }
        let what = format!("facets of the boundary {}", on.join(", "));
        warn(&name, [&what, "the boundary where it changes, or select facets by `where`"], mine);
    };
    for (number, (load, table)) in body.load.tractions.iter().zip(&job.traction).enumerate() {
        if load.value.iter().chain(&load.pressure).any(Scalar::depends_on_position) {
            on_facets(format!("traction.{number}"), &table.on, load);
        }
    }
    for (number, table) in job.heat.iter().enumerate() {
        let coefficient = table.convection.as_ref().map(|convection| &convection.coefficient);
        let value = table.flux.as_ref().or(coefficient);
        if let Some(value) = value.filter(|value| value.depends_on_position()) {
            let facets = part_of(session, &body.mesh, ("heat", &table.on), table.part.as_ref())?;
            let load = Traction { facets, value: vec![value.clone()], pressure: None };
            on_facets(format!("heat.{number}"), &table.on, &load);
        }
    }
    Ok(out)
}

/// The times in s at which these are looked at.
fn times(job: &Job, values: &[&Scalar]) -> impl Iterator<Item = f64> {
    let (last, end) =
        (if values.iter().any(|value| value.depends_on_time()) { TIMES } else { 0 }, job.time.end);
    (0..=last).map(move |at| end * f64::from(at) / f64::from(TIMES))
}

/// By how much what the cells of this rank see of a quantity differs from its means over them, what they see, and its means, each the sum of
/// magnitudes times volumes.
fn error_in_cells<const D: usize, const S: usize>(
    job: &Job,
    body: &Body<D, S>,
    Seen { values, points, .. }: &Seen<'_>,
    places: &[Point],
) -> [f64; 3] {
    let mut sums = [0.0; 3];
    for time in times(job, values) {
        for (number, cell) in body.geometry.cells().enumerate() {
            let corners = body.mesh.cell(number)[..=D].iter().map(|node| body.mesh.nodes[*node as usize]);
            let mean = |points: &[Point]| {
                let mut mean = [0.0; COMPONENTS];
                for (shares, weight) in points {
                    let place = corners
                        .clone()
                        .zip(shares)
                        .fold([0.0; D], |at, (corner, share)| add_scaled(&at, *share, &corner));
                    mean.iter_mut()
                        .zip(values)
                        .for_each(|(sum, value)| *sum += weight * value.evaluate(time, &place));
                }
                mean
            };
            let (seen, whole) = (mean(points), mean(places));
            let parts = [norm(&add_scaled(&seen, -1.0, &whole)), norm(&seen), norm(&whole)];
            let volume = cell.whole().volume;
            sums.iter_mut().zip(parts).for_each(|(sum, part)| *sum += volume * part);
        }
    }
    sums
}

/// The centre of a cell.
fn centre_of_all<const D: usize>() -> Point {
    (std::array::from_fn(|corner| if corner <= D { 1.0 / (D + 1) as f64 } else { 0.0 }), 1.0)
}

/// The nodes of a cell of this order, with the means of their shape functions.
fn at_nodes<const D: usize>(order: usize) -> Vec<Point> {
    let at = |ends: [usize; 2]| -> [f64; 4] {
        std::array::from_fn(|corner| 0.5 * ends.iter().filter(|end| **end == corner).count() as f64)
    };
    let [of_corner, of_edge] = match (order, D) {
        (1, _) => [1.0 / (D + 1) as f64, 0.0],
        (_, 2) => [0.0, 1.0 / 3.0],
        _ => [-0.05, 0.2],
    };
    let corners = (0..=D).map(|a| (at([a, a]), of_corner));
    let edges = (0..=D).flat_map(|a| (a + 1..=D).map(move |b| [a, b])).map(|ends| (at(ends), of_edge));
    corners.chain(edges).filter(|(_, weight)| *weight != 0.0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is_a_mean<const D: usize>(points: &[Point]) {
        for corner in 0..4 {
            let mean: f64 = points.iter().map(|(shares, weight)| weight * shares[corner]).sum();
            let centre = if corner <= D { 1.0 / (D + 1) as f64 } else { 0.0 };
            assert!((mean - centre).abs() < 1e-14, "{corner}: {mean}");
        }
        assert!((points.iter().map(|(_, weight)| weight).sum::<f64>() - 1.0).abs() < 1e-14);
    }

    #[test]
    fn means_over_cells_are_exact_of_linear_functions() {
        is_a_mean::<2>(&at_nodes::<2>(1));
        is_a_mean::<3>(&at_nodes::<3>(1));
        is_a_mean::<2>(&at_nodes::<2>(2));
        is_a_mean::<3>(&at_nodes::<3>(2));
        is_a_mean::<2>(&[centre_of_all::<2>()]);
        is_a_mean::<3>(&[centre_of_all::<3>()]);
    }
}
