//! All files of a run, opened for a new start or to continue.

use super::Simulation;
use crate::{
    error::{Error, Result},
    fem::{body::Body, state::State},
    io::output::{
        checkpoint::{self, Header, Identity},
        checkpoint_folder::{checkpoint_path, prune},
        csv::CsvFile,
        field_output::FieldOutput,
        history::{History, Totals},
        log::Log,
        output_field::Converged,
        probes::Probes,
        profiles::Profiles,
        resultants::ResultantTable,
        whole_file::write_whole,
    },
    job::{Contact, Every, Job},
    mesh::other_side,
    parallel::{agreement::Agreed, session::Session},
    solver::stepping::{StepOutcome, without_rounding},
};
use std::{
    collections::BTreeMap,
    os::unix::fs::MetadataExt,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

/// The output of a run.
pub(super) struct Outputs<const D: usize, const S: usize> {
    folder: PathBuf,
    identity: Identity,
    history: Option<History>,
    resultants: ResultantTable<D>,
    probes: Probes<D>,
    profiles: Profiles<D>,
    fields: FieldOutput<D>,
    every: Option<Every>,
    /// The times of profiles, if they differ from those of fields.
    profiles_every: Option<Every>,
    /// The last time in s whose profiles are written, if there is one.
    profiled: Option<f64>,
    keep: usize,
    /// Bytes of the growing files when the run opened them, on rank 0.
    before: u64,
    /// The files that are extended, with what identifies them on their disk, on rank 0.
    opened: Vec<(PathBuf, [u64; 2])>,
    /// Bytes of the checkpoints so far, on rank 0.
    checkpoints: u64,
    /// Time spent on writing.
    pub spent: Duration,
}

/// The data that determine the files of a run.
pub(super) struct Contents<'a, const D: usize> {
    /// The job.
    pub job: &'a Job,
    /// The problem that checkpoints belong to.
    pub identity: Identity,
    /// The probes, already located.
    pub probes: Probes<D>,
    /// Whether the files of an earlier run are continued.
    pub is_restart: bool,
}

impl<const D: usize, const S: usize> Outputs<D, S> {
    /// Prepares the profiles and opens the files; those of a run that is continued are cut after the state's step. Collective.
    pub(super) fn open(
        session: &Session,
        contents: Contents<D>,
        simulation: &Simulation<D, S>,
        log: &mut Log,
    ) -> Result<Self> {
        let start = Instant::now();
        let Simulation { body, state, totals, .. } = simulation;
        let Contents { job, identity, mut probes, is_restart } = contents;
        let folder = job.output_folder().to_owned();
        let before = if is_restart && session.is_first() { length_of_all(&folder) } else { 0 };
        let mut profiles = profiles(session, body, job)?;
        let mut resultants = ResultantTable::new(session, body, state, job)?;
        let (step, time) = (is_restart.then_some(state.step), is_restart.then_some(state.time));
        let fields = FieldOutput::open(session, job, body, time, log)?;
        // If the fields of a state could not be written, for instance on a full disk, they are written again, with the profiles.
        let (every, profiles_every) = (job.output.fields.clone(), job.output.profiles.clone());
        let is_there = fields.last_time().is_some_and(|last| last >= state.time);
        let rewrites = if profiles_every.is_some() {
            due(&profiles_every, state, totals)
        } else {
            due(&every, state, totals) && !is_there
        };
        let before_rewritten = |time: f64| if rewrites { time.next_down() } else { time };
        let profiled = time.map(before_rewritten);
        // The same of the times in the table.
        let last_row = time.map(|time| before_rewritten(without_rounding(time)));
        let tables = || {
            write_whole(&folder.join("job.toml"), &job.to_toml()?)?;
            resultants.open(&folder, step)?;
            probes.open(&folder, step)?;
            profiles.open(&folder, last_row)?;
            History::open(&folder, body.heat.is_some(), step)
        };
        let history = session.on_first(tables)?;
        let opened = if session.is_first() { extended(&folder) } else { Vec::new() };
        let of_history = history.iter().flat_map(History::faults);
        let files = [&resultants.file, &probes.file, &profiles.file].into_iter().flatten();
        of_history.chain(files.flat_map(CsvFile::faults)).for_each(|fault| log.warning(fault));
        let keep = job.checkpoint.as_ref().map_or(2, |c| c.keep as usize);
        let spent = start.elapsed();
        let checkpoints = 0;
        Ok(Self {
            folder,
            identity,
            history,
            resultants,
            probes,
            profiles,
            fields,
            every,
            profiles_every,
            profiled,
            keep,
            before,
            opened,
            checkpoints,
            spent,
        })
    }

    /// Writes the output that is due after a step. Collective.
    pub(super) fn after_step(
        &mut self,
        session: &Session,
        simulation: &Simulation<D, S>,
        outcome: &StepOutcome,
    ) -> Result<()> {
        let start = Instant::now();
        let Simulation { body, state, scheme, totals, .. } = simulation;
        let mut written = Ok(());
        let mean_temperature = body.heat.as_ref().map_or(0.0, |heat| {
            let [heats, capacities] = session.sum(heat.heat_and_capacity());
            heats / capacities
        });
        if let Some(history) = &mut self.history {
            written = history.row(state, outcome, totals, mean_temperature);
        }
        session.agree(written)?;
        let motion = scheme.balanced_motion(state);
        self.resultants.write(session, body, state, motion, scheme.load.as_ref())?;
        if self.probes.needs_stress() {
            let stress = session.agree(body.stress(state))?;
            let at = Converged { session, body, state, stress: &stress };
            self.probes.write(session, state, Some((at, motion)))?;
        } else if !self.probes.is_empty() {
            self.probes.write::<S>(session, state, None)?;
        }
        self.write_state(
            session,
            body,
            state,
            [due(&self.every, state, totals), due(&self.profiles_every, state, totals)],
        )?;
        self.fields.write_out_if_due()?;
        self.spent += start.elapsed();
        Ok(())
    }

    /// Writes the fields and profiles of the initial state, if they are due and not in their files yet. Collective.
    pub(super) fn at_start(&mut self, session: &Session, simulation: &Simulation<D, S>) -> Result<()> {
        let Simulation { body, state, totals, .. } = simulation;
        let fields = self.lacks_fields(state) && due(&self.every, state, totals);
        let profiles = self.lacks_profiles(state) && due(&self.profiles_every, state, totals);
        self.write_state(session, body, state, [fields, profiles])
    }

    /// Writes the fields and profiles of the last state unless their files have them, and flushes all tables. Collective.
    pub(super) fn at_end(&mut self, session: &Session, body: &Body<D, S>, state: &State) -> Result<()> {
        let start = Instant::now();
        let fields = !self.fields.write_failed() && self.lacks_fields(state);
        let profiles = self.profiles_every.is_some() && self.lacks_profiles(state);
        self.write_state(session, body, state, [fields, profiles])?;
        self.fields.write_out()?;
        session.agree(self.flush())?;
        session.on_first(|| self.are_there())?;
        self.spent += start.elapsed();
        Ok(())
    }

    fn lacks_fields(&self, state: &State) -> bool {
        self.fields.last_time().is_none_or(|time| time < state.time)
    }

    fn lacks_profiles(&self, state: &State) -> bool {
        self.profiled.is_none_or(|time| time < state.time)
    }

    /// Writes fields and profiles of a state; without times of their own, profiles are written with the fields. Collective.
    fn write_state(
        &mut self,
        session: &Session,
        body: &Body<D, S>,
        state: &State,
        [fields, profiles]: [bool; 2],
    ) -> Result<()> {
        let profiles = !self.profiles.is_empty() && (profiles || fields && self.profiles_every.is_none());
        if !fields && !profiles {
            return Ok(());
        }
        let stress = session.agree(body.stress(state))?;
        if fields {
            self.fields.write(Converged { session, body, state, stress: &stress })?;
        }
        if profiles {
            self.profiles.write(session, body, state, &stress)?;
            self.profiled = Some(state.time);
        }
        Ok(())
    }

    /// Numbers that sum up the fields of a state, by their names in `summary.json`. Collective.
    pub(super) fn figures(&self, at: Converged<D, S>) -> Result<BTreeMap<&'static str, f64>, Agreed> {
        self.fields.figures(at)
    }

    /// Flushes all tables.
    fn flush(&mut self) -> Result<()> {
        self.history.as_mut().map_or(Ok(()), History::flush)?;
        let files = [&mut self.resultants.file, &mut self.probes.file];
        files.into_iter().flatten().try_for_each(CsvFile::flush)?;
        self.profiles.flush()
    }

    /// Writes a checkpoint and removes the oldest. It does not depend on fields: if these can't be written or files are lost, the
    /// checkpoint is written, and the failure returned. Collective.
    pub(super) fn checkpoint(
        &mut self,
        session: &Session,
        body: &Body<D, S>,
        state: &State,
        of_steps: (&Totals, &[String]),
    ) -> Result<PathBuf> {
        let start = Instant::now();
        // A restart continues the files, which should therefore be complete up to this step.
        let fields = if self.fields.write_failed() { Ok(()) } else { self.fields.write_out() };
        session.agree(self.flush())?;
        let path = checkpoint_path(&self.folder, state.step);
        let (totals, warnings) = of_steps;
        let header = Header {
            warnings: warnings.to_vec(),
            ..Header::new(session, &self.identity, body, state, totals)
        };
        checkpoint::save(session, &path, &header, body, state)?;
        session.on_first(|| {
            self.checkpoints += length(&path);
            prune(&self.folder, self.keep)
        })?;
        self.spent += start.elapsed();
        fields?;
        session.on_first(|| self.are_there())?;
        Ok(path)
    }

    /// Fails if a file that is extended is no longer in its folder: what is written to it then is lost.
    fn are_there(&self) -> Result<()> {
        let lost = self.opened.iter().find(|(path, identity)| identity_of(path) != Some(*identity));
        lost.map_or(Ok(()), |(path, _)| {
            Err(Error::Failed(format!(
                "{} was removed or replaced during the run, and what the run wrote to it is lost; continue with --restart, or repeat \
                 the run with --force to have the whole file",
                path.display()
            )))
        })
    }

    /// Bytes that this run wrote: the growth of tables and fields, and all checkpoints. On rank 0; 0 elsewhere.
    pub(super) fn written(&self) -> u64 {
        let tables = if self.history.is_some() { length_of_all(&self.folder) } else { 0 };
        tables.saturating_sub(self.before) + self.checkpoints
    }

    /// Closes the field files. Collective.
    pub(super) fn close(self) -> Result<(), Agreed> {
        self.fields.close()
    }
}

/// Files that grow during a run.
const GROWING: [&str; 6] =
    ["history.csv", "resultants.csv", "probes.csv", "profiles.csv", "fields.vtkhdf", WRITTEN_ANEW];
/// The one of them that is written anew each time.
const WRITTEN_ANEW: &str = "fields.xdmf";

/// The files of a folder that are extended.
fn extended(folder: &Path) -> Vec<(PathBuf, [u64; 2])> {
    let names = GROWING.iter().filter(|name| **name != WRITTEN_ANEW);
    let paths = names.map(|name| folder.join(name));
    paths.filter_map(|path| identity_of(&path).map(|identity| (path, identity))).collect()
}

/// The disk of a file and its number there, if it exists.
fn identity_of(path: &Path) -> Option<[u64; 2]> {
    std::fs::metadata(path).ok().map(|file| [file.dev(), file.ino()])
}

fn length_of_all(folder: &Path) -> u64 {
    GROWING.iter().map(|name| length(&folder.join(name))).sum()
}

/// Bytes of a file; 0 if it does not exist.
fn length(path: &Path) -> u64 {
    std::fs::metadata(path).map_or(0, |file| file.len())
}

/// Whether output of this state is due; that of the initial state always is, unless the job lists the times.
fn due(every: &Option<Every>, state: &State, totals: &Totals) -> bool {
    let times = [state.time - state.step_length, state.time];
    every.as_ref().is_some_and(|every| is_due(every, totals.whole_steps(state.step), times))
}

/// Whether the step just taken reached one of these times.
pub(super) fn reaches(listed: &[f64], state: &State) -> bool {
    state.step > 0 && is_among(listed, [state.time - state.step_length, state.time])
}

/// Whether one of these times lies in the step that went from the time `before` to `after` in s. Steps end at these times.
fn is_among(listed: &[f64], [before, after]: [f64; 2]) -> bool {
    let close = 1e-12 * after.abs();
    listed.iter().any(|time| *time > before + close && *time <= after + close)
}

/// Whether output is due after this number of whole steps, if one has ended, the last of which or a part of it went from the time `before`
/// to `after` in s.
fn is_due(every: &Every, step: Option<u64>, [before, after]: [f64; 2]) -> bool {
    match every {
        Every::At(listed) if step == Some(0) => listed.first() == Some(&0.0),
        Every::At(listed) => is_among(listed, [before, after]),
        _ if step == Some(0) => true,
        Every::Every(steps) => step.is_some_and(|step| step.is_multiple_of(*steps)),
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
    let contacts_on = |name: &String| {
        let contacts = job.contact.iter().enumerate();
        let is_side = |on: &String| on == name || other_side(on) == *name;
        let acts = |contact: &Contact| contact.on.iter().any(is_side) || contact.against.contains(name);
        contacts.filter(|(_, contact)| acts(contact)).map(|(at, _)| at).collect()
    };
    let along: Vec<(String, Vec<usize>)> =
        job.output.profile.iter().map(|profile| (profile.on.clone(), contacts_on(&profile.on))).collect();
    Profiles::new(session, body, &along)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn multiples_of_an_interval_that_rounding_misses_are_due() {
        let tenths = |times| is_due(&Every::Interval(0.1), Some(5), times);
        assert!(0.3 / 0.1 < 3.0 && tenths([0.2, 0.3]), "0.3 is a multiple of 0.1");
        assert!(!tenths([0.3, 0.35]) && tenths([0.35, 0.45]) && tenths([0.2, 0.75]));
        let third = |step| is_due(&Every::Every(3), step, [0.0; 2]);
        assert!(is_due(&Every::Interval(0.1), Some(0), [0.0; 2]) && third(Some(0)));
        assert!(third(Some(6)) && !third(Some(7)) && !third(None));
    }
    #[test]
    fn listed_times_are_due_once_in_the_step_that_ends_there() {
        let at = Every::At(vec![0.3, 0.5]);
        let steps = [[0.2, 0.1 + 0.2], [0.1 + 0.2, 0.45], [0.45, 0.5], [0.5, 0.6]];
        assert_eq!(steps.map(|times| is_due(&at, Some(3), times)), [true, false, true, false]);
        assert!(!is_due(&at, Some(0), [0.0; 2]) && is_due(&Every::At(vec![0.0]), Some(0), [0.0; 2]));
    }
}
