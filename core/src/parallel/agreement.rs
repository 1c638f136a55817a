//! One outcome on all ranks.

use crate::error::{Error, Exit, Result};
use mpi::collective::SystemOperation;
use mpi::topology::SimpleCommunicator;
use mpi::traits::{Communicator, CommunicatorCollectives, Root};
use std::cell::Cell;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::time::Duration;

/// Time for which a rank with a fault of a library waits until the other ranks reach the agreement that ends the run.
const GRACE: Duration = Duration::from_secs(10);

/// A failure known to all ranks, with the same kind, rank and message on each, so that control flow may depend on it.
///
/// Only [`agree`] creates it. A failure of one rank is an [`Error`], whose kind is not accessible.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{words}")]
pub struct Agreed {
    rank: usize,
    exit: Exit,
    words: String,
}

impl Agreed {
    /// The exit code of all ranks.
    pub fn exit(&self) -> Exit {
        self.exit
    }

    /// The lowest rank that failed, which prints the message.
    pub fn rank(&self) -> usize {
        self.rank
    }

    /// Whether the computation failed, so that another method may succeed; false if the job is refused or a library failed.
    pub fn is_failure(&self) -> bool {
        self.exit == Exit::Failed
    }
}

impl From<Agreed> for Error {
    fn from(Agreed { rank, exit, words }: Agreed) -> Self {
        Self::of_all(rank, exit, words)
    }
}

/// Combines the results of the ranks into one outcome: a value on every rank, or on every rank the failure of the lowest rank
/// that failed. Collective.
pub fn agree<T, E: Into<Error>>(communicator: &impl Communicator, result: Result<T, E>) -> Result<T, Agreed> {
    // The value may be a file that all ranks close together; it is kept until the ranks have agreed.
    let (value, error) = match result {
        Ok(value) => (Some(value), pass().err()),
        Err(error) => (None, Some(error.into())),
    };
    match (first_failure(communicator, error), value) {
        (None, Some(value)) => Ok(value),
        (failure, _) => {
            Err(failure.unwrap_or(Agreed { rank: 0, exit: Exit::Internal, words: String::new() }))
        }
    }
}

/// The failure of the lowest rank that failed; none if no rank did. Apart from [`agree`], so that it is compiled once for all values.
/// Collective.
fn first_failure(communicator: &impl Communicator, error: Option<Error>) -> Option<Agreed> {
    let (size, rank) = (communicator.size(), communicator.rank());
    let own = if error.is_none() { size } else { rank };
    let mut lowest = size;
    let watch = error
        .as_ref()
        .filter(|error| size > 1 && error.is_local_fault())
        .map(|error| end_alone_after_grace(rank, error));
    communicator.all_reduce_into(&own, &mut lowest, SystemOperation::min());
    drop(watch);
    if lowest == size {
        return None;
    }
    let mut failure = Agreed { rank: 0, exit: Exit::Internal, words: String::new() };
    if let Some(error) = error.filter(|_| rank == lowest) {
        let (known, exit, words) = error.into_parts();
        let is_told = known.is_some() || rank == 0;
        let words = if is_told { words } else { format!("rank {rank}: {words}") };
        failure = Agreed { rank: known.unwrap_or(rank as usize), exit, words };
    }
    let mut numbers = [failure.rank as u64, u64::from(failure.exit as u8), failure.words.len() as u64];
    let mut text = failure.words.into_bytes();
    let culprit = communicator.process_at_rank(lowest);
    culprit.broadcast_into(&mut numbers[..]);
    text.resize(numbers[2] as usize, 0);
    culprit.broadcast_into(&mut text[..]);
    Some(Agreed {
        rank: numbers[0] as usize,
        exit: Exit::from_code(numbers[1] as i32),
        words: String::from_utf8_lossy(&text).into_owned(),
    })
}

/// Ends the run on all ranks unless the returned value is dropped in time. A library that fails on one rank amid a collective
/// operation of its own leaves the other ranks waiting in it, so that they never reach the agreement; the run ends with exit code
/// 4 in either case.
fn end_alone_after_grace(rank: i32, error: &Error) -> Sender<()> {
    let words = format!(
        "error: rank {rank}: {error}\nOther ranks wait inside the library and cannot be notified: the run ends here."
    );
    let (dropped, waiting) = channel();
    std::thread::spawn(move || {
        if waiting.recv_timeout(GRACE) == Err(RecvTimeoutError::Timeout) {
            eprintln!("{words}");
            SimpleCommunicator::world().abort(Exit::Internal as i32);
        }
    });
    dropped
}

thread_local! {
    /// Number of agreements and file operations so far, and the number of the one to fail.
    static PASSED: Cell<u64> = const { Cell::new(0) };
    static FAILS: Cell<u64> = const { Cell::new(u64::MAX) };
}

/// Counts an agreement or a file operation of this process; fails if a test requests it.
pub(crate) fn pass() -> Result<()> {
    let number = PASSED.replace(PASSED.get() + 1);
    if number == FAILS.get() {
        return Err(Error::Failed(format!("operation {number} failed for a test")));
    }
    Ok(())
}

/// For tests: counts agreements and file operations of this thread from zero, and makes the one of this number fail. Returns how
/// many there were.
#[doc(hidden)]
pub fn fail_at(number: Option<u64>) -> u64 {
    FAILS.set(number.unwrap_or(u64::MAX));
    PASSED.replace(0)
}
