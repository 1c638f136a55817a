//! One outcome on all ranks.

use crate::error::{Error, Exit, Result};
use mpi::collective::SystemOperation;
use mpi::traits::{Communicator, CommunicatorCollectives, Root};

/// Turns the results of the ranks into one outcome: a value everywhere, or an error everywhere. The lowest rank that
/// failed by itself keeps its error, the others get its words. Collective.
pub fn agree<T>(communicator: &impl Communicator, result: Result<T>) -> Result<T> {
    let (size, rank) = (communicator.size(), communicator.rank());
    let own = match &result {
        Ok(_) => 2 * size,
        Err(Error::Elsewhere { .. }) => size + rank,
        Err(_) => rank,
    };
    let mut lowest = 2 * size;
    communicator.all_reduce_into(&own, &mut lowest, SystemOperation::min());
    if lowest == 2 * size {
        return result;
    }
    let (mut exit, mut text) = match &result {
        Err(error) if own == lowest => (error.exit() as u8, error.to_string().into_bytes()),
        _ => (0, Vec::new()),
    };
    let speaker = lowest % size;
    let culprit = communicator.process_at_rank(speaker);
    let mut length = text.len() as u64;
    culprit.broadcast_into(&mut exit);
    culprit.broadcast_into(&mut length);
    text.resize(length as usize, 0);
    culprit.broadcast_into(&mut text[..]);
    match result {
        Err(error) if own == lowest => Err(error),
        _ => Err(Error::Elsewhere {
            rank: speaker as usize,
            exit: Exit::from_code(i32::from(exit)),
            message: String::from_utf8_lossy(&text).into_owned(),
        }),
    }
}
