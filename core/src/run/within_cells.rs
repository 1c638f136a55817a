//! Formulas of the place that change within cells and facets, where they are evaluated at points alone.

use super::parts::{area_of, holds_at_nodes, part_of};
use crate::{
    fem::{
        body::Body,
        effect::Traction,
        pairs::{Pair, is_exchanged},
        space::{cell_rule, evenly_spread, facets, fine_cell_rule, spread_over_facet},
    },
    job::{Job, Material, Scalar},
    laws::contact::Quadrature,
    linear_algebra::tensor::{Vector, add_scaled, larger, norm},
    mesh::Mesh,
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

/// A place in a cell or facet by the shares of its corners, with its weight in the mean over it.
type Point = ([f64; 4], f64);

/// A quantity that cells or facets see at these points only.
struct Seen<'a> {
    name: String,
    values: Vec<Scalar>,
    /// Its value counts from this one.
    level: f64,
    points: Vec<Point>,
    on: On<'a>,
}

/// What sees a quantity.
enum On<'a> {
    /// The cells, of one material if it is given.
    Cells(Option<&'a Material>),
    /// These facets of this rank, of these boundaries.
    Facets(Vec<u32>, &'a [String]),
}

/// Warnings about what a job gives by formulas of the place that cells or facets do not resolve. Collective, with the same warnings on all
/// ranks.
pub(super) fn warnings<const D: usize, const S: usize>(
    session: &Session,
    job: &Job,
    body: &Body<D, S>,
) -> Result<Vec<String>, Agreed> {
    let Body { mesh, load, .. } = body;
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
    let all = in_cells(session, job, mesh);
    if !all.is_empty() {
        let cells = session.total(mesh.cell_count());
        let places = |parts: &usize| evenly_spread(D + 1, *parts);
        let is_fitting = |places: &Vec<[f64; 4]>| cells * places.len() <= MOST_PLACES;
        let places = means(PARTS.iter().map(places).find(is_fitting).unwrap_or_else(|| places(&2)));
        for seen in &all {
            warn(&seen.name, ["cells", "the mesh where it changes"], error_of(job, body, seen, &places));
        }
    }
    let places = means(spread_over_facet::<D>());
    let facets_of = |on: &[String]| format!("facets of the boundary {}", on.join(", "));
    for seen in at_nodes_of_facets(session, job, (mesh, &body.pairs))? {
        let On::Facets(_, on) = seen.on else { continue };
        let words = [&*facets_of(on), "the boundary where it changes"];
        warn(&seen.name, words, error_of(job, body, &seen, &places));
    }
    let mut on_facets = |name: String, on: &[String], load: &Traction| {
        let mut mine = [0.0; 3];
        for time in times(job, load.value.iter().chain(&load.pressure)) {
            // A step at which the load is no number ends the run with the reason.
            if let Ok(sums) = load.error_of_rule(mesh, time) {
                mine.iter_mut().zip(sums).for_each(|(all, sum)| *all += sum);
            }
        }
        let words = [&*facets_of(on), "the boundary where it changes, or select facets by `where`"];
        warn(&name, words, mine);
    };
    for (number, (load, table)) in load.tractions.iter().zip(&job.traction).enumerate() {
        if load.value.iter().chain(&load.pressure).any(Scalar::depends_on_position) {
            on_facets(format!("traction.{number}"), &table.on, load);
        }
    }
    let flows = job.heat.iter().enumerate().map(|(number, table)| {
        let coefficient = table.convection.as_ref().map(|convection| &convection.coefficient);
        (format!("heat.{number}"), ("heat", &table.on), &table.part, table.flux.as_ref().or(coefficient))
    });
    let gaps = job.contact.iter().enumerate().map(|(number, table)| {
        let gap = table.normal.gap().filter(|_| table.quadrature == Quadrature::Gauss);
        (format!("contact.{number}.{}.gap", table.normal.table()), ("contact", &table.on), &table.part, gap)
    });
    for (name, on, part, value) in flows.chain(gaps) {
        if let Some(value) = value.filter(|value| value.depends_on_position()) {
            let facets = part_of(session, mesh, (on.0, on.1), part.as_ref())?;
            on_facets(name, on.1, &Traction { facets, value: vec![value.clone()], pressure: None });
        }
    }
    Ok(out)
}

/// What cells see of the formulas of a job. Collective.
fn in_cells<'a, const D: usize>(session: &Session, job: &'a Job, mesh: &Mesh<D>) -> Vec<Seen<'a>> {
    let rule = || if mesh.order() == 1 { cell_rule::<D>() } else { fine_cell_rule::<D>() }.to_vec();
    let (centre, nodes) = (|| means(evenly_spread(D + 1, 1)), |order: usize| at_nodes(D + 1, order));
    let mut all = Vec::new();
    let mut add = |name: String, values: Vec<Scalar>, points: Vec<Point>| {
        all.push(Seen { name, values, level: 0.0, points, on: On::Cells(None) });
    };
    for (number, force) in job.body_force.iter().enumerate() {
        add(format!("body_force.{number}"), force.value.clone(), rule());
    }
    if let Some(gravity) = &job.gravity {
        add("gravity".into(), gravity.acceleration.clone(), rule());
    }
    if let Some(initial) = &job.initial {
        for (key, value) in [("displacement", &initial.displacement), ("velocity", &initial.velocity)] {
            let values = value.iter().flatten().cloned().collect();
            add(format!("initial.{key}"), values, nodes(mesh.order()));
        }
        if let Some(stress) = &initial.stress {
            let values = [&stress.xx, &stress.yy, &stress.zz, &stress.xy, &stress.yz, &stress.xz];
            let points = if mesh.order() == 1 { centre() } else { cell_rule::<D>().to_vec() };
            add("initial.stress".into(), values.map(Scalar::clone).to_vec(), points);
        }
        // Nodes on edges have the mean of their ends.
        add("initial.temperature".into(), initial.temperature.clone().into_iter().collect(), nodes(1));
        if let (Some(seen), Some(temperature)) = (all.last_mut(), &initial.temperature) {
            let coldest = mesh.nodes.iter().map(|node| -temperature.evaluate(0.0, node));
            seen.level = -session.largest([coldest.fold(f64::NEG_INFINITY, larger)])[0];
        }
    }
    for (path, material) in job.materials() {
        let of_cells = material.variables().map(|(key, value)| Seen {
            name: format!("{path}.{key}"),
            values: vec![value.clone()],
            level: 0.0,
            points: centre(),
            on: On::Cells(Some(material)),
        });
        all.extend(of_cells);
    }
    all.retain(Seen::depends_on_position);
    all
}

/// What nodes see of the formulas of contacts and of the motions of supports on facets. Collective.
fn at_nodes_of_facets<'a, const D: usize>(
    session: &Session,
    job: &'a Job,
    (mesh, pairs): (&Mesh<D>, &[Pair<D>]),
) -> Result<Vec<Seen<'a>>, Agreed> {
    let mut all = Vec::new();
    let seen = |name: String, values: Vec<Scalar>, on: &'a [String]| {
        let points = at_nodes(D, mesh.order());
        let seen = Seen { name, values, level: 0.0, points, on: On::Facets(Vec::new(), on) };
        Some(seen).filter(Seen::depends_on_position)
    };
    for (number, contact) in job.contact.iter().enumerate() {
        let gap = contact.normal.gap().filter(|_| contact.quadrature == Quadrature::Nodal).cloned();
        let gap = (format!("{}.gap", contact.normal.table()), gap);
        let friction = contact.friction.as_ref();
        let friction = friction.map(|law| (format!("{}.coefficient", law.table()), law.in_time()));
        for (key, value) in std::iter::once(gap).chain(friction) {
            let name = format!("contact.{number}.{key}");
            if let Some(mut seen) = seen(name, value.into_iter().collect(), &contact.on) {
                seen.on = match is_exchanged(pairs, number) {
                    true => On::Facets(facets(mesh, &contact.against), &contact.against),
                    false => {
                        let part = part_of(session, mesh, ("contact", &contact.on), contact.part.as_ref())?;
                        On::Facets(part, &contact.on)
                    }
                };
                all.push(seen);
            }
        }
    }
    for (number, support) in job.support.iter().enumerate() {
        for (key, values) in [("displacement", &support.displacement), ("velocity", &support.velocity)] {
            let name = format!("support.{number}.{key}");
            let is_moved =
                |facet: &u32| support.part.as_ref().is_none_or(|part| holds_at_nodes(mesh, *facet, part));
            if let Some(mut seen) = seen(name, values.iter().flatten().cloned().collect(), &support.on) {
                let mut moved = facets(mesh, &support.on);
                moved.retain(is_moved);
                seen.on = On::Facets(moved, &support.on);
                all.push(seen);
            }
        }
    }
    Ok(all)
}

impl Seen<'_> {
    fn depends_on_position(&self) -> bool {
        self.values.iter().any(Scalar::depends_on_position)
    }
}

/// The times in s at which these are looked at.
fn times<'a>(job: &Job, mut values: impl Iterator<Item = &'a Scalar>) -> impl Iterator<Item = f64> {
    let (last, end) = (if values.any(Scalar::depends_on_time) { TIMES } else { 0 }, job.time.end);
    (0..=last).map(move |at| end * f64::from(at) / f64::from(TIMES))
}

/// By how much what the cells or facets of this rank see of a quantity differs from its means over them, what they see, and its means, each
/// the sum of magnitudes times volumes or areas.
fn error_of<const D: usize, const S: usize>(
    job: &Job,
    body: &Body<D, S>,
    seen: &Seen<'_>,
    places: &[Point],
) -> [f64; 3] {
    let mut sums = [0.0; 3];
    for time in times(job, seen.values.iter()) {
        let mut add = |corners: &[Vector<D>], size: f64| {
            let mean = |points: &[Point]| {
                let mut mean = [0.0; COMPONENTS];
                for (shares, weight) in points {
                    let place = corners
                        .iter()
                        .zip(shares)
                        .fold([0.0; D], |at, (corner, share)| add_scaled(&at, *share, corner));
                    mean.iter_mut().zip(&seen.values).for_each(|(sum, value)| {
                        *sum += weight * (value.evaluate(time, &place) - seen.level)
                    });
                }
                mean
            };
            let (seen, whole) = (mean(&seen.points), mean(places));
            let parts = [norm(&add_scaled(&seen, -1.0, &whole)), norm(&seen), norm(&whole)];
            sums.iter_mut().zip(parts).for_each(|(sum, part)| *sum += size * part);
        };
        let mesh = &body.mesh;
        match &seen.on {
            On::Facets(facets, _) => {
                facets.iter().for_each(|facet| add(&mesh.facet_corners(*facet), area_of(mesh, *facet)));
            }
            On::Cells(material) => {
                let sees = |region: &String| {
                    material.is_none_or(|material| std::ptr::eq(job.material_of(region), material))
                };
                let sees: Vec<bool> = mesh.regions.iter().map(sees).collect();
                let cells = body.geometry.cells().enumerate();
                for (number, cell) in cells.filter(|(cell, _)| sees[usize::from(mesh.cell_regions[*cell])]) {
                    add(&mesh.corners(number)[..=D], cell.whole().volume);
                }
            }
        }
    }
    sums
}

/// Places with equal weights in a mean.
fn means(places: Vec<[f64; 4]>) -> Vec<Point> {
    let weight = 1.0 / places.len() as f64;
    places.into_iter().map(|place| (place, weight)).collect()
}

/// The nodes of a cell or facet with so many corners, of cells of this order, with the means of their shape functions.
fn at_nodes(corners: usize, order: usize) -> Vec<Point> {
    let at = |ends: [usize; 2]| -> [f64; 4] {
        std::array::from_fn(|corner| 0.5 * ends.iter().filter(|end| **end == corner).count() as f64)
    };
    let [of_corner, of_edge] = match (order, corners) {
        (1, _) => [1.0 / corners as f64, 0.0],
        (_, 2) => [1.0 / 6.0, 2.0 / 3.0],
        (_, 3) => [0.0, 1.0 / 3.0],
        _ => [-0.05, 0.2],
    };
    let edges = (0..corners).flat_map(|a| (a + 1..corners).map(move |b| [a, b]));
    let edges = edges.map(|ends| (at(ends), of_edge));
    let all = (0..corners).map(|a| (at([a, a]), of_corner)).chain(edges);
    all.filter(|(_, weight)| *weight != 0.0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_over_cells_and_facets_are_exact_of_linear_functions() {
        for (corners, order) in [(2, 1), (3, 1), (4, 1), (2, 2), (3, 2), (4, 2)] {
            let points = at_nodes(corners, order);
            for corner in 0..4 {
                let mean: f64 = points.iter().map(|(shares, weight)| weight * shares[corner]).sum();
                let centre = if corner < corners { 1.0 / corners as f64 } else { 0.0 };
                assert!((mean - centre).abs() < 1e-14, "{corner}: {mean}");
            }
            assert!((points.iter().map(|(_, weight)| weight).sum::<f64>() - 1.0).abs() < 1e-14);
        }
        // Simpson's rule.
        let square =
            at_nodes(2, 2).iter().map(|(shares, weight)| weight * shares[0] * shares[0]).sum::<f64>();
        assert!((square - 1.0 / 3.0).abs() < 1e-14, "{square}");
    }
}
