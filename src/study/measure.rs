//! Errors of a finished run: norms over time, and values at points.

use super::{
    difference::{Against, Pair, Squares},
    document::{Norm, Over, ProbeError, Quantity, Space},
    exact::ExactFields,
    stored::StoredFields,
};
use crate::{
    error::{Error, Result},
    session::Session,
};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Share of the body that two meshes may not have in common.
const UNCOVERED: f64 = 0.01;
/// Times nearer than this share are the same.
const SAME_TIME: f64 = 1e-9;

/// An error and the same norm of the reference.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// Norm of run minus reference.
    pub error: f64,
    /// Norm of the reference.
    pub size: f64,
}

/// What a run is held against, by where it is found.
#[derive(Clone, Copy)]
pub enum Target<'a> {
    /// The folder of another run; whether times between its steps are allowed.
    Run(&'a Path, bool),
    /// Expressions.
    Exact(&'a ExactFields),
}

/// Errors of the run in `folder` in some norms, and what the reader should know about them. Collective.
pub fn errors<const D: usize>(
    session: &Session,
    folder: &Path,
    target: Target,
    norms: &[Norm],
) -> Result<(Vec<Measured>, Vec<String>)> {
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
    let mut notes = Vec::new();
    if pair.uncovered.abs() > UNCOVERED {
        return Err(Error::Failed(format!(
            "its mesh covers only {:.2} % of the reference's body: they are not meshes of the same body",
            100.0 * (1.0 - pair.uncovered)
        )));
    }
    if pair.uncovered.abs() > 1e-9 {
        notes.push(format!(
            "its mesh covers {:.6} % of the reference's body; errors are of what both cover",
            100.0 * (1.0 - pair.uncovered)
        ));
    }
    let mut kinds: Vec<(Quantity, Space)> = Vec::new();
    for norm in norms {
        if !kinds.contains(&(norm.of, norm.space)) {
            kinds.push((norm.of, norm.space));
        }
    }
    let last = run.times.len().saturating_sub(1);
    let mut measured = vec![Measured { error: 0.0, size: 0.0 }; norms.len()];
    for step in 0..run.times.len() {
        if run.times[step] <= 0.0 {
            continue;
        }
        let length = run.times[step] - if step > 0 { run.times[step - 1] } else { 0.0 };
        for &(of, space) in &kinds {
            let of_kind = |norm: &Norm| (norm.of, norm.space) == (of, space);
            if step == last || norms.iter().any(|norm| of_kind(norm) && norm.over != Over::End) {
                let squares = pair.squares(session, of, space, step)?;
                let sums = norms.iter().zip(&mut measured).filter(|(norm, _)| of_kind(norm));
                add(sums, squares, length, step == last);
            }
        }
    }
    for value in &mut measured {
        *value = Measured { error: value.error.sqrt(), size: value.size.sqrt() };
    }
    Ok((measured, notes))
}

fn add<'a>(
    norms: impl Iterator<Item = (&'a Norm, &'a mut Measured)>,
    squares: Squares,
    length: f64,
    is_last: bool,
) {
    for (norm, sum) in norms {
        match norm.over {
            Over::Max => {
                sum.error = sum.error.max(squares.error);
                sum.size = sum.size.max(squares.size);
            }
            Over::Sum => {
                sum.error += length * squares.error;
                sum.size += length * squares.size;
            }
            Over::End if is_last => *sum = Measured { error: squares.error, size: squares.size },
            Over::End => {}
        }
    }
}

fn contained<const D: usize>(times: &[f64], reference: &StoredFields<D>) -> Result<()> {
    match times.iter().find(|time| !reference.has_time(**time)) {
        None => Ok(()),
        Some(time) => Err(Error::Failed(format!("the reference has no step at t = {time} s"))),
    }
}

/// The error of one value at a probe; `point` is where it is. In each process by itself.
pub fn probe_error(folder: &Path, target: Target, probe: &ProbeError, point: &[f64]) -> Result<Measured> {
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
            Over::Max => sum = Measured { error: sum.error.max(error), size: sum.size.max(size) },
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

/// The value at a time, between two rows on the straight line.
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
    let path = folder.join("probes.csv");
    let text = std::fs::read_to_string(&path).map_err(|error| Error::unreadable(&path, error))?;
    let mut lines = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let header = lines.next().unwrap_or_default();
    let place = |name: &str| {
        let found = header.iter().position(|column| *column == name);
        found.ok_or_else(|| Error::Failed(format!("{}: no column `{name}`", path.display())))
    };
    let (time, name, value) = (place("time")?, place("probe")?, place(&probe.value)?);
    let number = |row: &[&str], at: usize| row.get(at).and_then(|text| text.parse::<f64>().ok());
    let rows = lines.filter(|row| row.get(name).is_some_and(|word| *word == probe.name));
    Ok(rows.filter_map(|row| Some((number(&row, time)?, number(&row, value)?))).collect())
}
