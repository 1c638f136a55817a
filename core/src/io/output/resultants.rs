//! `resultants.csv`: forces and moments on the body, with one row per step and source.

use super::{
    columns::RESULTANTS,
    csv::{CsvFile, Numbers, Time, entry},
};
use crate::{
    error::Result,
    fem::{
        body::Body,
        effect::{ContactAreas, LoadedMotion},
        resultants::{BalancedMotion, Resultants, Source},
        state::State,
    },
    job::Job,
    linear_algebra::{petsc::DistributedVector, tensor::Vector},
    mesh::other_side,
    parallel::{agreement::Agreed, session::Session},
};
use std::{
    fmt::{self, Display, Formatter},
    path::Path,
};

/// The resultants of a run with their file.
#[derive(Debug)]
pub(crate) struct ResultantTable<const D: usize> {
    resultants: Resultants<D>,
    /// A name for each source, no two alike, as entries of the table.
    names: Vec<String>,
    /// The point about which moments are, in m.
    about: Vector<D>,
    /// The groups of columns that there are.
    with: [bool; 5],
    /// The file, on rank 0.
    pub(crate) file: Option<CsvFile>,
}

impl<const D: usize> ResultantTable<D> {
    /// Prepares the resultants of a job. Collective.
    pub(crate) fn new<const S: usize>(
        session: &Session,
        body: &Body<D, S>,
        state: &State,
        job: &Job,
    ) -> Result<Self, Agreed> {
        let resultants = Resultants::new(session, body, state, &job.support)?;
        let mut names: Vec<String> = Vec::new();
        for source in &resultants.sources {
            let name = name(job, *source);
            let same = |number: usize| if number == 1 { name.clone() } else { format!("{name} ({number})") };
            names.extend((1..).map(same).find(|name| !names.contains(name)));
        }
        let names = names.iter().map(|name| entry(name)).collect();
        let about =
            job.output.moments_about.as_deref().filter(|_| !body.mesh.is_revolved).unwrap_or_default();
        let about = std::array::from_fn(|i| about.get(i).copied().unwrap_or(0.0));
        Ok(Self { resultants, names, about, with: groups(job), file: None })
    }

    /// Opens the file on rank 0; continues it after this step if one is given.
    pub(crate) fn open(&mut self, folder: &Path, goes_on_after: Option<u64>) -> Result<()> {
        let (path, header) = (folder.join(RESULTANTS.file), RESULTANTS.header(D, &self.with));
        self.file = Some(CsvFile::open(&path, &header, goes_on_after.map(|step| step as f64))?);
        Ok(())
    }

    /// Writes the rows of the step just committed, given the nodal loads in it. Collective.
    pub(crate) fn write<const S: usize>(
        &mut self,
        session: &Session,
        body: &Body<D, S>,
        state: &State,
        motion: BalancedMotion<'_>,
        load: Option<&DistributedVector>,
    ) -> Result<(), Agreed> {
        let time = motion.time;
        self.resultants.update(session, body, state, motion, load)?;
        let Self { resultants, names, about, with, file } = self;
        let written: Result<()> = file.as_mut().map_or(Ok(()), |file| {
            let rows = resultants.sources.iter().zip(resultants.rows());
            for (name, (source, (resultant, areas))) in names.iter().zip(rows) {
                let [path, turn] = match source {
                    Source::Contact(at) => {
                        let motions = body.contacts[*at].obstacle.motions.each_ref();
                        motions.map(|motion| motion.as_ref().map(LoadedMotion::balanced))
                    }
                    _ => [None; 2],
                };
                let moment = &resultant.moment_about(about)[if D == 2 { 2 } else { 0 }..];
                let [_, of_contacts, of_friction, of_path, of_turn] = *with;
                file.row(format_args!(
                    "{},{},{name},{},{}{}{}{}{}",
                    state.step,
                    Time(time),
                    Numbers(&resultant.force),
                    Numbers(moment),
                    Cells(areas.map(contact_cells), of_contacts),
                    Cells(areas.map(|areas| [areas.sticking, areas.slipping]), of_friction),
                    Cells(path, of_path),
                    Cells(turn, of_turn),
                ))?;
            }
            Ok(())
        });
        session.agree(written)
    }
}

/// The kind of a source and its boundaries.
fn name(job: &Job, source: Source) -> String {
    let (kind, on) = match source {
        Source::Support(at) => ("support", &job.support[at].on),
        Source::Contact(at) => ("contact", &job.contact[at].on),
        Source::Against(at) if job.contact[at].against.is_empty() => {
            let sides: Vec<String> = job.contact[at].on.iter().map(|name| other_side(name)).collect();
            return sides.join("+");
        }
        Source::Against(at) => ("against", &job.contact[at].against),
        Source::Traction(at) => ("traction", &job.traction[at].on),
        Source::BodyForce => return "body_force".into(),
        Source::Damping => return "damping".into(),
        Source::Momentum => return "momentum".into(),
    };
    format!("{kind} {}", on.join("+"))
}

/// The groups of columns that a run of the job has.
pub(super) fn groups(job: &Job) -> [bool; 5] {
    let friction = job.contact.iter().any(|contact| contact.friction.is_some());
    let loads = || job.contact.iter().filter_map(|contact| contact.obstacle_load.as_ref());
    let moves = loads().any(|load| !load.direction.is_empty());
    let turns = loads().any(|load| load.moment.is_some());
    [true, !job.contact.is_empty(), friction, moves, turns]
}

/// The names of all sources that a run of the job may have.
pub fn source_names(job: &Job) -> Vec<String> {
    let supports = (0..job.support.len()).map(Source::Support);
    let contacts = (0..job.contact.len()).map(Source::Contact);
    // A boundary without obstacle may be a fault inside the body.
    let against =
        (0..job.contact.len()).filter(|at| job.contact[*at].obstacle.is_none()).map(Source::Against);
    let tractions = (0..job.traction.len()).map(Source::Traction);
    let others = [Source::BodyForce, Source::Damping, Source::Momentum];
    supports
        .chain(contacts)
        .chain(against)
        .chain(tractions)
        .chain(others)
        .map(|source| name(job, source))
        .collect()
}

/// The cells of a group of columns, if it is there, each after a comma; empty for a source without these values.
struct Cells<const N: usize>(Option<[f64; N]>, bool);

impl<const N: usize> Display for Cells<N> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self(_, false) => Ok(()),
            Self(Some(values), true) => write!(f, ",{}", Numbers(values)),
            Self(None, true) => (0..N).try_for_each(|_| f.write_str(",")),
        }
    }
}

/// Touching and open area, mean and largest pressure.
fn contact_cells(areas: ContactAreas) -> [f64; 4] {
    let ContactAreas { touching, open, pressure, largest_pressure, .. } = areas;
    let [mean, largest] = if touching == 0.0 { [0.0; 2] } else { [pressure / touching, largest_pressure] };
    [touching, open, mean, largest]
}
