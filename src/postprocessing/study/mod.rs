//! Studies: a job on several meshes, with several steps and schemes, compared with a reference; sweeps over any keys of a job.
//!
//! Every run is an ordinary run in its own folder; a restarted study uses the finished runs. Each rank reads the complete fields of
//! a run and of the reference and integrates over its part of the cells.

mod ablate;
mod check;
mod compare;
mod convergence;
mod difference;
mod document;
mod exact;
mod execute;
mod map;
mod measure;
mod orders;
mod overlap;
mod part;
mod period;
mod plan;
mod plot;
mod quantity;
mod record;
mod responses;
mod results;
mod side_by_side;
mod split;
mod squares;
mod stored;
mod sweep;
mod table;
mod targets;
mod write;

pub use part::Part;
pub use plan::Plan;
pub use quantity::quantity;
pub use results::Results;
pub(crate) use write::{COLUMNS, ROWS};

use crate::{
    error::{Exit, Result},
    job::{Named, describe_kind, markdown_of, named as named_of},
    parallel::session::Session,
    run::version,
};
use compare::Compared;
use document::Take;
use execute::{Speaker, announced};
use plan::{Planned, PlannedReference, RefusedRun, one_of_each_fault};
use record::{Counts, Ran, seconds_of};
use results::RunResult;
use side_by_side::{Numbered, execute_all};

/// The reference of the keys of studies: of all tables, or of one table or key.
pub fn describe(table: Option<&str>) -> Result<String> {
    describe_kind(document::kind(), table, &[])
}

/// All tables and keys of studies, for searches by a word.
pub(crate) fn named() -> Vec<Named> {
    named_of(document::kind())
}

/// The JSON Schema (draft 2020-12) of a study.
pub fn describe_json() -> String {
    format!("{:#}", document::kind().schema)
}

/// The reference of all keys of a study as a page in Markdown.
pub fn describe_markdown() -> String {
    markdown_of(document::kind())
}

/// How a study is executed.
#[derive(Debug, Clone, Copy, Default)]
pub struct Options {
    /// Whether the base job is also run without each of its effects.
    pub with_ablation: bool,
    /// Whether only failures are printed, as errors.
    pub is_quiet: bool,
}

/// Executes the study and writes its tables. Collective.
pub fn study(session: &Session, plan: &Plan, Options { with_ablation, is_quiet }: Options) -> Result<Exit> {
    let speaker = Speaker::new(session, is_quiet);
    let repetitions = plan.study.timing.repetitions as usize;
    let number = |index: usize| format!("{}/{}", index + 1, plan.runs.len());
    let numbered = |(index, planned)| (planned, repetitions, number(index));
    let runs: Vec<Numbered> = plan.runs.iter().enumerate().map(numbered).collect();
    let once = |planned, what| announced(session, planned, 1, what, speaker);
    announce_refused(plan, speaker);
    let reference = reference_run(plan).map(|planned| once(planned, "reference"));
    let Some(reference) = reference.into_iter().collect::<Result<Option<Vec<Ran>>>>()? else {
        return stopped(speaker);
    };
    let Some(ran) = execute_all(session, plan, &runs, speaker)? else { return stopped(speaker) };
    let on_meshes = plan.split.iter().map(|planned| once(planned, "split"));
    let Some(on_meshes) = on_meshes.collect::<Result<Option<Vec<Ran>>>>()? else { return stopped(speaker) };
    let mut results = assembled(session, plan, reference.first(), &ran, &on_meshes)?;
    if with_ablation {
        match ablate::ablate(session, plan, speaker)? {
            Some(ablation) => results.ablation = Some(ablation),
            None => return stopped(speaker),
        }
    }
    session.on_first(|| write::all(plan, &results))?;
    let tables = table::all(&results).iter().map(|t| t.text()).collect::<Vec<_>>().join("\n");
    speaker.say(&format!("\n{tables}\nfiles      {}", plan.folder.display()));
    Ok(announce_failed(plan, &results, speaker))
}

/// Says how many runs failed or could not be compared, and of the latter, which no line names yet, the reason.
fn announce_failed(plan: &Plan, results: &Results, speaker: Speaker<'_>) -> Exit {
    let failed = || results.runs.iter().chain(&results.reference).filter(|run| run.error.is_some());
    let count = failed().count();
    if count == 0 {
        return Exit::Done;
    }
    if speaker.is_quiet() {
        for run in failed().filter(|run| run.status == "completed") {
            speaker.complain(&format!("run {}: {}", run.name, run.error.as_deref().unwrap_or_default()));
        }
    }
    let all = plan.runs.len() + plan.refused.len();
    speaker.complain(&format!("{count} of {all} runs failed or could not be compared; see above"));
    Exit::Failed
}

/// Executes a part of the runs of the study, each in its own folder, and writes no tables. When all parts are finished, the study,
/// started on the same number of ranks (on any, for runs side by side), uses their runs. Collective.
pub fn study_part(session: &Session, plan: &Plan, part: Part, is_quiet: bool) -> Result<Exit> {
    let speaker = Speaker::new(session, is_quiet);
    let repetitions = plan.study.timing.repetitions as usize;
    let once = reference_run(plan).into_iter().chain(&plan.split).map(|planned| (planned, 1));
    let all: Vec<_> = once.chain(plan.runs.iter().map(|planned| (planned, repetitions))).collect();
    let mine = all.iter().enumerate().filter(|(index, _)| part.has(*index));
    let count = |index: usize| format!("{}/{}", index + 1, all.len());
    announce_refused(plan, speaker);
    let mine: Vec<Numbered> =
        mine.map(|(index, (planned, repetitions))| (*planned, *repetitions, count(index))).collect();
    let Some(ran) = execute_all(session, plan, &mine, speaker)? else { return stopped(speaker) };
    let failed = ran.iter().any(|ran| ran.record.error.is_some());
    Ok(if failed { Exit::Failed } else { Exit::Done })
}

/// The run that is the reference, if it is one.
fn reference_run(plan: &Plan) -> Option<&Planned> {
    match &plan.reference {
        Some(PlannedReference::Run(planned)) => Some(planned),
        _ => None,
    }
}

/// Says which runs of the sweep are refused, each with its first fault, before the first run starts.
fn announce_refused(plan: &Plan, speaker: Speaker<'_>) {
    for (run, others) in one_of_each_fault(&plan.refused) {
        let more = if others > 0 { format!(" (and {others} more)") } else { String::new() };
        speaker.complain(&format!("run refused   {:<40} {}{more}", run.name, run.fault()));
    }
}

fn stopped(speaker: Speaker<'_>) -> Result<Exit> {
    speaker.say("stopped on request; the same command continues with the unfinished runs");
    Ok(Exit::Stopped)
}

fn assembled(
    session: &Session,
    plan: &Plan,
    reference: Option<&Ran>,
    ran: &[Ran],
    on_meshes: &[Ran],
) -> Result<Results> {
    let study = &plan.study;
    let take = study.timing.take;
    let mut results = Results {
        version: version(),
        ranks: session.ranks(),
        title: study.about.title.clone().unwrap_or_else(|| plan.name.clone()),
        source: study.about.reference.clone(),
        notes: study.about.notes.clone(),
        reference: None,
        sweep: study.sweep.keys().cloned().collect(),
        response: study.response.iter().map(document::Response::name).collect(),
        norms: table::norms(study),
        runs: plan.runs.iter().zip(ran).map(|(planned, ran)| result(planned, ran, take)).collect(),
        tolerances: Vec::new(),
        targets: Vec::new(),
        ablation: None,
    };
    results.reference = reference_run(plan).zip(reference).map(|(planned, ran)| result(planned, ran, take));
    for (at, ran) in ran.iter().enumerate().filter(|(_, ran)| ran.record.is_complete()) {
        let run = &mut results.runs[at];
        let added = Compared::with_reference(plan, &plan.runs[at], &ran.record, reference)
            .and_then(|compared| compared.map_or(Ok(()), |c| compare::add_errors(session, plan, &c, run)));
        run.error = added.err().map(|error| error.to_string());
        run.errors.resize(results.norms.len(), None);
    }
    responses::add(session, plan, &mut results);
    split::add_parts(session, plan, ran, on_meshes, &mut results)?;
    convergence::add_orders(plan, ran, &mut results);
    convergence::add_published(plan, ran, &mut results);
    compare::add_tolerances(session, plan, ran, &mut results)?;
    results.targets = targets::targets(study, &results);
    results.runs.extend(plan.refused.iter().map(|run| refused(plan, run)));
    Ok(results)
}

/// The result of a run whose job is refused: that of a failed run, with the scheme, mesh and step of the base job.
fn refused(plan: &Plan, run: &RefusedRun) -> RunResult {
    let job = &plan.base.job;
    RunResult {
        name: run.name.clone(),
        scheme: job.time.scheme.name().to_owned(),
        cells: job.mesh.source.cells(),
        step: job.time.step,
        adaptive: job.time.adaptive.as_ref().map(|adaptive| adaptive.tolerance),
        tolerance: job.solver.tolerance,
        set: run.set.clone(),
        sweep: run.swept.clone(),
        response: vec![None; plan.study.response.len()],
        status: "failed".into(),
        error: Some(run.error.clone()),
        warnings: Vec::new(),
        notes: Vec::new(),
        found: false,
        counts: Counts::default(),
        seconds: None,
        repetitions: Vec::new(),
        errors: Vec::new(),
        places: Vec::new(),
    }
}

fn result(planned: &Planned, ran: &Ran, take: Take) -> RunResult {
    let record = &ran.record;
    RunResult {
        name: planned.name.clone(),
        scheme: planned.scheme.name().to_owned(),
        cells: planned.cells.clone(),
        step: planned.step,
        adaptive: planned.adaptive,
        tolerance: planned.tolerance,
        set: planned.set.clone(),
        sweep: planned.swept.clone(),
        response: Vec::new(),
        status: record.status.clone(),
        error: record.error.clone(),
        warnings: record.warnings.clone(),
        notes: Vec::new(),
        found: ran.found,
        counts: record.counts,
        seconds: seconds_of(record, take).filter(|_| record.is_complete()),
        repetitions: record.seconds.clone(),
        errors: Vec::new(),
        places: Vec::new(),
    }
}
