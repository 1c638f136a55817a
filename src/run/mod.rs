//! From a job to results: builds only what the job calls for, then takes the steps.

mod build;
mod check;
mod estimate;
mod header;
mod inventory;
mod outputs;
mod scene;
mod setup;
mod simulation;
mod summary;
mod time_loop;

pub use inventory::Inventory;
pub use scene::{Scene, whole_mesh};
pub use simulation::Simulation;
pub use summary::Summary;

use crate::{
    error::{Error, Exit, Result},
    job::{self, Loaded},
    session::Session,
};
use mpi::topology::Communicator;
use mpi::traits::Root;
use scene::AnyScene;
use std::{
    path::PathBuf,
    time::{Duration, Instant},
};

/// Version of the solver with the id of its source.
pub const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), " (", env!("CLARKE_GIT_ID"), ")");

/// Where a run starts from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Start {
    /// The initial state.
    Anew,
    /// The newest good checkpoint of the output folder.
    Newest,
    /// This checkpoint.
    From(PathBuf),
}

/// When the process began and how long MPI and PETSc took to start.
#[derive(Debug, Clone, Copy)]
pub struct Clock {
    /// The beginning.
    pub began: Instant,
    /// Time until MPI and PETSc were up.
    pub launched: Duration,
}

/// What is to be done with a job.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Purpose {
    /// Run it to its end or to a request to stop.
    Run(Start),
    /// Print what a run would be, as text or as a JSON object; no file is written.
    Check {
        /// Print one JSON object.
        json: bool,
    },
}

/// Runs or checks a job. Collective.
pub fn run(session: &Session, loaded: Loaded, purpose: &Purpose, clock: Clock) -> Result<Exit> {
    let mut loaded = loaded;
    let scene = session.agree(scene::AnyScene::of(session, &mut loaded))?;
    match (dimension(session, &scene), loaded.job.material.hypothesis) {
        (2, Some(job::Hypothesis::PlaneStrain)) => {
            go_on::<2, 4>(session, &loaded, scene.and_then(AnyScene::two), purpose, clock)
        }
        (2, _) => go_on::<2, 3>(session, &loaded, scene.and_then(AnyScene::two), purpose, clock),
        (3, _) => go_on::<3, 6>(session, &loaded, scene.and_then(AnyScene::three), purpose, clock),
        (other, _) => Err(Error::Internal(format!("a mesh of dimension {other}"))),
    }
}

fn go_on<const D: usize, const S: usize>(
    session: &Session,
    loaded: &Loaded,
    scene: Option<Scene<D>>,
    purpose: &Purpose,
    clock: Clock,
) -> Result<Exit> {
    match purpose {
        Purpose::Run(start) => time_loop::run::<D, S>(session, loaded, scene, start, clock),
        Purpose::Check { json } => check::check::<D, S>(session, loaded, scene, *json),
    }
}

/// The dimension of the mesh, which rank 0 knows. Collective.
fn dimension(session: &Session, scene: &Option<AnyScene>) -> usize {
    let mut dimension = match scene {
        Some(AnyScene::Two(_)) => 2,
        Some(AnyScene::Three(_)) => 3,
        None => 0,
    };
    session.world().process_at_rank(0).broadcast_into(&mut dimension);
    dimension
}
