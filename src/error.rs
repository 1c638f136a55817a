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

/// An error with the words the user reads; its kind decides the exit code.
///
/// It may be known on one rank alone. Nothing may depend on it but the end of what the rank is doing, so it does not show its kind:
/// what ranks do next is chosen by an `Agreed` failure, which is the same on all of them.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{words}")]
pub struct Error {
    exit: Exit,
    words: String,
    /// Whose words they are, once all ranks know of it.
    rank: Option<usize>,
}

/// Result with the crate's error.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// The kinds, made as the variants of an enum would be; unlike these, they can't be told apart again.
#[allow(non_snake_case)]
impl Error {
    /// The job, mesh or command line can't be run: what, where and what to do.
    pub fn Refused(words: String) -> Self {
        Self { exit: Exit::Refused, words, rank: None }
    }

    /// The run can't go on: what happened, when, and what to try.
    pub fn Failed(words: String) -> Self {
        Self { exit: Exit::Failed, words, rank: None }
    }

    /// A library or the machine failed in a way the user did not cause.
    pub fn Internal(words: String) -> Self {
        Self { exit: Exit::Internal, words, rank: None }
    }
}

impl Error {
    /// One that all ranks share.
    pub(crate) fn of_all(rank: usize, exit: Exit, words: String) -> Self {
        Self { exit, words, rank: Some(rank) }
    }

    /// Whether a library failed, and other ranks may not know of it.
    pub(crate) fn is_local_fault(&self) -> bool {
        self.exit == Exit::Internal && self.rank.is_none()
    }

    /// Rank, if all know of it, exit code and words.
    pub(crate) fn into_parts(self) -> (Option<usize>, Exit, String) {
        (self.rank, self.exit, self.words)
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

/// The exit code that an error ends the process with.
impl From<Error> for Exit {
    fn from(error: Error) -> Self {
        error.exit
    }
}
