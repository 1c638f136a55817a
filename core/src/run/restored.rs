//! The checkpoint that a restarted run continues from.

use super::{
    Start,
    reactions::{imbalance, moved_before, take_over},
};
use crate::{
    error::{Error, Exit, Result},
    fem::{
        body::Body,
        effect::{Heat, Moment, SEEN, SUPPORT_REACTION, TEMPERATURE},
        state::State,
    },
    io::output::{
        checkpoint::{self, Identity, start_state_of, state_digest},
        checkpoint_folder::{checkpoint_path, list},
        history::Totals,
    },
    job::{Loaded, Reset},
    linear_algebra::tensor::{Vector, norm},
    parallel::{agreement::Agreed, exchange::gather, session::Session},
};
use mpi::traits::{Communicator, Root};
use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

/// A unit direction with a smaller free part is held.
const ROUNDING: f64 = 1e-9;

/// A checkpoint that was read.
pub(super) struct Restored {
    pub file: String,
    pub totals: Totals,
    /// The warnings that its steps have given.
    pub warnings: Vec<String>,
    /// Newer checkpoints that can't be read, and why.
    pub faults: Vec<String>,
    /// The line of the log about it.
    pub words: String,
}

/// The checkpoints that a run may continue from, the newest first; none for a new start. Refused if a restart finds none. Collective.
pub(super) fn candidates(session: &Session, start: &Start, folder: &Path) -> Result<Vec<PathBuf>, Agreed> {
    match start {
        Start::Anew | Start::Over => Ok(Vec::new()),
        Start::From(path) => Ok(vec![path.clone()]),
        Start::Newest => {
            let found = newest(session, folder)?;
            let words = || {
                format!(
                    "{}: no checkpoint to continue from; run without --restart (a finished run keeps its last state where the job has a [checkpoint] table)",
                    folder.display()
                )
            };
            session.agree(if found.is_empty() { Err(Error::Refused(words())) } else { Ok(found) })
        }
    }
}

/// Reads the first of these checkpoints that is sound into body and state; none without candidates. Collective.
pub(super) fn restore<const D: usize, const S: usize>(
    session: &Session,
    candidates: &[PathBuf],
    identity: &Identity,
    body: &mut Body<D, S>,
    state: &mut State,
) -> Result<Option<Restored>, Agreed> {
    let mut faults = Vec::new();
    for path in candidates {
        match session.agree(checkpoint::restore(session, path, identity, body, state)) {
            Ok(header) => {
                let file = path.display().to_string();
                let words = format!("continuing from {file} (step {}, t = {} s)", header.step, header.time);
                let (totals, warnings) = (header.totals, header.warnings);
                return Ok(Some(Restored { file, totals, warnings, faults, words }));
            }
            Err(error) if error.exit() == Exit::Refused => return Err(error),
            Err(error) => faults.push(error.to_string()),
        }
    }
    if faults.is_empty() {
        return Ok(None);
    }
    session.agree(Err(Error::Refused(format!(
        "no intact checkpoint to continue from; run without --restart\n{}",
        faults.join("\n")
    ))))
}

/// The state of another run from which a run starts.
pub(super) struct StartState {
    /// The digest of its checkpoint.
    pub digest: String,
    /// The line of the log about it.
    pub words: String,
    /// The warning about its balance.
    pub warning: Option<String>,
    /// Whether it is gone, so that a checkpoint of the run itself stands for it.
    pub is_gone: bool,
}

/// A file with the state that a job starts from.
pub(super) struct StartFile {
    pub path: PathBuf,
    /// The digest of the start state if that is gone and the file is a checkpoint of the run itself.
    gone: Option<String>,
}

/// The file of the state that a job starts from, if it names one; if it is gone, the newest of the run's own checkpoints that tells from which
/// state the run started. Collective.
pub(super) fn start_file(
    session: &Session,
    loaded: &Loaded,
    own: &[PathBuf],
) -> Result<Option<StartFile>, Agreed> {
    let Some(from) = loaded.job.initial.as_ref().and_then(|initial| initial.from.as_deref()) else {
        return Ok(None);
    };
    let fault = |words: String, help: &str| loaded.fault("initial.from", words, help);
    let is_folder = session.total(usize::from(session.is_first() && from.is_dir())) > 0;
    let is_file = session.total(usize::from(session.is_first() && from.is_file())) > 0;
    let found = match is_folder {
        true => newest(session, from)?.into_iter().next(),
        false => is_file.then(|| from.to_owned()),
    };
    if let Some(path) = found {
        return Ok(Some(StartFile { path, gone: None }));
    }
    let is_known = |path: &PathBuf| state_digest(path).is_ok() && start_state_of(path).is_some();
    let known = if session.is_first() { own.iter().position(is_known).map_or(0, |at| at + 1) } else { 0 };
    let at = session.total(known);
    session.agree(if at > 0 {
        let path = own[at - 1].clone();
        let gone = start_state_of(&path);
        let unreadable =
            || Error::Failed(format!("{}: the file cannot be read on every rank", path.display()));
        if gone.is_none() { Err(unreadable()) } else { Ok(Some(StartFile { path, gone })) }
    } else if is_folder {
        let help = "add a [checkpoint] table to the job of that folder, so that its last state is saved";
        Err(fault(format!("{} holds no checkpoint", from.display()), help))
    } else {
        let words = format!("{} does not exist or is no regular file", from.display());
        Err(fault(words, "name a checkpoint or an output folder"))
    })
}

/// The contacts between bodies that the run had which wrote the state that a job starts from, by their positions in the job, each with
/// whether its sides were exchanged. Collective.
pub(super) fn sides_before(
    session: &Session,
    loaded: &Loaded,
    file: Option<&Path>,
) -> Result<BTreeMap<usize, bool>, Agreed> {
    let Some(file) = file else { return Ok(BTreeMap::new()) };
    let physics = session.agree(loaded.job.physics())?;
    let found = session.on_first(|| Ok::<_, Error>(checkpoint::sides_of(file, &physics)))?;
    let own = found.unwrap_or_default().into_iter();
    let own: Vec<u32> = own.flat_map(|(number, is)| [number as u32, u32::from(is)]).collect();
    let all = gather(session.world(), &own)?;
    Ok(all.chunks_exact(2).map(|pair| (pair[0] as usize, pair[1] > 0)).collect())
}

/// Reads the state that a job starts from, if this file has one, into body and state. Components that supports
/// hold keep the displacement and have the velocity of the supports; where supports moved them before, their motion continues: the
/// velocity of the state is the mean of the last step in some schemes, and that of the support at this time would be a jump.
/// Collective.
pub(super) fn transfer<const D: usize, const S: usize>(
    session: &Session,
    (loaded, file): (&Loaded, Option<StartFile>),
    body: &mut Body<D, S>,
    state: &mut State,
) -> Result<Option<StartState>> {
    let Some(StartFile { path: file, gone }) = file else { return Ok(None) };
    let physics = session.agree(loaded.job.physics())?;
    // Elastic supports keep the reactions that they have taken over before.
    let [can_react] = session.largest([f64::from(u8::from(!body.elastic_support.points.is_empty()))]);
    if can_react > 0.0 {
        body.elastic_support.has_reactions = true;
        body.elastic_support.reactions = vec![0.0; body.mesh.owned * D];
    }
    let mut found = checkpoint::transfer(session, &file, &physics, body, state)?;
    let initial = loaded.job.initial.as_ref();
    if initial.is_some_and(|initial| initial.reset.contains(&Reset::Displacement)) {
        let here = session.agree(state.displacement.owned().map(|values| values.to_vec()))?;
        session.agree(checkpoint::count_from(&here, body, state))?;
    }
    let is_cold = found.at_rest.iter().any(|name| name == TEMPERATURE.name(Moment::Last))
        && initial.is_none_or(|initial| initial.temperature.is_none());
    session.agree(if is_cold { Err(without_temperature(loaded, &file)) } else { Ok(()) })?;
    if found.at_rest.iter().any(|name| name == SEEN.name(Moment::Last)) {
        body.heat.iter_mut().filter(|heat| heat.is_seen()).for_each(Heat::show);
        body.strain_by_temperature();
    }
    found.at_rest.retain(|name| name != SUPPORT_REACTION.name(Moment::Last));
    let handover = take_over(session, &found.physics, body, state)?;
    let moved = moved_before(session, &found.physics, &body.mesh, &state.velocity)?;
    let before: Vec<f64> = session.agree(state.velocity.owned())?.to_vec();
    for field in [&mut state.velocity, &mut state.previous_velocity] {
        body.held.clear(&mut field.owned_mut()?);
        field.update_ghosts()?;
    }
    if let Some(motion) = &body.support_motion {
        let step = loaded.job.time.step;
        let known = |node: usize, direction: &Vector<D>| {
            let is_free = norm(&moved.free_part(node, direction)) > ROUNDING;
            (!is_free).then(|| (0..D).map(|i| direction[i] * before[node * D + i]).sum())
        };
        session.agree(motion.start_velocity(step, known, &mut state.velocity.owned_mut()?))?;
        state.velocity.update_ghosts()?;
    }
    let mut words = format!("starting from {} (step {}, t = {} s)", file.display(), found.step, found.time);
    for (what, names) in [("dropped", &found.dropped), ("initial values", &found.at_rest)] {
        if !names.is_empty() {
            words += &format!("; {what}: {}", names.join(", "));
        }
    }
    if state.displacement_origin.is_some() {
        words += "; displacements count from the start of a stage";
    }
    words += &handover.words();
    if let Some(digest) = gone {
        let words = format!(
            "the state that [initial] from names is gone; the run goes on without it, because {} has all of it",
            file.display()
        );
        return Ok(Some(StartState { digest, words, warning: None, is_gone: true }));
    }
    let warning = match handover.warning() {
        None => imbalance(session, body, state, (&found.acceleration, loaded.job.time.step))?,
        released => released,
    };
    Ok(Some(StartState { digest: found.digest, words, warning, is_gone: false }))
}

fn without_temperature(loaded: &Loaded, file: &Path) -> Error {
    let message =
        format!("the state in {} has no temperature, which this body with heat has", file.display());
    loaded.fault("initial.from", message, "add temperature = 293.0 beside `from`")
}

/// The checkpoints of a folder as rank 0 lists them, the newest first; other ranks may see an outdated listing of a shared folder.
/// Collective.
fn newest(session: &Session, folder: &Path) -> Result<Vec<PathBuf>, Agreed> {
    let found = session.on_first(|| list(folder))?.unwrap_or_default();
    let mut count = found.len() as u64;
    session.world().process_at_rank(0).broadcast_into(&mut count);
    let mut steps: Vec<u64> = found.into_iter().map(|(step, _)| step).collect();
    steps.resize(count as usize, 0);
    session.world().process_at_rank(0).broadcast_into(&mut steps[..]);
    Ok(steps.into_iter().map(|step| checkpoint_path(folder, step)).collect())
}
