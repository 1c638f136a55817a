//! All files of a run, opened for a start or to go on.

use crate::{
    agreement::Agreed,
    body::Body,
    error::Result,
    job::{Every, Job},
    output::{
        checkpoint::{self, Header, Identity},
        checkpoint_folder::{checkpoint_path, prune},
        field_output::FieldOutput,
        history::{History, Totals},
        log::Log,
        output_field::Converged,
        probes::Probes,
        profiles::Profiles,
        whole_file::write_whole,
    },
    session::Session,
    state::State,
    stepping::StepOutcome,
    tensor::Mandel,
};
use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

/// What a run writes while it steps.
pub(super) struct Outputs<const D: usize, const S: usize> {
    folder: PathBuf,
    identity: Identity,
    history: Option<History>,
    probes: Probes<D>,
    profiles: Profiles<D>,
    fields: FieldOutput<D>,
    every: Option<Every>,
    keep: usize,
    /// Bytes of the files that grow when the run began to write, and of checkpoints so far; on rank 0.
    before: u64,
    checkpoints: u64,
    /// Time spent writing.
    pub spent: Duration,
}

/// What files are to say and hold.
pub(super) struct Wanted<'a, const D: usize> {
    /// What the job asks for.
    pub job: &'a Job,
    /// Whose checkpoints they are.
    pub identity: Identity,
    /// Where to look.
    pub probes: Probes<D>,
    /// Whether files of an earlier run are gone on with.
    pub goes_on: bool,
}

impl<const D: usize, const S: usize> Outputs<D, S> {
    /// Finds profiles and opens the files; behind the state's step if the run goes on. Collective.
    pub fn open(
        session: &Session,
        wanted: Wanted<D>,
        body: &Body<D, S>,
        state: &State,
        log: &mut Log,
    ) -> Result<Self> {
        let start = Instant::now();
        let Wanted { job, identity, mut probes, goes_on } = wanted;
        let folder = job.output_folder().to_owned();
        let before = if goes_on && session.is_first() { length_of_all(&folder) } else { 0 };
        let mut profiles = profiles(session, body, job)?;
        let (step, time) = (goes_on.then_some(state.step), goes_on.then_some(state.time));
        let fields = FieldOutput::open(session, job, body, time, log)?;
        // A state whose fields could not be written, as on a full disk, is written anew, with its profiles.
        let every = job.output.fields;
        let is_there = fields.last_time().is_some_and(|last| last >= state.time);
        let profiles_after =
            time.map(|time| if due(every, state) && !is_there { time.next_down() } else { time });
        let tables = || {
            write_whole(&folder.join("job.toml"), &job.to_toml()?)?;
            probes.open(&folder, step)?;
            profiles.open(&folder, profiles_after)?;
            History::open(&folder, step)
        };
        let history = session.agree(session.is_first().then(tables).transpose())?;
        let keep = job.checkpoint.as_ref().map_or(2, |c| c.keep as usize);
        let spent = start.elapsed();
        let checkpoints = 0;
        Ok(Self {
            folder,
            identity,
            history,
            probes,
            profiles,
            fields,
            every,
            keep,
            before,
            checkpoints,
            spent,
        })
    }

    /// Writes what is due after a step. Collective.
    pub fn after_step(
        &mut self,
        session: &Session,
        body: &Body<D, S>,
        state: &State,
        outcome: &StepOutcome,
        totals: &Totals,
    ) -> Result<()> {
        let start = Instant::now();
        let mut written = Ok(());
        if let Some(history) = &mut self.history {
            written = history.row(state.step, state.time, state.step_length, outcome, totals);
        }
        session.agree(written)?;
        if !self.probes.is_empty() {
            session.agree(self.probes.write(session, &body.mesh, state))?;
        }
        if due(self.every, state) {
            self.write_fields(session, body, state)?;
        }
        self.spent += start.elapsed();
        Ok(())
    }

    /// Writes the state that the run starts from, where its fields are due and not there yet. Collective.
    pub fn at_start(&mut self, session: &Session, body: &Body<D, S>, state: &State) -> Result<()> {
        let missing = self.fields.last_time().is_none_or(|time| time < state.time);
        if missing && due(self.every, state) { self.write_fields(session, body, state) } else { Ok(()) }
    }

    /// Writes the last state unless it was just written, and brings all rows to the files. Collective.
    pub fn at_end(&mut self, session: &Session, body: &Body<D, S>, state: &State) -> Result<()> {
        let start = Instant::now();
        if !self.fields.is_broken() && self.fields.last_time().is_none_or(|time| time < state.time) {
            self.write_fields(session, body, state)?;
        }
        session.agree(self.flush())?;
        self.spent += start.elapsed();
        Ok(())
    }

    fn write_fields(&mut self, session: &Session, body: &Body<D, S>, state: &State) -> Result<()> {
        let stress = session.agree(body.stress(state))?;
        self.fields.write(Converged { session, body, state, stress: &stress })?;
        Ok(self.profiles.write(session, body, state, &stress)?)
    }

    /// Numbers that sum up the fields of a state, by their names in `summary.json`. Collective.
    pub fn figures(&self, at: Converged<D, S>) -> Result<BTreeMap<&'static str, f64>, Agreed> {
        self.fields.figures(at)
    }

    /// Brings all rows to the files.
    fn flush(&mut self) -> Result<()> {
        self.history.as_mut().map_or(Ok(()), History::flush)?;
        self.probes.flush()?;
        self.profiles.flush()
    }

    /// Writes a checkpoint and removes the oldest. Collective.
    pub fn checkpoint(
        &mut self,
        session: &Session,
        body: &Body<D, S>,
        state: &State,
        totals: &Totals,
    ) -> Result<PathBuf> {
        let start = Instant::now();
        session.agree(self.flush())?;
        let path = checkpoint_path(&self.folder, state.step);
        let header = Header::new(session, &self.identity, body, state, totals);
        checkpoint::save(session, &path, &header, body, state)?;
        if session.is_first() {
            self.checkpoints += length(&path);
        }
        let pruned = if session.is_first() { prune(&self.folder, self.keep) } else { Ok(()) };
        session.agree(pruned)?;
        self.spent += start.elapsed();
        Ok(path)
    }

    /// Bytes that this run brought to files: what tables and fields grew by, and all checkpoints. On rank 0, elsewhere 0.
    pub fn written(&self) -> u64 {
        let tables = if self.history.is_some() { length_of_all(&self.folder) } else { 0 };
        tables.saturating_sub(self.before) + self.checkpoints
    }

    /// Closes the field files. Collective.
    pub fn close(self) -> Result<(), Agreed> {
        self.fields.close()
    }
}

/// Files that grow while a run goes on.
const GROWING: [&str; 5] = ["history.csv", "probes.csv", "profiles.csv", "fields.vtkhdf", "fields.xdmf"];

fn length_of_all(folder: &Path) -> u64 {
    GROWING.iter().map(|name| length(&folder.join(name))).sum()
}

/// Bytes of a file; none where there is no such file.
fn length(path: &Path) -> u64 {
    std::fs::metadata(path).map_or(0, |file| file.len())
}

/// Whether the fields of this state are to be written: of the initial one always, where fields are wanted along the way.
fn due(every: Option<Every>, state: &State) -> bool {
    every.is_some_and(|every| has_come(every, state.step, [state.time - state.step_length, state.time]))
}

/// Whether this is the number of a step, or the times in s before and after it, at which something is written.
fn has_come(every: Every, step: u64, [before, after]: [f64; 2]) -> bool {
    match every {
        _ if step == 0 => true,
        Every::Every(steps) => step.is_multiple_of(steps),
        Every::Interval(interval) => {
            let count = |time: f64| (time / interval * (1.0 + 1e-12)).floor();
            count(after) > count(before)
        }
    }
}

fn profiles<const D: usize, const S: usize>(
    session: &Session,
    body: &Body<D, S>,
    job: &Job,
) -> Result<Profiles<D>> {
    let along: Vec<(String, Option<usize>)> = job
        .output
        .profile
        .iter()
        .map(|p| (p.on.clone(), job.contact.iter().position(|c| c.on.contains(&p.on))))
        .collect();
    Profiles::new(session, body, &along)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn multiples_of_an_interval_that_rounding_misses_have_come() {
        let tenths = |times| has_come(Every::Interval(0.1), 5, times);
        assert!(0.3 / 0.1 < 3.0 && tenths([0.2, 0.3]), "0.3 is a multiple of 0.1");
        assert!(!tenths([0.3, 0.35]) && tenths([0.35, 0.45]) && tenths([0.2, 0.75]));
        assert!(has_come(Every::Interval(0.1), 0, [0.0; 2]) && has_come(Every::Every(3), 0, [0.0; 2]));
        assert!(has_come(Every::Every(3), 6, [0.0; 2]) && !has_come(Every::Every(3), 7, [0.0; 2]));
    }
}
