//! Errors of a finished run: norms over time, and values at points.

use super::{
    difference::{Against, Pair},
    document::{Norm, Over, ProbeError, Quantity, Space},
    exact::ExactFields,
    squares::Squares,
    stored::StoredFields,
};
use crate::{
    error::{Error, Result},
    io::output::{columns::PROBES, csv::records},
    linear_algebra::tensor::larger,
    parallel::session::Session,
};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Accepted fraction of the body that only one of two meshes covers.
const UNCOVERED: f64 = 0.01;
/// Times whose relative difference is smaller are equal.
const SAME_TIME: f64 = 1e-9;

/// The norm of an error and that of the reference.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// Norm of the difference of run and reference.
    pub error: f64,
    /// Norm of the reference.
    pub size: f64,
}

/// The solution with which a run is compared.
#[derive(Clone, Copy)]
pub(super) enum Target<'a> {
    /// The folder of another run, and whether times between its steps are allowed.
    Run(&'a Path, bool),
    /// Expressions.
    Exact(&'a ExactFields),
}

/// Errors of a run.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Errors {
    /// One for each norm.
    pub measured: Vec<Measured>,
    /// The distribution of each error in time and space.
    pub places: Vec<Place>,
    /// Notes for the reader.
    pub notes: Vec<String>,
}

/// The distribution of an error in time and space.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Place {
    /// Times in s with the norm in space; only the last time for a norm at the end.
    pub over_time: Vec<[f64; 2]>,
    /// The time in s of the largest norm.
    pub worst: f64,
    /// The root mean square of the error in each cell at that time.
    pub cells: Vec<f64>,
}

/// The quantity of a norm.
#[derive(Clone, Copy, PartialEq)]
struct Kind {
    of: Quantity,
    space: Space,
    /// Whether the norm is that at the end only.
    at_end: bool,
}

/// Errors of the run in `folder` in some norms. Collective.
pub(super) fn errors<const D: usize>(
    session: &Session,
    folder: &Path,
    target: Target,
    norms: &[Norm],
) -> Result<Errors> {
    let run = session.agree(StoredFields::<D>::open(folder))?;
    let reference = match target {
        Target::Run(path, _) => Some(session.agree(StoredFields::<D>::open(path))?),
        Target::Exact(_) => None,
    };
    let against = match (&reference, target) {
        (Some(fields), Target::Run(_, between)) => {
            if !between {
                session.agree(contained(&run.times, fields))?;
            }
            Against::Run(fields)
        }
        (_, Target::Exact(exact)) => Against::Exact(exact),
        (None, Target::Run(..)) => return Err(Error::Internal("no reference to compare with".into())),
    };
    let pair = Pair::new(session, &run, against);
    let mut found = Errors { notes: covered(pair.uncovered)?, ..Errors::default() };
    let is_quadratic =
        [Some(&run), reference.as_ref()].into_iter().flatten().any(|fields| fields.mesh.order() == 2);
    if is_quadratic && norms.iter().any(|norm| norm.of == Quantity::Stress) {
        let words = "for quadratic cells the mean stress of each cell is compared, not the stress at its integration points: the \
                     error is larger, and its order of convergence is lower by one";
        found.notes.push(words.into());
    }
    let mut known: Vec<(Kind, (Vec<Squares>, Place))> = Vec::new();
    for norm in norms {
        let kind = Kind { of: norm.of, space: norm.space, at_end: norm.over == Over::End };
        if !known.iter().any(|(other, _)| *other == kind) {
            known.push((kind, over_time(session, &pair, &run, kind)?));
        }
        let Some((_, (squares, place))) = known.iter().find(|(other, _)| *other == kind) else { continue };
        found.measured.push(measured(norm.over, squares, &place.over_time));
        found.places.push(place.clone());
    }
    Ok(found)
}

/// Adds a note on a mesh that covers only this fraction of the reference's body; refused if the difference is large.
fn covered(uncovered: f64) -> Result<Vec<String>> {
    let covers = 100.0 * (1.0 - uncovered);
    if uncovered.abs() > UNCOVERED {
        return Err(Error::Failed(format!(
            "its mesh covers only {covers:.2} % of the reference's body: they are not meshes of the same body"
        )));
    }
    let words = || {
        format!(
            "its mesh covers {covers:.6} % of the reference's body; errors are measured on the part that both cover"
        )
    };
    Ok((uncovered.abs() > 1e-9).then(words).into_iter().collect())
}

/// The squares at the steps after time 0, or at the last one only, and their distribution at the time of the largest one.
/// Collective.
fn over_time<const D: usize>(
    session: &Session,
    pair: &Pair<D>,
    run: &StoredFields<D>,
    Kind { of, space, at_end }: Kind,
) -> Result<(Vec<Squares>, Place)> {
    let last = run.times.len().saturating_sub(1);
    let steps = if at_end { last..last + 1 } else { 0..last + 1 };
    let (mut all, mut place, mut worst) = (Vec::new(), Place::default(), None);
    for step in steps.filter(|step| run.times.get(*step).is_some_and(|time| *time > 0.0)) {
        let squares = pair.squares(session, of, space, step)?;
        if worst.is_none_or(|(_, largest)| squares.error > largest) {
            worst = Some((step, squares.error));
        }
        place.over_time.push([run.times[step], squares.error.sqrt()]);
        all.push(squares);
    }
    if let Some((step, _)) = worst {
        place.worst = run.times[step];
        let squares = pair.squares_of_cells(session, of, space, step)?;
        let cells = squares.iter().zip(&run.mesh.geometry);
        place.cells = cells.map(|(square, cell)| (square / cell.volume).sqrt()).collect();
    }
    Ok((all, place))
}

/// The norm over time of these squares.
fn measured(over: Over, all: &[Squares], times: &[[f64; 2]]) -> Measured {
    let mut sum = Squares::default();
    let mut before = 0.0;
    for (squares, [time, _]) in all.iter().zip(times) {
        match over {
            Over::Max => {
                sum =
                    Squares { error: larger(sum.error, squares.error), size: larger(sum.size, squares.size) }
            }
            Over::Sum => sum.add(Squares {
                error: (time - before) * squares.error,
                size: (time - before) * squares.size,
            }),
            Over::End => sum = *squares,
        }
        before = *time;
    }
    Measured { error: sum.error.sqrt(), size: sum.size.sqrt() }
}

fn contained<const D: usize>(times: &[f64], reference: &StoredFields<D>) -> Result<()> {
    match times.iter().find(|time| !reference.has_time(**time)) {
        None => Ok(()),
        Some(time) => Err(Error::Failed(format!("the reference has no step at t = {time} s"))),
    }
}

/// The error of a value at the probe at `point`. Not collective.
pub(super) fn probe_error(
    folder: &Path,
    target: Target,
    probe: &ProbeError,
    point: &[f64],
) -> Result<Measured> {
    let mine = column(folder, probe)?;
    let theirs = match target {
        Target::Run(path, _) => column(path, probe)?,
        Target::Exact(exact) => mine
            .iter()
            .map(|(time, _)| (*time, exact.column(&probe.value, *time, point).unwrap_or(f64::NAN)))
            .collect(),
    };
    let mut sum = Measured { error: 0.0, size: 0.0 };
    let mut before = 0.0;
    for (at, (time, value)) in mine.iter().enumerate() {
        let Some(reference) = value_at(&theirs, *time) else {
            return Err(Error::Failed(format!("the reference's probes.csv does not reach t = {time} s")));
        };
        let (error, size) = ((value - reference).abs(), reference.abs());
        match probe.over {
            Over::Max => sum = Measured { error: larger(sum.error, error), size: larger(sum.size, size) },
            Over::Sum => {
                sum.error += (time - before) * error * error;
                sum.size += (time - before) * size * size;
            }
            Over::End if at + 1 == mine.len() => sum = Measured { error, size },
            Over::End => {}
        }
        before = *time;
    }
    if probe.over == Over::Sum {
        sum = Measured { error: sum.error.sqrt(), size: sum.size.sqrt() };
    }
    Ok(sum)
}

/// The value at a time, interpolated linearly between two rows.
fn value_at(rows: &[(f64, f64)], time: f64) -> Option<f64> {
    let behind = rows.partition_point(|(t, _)| *t < time * (1.0 - SAME_TIME));
    let (next, value) = *rows.get(behind)?;
    let (before, earlier) = *behind.checked_sub(1).and_then(|at| rows.get(at)).unwrap_or(&(0.0, 0.0));
    if next <= time * (1.0 + SAME_TIME) || next <= before {
        return Some(value);
    }
    Some(earlier + (value - earlier) * (time - before) / (next - before))
}

/// Time and value in the rows of a probe.
fn column(folder: &Path, probe: &ProbeError) -> Result<Vec<(f64, f64)>> {
    let path = folder.join(PROBES.file);
    let bytes = std::fs::read(&path).map_err(|error| Error::unreadable(&path, error))?;
    let mut rows = records(&bytes).map(|record| record.entries);
    let header = rows.next().unwrap_or_default();
    let place = |name: &str| {
        let found = header.iter().position(|column| *column == name);
        found.ok_or_else(|| Error::Failed(format!("{}: no column `{name}`", path.display())))
    };
    let (time, name, value) = (place("time")?, place("probe")?, place(&probe.value)?);
    let number = |row: &[String], at: usize| row.get(at).and_then(|text| text.parse::<f64>().ok());
    let rows = rows.filter(|row| row.get(name).is_some_and(|word| *word == probe.name));
    Ok(rows.filter_map(|row| Some((number(&row, time)?, number(&row, value)?))).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_at_a_probe_are_measured_over_time_beside_the_size_of_the_reference() {
        let folders = [(); 2].map(|()| tempfile::tempdir().unwrap());
        for (folder, values) in folders.iter().zip([[1.0, 4.0], [2.0, 6.0]]) {
            let rows =
                format!("step,time,probe,velocity_y\n1,0.5,tip,{}\n2,0.75,tip,{}\n", values[0], values[1]);
            std::fs::write(folder.path().join("probes.csv"), rows).unwrap();
        }
        let measured = |over| {
            let probe = ProbeError { name: "tip".into(), value: "velocity_y".into(), over };
            let target = Target::Run(folders[1].path(), false);
            probe_error(folders[0].path(), target, &probe, &[]).map(|m| [m.error, m.size]).unwrap()
        };
        assert_eq!(measured(Over::Max), [2.0, 6.0]);
        assert_eq!(measured(Over::End), [2.0, 6.0]);
        // 0.5 s and 0.25 s: 0.5 x 1 + 0.25 x 4 and 0.5 x 4 + 0.25 x 36.
        assert_eq!(measured(Over::Sum), [1.5f64.sqrt(), 11f64.sqrt()]);
    }
}
