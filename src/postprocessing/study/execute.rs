//! Executes the runs of a study one after the other, each as an ordinary run in its own folder.

use super::{
    plan::Planned,
    record::{Ran, Record, counted, digest},
};
use crate::{
    error::{Exit, Result},
    io::output::log::WORDS,
    laws::lines::wrapped,
    linear_algebra::petsc::clear_option,
    parallel::{agreement::Agreed, session::Session},
    run::{self, Clock, Start},
};
use std::{
    io::Write,
    time::{Duration, Instant},
};

/// The outcome of a run.
pub(super) enum Outcome {
    /// The run was executed now, or an earlier study had finished it.
    Ran {
        /// Its record.
        record: Box<Record>,
        /// Whether an earlier study had finished it.
        found: bool,
    },
    /// The run was stopped on request.
    Stopped,
}

/// Writes lines to the terminal, on the first rank of a session.
#[derive(Clone, Copy)]
pub(super) struct Speaker<'a> {
    session: &'a Session,
    is_quiet: bool,
}

impl<'a> Speaker<'a> {
    /// Says everything, or only what went wrong.
    pub(super) fn new(session: &'a Session, is_quiet: bool) -> Self {
        Self { session, is_quiet }
    }

    /// The same on a group of ranks.
    pub(super) fn of_group(self, ranks: &Session) -> Speaker<'_> {
        Speaker { session: ranks, is_quiet: self.is_quiet }
    }

    /// Whether it only says what went wrong.
    pub(super) fn is_quiet(self) -> bool {
        self.is_quiet
    }

    /// Says what happens.
    pub(super) fn say(self, words: &str) {
        if self.session.is_first() && !self.is_quiet {
            let _ = writeln!(std::io::stdout(), "{}", wrapped(words, WORDS));
        }
    }

    /// Says what went wrong: among the other lines, or, if there are none, as an error.
    pub(super) fn complain(self, words: &str) {
        if !self.is_quiet {
            self.say(words);
        } else if self.session.is_first() {
            let _ = writeln!(std::io::stderr(), "{}", wrapped(&format!("error: {words}"), WORDS));
        }
    }
}

/// Executes a planned run and says how it ended; `None` if it was stopped on request. Collective.
pub(super) fn announced(
    session: &Session,
    planned: &Planned,
    repetitions: usize,
    count: &str,
    speaker: Speaker<'_>,
) -> Result<Option<Ran>> {
    let Outcome::Ran { record, found } = execute(session, planned, repetitions)? else { return Ok(None) };
    let line = |words: &str| format!("run {count:<9} {:<40} {words}", planned.name);
    match &record.error {
        Some(error) => speaker.complain(&line(&format!("failed: {error}"))),
        None => {
            let seconds = || record.seconds.iter().map(|s| s.total).sum::<f64>();
            let ended = if found { "already finished".into() } else { format!("{:.2} s", seconds()) };
            let warned = counted(&record.warnings).map(|words| format!(", {words}"));
            speaker.say(&line(&(ended + &warned.unwrap_or_default())));
        }
    }
    Ok(Some(Ran { record: *record, found }))
}

/// Executes a planned run, unless its folder contains the finished run. A failed run is an outcome, not an error. Collective.
pub(super) fn execute(session: &Session, planned: &Planned, repetitions: usize) -> Result<Outcome> {
    let folder = planned.loaded.job.output_folder();
    let digest = session.on_first(|| digest(planned, session.ranks()))?.unwrap_or_default();
    let found = if session.is_first() { Record::of_finished(folder, &digest, repetitions) } else { None };
    if let Some(record) = Record::share(session, found)? {
        return Ok(Outcome::Ran { record: Box::new(record), found: true });
    }
    let mut record = Record::new(digest);
    for _ in 0..repetitions {
        let finished = match run_once(session, planned) {
            Ok(Exit::Stopped) => return Ok(Outcome::Stopped),
            Ok(_) => session.on_first(|| record.add_summary(folder)),
            Err(error) => Err(error),
        };
        if let Err(error) = finished {
            record.error = Some(error.to_string());
            break;
        }
    }
    session.on_first(|| {
        if record.error.is_none() {
            record.complete(folder)?;
        }
        record.write(folder)
    })?;
    match Record::share(session, Some(record))? {
        Some(record) => Ok(Outcome::Ran { record: Box::new(record), found: false }),
        None => Ok(Outcome::Stopped),
    }
}

/// One run. Its PETSc options are cleared afterwards, so that they do not affect the next run. Collective.
fn run_once(session: &Session, planned: &Planned) -> Result<Exit, Agreed> {
    let clock =
        Clock { began: Instant::now(), launched: Duration::ZERO, on_terminal: false, logs_every_step: false };
    let ended = run::run(session, planned.loaded.clone(), &Start::Over, clock);
    for name in planned.loaded.job.solver.petsc.keys() {
        session.agree(clear_option(name))?;
    }
    ended
}
