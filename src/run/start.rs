//! The options of the command line that affect a run besides its job.

use std::{
    path::PathBuf,
    time::{Duration, Instant},
};

/// Version of the solver with the id of its source.
pub const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), " (", env!("CLARKE_GIT_ID"), ")");

/// The state from which a run starts.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Start {
    /// The initial state.
    Anew,
    /// The initial state, overwriting the results of another job.
    Over,
    /// The newest valid checkpoint of the output folder.
    Newest,
    /// This checkpoint.
    From(PathBuf),
}

impl Start {
    /// Whether the run continues an earlier one.
    pub(super) fn is_restart(&self) -> bool {
        matches!(self, Self::Newest | Self::From(_))
    }
}

/// The start of the process, and whether its log is shown.
#[derive(Debug, Clone, Copy)]
pub struct Clock {
    /// Start of the process.
    pub began: Instant,
    /// Time until MPI and PETSc were initialised.
    pub launched: Duration,
    /// Whether the run's log is shown on the terminal too.
    pub on_terminal: bool,
    /// Whether every step of a long run is logged.
    pub logs_every_step: bool,
}
