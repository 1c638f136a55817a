//! The contents of the checkpoints of a run, and their restoration.

use super::{
    checkpoint_file::{self, Checkpoint, IdTable, RowSet, SavedRows},
    history::Totals,
    seal,
};
use crate::{
    error::{Error, Exit, Result},
    fem::{
        body::Body,
        effect::{Closeness, History, LoadedMotion, Moment, Quantity},
        state::State,
    },
    job::differing_keys,
    linear_algebra::petsc::DistributedVector,
    parallel::{agreement::Agreed, session::Session},
};
use serde::{Deserialize, Serialize};
use std::{collections::BTreeMap, path::Path};

/// The sets of rows, and their positions in lists.
const SETS: [&str; 2] = ["cells", "nodes"];
const CELLS: usize = 0;
const NODES: usize = 1;
/// The tables of nodal fields.
const DISPLACEMENT: &str = "displacement";
const VELOCITY: &str = "velocity";
const PREVIOUS_VELOCITY: &str = "previous_velocity";
const PREVIOUS_DISPLACEMENT: &str = "previous_displacement";
const TRACTION: &str = "contact_traction";
/// The displacement from which pairs of bodies that slide were formed.
const PAIRED: &str = "paired_displacement";
/// The planes that the nodes of these pairs face.
const PLANES: &str = "faced_planes";
/// The displacement from which outputs and supports count.
const ORIGIN: &str = "displacement_origin";
/// Version of the format; increased when older files can no longer be read.
const FORMAT: u32 = 3;

/// The data of a checkpoint that are not fields.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// Version of the format.
    pub format: u32,
    /// Version of the solver that wrote it.
    pub version: String,
    /// Ranks that wrote it.
    pub ranks: usize,
    /// 2 or 3.
    pub dimension: usize,
    /// Number of steps.
    pub step: u64,
    /// Time in s.
    pub time: f64,
    /// Length of the last step in s.
    pub step_length: f64,
    /// The number of the fallback of Newton's method that solved the last step.
    #[serde(default)]
    pub fallback: usize,
    /// Sums over the steps so far.
    pub totals: Totals,
    /// For each contact whose obstacle a force moves: displacement in m and velocity in m/s after the last step, and before it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub obstacles: Vec<[f64; 4]>,
    /// For the same contacts: the resultant in N of the contact tractions in the last step.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub obstacle_resultants: Vec<f64>,
    /// For each contact whose obstacle a moment turns: angle and angular velocity in rad/s after the last step, and before it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub obstacle_rotations: Vec<[f64; 4]>,
    /// For the same contacts: the resultant moment in N m of the contact tractions in the last step.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub obstacle_rotation_resultants: Vec<f64>,
    /// The digest of the checkpoint from which the run started, if it started from one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start_state: Option<String>,
    /// For each contact the numbers of its [`Closeness`] so far, those of all ranks.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub closeness: Vec<Vec<Option<f64>>>,
    /// The warnings that the steps so far have given.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
    /// The contacts between bodies whose law acts at nodes of `against`, by their positions in the job.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub exchanged: Vec<usize>,
    /// Digest of the mesh.
    pub mesh: String,
    /// The keys of the job that affect the results, with their values.
    pub physics: BTreeMap<String, String>,
}

/// The data that identify the problem of a checkpoint.
#[derive(Debug, Clone, PartialEq)]
pub struct Identity {
    /// Version of this solver.
    pub version: String,
    /// The keys of the job that affect the results, with their values.
    pub physics: BTreeMap<String, String>,
    /// The digest of the checkpoint from which the run started, if it started from one.
    pub start_state: Option<String>,
}

impl Header {
    /// The header for a state, and the sums over the steps up to it, without warnings. Collective.
    pub fn new<const D: usize, const S: usize>(
        session: &Session,
        identity: &Identity,
        body: &Body<D, S>,
        state: &State,
        totals: &Totals,
    ) -> Self {
        let motions = |number: usize| {
            body.contacts.iter().filter_map(move |contact| contact.obstacle.motions[number].as_ref())
        };
        Self {
            format: FORMAT,
            version: identity.version.clone(),
            ranks: session.ranks(),
            dimension: D,
            step: state.step,
            time: state.time,
            step_length: state.step_length,
            fallback: state.fallback,
            totals: *totals,
            obstacles: motions(0).map(LoadedMotion::saved).collect(),
            obstacle_resultants: motions(0).map(LoadedMotion::resultant).collect(),
            obstacle_rotations: motions(1).map(LoadedMotion::saved).collect(),
            obstacle_rotation_resultants: motions(1).map(LoadedMotion::resultant).collect(),
            start_state: identity.start_state.clone(),
            closeness: body
                .contacts
                .iter()
                .map(|contact| contact.closeness.of_all(session).saved())
                .collect(),
            warnings: Vec::new(),
            exchanged: exchanged(body),
            mesh: digest(body),
            physics: identity.physics.clone(),
        }
    }
}

/// The digest that the seal of a checkpoint records, by which a run that starts from it knows it wherever it is. On one rank.
pub fn state_digest(path: &Path) -> Result<String> {
    let (_, digest) = seal::read_seal(path, seal::CHECKPOINT)?;
    Ok(format!("{digest:016x}"))
}

/// The digest of the checkpoint from which the run that wrote this one started; `None` if it started from none, or if the file cannot
/// be read. On one rank.
pub fn start_state_of(path: &Path) -> Option<String> {
    let header = hdf5::File::open(path).and_then(|file| file.dataset("header")?.read_raw::<u8>()).ok()?;
    serde_json::from_slice::<Header>(&header).ok()?.start_state
}

/// The contacts of a job with these keys which the run that wrote a checkpoint had between the same surfaces, by their positions, each with
/// whether the law acted at nodes of `against`. None if the file cannot be read. On one rank.
pub fn sides_of(path: &Path, physics: &BTreeMap<String, String>) -> BTreeMap<usize, bool> {
    let header = hdf5::File::open(path).and_then(|file| file.dataset("header")?.read_raw::<u8>());
    let Some(header) = header.ok().and_then(|bytes| serde_json::from_slice::<Header>(&bytes).ok()) else {
        return BTreeMap::new();
    };
    let surfaces = |keys: &BTreeMap<String, String>, number: usize| {
        let of = |key: &str| keys.get(&format!("contact.{number}.{key}")).cloned();
        of("against").map(|against| [Some(against), of("on"), of("where")])
    };
    let count = |keys: &BTreeMap<String, String>| {
        (0..).take_while(|number| keys.contains_key(&format!("contact.{number}.on"))).count()
    };
    let there: Vec<_> = (0..count(&header.physics)).map(|number| surfaces(&header.physics, number)).collect();
    let own = (0..count(physics)).filter_map(|number| {
        let surfaces = surfaces(physics, number)?;
        let before = there.iter().position(|other| other.as_ref() == Some(&surfaces))?;
        Some((number, header.exchanged.contains(&before)))
    });
    own.collect()
}

/// Saves the state with its header. Collective, with the same outcome on all ranks.
pub fn save<const D: usize, const S: usize>(
    session: &Session,
    path: &Path,
    header: &Header,
    body: &Body<D, S>,
    state: &State,
) -> Result<()> {
    let header = serde_json::to_vec_pretty(header)
        .map_err(|e| Error::Internal(format!("the checkpoint's header can't be written: {e}")))?;
    let ids = ids(body);
    let sets = [NODES, CELLS].map(|at| RowSet { name: SETS[at], total: totals(body)[at], ids: &ids[at] });
    let fields = [
        (DISPLACEMENT, Some(&state.displacement)),
        (VELOCITY, Some(&state.velocity)),
        (PREVIOUS_VELOCITY, Some(&state.previous_velocity)),
        (TRACTION, state.contact_traction.as_ref()),
        (PREVIOUS_DISPLACEMENT, state.previous_displacement.as_ref()),
        (ORIGIN, state.displacement_origin.as_ref()),
        (PAIRED, body.paired_displacement.as_ref()),
    ];
    let mut owned = Vec::new();
    for (name, field) in fields {
        if let Some(field) = field {
            owned.push((name, field.owned()?));
        }
    }
    let mut tables: Vec<IdTable> =
        owned.iter().map(|(name, values)| IdTable { name, set: SETS[NODES], width: D, values }).collect();
    let planes = body.faced_planes();
    let table = |values| IdTable { name: PLANES, set: SETS[NODES], width: D + 1, values };
    tables.extend(planes.as_deref().map(table));
    let of_cells: Vec<History> = body.all_cell_histories().collect();
    let of_nodes: Vec<History> = body.all_node_histories().collect();
    for (set, histories) in SETS.into_iter().zip([&of_cells, &of_nodes]) {
        let table = |h| {
            let History { width, values, .. }: &History = h;
            IdTable { name: h.name(), set, width: *width, values }
        };
        tables.extend(histories.iter().map(table));
    }
    Ok(checkpoint_file::write(path, session.world(), &header, &sets, &tables)?)
}

/// Reads a saved state into `body` and `state`. Refused if the checkpoint is damaged or belongs to another problem. Collective,
/// with the same outcome on all ranks.
pub fn restore<const D: usize, const S: usize>(
    session: &Session,
    path: &Path,
    identity: &Identity,
    body: &mut Body<D, S>,
    state: &mut State,
) -> Result<Header> {
    let checkpoint = Checkpoint::open(path, session.world()).map_err(damaged)?;
    let header = session.agree(check(path, checkpoint.header(), identity, body))?;
    let saved = Saved::new(&checkpoint, body)?;
    saved.fill::<D>(DISPLACEMENT, &mut state.displacement)?;
    saved.fill::<D>(VELOCITY, &mut state.velocity)?;
    saved.fill::<D>(PREVIOUS_VELOCITY, &mut state.previous_velocity)?;
    saved.count_from_origin(body, state)?;
    if let Some(traction) = &mut state.contact_traction {
        saved.fill_traction(traction, body)?;
    }
    if let Some(previous) = &mut state.previous_displacement {
        saved.fill::<D>(PREVIOUS_DISPLACEMENT, previous)?;
    }
    if body.paired_displacement.is_some() {
        let mut paired = state.displacement.like()?;
        saved.fill::<D>(PAIRED, &mut paired)?;
        body.form_pairs(session, &paired, false)?;
        saved.face_planes(body)?;
    }
    for (at, kept) in kept_by(body).into_iter().enumerate() {
        for (quantity, moment, width) in kept {
            let name = quantity.name(moment);
            let is_there = saved.tables[at].iter().any(|table| table == name);
            session.agree(if is_there { Ok(()) } else { Err(refused(path, &not_kept(quantity))) })?;
            body.restore_history(quantity, moment, &saved.rows[at].read(name, width)?);
        }
    }
    body.refresh_histories()?;
    let saved = [
        (&header.obstacles, &header.obstacle_resultants),
        (&header.obstacle_rotations, &header.obstacle_rotation_resultants),
    ];
    for (number, (motions, resultants)) in saved.into_iter().enumerate() {
        for (at, motion) in loaded_motions(body, number).enumerate() {
            motions.get(at).into_iter().for_each(|saved| motion.restore(*saved));
            motion.restore_resultant(resultants.get(at).copied().unwrap_or(0.0));
        }
    }
    for (contact, saved) in body.contacts.iter_mut().zip(&header.closeness) {
        contact.closeness = Closeness::restored(saved);
    }
    (state.step, state.time, state.step_length) = (header.step, header.time, header.step_length);
    state.fallback = header.fallback;
    Ok(header)
}

/// The part of the state of another run that this job can use.
#[derive(Debug)]
pub struct Transferred {
    /// The digest of the checkpoint.
    pub digest: String,
    /// Number of steps of that run.
    pub step: u64,
    /// Its time in s.
    pub time: f64,
    /// Mean acceleration in m/s^2 in its last step; 0 if it took none.
    pub acceleration: DistributedVector,
    /// Tables of the checkpoint and motions of its obstacles that this job does not have.
    pub dropped: Vec<String>,
    /// Histories and motions of obstacles of this job that the checkpoint does not have.
    pub at_rest: Vec<String>,
    /// The keys of that run's job that affect the results, with their values.
    pub physics: BTreeMap<String, String>,
}

/// Reads the last state of another run on the same mesh into `body` and `state` as a state at time 0, given the keys of this job that
/// affect the results. Refused if the checkpoint is damaged or belongs to another mesh. Collective, with the same outcome on all ranks.
pub fn transfer<const D: usize, const S: usize>(
    session: &Session,
    path: &Path,
    physics: &BTreeMap<String, String>,
    body: &mut Body<D, S>,
    state: &mut State,
) -> Result<Transferred> {
    let checkpoint = Checkpoint::open(path, session.world())?;
    let header = session.agree(check_mesh(path, checkpoint.header(), body))?;
    let saved = Saved::new(&checkpoint, body)?;
    saved.fill::<D>(DISPLACEMENT, &mut state.displacement)?;
    saved.fill::<D>(VELOCITY, &mut state.velocity)?;
    let acceleration = last_acceleration::<D>(&saved, header.step_length, state)?;
    state.previous_velocity.copy_from(&state.velocity)?;
    state.previous_velocity.update_ghosts()?;
    if let Some(previous) = &mut state.previous_displacement {
        previous.copy_from(&state.displacement)?;
        previous.update_ghosts()?;
    }
    if body.paired_displacement.is_some() {
        // What was in contact stays paired as it was: under small sliding without any displacement.
        let mut paired = state.displacement.like()?;
        let are_same = surfaces_in_contact(&header.physics) == surfaces_in_contact(physics);
        if !are_same {
            paired.copy_from(&state.displacement)?;
            paired.update_ghosts()?;
        } else if saved.has(PAIRED) {
            saved.fill::<D>(PAIRED, &mut paired)?;
        }
        body.form_pairs(session, &paired, false)?;
        if are_same && saved.has(PAIRED) {
            saved.face_planes(body)?;
        }
    }
    saved.count_from_origin(body, state)?;
    let mut known: Vec<&str> = vec![DISPLACEMENT, VELOCITY, PAIRED, PLANES, ORIGIN];
    if let Some(traction) = &mut state.contact_traction
        && saved.has(TRACTION)
    {
        known.push(TRACTION);
        saved.fill_traction(traction, body)?;
    }
    let mut at_rest = Vec::new();
    for (at, kept) in kept_by(body).into_iter().enumerate() {
        for (quantity, moment, width) in kept {
            // At the start of a run the previous values equal the current ones.
            let current = quantity.name(Moment::Last);
            if saved.tables[at].iter().any(|table| table == current) {
                known.extend([current, quantity.name(moment)]);
                body.restore_history(quantity, moment, &saved.rows[at].read(current, width)?);
            } else if moment == Moment::Last {
                at_rest.push(current.to_owned());
            }
        }
    }
    body.refresh_histories()?;
    let is_dropped = |name: &&String| !known.contains(&name.as_str()) && !name.starts_with("previous_");
    let mut dropped: Vec<String> = saved.tables.iter().rev().flatten().filter(is_dropped).cloned().collect();
    let has_stress =
        |keys: &BTreeMap<String, String>| keys.keys().any(|key| key.starts_with("initial.stress."));
    if has_stress(&header.physics) && !has_stress(physics) {
        dropped.push("initial stress of materials without viscoplasticity".into());
    }
    let digest = session.agree(state_digest(path))?;
    let mut found = Transferred {
        digest,
        step: header.step,
        time: header.time,
        acceleration,
        dropped,
        at_rest,
        physics: BTreeMap::new(),
    };
    transfer_motions(&header, physics, body, &mut found);
    found.physics = header.physics;
    Ok(found)
}

/// The mean acceleration of a step of this length in s, with which a saved state came to the velocity already read into `state`. Collective.
fn last_acceleration<const D: usize>(saved: &Saved, length: f64, state: &State) -> Result<DistributedVector> {
    let mut acceleration = state.velocity.like()?;
    if length > 0.0 {
        saved.fill::<D>(PREVIOUS_VELOCITY, &mut acceleration)?;
        let (mut values, velocity) = (acceleration.local_mut()?, state.velocity.local()?);
        values.iter_mut().zip(velocity.iter()).for_each(|(value, now)| *value = (now - *value) / length);
    }
    Ok(acceleration)
}

/// The keys of a job that say which surfaces act on each other.
fn surfaces_in_contact(physics: &BTreeMap<String, String>) -> Vec<(&String, &String)> {
    let is_surface = |key: &str| {
        key.starts_with("contact.")
            && ["on", "against", "where", "closed"].contains(&key.rsplit('.').next().unwrap_or_default())
    };
    physics.iter().filter(|(key, _)| is_surface(key)).collect()
}

/// Lets the obstacles moved by forces continue their motion, where both jobs have it: a contact on the same boundaries, or the same part
/// of them, along the same direction or about the same axis.
fn transfer_motions<const D: usize, const S: usize>(
    header: &Header,
    physics: &BTreeMap<String, String>,
    body: &mut Body<D, S>,
    found: &mut Transferred,
) {
    let translation = ("direction", &["obstacle_load.direction"][..], "displacement");
    let rotation = ("moment", &["obstacle.sphere.axis", "obstacle.shape.axis"][..], "rotation");
    let saved = [(translation, &header.obstacles), (rotation, &header.obstacle_rotations)];
    for (number, ((key, alike, what), motions)) in saved.into_iter().enumerate() {
        let there = motions_of(&header.physics, key, alike);
        let here = motions_of(physics, key, alike);
        let name = |contact: usize| format!("{what} of the obstacle of contact.{contact}");
        for ((contact, own), motion) in here.iter().zip(loaded_motions(body, number)) {
            let at = there.iter().position(|(_, other)| own == other);
            let Some([displacement, velocity, ..]) = at.and_then(|at| motions.get(at).copied()) else {
                found.at_rest.push(name(*contact));
                continue;
            };
            motion.restore([displacement, velocity, displacement, velocity]);
        }
        let is_dropped = |(_, other): &&(usize, Vec<_>)| here.iter().all(|(_, own)| own != other);
        found.dropped.extend(there.iter().filter(is_dropped).map(|(contact, _)| name(*contact)));
    }
}

/// The contacts with this key of `obstacle_load`, and what two jobs must have in common for its motion to be the same: boundaries,
/// their part, and the values of these keys.
fn motions_of<'a>(
    physics: &'a BTreeMap<String, String>,
    key: &str,
    alike: &[&str],
) -> Vec<(usize, Vec<Option<&'a String>>)> {
    let value = |contact: usize, key: &str| physics.get(&format!("contact.{contact}.{key}"));
    let contacts = (0..).take_while(|contact| value(*contact, "on").is_some());
    let loaded = contacts.filter(|contact| value(*contact, &format!("obstacle_load.{key}")).is_some());
    let keys = || ["on", "where"].iter().chain(alike);
    loaded.map(|contact| (contact, keys().map(|key| value(contact, key)).collect())).collect()
}

/// The motions of obstacles along a direction (number 0) or about an axis (1), in the order of the contacts.
fn loaded_motions<const D: usize, const S: usize>(
    body: &mut Body<D, S>,
    number: usize,
) -> impl Iterator<Item = &mut LoadedMotion> {
    body.contacts.iter_mut().filter_map(move |contact| contact.obstacle.motions[number].as_mut())
}

/// What a body keeps in its cells and at its nodes, with the numbers of values of a cell or node.
fn kept_by<const D: usize, const S: usize>(body: &Body<D, S>) -> [Vec<(Quantity, Moment, usize)>; 2] {
    let kept = |history: History<'_>| (history.quantity, history.moment, history.width);
    [body.all_cell_histories().map(kept).collect(), body.all_node_histories().map(kept).collect()]
}

/// What a checkpoint has for the cells of this rank and for the nodes that it owns.
struct Saved<'a> {
    rows: [SavedRows<'a>; 2],
    tables: [Vec<String>; 2],
}

impl<'a> Saved<'a> {
    fn new<const D: usize, const S: usize>(checkpoint: &'a Checkpoint, body: &Body<D, S>) -> Result<Self> {
        let (ids, totals) = (ids(body), totals(body));
        let rows = |at: usize| checkpoint.rows(SETS[at], totals[at], &ids[at]);
        let tables = [checkpoint.tables(SETS[CELLS])?, checkpoint.tables(SETS[NODES])?];
        Ok(Self { rows: [rows(CELLS)?, rows(NODES)?], tables })
    }

    fn has(&self, field: &str) -> bool {
        self.tables[NODES].iter().any(|name| name == field)
    }

    /// Lets nodes of pairs that slide face the saved planes, of files that have them.
    fn face_planes<const D: usize, const S: usize>(&self, body: &mut Body<D, S>) -> Result<()> {
        if self.has(PLANES) {
            body.face_planes(&self.rows[NODES].read(PLANES, D + 1)?);
        }
        Ok(())
    }

    /// Reads a nodal field.
    fn fill<const D: usize>(&self, name: &str, field: &mut DistributedVector) -> Result<()> {
        fill(field, &self.rows[NODES].read(name, D)?)
    }

    /// Reads the tractions of contacts, and sets their pressures.
    fn fill_traction<const D: usize, const S: usize>(
        &self,
        traction: &mut DistributedVector,
        body: &mut Body<D, S>,
    ) -> Result<()> {
        self.fill::<D>(TRACTION, traction)?;
        let values = traction.owned()?;
        body.contacts.iter_mut().for_each(|contact| contact.restore_pressures(&values));
        Ok(())
    }

    /// Reads the displacement from which outputs and supports count, if there is one.
    fn count_from_origin<const D: usize, const S: usize>(
        &self,
        body: &mut Body<D, S>,
        state: &mut State,
    ) -> Result<()> {
        if self.has(ORIGIN) { count_from(&self.rows[NODES].read(ORIGIN, D)?, body, state) } else { Ok(()) }
    }
}

/// A damaged file is a failure, not a refusal, so that an older checkpoint can be tried.
fn damaged(error: Agreed) -> Error {
    if error.exit() == Exit::Refused { Error::Failed(error.to_string()) } else { error.into() }
}

fn fill(field: &mut DistributedVector, values: &[f64]) -> Result<()> {
    field.owned_mut()?.copy_from_slice(values);
    field.update_ghosts()
}

/// Lets displacements of outputs and supports count from this one of owned nodes. Collective.
pub fn count_from<const D: usize, const S: usize>(
    values: &[f64],
    body: &mut Body<D, S>,
    state: &mut State,
) -> Result<()> {
    let mut origin = state.displacement.like()?;
    fill(&mut origin, values)?;
    state.displacement_origin = Some(origin);
    body.support_motion.iter_mut().for_each(|motion| motion.count_from(values));
    Ok(())
}

/// Why a run of the same problem did not write a history: only output asks for it.
fn not_kept(quantity: Quantity) -> String {
    let name = quantity.name(Moment::Last);
    format!(
        "the checkpoint has no {name}, which the job asks for and that of the checkpoint did not: delete \"{name}\" from [output] also and \
         probe_also, or start the run again without --restart"
    )
}

fn refused(path: &Path, words: &str) -> Error {
    Error::Refused(format!("{}: {words}", path.display()))
}

/// The header of a checkpoint of a format that can be read.
fn read_header(path: &Path, bytes: &[u8]) -> Result<Header> {
    let header: Header = serde_json::from_slice(bytes).map_err(|error| {
        refused(
            path,
            &format!("the header of the checkpoint cannot be parsed ({error}); start the run again"),
        )
    })?;
    if header.format != FORMAT {
        let words = format!(
            "the checkpoint has format {} of Clarke {}, this version reads format {FORMAT}; continue with that version",
            header.format, header.version
        );
        return Err(refused(path, &words));
    }
    Ok(header)
}

/// The header of a checkpoint of another run on the mesh of this body.
fn check_mesh<const D: usize, const S: usize>(
    path: &Path,
    bytes: &[u8],
    body: &Body<D, S>,
) -> Result<Header> {
    let header = read_header(path, bytes)?;
    if header.mesh != digest(body) || header.dimension != D {
        let words = "the checkpoint belongs to another mesh, or to a body of another hypothesis; a run can start only from a state on its own mesh";
        return Err(refused(path, words));
    }
    Ok(header)
}

fn check<const D: usize, const S: usize>(
    path: &Path,
    bytes: &[u8],
    identity: &Identity,
    body: &Body<D, S>,
) -> Result<Header> {
    let refuse = |words: String| Err(refused(path, &words));
    let header = read_header(path, bytes)?;
    if header.start_state.is_some() && header.start_state != identity.start_state {
        return refuse(
            "the state from which the run started has changed since the checkpoint was written; restore that state, or start the run \
             again without --restart"
                .into(),
        );
    }
    let differing = differing_keys(&header.physics, &identity.physics);
    if !differing.is_empty() {
        let lines: Vec<String> = differing
            .iter()
            .map(|key| {
                let value = |side: &BTreeMap<String, String>| {
                    side.get(key).cloned().unwrap_or_else(|| "absent".into())
                };
                format!("  {key}: checkpoint {}, job {}", value(&header.physics), value(&identity.physics))
            })
            .collect();
        return refuse(format!(
            "the checkpoint belongs to another problem; these keys differ:\n{}\nrestore them, or start the run again without --restart",
            lines.join("\n")
        ));
    }
    if header.mesh != digest(body) || header.dimension != D {
        return refuse("the mesh has changed since the checkpoint was written; start the run again".into());
    }
    if header.exchanged != exchanged(body) {
        return refuse(format!(
            "version {} chose other sides of contact between bodies to carry the law; continue with that version, or start the run again \
             without --restart",
            header.version
        ));
    }
    Ok(header)
}

/// The contacts whose law acts at nodes of `against`.
fn exchanged<const D: usize, const S: usize>(body: &Body<D, S>) -> Vec<usize> {
    body.pairs.iter().filter(|pair| pair.exchange.is_some()).map(|pair| pair.contact).collect()
}

fn digest<const D: usize, const S: usize>(body: &Body<D, S>) -> String {
    format!("{:016x}", body.mesh.digest)
}

/// The ids of this rank's cells and of the nodes that it owns.
fn ids<const D: usize, const S: usize>(body: &Body<D, S>) -> [Vec<u64>; 2] {
    let mesh = &body.mesh;
    [&mesh.cell_ids[..], &mesh.node_ids[..mesh.owned]]
        .map(|ids| ids.iter().map(|&id| u64::from(id)).collect())
}

/// The numbers of all cells and nodes.
fn totals<const D: usize, const S: usize>(body: &Body<D, S>) -> [u64; 2] {
    [body.mesh.total_cells, body.mesh.total_nodes].map(|total| total as u64)
}
