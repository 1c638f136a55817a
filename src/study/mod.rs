//! Accuracy against cost: a job on several meshes, with several steps and schemes, held against a reference.
//!
//! Every run is an ordinary run in a folder of its own; a study that is started again finds those that are finished.
//! Each rank reads the fields of a run and of the reference whole and integrates over its share of the cells.

mod ablate;
mod check;
mod difference;
mod document;
mod exact;
mod execute;
mod measure;
mod orders;
mod overlap;
mod plan;
mod plot;
mod record;
mod results;
mod stored;
mod table;
mod write;

pub use plan::Plan;
pub use results::Results;

use crate::{
    error::{Error, Exit, Result},
    job::describe_kind,
    run::VERSION,
    session::Session,
};
use document::{Norm, Take};
use execute::{Outcome, execute};
use measure::{Measured, Target, errors, probe_error};
use orders::{Refinement, Size, expected, observed, refinements};
use plan::{Planned, PlannedReference};
use record::{Record, Seconds};
use results::{Change, ErrorResult, Order, RunResult, ToleranceResult};
use std::{io::Write, path::Path};

/// The reference of the study's keys: of all tables, or of one table or key.
pub fn describe(table: Option<&str>) -> Result<String> {
    describe_kind(document::kind(), table)
}

/// The JSON Schema (draft 2020-12) of a study.
pub fn describe_json() -> String {
    format!("{:#}", document::kind().schema)
}

/// Runs the study and writes its tables; with `with_ablation` the base job is run without each of its effects as well.
/// Collective.
pub fn study(session: &Session, plan: &Plan, with_ablation: bool) -> Result<Exit> {
    let say = |words: &str| {
        if session.is_first() {
            let _ = writeln!(std::io::stdout(), "{words}");
        }
    };
    let repetitions = plan.study.timing.repetitions as usize;
    let mut reference = None;
    if let Some(PlannedReference::Run(planned)) = &plan.reference {
        match announced(session, planned, 1, "reference", &say)? {
            Some(ran) => reference = Some(ran),
            None => return stopped(&say),
        }
    }
    let mut ran = Vec::new();
    for (index, planned) in plan.runs.iter().enumerate() {
        let count = format!("{}/{}", index + 1, plan.runs.len());
        match announced(session, planned, repetitions, &count, &say)? {
            Some(one) => ran.push(one),
            None => return stopped(&say),
        }
    }
    let mut results = assembled(session, plan, reference.as_ref(), &ran)?;
    if with_ablation {
        match ablate::ablate(session, plan, &say)? {
            Some(ablation) => results.ablation = Some(ablation),
            None => return stopped(&say),
        }
    }
    let written = if session.is_first() { write::all(&plan.folder, &results) } else { Ok(()) };
    session.agree(written)?;
    let tables = table::all(&results).iter().map(|t| t.text()).collect::<Vec<_>>().join("\n");
    say(&format!("\n{tables}\nfiles      {}", plan.folder.display()));
    let failed = results.runs.iter().chain(&results.reference).filter(|run| run.error.is_some()).count();
    if failed > 0 {
        say(&format!("{failed} of {} runs failed or could not be compared; see above", plan.runs.len()));
        return Ok(Exit::Failed);
    }
    Ok(Exit::Done)
}

fn stopped(say: &dyn Fn(&str)) -> Result<Exit> {
    say("stopped on request; the same command goes on with the runs that are not finished");
    Ok(Exit::Stopped)
}

/// What came of a run, and whether an earlier study left it.
struct Ran {
    record: Record,
    found: bool,
}

fn announced(
    session: &Session,
    planned: &Planned,
    repetitions: usize,
    count: &str,
    say: &dyn Fn(&str),
) -> Result<Option<Ran>> {
    let Outcome::Ran { record, found } = execute(session, planned, repetitions)? else { return Ok(None) };
    let words = match &record.error {
        Some(error) => format!("failed: {error}"),
        None if found => "found finished".into(),
        None => format!("{:.2} s", record.seconds.iter().map(|s| s.total).sum::<f64>()),
    };
    say(&format!("run {count:<9} {:<40} {words}", planned.name));
    Ok(Some(Ran { record, found }))
}

/// The repetition that counts.
fn seconds_of(record: &Record, take: Take) -> Option<Seconds> {
    let mut all = record.seconds.clone();
    all.sort_by(|a, b| a.computing.total_cmp(&b.computing));
    match take {
        Take::Best => all.first().copied(),
        Take::Median => all.get(all.len() / 2).copied(),
    }
}

fn assembled(session: &Session, plan: &Plan, reference: Option<&Ran>, ran: &[Ran]) -> Result<Results> {
    let study = &plan.study;
    let take = study.timing.take;
    let mut results = Results {
        version: VERSION,
        ranks: session.ranks(),
        title: study.about.title.clone().unwrap_or_else(|| plan.name.clone()),
        source: study.about.reference.clone(),
        notes: study.about.notes.clone(),
        reference: None,
        norms: table::norms(study),
        runs: plan.runs.iter().zip(ran).map(|(planned, ran)| result(planned, ran, take)).collect(),
        tolerances: Vec::new(),
        ablation: None,
    };
    if let (Some(PlannedReference::Run(planned)), Some(ran)) = (&plan.reference, reference) {
        results.reference = Some(result(planned, ran, take));
    }
    for (at, ran) in ran.iter().enumerate().filter(|(_, ran)| ran.record.is_complete()) {
        let run = &mut results.runs[at];
        run.errors = vec![None; results.norms.len()];
        match run_errors(session, plan, &plan.runs[at], &ran.record, reference) {
            Ok((measured, notes)) => {
                run.errors = measured.into_iter().map(|m| Some(ErrorResult::new(m))).collect();
                run.notes = notes;
            }
            Err(error) => run.error = Some(error.to_string()),
        }
        run.errors.resize(results.norms.len(), None);
    }
    add_orders(plan, ran, &mut results);
    add_published(plan, ran, &mut results);
    add_tolerances(session, plan, ran, &mut results)?;
    Ok(results)
}

fn result(planned: &Planned, ran: &Ran, take: Take) -> RunResult {
    let record = &ran.record;
    RunResult {
        name: planned.name.clone(),
        scheme: planned.scheme.clone(),
        cells: planned.cells.clone(),
        step: planned.step,
        tolerance: planned.tolerance,
        set: planned.set.clone(),
        status: record.status.clone(),
        error: record.error.clone(),
        notes: Vec::new(),
        found: ran.found,
        unknowns: record.unknowns,
        steps: record.steps,
        newton_iterations: record.newton_iterations,
        linear_iterations: record.linear_iterations,
        seconds: seconds_of(record, take).filter(|_| record.is_complete()),
        repetitions: record.seconds.clone(),
        errors: Vec::new(),
    }
}

/// Errors of a run in all norms and at all probes. Collective.
fn run_errors(
    session: &Session,
    plan: &Plan,
    planned: &Planned,
    record: &Record,
    reference: Option<&Ran>,
) -> Result<(Vec<Measured>, Vec<String>)> {
    let target = match (&plan.reference, reference) {
        (None, _) => return Ok((Vec::new(), Vec::new())),
        (Some(PlannedReference::Exact(exact)), _) => Target::Exact(exact),
        (Some(PlannedReference::Run(other)), Some(ran)) if ran.record.is_complete() => {
            Target::Run(other.loaded.job.output_folder(), planned.adaptive || other.adaptive)
        }
        _ => return Err(Error::Failed("the reference run failed: there is nothing to compare with".into())),
    };
    let folder = planned.loaded.job.output_folder();
    let norms = &plan.study.norm;
    let (mut all, notes) = in_dimension(session, record.dimension, folder, target, norms)?;
    for probe in &plan.study.probe {
        let place = plan.base.job.output.probe.iter().find(|p| p.name == probe.name);
        let point = place.map_or(&[][..], |p| &p.point);
        all.push(session.agree(probe_error(folder, target, probe, point))?);
    }
    Ok((all, notes))
}

fn in_dimension(
    session: &Session,
    dimension: usize,
    folder: &Path,
    target: Target,
    norms: &[Norm],
) -> Result<(Vec<Measured>, Vec<String>)> {
    if norms.is_empty() {
        return Ok((Vec::new(), Vec::new()));
    }
    match dimension {
        2 => errors::<2>(session, folder, target, norms),
        _ => errors::<3>(session, folder, target, norms),
    }
}

fn sizes(plan: &Plan, ran: &[Ran]) -> Vec<Option<Size>> {
    let of = |(planned, ran): (&Planned, &Ran)| {
        let record = &ran.record;
        record.is_complete().then(|| Size {
            family: format!("{} {:e} {:?}", planned.scheme, planned.tolerance, planned.set),
            mesh: (record.cells as f64).powf(-1.0 / record.dimension.max(1) as f64),
            step: planned.step,
        })
    };
    plan.runs.iter().zip(ran).map(of).collect()
}

fn add_orders(plan: &Plan, ran: &[Ran], results: &mut Results) {
    let coarser = refinements(&sizes(plan, ran));
    for (at, refined) in coarser.iter().enumerate() {
        for norm in 0..results.norms.len() {
            let orders: Vec<(Refinement, Order)> =
                refined.iter().filter_map(|r| Some((*r, order(plan, results, at, norm, r)?))).collect();
            let gained = orders.first().and_then(|(r, _)| digits_per_second(results, r.of, at, norm));
            if let Some(error) = &mut results.runs[at].errors.get_mut(norm).and_then(Option::as_mut) {
                error.digits_per_second = gained;
                error.orders = orders.into_iter().map(|(_, order)| order).collect();
            }
        }
    }
}

fn error_of(results: &Results, run: usize, norm: usize) -> Option<f64> {
    results.runs[run].errors.get(norm)?.as_ref().map(|error| error.error)
}

fn order(plan: &Plan, results: &Results, run: usize, norm: usize, refined: &Refinement) -> Option<Order> {
    let (coarse, fine) = (error_of(results, refined.of, norm)?, error_of(results, run, norm)?);
    let theory = plan.study.norm.get(norm);
    Some(Order {
        refined: refined.what,
        against: results.runs[refined.of].name.clone(),
        observed: observed(coarse, fine, refined.factor)?,
        expected: theory.map(|norm| expected(norm, refined.what, &plan.runs[run].scheme)),
    })
}

fn digits_per_second(results: &Results, coarse: usize, fine: usize, norm: usize) -> Option<f64> {
    let digits = (error_of(results, coarse, norm)? / error_of(results, fine, norm)?).log10();
    let more = results.runs[fine].seconds?.computing - results.runs[coarse].seconds?.computing;
    (more > 0.0 && digits.is_finite()).then(|| digits / more)
}

fn add_published(plan: &Plan, ran: &[Ran], results: &mut Results) {
    let coarser = refinements(&sizes(plan, ran));
    for (at, norm) in plan.study.norm.iter().enumerate().filter(|(_, norm)| !norm.published.is_empty()) {
        for (run, published) in norm.published.iter().enumerate() {
            let Some(Some(error)) = results.runs[run].errors.get_mut(at) else { continue };
            error.published = Some(*published);
            error.ratio = Some(error.error / published);
            let before = coarser[run].first();
            error.published_order = before.and_then(|r| observed(norm.published[r.of], *published, r.factor));
        }
    }
}

/// Holds every run against the one that differs by the tightest tolerance only. Collective.
fn add_tolerances(session: &Session, plan: &Plan, ran: &[Ran], results: &mut Results) -> Result<()> {
    let same = |a: &Planned, b: &Planned| {
        (&a.cells, a.step, &a.scheme, &a.set) == (&b.cells, b.step, &b.scheme, &b.set)
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
        let folder = |planned: &Planned| planned.loaded.job.output_folder().to_owned();
        let (mine, theirs) = (folder(planned), folder(tightest));
        let target = Target::Run(&theirs, planned.adaptive);
        let (measured, _) = in_dimension(session, ran[at].record.dimension, &mine, target, &plan.study.norm)?;
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
