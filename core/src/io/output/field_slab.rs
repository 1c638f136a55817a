//! The rows of a field that this rank writes.

use super::parallel_file::ParallelFile;
use super::redistribution::{Redistribution, first_of_part};
use crate::error::{Error, Result};
use crate::parallel::agreement::{Agreed, agree};
use mpi::collective::SystemOperation;
use mpi::traits::{Communicator, CommunicatorCollectives};

/// The position of the rows of this rank in the file.
pub(super) struct Slab {
    /// Rows this rank owns in the run.
    pub(super) owned: usize,
    /// Rows over all ranks.
    pub(super) total: u64,
    /// First row this rank writes.
    pub(super) first: u64,
    /// Redistribution from the order of the run to that of the file, if they differ.
    pub(super) reorder: Option<Redistribution>,
}

impl Slab {
    /// The slab of a new file, in the order of the ranks.
    pub(super) fn new(file: &ParallelFile, communicator: &impl Communicator, owned: usize) -> Self {
        let (own, mut total) = (owned as u64, 0_u64);
        communicator.all_reduce_into(&own, &mut total, SystemOperation::sum());
        Self { owned, total, first: file.slab_start(owned), reorder: None }
    }

    /// The slab of a file whose rows have the ids of the dataset `stored`, for a run whose rows have the ids `owned`.
    pub(super) fn resume(
        file: &ParallelFile,
        communicator: &impl Communicator,
        stored: &str,
        owned: &[u64],
    ) -> Result<Self, Agreed> {
        let mut slab = Self::new(file, communicator, owned.len());
        let rows = file.rows::<i64>(stored)?;
        if rows.count() != slab.total {
            let fault = Error::Refused(format!(
                "{}: {stored} has {} rows, the job's mesh {}: it belongs to another mesh. Restart with the job that wrote it \
                 or move the file away",
                file.path().display(),
                rows.count(),
                slab.total
            ));
            return agree(communicator, Err(fault));
        }
        let (rank, size) = (communicator.rank() as usize, communicator.size() as usize);
        slab.first = first_of_part(slab.total, rank, size);
        let count = first_of_part(slab.total, rank + 1, size) - slab.first;
        let wanted: Vec<u64> =
            rows.read(slab.first, count as usize)?.into_iter().map(|id| id as u64).collect();
        slab.reorder = Some(Redistribution::new(communicator, slab.total, owned, &wanted)?);
        Ok(slab)
    }
}
