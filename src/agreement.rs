//! One outcome on all ranks.

use crate::error::{Error, Exit, Result};
use mpi::collective::SystemOperation;
use mpi::traits::{Communicator, CommunicatorCollectives, Root};

/// Turns the results of the ranks into one outcome: a value everywhere, or an error everywhere. A rank that failed
/// keeps its own error, the others get that of the lowest rank that failed. Collective.
pub fn agree<T>(communicator: &impl Communicator, result: Result<T>) -> Result<T> {
    let size = communicator.size();
    let own = if result.is_ok() { size } else { communicator.rank() };
    let mut lowest = size;
    communicator.all_reduce_into(&own, &mut lowest, SystemOperation::min());
    if lowest == size {
        return result;
    }
    let (mut exit, mut text) = match &result {
        Err(error) if own == lowest => (error.exit() as u8, error.to_string().into_bytes()),
        _ => (0, Vec::new()),
    };
    let culprit = communicator.process_at_rank(lowest);
    let mut length = text.len() as u64;
    culprit.broadcast_into(&mut exit);
    culprit.broadcast_into(&mut length);
    text.resize(length as usize, 0);
    culprit.broadcast_into(&mut text[..]);
    match result {
        Err(error) => Err(error),
        Ok(_) => Err(Error::Elsewhere {
            rank: lowest as usize,
            exit: Exit::from_code(i32::from(exit)),
            message: String::from_utf8_lossy(&text).into_owned(),
        }),
    }
}
