//! `probes.csv`: displacement and velocity at points of the body, with one row per step and probe.

use super::csv::{CsvFile, Number, Numbers};
use crate::{
    error::{Error, Result},
    fem::{space::Simplex, state::State},
    job::Probe,
    linear_algebra::tensor::Vector,
    mesh::Mesh,
    parallel::session::Session,
};
use mpi::{collective::SystemOperation, traits::CommunicatorCollectives};
use std::path::Path;

/// Smallest barycentric coordinate of a point inside a cell, which allows for rounding.
const INSIDE: f64 = -1e-9;

/// The probes of a job; each is evaluated by one rank.
#[derive(Debug)]
pub(crate) struct Probes<const D: usize> {
    names: Vec<String>,
    /// Local cell and barycentric coordinates, on the rank that evaluates.
    places: Vec<Option<(usize, [f64; 4])>>,
    file: Option<CsvFile>,
    /// Values of this rank and of all ranks.
    room: [Vec<f64>; 2],
}

impl<const D: usize> Probes<D> {
    /// Finds the probes in the mesh; one outside the body is refused. Collective.
    pub(crate) fn locate(session: &Session, mesh: &Mesh<D>, probes: &[Probe]) -> Result<Self> {
        let mut places = Vec::new();
        for Probe { name, point } in probes {
            let point = std::array::from_fn(|i| point.get(i).copied().unwrap_or(0.0));
            let here = find(mesh, &point);
            let mine = if here.is_some() { session.rank() as f64 } else { f64::MAX };
            let owner = -session.largest([-mine])[0];
            if owner == f64::MAX {
                return Err(Error::Refused(format!(
                    "probe \"{name}\" at {point:?} m lies outside the body; move its point inside"
                )));
            }
            places.push(here.filter(|_| owner == mine));
        }
        Ok(Self {
            names: probes.iter().map(|probe| probe.name.clone()).collect(),
            places,
            file: None,
            room: Default::default(),
        })
    }

    /// Whether there are no probes.
    pub(crate) fn is_empty(&self) -> bool {
        self.names.is_empty()
    }

    /// Opens the file on rank 0, if there are probes; continues it after this step if one is given.
    pub(crate) fn open(&mut self, folder: &Path, goes_on_after: Option<u64>) -> Result<()> {
        if self.is_empty() {
            return Ok(());
        }
        let path = folder.join("probes.csv");
        let axes = &["x", "y", "z"][..D];
        let columns = |what: &str| axes.iter().map(|a| format!(",{what}_{a}")).collect::<String>();
        let header = format!("step,time,probe{}{}", columns("displacement"), columns("velocity"));
        self.file = Some(CsvFile::open(&path, &header, goes_on_after.map(|step| step as f64))?);
        Ok(())
    }

    /// Finds the values at all probes on all ranks: displacement, then velocity. Collective.
    fn values(&mut self, session: &Session, mesh: &Mesh<D>, state: &State) -> Result<()> {
        let (displacement, velocity) = (state.displacement.local()?, state.velocity.local()?);
        let [mine, all] = &mut self.room;
        mine.clear();
        mine.resize(self.names.len() * 2 * D, 0.0);
        all.clone_from(mine);
        for (place, values) in self.places.iter().zip(mine.chunks_exact_mut(2 * D)) {
            let Some((cell, shares)) = place else { continue };
            for (&node, share) in mesh.cell(*cell).iter().zip(shares) {
                for i in 0..D {
                    values[i] += share * displacement[node as usize * D + i];
                    values[D + i] += share * velocity[node as usize * D + i];
                }
            }
        }
        session.world().all_reduce_into(&mine[..], &mut all[..], SystemOperation::sum());
        Ok(())
    }

    /// Writes the rows of a step. Collective.
    pub(crate) fn write(&mut self, session: &Session, mesh: &Mesh<D>, state: &State) -> Result<()> {
        self.values(session, mesh, state)?;
        let Some(file) = &mut self.file else { return Ok(()) };
        for (name, values) in self.names.iter().zip(self.room[1].chunks_exact(2 * D)) {
            file.row(format_args!("{},{},{name},{}", state.step, Number(state.time), Numbers(values)))?;
        }
        Ok(())
    }

    /// Flushes all rows to the file.
    pub(crate) fn flush(&mut self) -> Result<()> {
        self.file.as_mut().map_or(Ok(()), CsvFile::flush)
    }
}

fn find<const D: usize>(mesh: &Mesh<D>, point: &Vector<D>) -> Option<(usize, [f64; 4])> {
    (0..mesh.cell_count()).find_map(|number| {
        let corners = mesh.corners(number);
        let outside = (0..D).any(|i| {
            let along = corners[..=D].iter().map(|c| c[i]);
            let (low, high) = along.fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(x), h.max(x)));
            let slack = 1e-9 * (high - low);
            point[i] < low - slack || point[i] > high + slack
        });
        if outside {
            return None;
        }
        let cell = Simplex::new(&corners[..=D]);
        let mut shares = [0.0; 4];
        shares[0] = 1.0;
        for a in 1..=D {
            shares[a] = (0..D).map(|i| cell.gradients[a - 1][i] * (point[i] - corners[0][i])).sum();
            shares[0] -= shares[a];
        }
        shares[..=D].iter().all(|s| *s >= INSIDE).then_some((number, shares))
    })
}
