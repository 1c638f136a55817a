//! What can go wrong, and the exit code each ends with.

/// How the process ends; the numbers are part of the contract with batch scripts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Exit {
    /// The run reached its end time.
    Done = 0,
    /// The run failed; a state was saved.
    Failed = 1,
    /// The job, mesh or command line is refused before anything ran.
    Refused = 2,
    /// Stopped on request with a checkpoint; resubmit to go on.
    Stopped = 3,
    /// A fault of the solver or of a library it stands on.
    Internal = 4,
}

impl Exit {
    /// The exit code with this number; unknown numbers are internal faults.
    pub fn from_code(code: i32) -> Self {
        match code {
            0 => Self::Done,
            1 => Self::Failed,
            2 => Self::Refused,
            3 => Self::Stopped,
            _ => Self::Internal,
        }
    }
}

/// An error with the words the user reads; the kind decides the exit code.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// The job, mesh or command line can't be run: what, where and what to do.
    #[error("{0}")]
    Refused(String),
    /// The run can't go on: what happened, when, and what to try.
    #[error("{0}")]
    Failed(String),
    /// A library or the machine failed in a way the user did not cause.
    #[error("{0}")]
    Internal(String),
    /// Another rank failed; it carries that rank's own words.
    #[error("rank {rank}: {message}")]
    Elsewhere {
        /// The lowest rank that failed.
        rank: usize,
        /// The exit code of that rank's error.
        exit: Exit,
        /// That rank's message.
        message: String,
    },
}

/// Result with the crate's error.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// The exit code this error ends the process with.
    pub fn exit(&self) -> Exit {
        match self {
            Self::Refused(_) => Exit::Refused,
            Self::Failed(_) => Exit::Failed,
            Self::Internal(_) => Exit::Internal,
            Self::Elsewhere { exit, .. } => *exit,
        }
    }

    /// A file operation that failed while the job was being read.
    pub fn unreadable(path: &std::path::Path, error: impl std::fmt::Display) -> Self {
        Self::Refused(format!("cannot read {}: {error}", path.display()))
    }

    /// A file operation that failed while results were being written.
    pub fn unwritable(path: &std::path::Path, error: impl std::fmt::Display) -> Self {
        Self::Failed(format!("cannot write {}: {error}", path.display()))
    }
}
