//! Messages whose lengths are known to the sender only.

use crate::{
    error::{Error, Result},
    parallel::agreement::{Agreed, agree},
};
use mpi::{
    Count,
    datatype::{Equivalence, Partition, PartitionMut},
    topology::{Communicator, SimpleCommunicator},
    traits::CommunicatorCollectives,
};

/// Sends `counts[r]` of the numbers, which are sorted by rank, to rank `r`; returns the received numbers in the order of the ranks,
/// and their count for each rank. Collective, with the same outcome on all ranks.
///
/// Fails where one rank sends or receives 2^31 numbers or more: MPI counts in 32 bits.
pub fn exchange<T: Equivalence + Copy + Default>(
    communicator: &SimpleCommunicator,
    numbers: &[T],
    counts: &[usize],
) -> Result<(Vec<T>, Vec<usize>), Agreed> {
    let mut received_counts = vec![0_u64; counts.len()];
    let sent_counts: Vec<u64> = counts.iter().map(|count| *count as u64).collect();
    communicator.all_to_all_into(&sent_counts[..], &mut received_counts[..]);
    let received_counts: Vec<usize> = received_counts.into_iter().map(|count| count as usize).collect();

    let both = mpi_counts(counts).and_then(|sent| Ok((sent, mpi_counts(&received_counts)?)));
    let ((send_counts, send_offsets), (take_counts, take_offsets)) = agree(communicator, both)?;
    let mut received = vec![T::default(); received_counts.iter().sum()];
    communicator.all_to_all_varcount_into(
        &Partition::new(numbers, &send_counts[..], &send_offsets[..]),
        &mut PartitionMut::new(&mut received[..], &take_counts[..], &take_offsets[..]),
    );
    Ok((received, received_counts))
}

/// As [`exchange`], with a list for each rank.
pub fn exchange_lists<T: Equivalence + Copy + Default>(
    communicator: &SimpleCommunicator,
    lists: &[Vec<T>],
) -> Result<Vec<T>, Agreed> {
    let counts: Vec<usize> = lists.iter().map(Vec::len).collect();
    Ok(exchange(communicator, &lists.concat(), &counts)?.0)
}

/// The numbers of all ranks, in the order of the ranks. Collective, with the same outcome on all ranks.
pub fn gather<T: Equivalence + Copy + Default>(
    communicator: &SimpleCommunicator,
    numbers: &[T],
) -> Result<Vec<T>, Agreed> {
    let gathering = Gathering::new(communicator, numbers.len())?;
    let mut all = vec![T::default(); gathering.total()];
    gathering.gather(communicator, numbers, &mut all);
    Ok(all)
}

/// Repeated gathering of lists of constant length.
#[derive(Debug)]
pub struct Gathering {
    counts: Vec<Count>,
    starts: Vec<Count>,
}

impl Gathering {
    /// Prepares gathering of this many numbers from this rank. Collective, with the same outcome on all ranks.
    pub fn new(communicator: &SimpleCommunicator, count: usize) -> Result<Self, Agreed> {
        let mut counts = vec![0_u64; communicator.size() as usize];
        communicator.all_gather_into(&(count as u64), &mut counts[..]);
        let counts: Vec<usize> = counts.into_iter().map(|count| count as usize).collect();
        let (counts, starts) = agree(communicator, mpi_counts(&counts))?;
        Ok(Self { counts, starts })
    }

    /// Number of values of all ranks.
    pub fn total(&self) -> usize {
        self.counts.iter().map(|&count| count as usize).sum()
    }

    /// The range of the numbers of a rank in those of all ranks.
    pub fn range(&self, rank: usize) -> std::ops::Range<usize> {
        let start = self.starts[rank] as usize;
        start..start + self.counts[rank] as usize
    }

    /// Writes the numbers of all ranks to `all`, in the order of the ranks. Collective.
    pub fn gather<T: Equivalence>(&self, communicator: &SimpleCommunicator, numbers: &[T], all: &mut [T]) {
        communicator.all_gather_varcount_into(
            numbers,
            &mut PartitionMut::new(all, &self.counts[..], &self.starts[..]),
        );
    }
}

/// The start of each of the counted parts.
pub fn offsets(counts: &[usize]) -> Vec<usize> {
    counts.iter().scan(0, |next, count| Some(std::mem::replace(next, *next + count))).collect()
}

fn mpi_counts(counts: &[usize]) -> Result<(Vec<Count>, Vec<Count>)> {
    let narrow = |numbers: &[usize]| numbers.iter().map(|number| Count::try_from(*number)).collect();
    let total: usize = counts.iter().sum();
    match (narrow(counts), narrow(&offsets(counts)), Count::try_from(total)) {
        (Ok(counts), Ok(offsets), Ok(_)) => Ok((counts, offsets)),
        _ => Err(Error::Failed(format!(
            "a rank has to exchange {total} numbers at once, more than MPI can count: use more ranks"
        ))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_start_where_the_parts_before_end() {
        assert_eq!(offsets(&[2, 0, 3]), [0, 2, 2]);
    }

    #[test]
    fn more_numbers_than_mpi_can_count_are_refused_in_words() {
        let error = mpi_counts(&[1 << 30, 1 << 30]).expect_err("too many").to_string();
        assert!(error.contains("use more ranks"), "{error}");
    }
}
