//! The options of the command line that affect a run besides its job.

use std::{
    path::PathBuf,
    sync::OnceLock,
    time::{Duration, Instant},
};

/// The version with the id of its source, once the program has stated it.
static VERSION: OnceLock<String> = OnceLock::new();

/// Version of the solver, with the id of its source in a program that has stated it.
pub fn version() -> &'static str {
    VERSION.get().map_or(env!("CARGO_PKG_VERSION"), String::as_str)
}

/// States the id of the source that is built, once at the start of a program: the library has none of its own, so that a new
/// commit does not compile it again.
pub fn state_source(id: &str) {
    VERSION.get_or_init(|| format!("{} ({id})", env!("CARGO_PKG_VERSION")));
}

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
