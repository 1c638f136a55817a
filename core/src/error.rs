//! Errors and exit codes, and what all readers of files refuse.

/// Exit codes, which are part of the public interface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Exit {
    /// The run reached its end time.
    Done = 0,
    /// The run failed; a state was saved.
    Failed = 1,
    /// The job, mesh or command line is refused before the run.
    Refused = 2,
    /// Stopped on request with a checkpoint; resubmit the job to continue.
    Stopped = 3,
    /// A fault of the solver or of a library.
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

/// An error with its message; its kind determines the exit code.
///
/// It may exist on one rank only. Therefore it does not reveal its kind: it only ends the present operation of the rank, and the
/// further flow depends on an `Agreed` failure, which is the same on all ranks.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{words}")]
pub struct Error {
    exit: Exit,
    words: String,
    /// The rank of the message, once all ranks have received it.
    rank: Option<usize>,
}

/// Result with the crate's error.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// The constructors, named as the variants of an enum; in contrast to these, the kinds cannot be distinguished afterwards.
#[allow(non_snake_case)]
impl Error {
    /// The job, mesh or command line is refused; the message states what is wrong, where, and what to do.
    pub fn Refused(words: String) -> Self {
        Self { exit: Exit::Refused, words, rank: None }
    }

    /// The run cannot continue; the message states what happened, when, and what to try.
    pub fn Failed(words: String) -> Self {
        Self { exit: Exit::Failed, words, rank: None }
    }

    /// The run was asked to stop.
    pub fn Stopped(words: String) -> Self {
        Self { exit: Exit::Stopped, words, rank: None }
    }

    /// A library or the machine failed without a fault of the user.
    pub fn Internal(words: String) -> Self {
        Self { exit: Exit::Internal, words, rank: None }
    }
}

impl Error {
    /// An error that all ranks know.
    pub(crate) fn of_all(rank: usize, exit: Exit, words: String) -> Self {
        Self { exit, words, rank: Some(rank) }
    }

    /// Whether a library failed, and other ranks may not know of it.
    pub(crate) fn is_local_fault(&self) -> bool {
        self.exit == Exit::Internal && self.rank.is_none()
    }

    /// Rank, if all ranks know the error, exit code and message.
    pub(crate) fn into_parts(self) -> (Option<usize>, Exit, String) {
        (self.rank, self.exit, self.words)
    }

    /// A file operation failed while input was read.
    pub fn unreadable(path: &std::path::Path, error: impl std::fmt::Display) -> Self {
        Self::Refused(format!("cannot read {}: {error}", path.display()))
    }

    /// A file operation failed while output was written.
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

/// Refuses to open what is neither a file nor a folder: a reader would wait for a pipe or a device, perhaps for ever.
pub(crate) fn regular_file(path: &std::path::Path) -> std::io::Result<std::fs::Metadata> {
    let found = std::fs::metadata(path)?;
    if found.is_file() || found.is_dir() {
        return Ok(found);
    }
    Err(std::io::Error::other("it is a device or a pipe, not a file: copy its contents to a file"))
}

#[cfg(test)]
mod tests {
    use super::regular_file;

    #[test]
    fn pipes_and_devices_are_refused_before_they_are_opened() {
        let folder = tempfile::tempdir().expect("folder");
        let pipe = folder.path().join("pipe");
        rustix::fs::mkfifoat(rustix::fs::CWD, &pipe, rustix::fs::Mode::RUSR | rustix::fs::Mode::WUSR)
            .expect("pipe");
        for path in [pipe.as_path(), std::path::Path::new("/dev/null"), std::path::Path::new("/dev/zero")] {
            let said = regular_file(path).expect_err("refused").to_string();
            assert!(said.contains("a device or a pipe"), "{said}");
        }
        std::fs::write(folder.path().join("file"), "1").expect("written");
        assert_eq!(regular_file(&folder.path().join("file")).expect("a file").len(), 1);
        assert!(regular_file(&folder.path().join("nowhere")).is_err());
    }
}
