//! `resultants.csv`: forces and moments on the body, with one row per step and source.

use super::csv::{CsvFile, Numbers, Time, entry};
use crate::{
    error::Result,
    fem::{
        body::Body,
        effect::ContactAreas,
        resultants::{BalancedMotion, Resultants, Source},
        state::State,
    },
    job::Job,
    linear_algebra::petsc::DistributedVector,
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
    /// Whether there are columns of contacts, and of friction.
    with: Columns,
    file: Option<CsvFile>,
}

/// The columns beside forces and moments.
#[derive(Debug, Clone, Copy)]
struct Columns {
    contact: bool,
    friction: bool,
    /// Motion of an obstacle that a force moves, and of one that a moment turns.
    motions: [bool; 2],
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
        for source in resultants.sources() {
            let name = name(job, *source);
            let same = |number: usize| if number == 1 { name.clone() } else { format!("{name} ({number})") };
            names.extend((1..).map(same).find(|name| !names.contains(name)));
        }
        let names = names.iter().map(|name| entry(name)).collect();
        let friction = job.contact.iter().any(|contact| contact.friction.is_some());
        let loads = || job.contact.iter().filter_map(|contact| contact.obstacle_load.as_ref());
        let motions =
            [loads().any(|load| !load.direction.is_empty()), loads().any(|load| load.moment.is_some())];
        let with = Columns { contact: !job.contact.is_empty(), friction, motions };
        Ok(Self { resultants, names, with, file: None })
    }

    /// Opens the file on rank 0; continues it after this step if one is given.
    pub(crate) fn open(&mut self, folder: &Path, goes_on_after: Option<u64>) -> Result<()> {
        let forces = ["x", "y", "z"][..D].iter().map(|axis| format!(",force_{axis}"));
        let moments = moment_axes::<D>().iter().map(|axis| format!(",moment_{axis}"));
        let columns: String = forces.chain(moments).collect();
        let contact =
            if self.with.contact { ",touching_area,open_area,mean_pressure,largest_pressure" } else { "" };
        let friction = if self.with.friction { ",sticking_area,slipping_area" } else { "" };
        let of_motions =
            [",obstacle_displacement,obstacle_velocity", ",obstacle_rotation,obstacle_angular_velocity"];
        let there = of_motions.into_iter().zip(self.with.motions).filter(|(_, is_there)| *is_there);
        let obstacle: String = there.map(|(columns, _)| columns).collect();
        let header = format!("step,time,source{columns}{contact}{friction}{obstacle}");
        let path = folder.join("resultants.csv");
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
        let Self { resultants, names, with, file } = self;
        let written: Result<()> = file.as_mut().map_or(Ok(()), |file| {
            let rows = resultants.sources().iter().zip(resultants.rows());
            for (name, (source, (resultant, areas))) in names.iter().zip(rows) {
                let areas = Areas { areas, with: *with };
                let obstacle = match source {
                    Source::Contact(at) => body.contacts[*at].obstacle.as_ref(),
                    _ => None,
                };
                let motions = obstacle.map_or([None; 2], |obstacle| obstacle.motions());
                let [path, turn] = [0, 1].map(|number| ObstaclePath {
                    motion: motions[number].map(|motion| motion.balanced()),
                    is_there: with.motions[number],
                });
                let moment = &resultant.moment[3 - moment_axes::<D>().len()..];
                file.row(format_args!(
                    "{},{},{name},{},{}{areas}{path}{turn}",
                    state.step,
                    Time(time),
                    Numbers(&resultant.force),
                    Numbers(moment),
                ))?;
            }
            Ok(())
        });
        session.agree(written)
    }

    /// What the table that is continued lacks.
    pub(crate) fn faults(&self) -> impl Iterator<Item = String> {
        self.file.iter().flat_map(CsvFile::faults)
    }

    /// Flushes all rows to the file.
    pub(crate) fn flush(&mut self) -> Result<()> {
        self.file.as_mut().map_or(Ok(()), CsvFile::flush)
    }
}

/// The axes of moments.
fn moment_axes<const D: usize>() -> &'static [&'static str] {
    if D == 2 { &["z"] } else { &["x", "y", "z"] }
}

/// The kind of a source and its boundaries.
fn name(job: &Job, source: Source) -> String {
    let (kind, on) = match source {
        Source::Support(at) => ("support", &job.support[at].on),
        Source::Contact(at) => ("contact", &job.contact[at].on),
        Source::Traction(at) => ("traction", &job.traction[at].on),
        Source::BodyForce => return "body_force".into(),
        Source::Momentum => return "momentum".into(),
    };
    format!("{kind} {}", on.join("+"))
}

/// The names of all sources that a run of the job may have.
pub(crate) fn source_names(job: &Job) -> Vec<String> {
    let supports = (0..job.support.len()).map(Source::Support);
    let contacts = (0..job.contact.len()).map(Source::Contact);
    let tractions = (0..job.traction.len()).map(Source::Traction);
    let others = [Source::BodyForce, Source::Momentum];
    supports.chain(contacts).chain(tractions).chain(others).map(|source| name(job, source)).collect()
}

/// The columns of the motion of an obstacle, each after a comma; empty where no force moves one.
struct ObstaclePath {
    motion: Option<[f64; 2]>,
    is_there: bool,
}

impl Display for ObstaclePath {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self.motion {
            Some(motion) => write!(f, ",{}", Numbers(&motion)),
            None if self.is_there => f.write_str(",,"),
            None => Ok(()),
        }
    }
}

/// The columns of contacts, each after a comma; empty where the source is no contact.
struct Areas {
    areas: Option<ContactAreas>,
    with: Columns,
}

impl Display for Areas {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Columns { contact, friction, .. } = self.with;
        let Some(areas) = self.areas else {
            let count = if contact { 4 } else { 0 } + if friction { 2 } else { 0 };
            return (0..count).try_for_each(|_| f.write_str(","));
        };
        let ContactAreas { touching, open, sticking, slipping, pressure, largest_pressure } = areas;
        let pressures = if touching == 0.0 { [0.0; 2] } else { [pressure / touching, largest_pressure] };
        write!(f, ",{},{}", Numbers(&[touching, open]), Numbers(&pressures))?;
        if friction { write!(f, ",{}", Numbers(&[sticking, slipping])) } else { Ok(()) }
    }
}
