//! Runs a job: builds only what the job contains, then takes the steps.

mod build;
mod check;
mod deadline;
mod estimate;
mod folder;
mod header;
mod validate;
mod inventory;
mod obstacles;
mod outputs;
mod phases;
mod restored;
mod scene;
mod setup;
mod simulation;
mod step_line;
mod steps;
mod summary;
mod time_loop;

pub use build::normal_law;
pub use check::Report;
pub use inventory::Inventory;
pub use scene::Scene;
pub use simulation::Simulation;
pub use summary::Summary;

use crate::{
    agreement::Agreed,
    error::{Exit, Result},
    job::Loaded,
    material::Hypothesis,
    session::Session,
};
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
    /// The initial state, overwriting the results of another job.
    Over,
    /// The newest good checkpoint of the output folder.
    Newest,
    /// This checkpoint.
    From(PathBuf),
}

impl Start {
    /// Whether the run continues an earlier one.
    fn goes_on(&self) -> bool {
        matches!(self, Self::Newest | Self::From(_))
    }
}

/// The start of the process, and whether its log is shown.
#[derive(Debug, Clone, Copy)]
pub struct Clock {
    /// When the process started.
    pub began: Instant,
    /// Time that MPI and PETSc took to start.
    pub launched: Duration,
    /// Whether the run's log is shown on the terminal too.
    pub on_terminal: bool,
}

/// Calls a function of a submodule on a job's mesh, for its dimension and hypothesis.
macro_rules! on_the_mesh {
    ($session:ident, $loaded:ident, $module:ident::$function:ident $(, $more:expr)*) => {{
        let mut loaded = $loaded;
        match (Scene::of($session, &mut loaded)?, loaded.job.material.hypothesis) {
            (Scene::Two(mesh), Some(Hypothesis::PlaneStrain)) => {
                $module::$function::<2, 4>($session, &loaded, mesh $(, $more)*)
            }
            (Scene::Two(mesh), _) => $module::$function::<2, 3>($session, &loaded, mesh $(, $more)*),
            (Scene::Three(mesh), _) => $module::$function::<3, 6>($session, &loaded, mesh $(, $more)*),
        }
    }};
}

/// Runs a job to its end or to a request to stop. Collective.
pub fn run(session: &Session, loaded: Loaded, start: &Start, clock: Clock) -> Result<Exit, Agreed> {
    on_the_mesh!(session, loaded, time_loop::run, start, clock)
}

/// Sets a job up as a run does and reports on it, without steps and without files. Collective.
pub fn check(session: &Session, loaded: Loaded) -> Result<Report, Agreed> {
    on_the_mesh!(session, loaded, check::check)
}
