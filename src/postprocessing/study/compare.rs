//! Compares runs with the reference and with each other.

use super::{
    Ran,
    convergence::error_of,
    document::Norm,
    measure::{Errors, Measured, Target, errors, probe_error},
    plan::{Plan, Planned, PlannedReference},
    record::Record,
    results::{Change, ErrorResult, Results, RunResult, ToleranceResult},
};
use crate::{
    error::{Error, Result},
    parallel::session::Session,
};
use std::path::Path;

/// A run and what its fields are compared with.
pub(super) struct Compared<'a> {
    /// 2 or 3.
    pub dimension: usize,
    /// The folder of the run.
    pub folder: &'a Path,
    /// What it is compared with.
    pub target: Target<'a>,
}

impl<'a> Compared<'a> {
    /// A run of the study and its reference; nothing in a study without one.
    pub(super) fn with_reference(
        plan: &'a Plan,
        planned: &'a Planned,
        record: &Record,
        reference: Option<&Ran>,
    ) -> Result<Option<Self>> {
        let target = match (&plan.reference, reference) {
            (None, _) => return Ok(None),
            (Some(PlannedReference::Exact(exact)), _) => Target::Exact(exact),
            (Some(PlannedReference::Run(other)), Some(ran)) if ran.record.is_complete() => {
                let between = planned.adaptive.or(other.adaptive).is_some();
                Target::Run(other.loaded.job.output_folder(), between)
            }
            _ => {
                return Err(Error::Failed(
                    "the reference run failed: there is nothing to compare with".into(),
                ));
            }
        };
        let folder = planned.loaded.job.output_folder();
        Ok(Some(Self { dimension: record.dimension, folder, target }))
    }

    /// Errors in norms. Collective.
    pub(super) fn errors(&self, session: &Session, norms: &[Norm]) -> Result<Errors> {
        if norms.is_empty() {
            return Ok(Errors::default());
        }
        match self.dimension {
            2 => errors::<2>(session, self.folder, self.target, norms),
            _ => errors::<3>(session, self.folder, self.target, norms),
        }
    }
}

/// Adds the errors of a run in all norms and at all probes. Collective.
pub(super) fn add_errors(
    session: &Session,
    plan: &Plan,
    compared: &Compared,
    run: &mut RunResult,
) -> Result<()> {
    let found = compared.errors(session, &plan.study.norm)?;
    run.errors = found.measured.into_iter().map(|m| Some(ErrorResult::new(m))).collect();
    for (error, place) in run.errors.iter_mut().flatten().zip(&found.places) {
        error.worst_time = Some(place.worst);
    }
    (run.notes, run.places) = (found.notes, found.places);
    if !plan.study.pictures.in_space.contains(&run.name) {
        run.places.iter_mut().for_each(|place| place.cells = Vec::new());
    }
    for probe in &plan.study.probe {
        let place = plan.base.job.output.probe.iter().find(|p| p.name == probe.name);
        let point = place.map_or(&[][..], |p| &p.point);
        let measured = session.agree(probe_error(compared.folder, compared.target, probe, point))?;
        run.errors.push(Some(ErrorResult::new(measured)));
    }
    Ok(())
}

/// Compares every run with the one that differs from it by the tightest tolerance only. Collective.
pub(super) fn add_tolerances(
    session: &Session,
    plan: &Plan,
    ran: &[Ran],
    results: &mut Results,
) -> Result<()> {
    let same = |a: &Planned, b: &Planned| {
        (&a.cells, a.step, a.adaptive, a.scheme, &a.set) == (&b.cells, b.step, b.adaptive, b.scheme, &b.set)
    };
    for (at, planned) in plan.runs.iter().enumerate() {
        let others = plan.runs.iter().enumerate().filter(|(other, run)| {
            same(run, planned) && run.tolerance < planned.tolerance && ran[*other].record.is_complete()
        });
        let Some((best, tightest)) = others.min_by(|a, b| a.1.tolerance.total_cmp(&b.1.tolerance)) else {
            continue;
        };
        if !ran[at].record.is_complete() {
            continue;
        }
        let [mine, theirs] = [planned, tightest].map(|planned| planned.loaded.job.output_folder());
        let target = Target::Run(theirs, planned.adaptive.is_some());
        let compared = Compared { dimension: ran[at].record.dimension, folder: mine, target };
        let measured = compared.errors(session, &plan.study.norm)?.measured;
        let change = |(norm, m): (usize, &Measured)| {
            let share = error_of(results, best, norm).map(|error| m.error / error).filter(|s| s.is_finite());
            Some(Change { difference: m.error, share_of_error: share })
        };
        results.tolerances.push(ToleranceResult {
            run: planned.name.clone(),
            tolerance: planned.tolerance,
            tightest: tightest.name.clone(),
            seconds: results.runs[at].seconds.map(|s| s.computing),
            changes: measured.iter().enumerate().map(change).collect(),
        });
    }
    Ok(())
}
