//! Pictures of a study: error against wall time and against unknowns times steps, errors over time, errors on the body, responses
//! over the keys of a sweep.
//!
//! Each mark is a run. A line joins those runs of a scheme that are more accurate than all cheaper runs of the scheme.

use super::{
    document::{Over, Quantity, Space, Values},
    measure::Place,
    plan::Plan,
    results::{NormResult, Results, RunResult},
    sweep::short,
};
use crate::{
    error::Result,
    io::output::{columns::RunTable, field_snapshot::Snapshot, quantity_name::TableQuantity, summary},
    job::Job,
    postprocessing::drawing::{
        body::{Coloured, DrawnBody},
        chart::{Axis, Chart, Look, Series},
        colour::{LINES, VIRIDIS},
        picture::Picture,
        scale::{extent, number, size},
    },
};

/// Ratio of the values of a swept key from which its axis is logarithmic.
const WIDE: f64 = 100.0;

/// Cost and error of a run.
type Point = [f64; 2];

/// The runs of a scheme.
#[derive(Debug, Clone, PartialEq)]
struct Curve {
    name: String,
    points: Vec<Point>,
}

/// All pictures of the results.
pub(super) fn all(plan: &Plan, results: &Results) -> Result<Vec<Picture>> {
    let mut pictures = Vec::new();
    let dimension = dimension(plan);
    for (at, norm) in results.norms.iter().enumerate() {
        let chosen = plan.study.norm.get(at);
        let of = chosen.map(|norm| (norm.of, norm.space));
        let is_summed = chosen.is_some_and(|norm| norm.over == Over::Sum);
        pictures.extend(costs(results, at, norm, &unit_of_norm(of, dimension, is_summed))?);
        pictures.extend(tolerances(results, at, norm)?);
        pictures.extend(over_time(plan, results, at, norm, &unit_of_norm(of, dimension, false))?);
        pictures.extend(on_the_body(plan, results, at, norm, of)?);
    }
    pictures.extend(responses(plan, results, dimension)?);
    Ok(pictures)
}

/// The dimension of the bodies, by which units are: 3 also of bodies of revolution; that of a mesh file is found in the fields of a run.
pub(super) fn dimension(plan: &Plan) -> usize {
    let of_run = |job: &Job| {
        let fields = || Snapshot::read(&job.output_folder().join("fields.vtkhdf")).ok();
        let of_mesh = job.dimension().filter(|_| !job.is_revolved());
        of_mesh.or(job.is_revolved().then_some(3)).or_else(|| Some(fields()?.dimension()))
    };
    plan.runs.iter().find_map(|run| of_run(&run.loaded.job)).unwrap_or(3)
}

/// Errors against cost, for a norm that is known for at least two runs.
fn costs(results: &Results, norm: usize, shown: &NormResult, unit: &str) -> Result<Vec<Picture>> {
    let seconds = |run: &RunResult| run.seconds.map(|seconds| seconds.computing);
    let work = |run: &RunResult| Some(run.counts.work() as f64);
    let by_time = curves(results, norm, seconds);
    if by_time.iter().map(|curve| curve.points.len()).sum::<usize>() < 2 {
        return Ok(Vec::new());
    }
    let time = Axis::new("computing time", "s");
    let unknowns = Axis::new("unknowns × steps", "");
    Ok(vec![
        cost((shown, unit), &by_time, time, "time")?,
        cost((shown, unit), &curves(results, norm, work), unknowns, "work")?,
    ])
}

fn cost((norm, unit): (&NormResult, &str), curves: &[Curve], axis: Axis, ending: &str) -> Result<Picture> {
    let quantity = format!("error {}", norm.name);
    let mut series = Vec::new();
    for (place, curve) in curves.iter().enumerate() {
        let front = front(&curve.points);
        let beaten = curve.points.iter().filter(|point| !front.contains(point)).copied().collect();
        series.push(Series::new(place, curve.name.clone(), Look::Dotted, front));
        series.push(Series { place, ..Series::new(place, "", Look::Dots, beaten) });
    }
    let chart = Chart {
        logarithmic: true,
        logarithmic_x: true,
        orders: &[1, 2],
        ..Chart::new(axis.clone(), Axis::new(quantity, unit), series)
    };
    let best = curves.iter().map(|curve| {
        let error = curve.points.iter().map(|point| point[1]).fold(f64::INFINITY, f64::min);
        format!("{} down to {}", curve.name, size(error))
    });
    let best = best.collect::<Vec<_>>().join(", ");
    Picture::of_chart(
        chart,
        &format!("work-precision-{}-{ending}", norm.name),
        format!("Chart of errors over {}, one line per scheme: {best}", axis.quantity),
        format!("{} over {}: {best}.", norm.meaning, axis.quantity),
    )
}

fn curves(results: &Results, norm: usize, cost: impl Fn(&RunResult) -> Option<f64>) -> Vec<Curve> {
    let mut curves: Vec<Curve> = Vec::new();
    for run in &results.runs {
        let Some((cost, error)) = cost(run).zip(error(run, norm)).filter(|(x, y)| *x > 0.0 && *y > 0.0)
        else {
            continue;
        };
        let name = run.line();
        match curves.iter_mut().find(|curve| curve.name == name) {
            Some(curve) => curve.points.push([cost, error]),
            None => curves.push(Curve { name, points: vec![[cost, error]] }),
        }
    }
    curves
}

fn error(run: &RunResult, norm: usize) -> Option<f64> {
    run.errors.get(norm)?.as_ref().map(|error| error.error)
}

/// The points whose error is smaller than that of all cheaper points, sorted by cost.
fn front(points: &[Point]) -> Vec<Point> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let mut best = f64::INFINITY;
    sorted.retain(|[_, error]| {
        let better = *error < best;
        best = best.min(*error);
        better
    });
    sorted
}

/// A chart of each response over each key of the sweep whose values are different numbers. Listed values of the other keys make a line
/// each, if there are not too many; random draws are dots.
fn responses(plan: &Plan, results: &Results, dimension: usize) -> Result<Vec<Picture>> {
    let is_drawn = |key: &String| matches!(plan.study.sweep.get(key), Some(Values::Draws(_)));
    let mut pictures = Vec::new();
    for (position, key) in results.sweep.iter().enumerate() {
        let others: Vec<usize> =
            (0..results.sweep.len()).filter(|at| *at != position && !is_drawn(&results.sweep[*at])).collect();
        let look = if results.sweep.iter().any(is_drawn) { Look::Dots } else { Look::Dotted };
        for (at, name) in results.response.iter().enumerate() {
            let mut curves: Vec<Curve> = Vec::new();
            for run in results.runs.iter().filter(|run| !run.sweep.is_empty()) {
                let point = run.sweep[position].number().zip(run.response.get(at).copied().flatten());
                let Some((x, y)) = point.filter(|(x, y)| x.is_finite() && y.is_finite()) else { continue };
                let value =
                    |other: &usize| format!("{} {}", short(&results.sweep[*other]), run.sweep[*other].text());
                let line = others.iter().map(value).collect::<Vec<_>>().join(", ");
                match curves.iter_mut().find(|curve| curve.name == line) {
                    Some(curve) => curve.points.push([x, y]),
                    None => curves.push(Curve { name: line, points: vec![[x, y]] }),
                }
            }
            pictures.extend(response(
                results,
                ([key, name], unit_of_response(name, dimension)),
                curves,
                look,
            )?);
        }
    }
    Ok(pictures)
}

/// A chart of a response over a key; `None` if there are no two different values of the key.
fn response(
    results: &Results,
    ([key, name], unit): ([&String; 2], &str),
    mut curves: Vec<Curve>,
    look: Look,
) -> Result<Option<Picture>> {
    let all = || curves.iter().flat_map(|curve| &curve.points);
    let range = |axis: usize| extent(all().map(|point| point[axis]));
    let (Some(keys), Some(values)) = (range(0), range(1)) else { return Ok(None) };
    if keys.0 == keys.1 {
        return Ok(None);
    }
    let look = if curves.len() > LINES.len() {
        let points = all().copied().collect();
        curves = vec![Curve { name: String::new(), points }];
        Look::Dots
    } else {
        look
    };
    let space = if unit.is_empty() { "" } else { " " };
    let words = format!(
        "{name} over {key}: from {} to {}{space}{unit} for {key} from {} to {}",
        size(values.0),
        size(values.1),
        size(keys.0),
        size(keys.1)
    );
    let series = curves.into_iter().enumerate().map(|(place, mut curve)| {
        curve.points.sort_by(|a, b| a[0].total_cmp(&b[0]));
        Series::new(place, curve.name, look, curve.points)
    });
    let [x, y] = [(key, ""), (name, unit)].map(|(quantity, unit)| Axis::new(quantity, unit));
    let is_wide = keys.0 > 0.0 && keys.1 >= WIDE * keys.0;
    let chart = Chart { logarithmic_x: is_wide, ..Chart::new(x, y, series.collect()) };
    let over = if results.sweep.len() > 1 { format!("-over-{}", short(key)) } else { String::new() };
    let picture = Picture::of_chart(
        chart,
        &format!("response-{name}{over}"),
        format!("Chart of {words}"),
        format!("{words}."),
    )?;
    Ok(Some(picture))
}

/// The unit of a response of bodies of this dimension; empty for numbers without one.
pub(super) fn unit_of_response(name: &str, dimension: usize) -> &'static str {
    // Without a window of time.
    let name = name.split(" (").next().unwrap_or(name);
    let (source, column) = (name.split('.').next(), name.rsplit('.').next().unwrap_or(name));
    if TableQuantity::parse(name).is_some_and(|quantity| matches!(quantity.side, Some("period" | "arrival")))
    {
        return "s";
    }
    if let Some(table) = source.and_then(RunTable::of) {
        return table.unit(column, dimension);
    }
    summary::unit(name, dimension)
}

/// The unit of a quantity whose norm is taken: that of the strain or the strain rate in V.
fn unit(of: Option<(Quantity, Space)>) -> &'static str {
    match of {
        None | Some((Quantity::Displacement, Space::V)) => "",
        Some((Quantity::Velocity, Space::V)) => "1/s",
        Some((of, _)) => of.field().units[0],
    }
}

/// The unit of a norm: the root of the integral of a square over a body of this dimension and, if it is summed over the steps, over
/// time.
fn unit_of_norm(of: Option<(Quantity, Space)>, dimension: usize, is_summed: bool) -> String {
    let Some((quantity, space)) = of else { return String::new() };
    let in_space = match (quantity, space, dimension) {
        (Quantity::Stress, _, 2) => "Pa m",
        (Quantity::Stress, ..) => "Pa m^1.5",
        (Quantity::Displacement, Space::V, 2) => "m",
        (Quantity::Displacement, Space::V, _) => "m^1.5",
        (Quantity::Displacement, _, 2) => "m²",
        (Quantity::Displacement, ..) => "m^2.5",
        (Quantity::Velocity, Space::V, 2) => "m/s",
        (Quantity::Velocity, Space::V, _) => "m^1.5/s",
        (Quantity::Velocity, _, 2) => "m²/s",
        (Quantity::Velocity, ..) => "m^2.5/s",
    };
    match (is_summed, in_space.strip_suffix("/s")) {
        (false, _) => in_space.into(),
        (true, None) => format!("{in_space} √s"),
        (true, Some(length)) => format!("{length}/√s"),
    }
}

/// The change by the solver's tolerance, relative to the error at the tightest tolerance.
fn tolerances(results: &Results, norm: usize, shown: &NormResult) -> Result<Option<Picture>> {
    let mut curves: Vec<Curve> = Vec::new();
    for row in &results.tolerances {
        let Some(run) = results.runs.iter().find(|run| run.name == row.run) else { continue };
        let share = row.changes.get(norm).and_then(|change| change.as_ref()?.share_of_error);
        let cells: Vec<String> = run.cells.iter().map(u32::to_string).collect();
        let steps = run.adaptive.map_or(format!("k = {} s", size(run.step)), |_| "adaptive".into());
        let name = format!("{}, {}, {steps}", run.scheme, cells.join(" × "));
        let point = [row.tolerance, share.unwrap_or(0.0)];
        match curves.iter_mut().find(|curve| curve.name == name) {
            Some(curve) => curve.points.push(point),
            None => curves.push(Curve { name, points: vec![point] }),
        }
    }
    if curves.is_empty() {
        return Ok(None);
    }
    let lines = curves.iter().take(LINES.len()).enumerate();
    let series =
        lines.map(|(place, c)| Series::new(place, c.name.clone(), Look::Dotted, c.points.clone())).collect();
    let tolerance = Axis::new("tolerance of the solver", "");
    let chart = Chart {
        logarithmic: true,
        logarithmic_x: true,
        levels: vec![(1.0, "as large as the error of mesh and steps".into())],
        ..Chart::new(tolerance, Axis::new("change over the error", ""), series)
    };
    let most = curves.iter().map(|curve| {
        let harmless = curve.points.iter().filter(|point| point[1] <= 0.1).map(|point| point[0]);
        format!("{} up to {}", curve.name, size(harmless.fold(0.0, f64::max)))
    });
    let most = most.collect::<Vec<_>>().join("; ");
    let picture = Picture::of_chart(
        chart,
        &format!("solver-tolerance-{}", shown.name),
        format!("Chart of the effect of the solver's tolerance; below a tenth of the error: {most}"),
        format!(
            "Effect of the solver's tolerance, {}. Tolerances whose effect is below a tenth of the error: {most}.",
            shown.meaning
        ),
    )?;
    Ok(Some(picture))
}

/// Errors over time of the runs listed in the study, or of the most accurate run of each scheme.
fn over_time(
    plan: &Plan,
    results: &Results,
    norm: usize,
    shown: &NormResult,
    unit: &str,
) -> Result<Option<Picture>> {
    let named = &plan.study.pictures.over_time;
    let mut chosen: Vec<&RunResult> = Vec::new();
    let known = results.runs.iter().filter(|run| run.places.get(norm).is_some_and(|p| p.over_time.len() > 1));
    for run in known {
        let rival = chosen.iter().position(|other| other.line() == run.line());
        match rival.filter(|_| named.is_empty()) {
            _ if !named.is_empty() && !named.contains(&run.name) => {}
            Some(at) if error(run, norm) < error(chosen[at], norm) => chosen[at] = run,
            Some(_) => {}
            None => chosen.push(run),
        }
    }
    if chosen.is_empty() {
        return Ok(None);
    }
    let series = chosen.iter().take(LINES.len()).enumerate().map(|(place, run)| {
        Series::new(place, run.name.clone(), Look::Line, run.places[norm].over_time.clone())
    });
    let time = Axis::time();
    let shown_error = Axis::new("error", unit);
    let chart =
        Chart { logarithmic: true, logarithmic_x: true, ..Chart::new(time, shown_error, series.collect()) };
    let worst = chosen.iter().map(|run| {
        format!("{} ({} steps) largest at t = {} s", run.name, run.counts.steps, size(run.places[norm].worst))
    });
    let worst = worst.collect::<Vec<_>>().join("; ");
    let picture = Picture::of_chart(
        chart,
        &format!("error-over-time-{}", shown.name),
        format!("Chart of errors over time: {worst}"),
        format!("Error over time, {}: {worst}.", shown.meaning),
    )?;
    Ok(Some(picture))
}

/// Errors of cells on the body, for the runs listed in the study.
fn on_the_body(
    plan: &Plan,
    results: &Results,
    norm: usize,
    shown: &NormResult,
    of: Option<(Quantity, Space)>,
) -> Result<Vec<Picture>> {
    let mut pictures = Vec::new();
    for (run, planned) in results.runs.iter().zip(&plan.runs) {
        let Some(Place { worst, cells, .. }) = run.places.get(norm).filter(|place| !place.cells.is_empty())
        else {
            continue;
        };
        let file = planned.loaded.job.output_folder().join("fields.vtkhdf");
        let snapshot = Snapshot { time: *worst, ..Snapshot::read(&file)?.without_fields() };
        let look = Coloured {
            name: &format!("error-in-space-{}-{}", shown.name, run.name),
            quantity: "error",
            unit: unit(of),
            shades: VIRIDIS,
        };
        let mut picture = DrawnBody::new(&snapshot).errors(look, cells)?;
        picture.caption = format!(
            "Error of {} in space at t = {} s, root mean square in each cell, {}. {}",
            run.name,
            number(*worst),
            shown.meaning,
            picture.caption
        );
        pictures.push(picture);
    }
    Ok(pictures)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The dimensions by hand: the root of the integral over an area is a length, over a volume a length to the power of 1.5.
    #[test]
    fn norms_have_the_unit_of_the_root_of_an_integral() {
        let unit = |quantity, space, dimension, is_summed| {
            unit_of_norm(Some((quantity, space)), dimension, is_summed)
        };
        assert_eq!(unit(Quantity::Stress, Space::Q, 2, false), "Pa m");
        assert_eq!(unit(Quantity::Stress, Space::Q, 3, true), "Pa m^1.5 √s");
        assert_eq!(unit(Quantity::Displacement, Space::V, 2, false), "m");
        assert_eq!(unit(Quantity::Displacement, Space::H, 2, false), "m²");
        assert_eq!(unit(Quantity::Velocity, Space::H, 3, false), "m^2.5/s");
        assert_eq!(unit(Quantity::Velocity, Space::V, 2, true), "m/√s");
    }

    #[test]
    fn the_line_joins_runs_that_no_cheaper_one_beats() {
        let points = [[4.0, 0.1], [1.0, 0.5], [2.0, 0.6], [3.0, 0.2], [3.0, 0.3]];
        assert_eq!(front(&points), [[1.0, 0.5], [3.0, 0.2], [4.0, 0.1]]);
    }

    #[test]
    fn a_picture_names_schemes_and_axes() {
        let curves = [
            Curve { name: "lagged_euler".into(), points: vec![[0.02, 0.3], [0.7, 0.04]] },
            Curve { name: "bdf2".into(), points: vec![[0.03, 0.1]] },
        ];
        let norm = NormResult { name: "v_max".into(), meaning: "max ||v||_H".into(), is_published: false };
        let picture =
            cost((&norm, "m/s"), &curves, Axis::new("computing time", "s"), "time").expect("picture");
        for words in ["<svg", "lagged_euler", "bdf2", "computing time / s", "10⁻²"] {
            assert!(picture.svg.contains(words), "{words}");
        }
        assert!(picture.caption.contains("max ||v||_H") && picture.caption.contains("bdf2 down to 0.1"));
        assert_eq!(picture.name, "work-precision-v_max-time");
    }
}
