//! Moves rows identified by global ids from the ranks that hold them to the ranks that need them.
//!
//! A directory of all ids is distributed over the ranks in equal blocks, so that no rank needs more memory than its part.

use crate::error::{Error, Result};
use crate::parallel::agreement::{Agreed, agree};
use crate::parallel::exchange::{exchange, offsets};
use mpi::collective::SystemOperation;
use mpi::topology::SimpleCommunicator;
use mpi::traits::{Communicator, CommunicatorCollectives};
use xxhash_rust::xxh3::xxh3_64;

/// A plan for the transfer of rows, computed once for a pair of row orders and applied to any number of tables.
pub struct Redistribution {
    communicator: SimpleCommunicator,
    send_rows: Vec<usize>,
    send_counts: Vec<usize>,
    receive_positions: Vec<usize>,
}

impl Redistribution {
    /// Plans the transfer of rows `held` by this rank to the `wanted` rows, both given by ids below `total`.
    ///
    /// Over all ranks each id must be held exactly once and may be requested any number of times. Collective, with the
    /// same outcome on all ranks.
    pub fn new(
        communicator: &impl Communicator,
        total: u64,
        held: &[u64],
        wanted: &[u64],
    ) -> Result<Self, Agreed> {
        let communicator = communicator.duplicate();
        let within = |ids: &[u64]| match ids.iter().find(|id| **id >= total) {
            Some(id) => Err(Error::Refused(format!("id {id} found, but there are only {total} rows"))),
            None => Ok(()),
        };
        agree(&communicator, within(held).and_then(|()| within(wanted)))?;
        let directory = Directory::new(&communicator, total, held)?;
        let holders = directory.look_up(&communicator, wanted)?;

        let grouped =
            Grouped::new(communicator.size() as usize, holders.iter().map(|place| place[0] as usize));
        let requests: Vec<u64> = grouped.order.iter().map(|position| holders[*position][1]).collect();
        let (send_rows, send_counts) = exchange(&communicator, &requests, &grouped.counts)?;
        let send_rows = send_rows.into_iter().map(|row| row as usize).collect();
        Ok(Self { communicator, send_rows, send_counts, receive_positions: grouped.order })
    }

    /// The requested rows, in the order of the request, of a table with `width` numbers a row of which this rank
    /// holds `values`. Collective, with the same outcome on all ranks.
    pub fn apply(&self, width: usize, values: &[f64]) -> Result<Vec<f64>, Agreed> {
        let mut packed = Vec::with_capacity(self.send_rows.len() * width);
        for row in &self.send_rows {
            packed.extend_from_slice(&values[row * width..(row + 1) * width]);
        }
        let counts: Vec<usize> = self.send_counts.iter().map(|rows| rows * width).collect();
        let (received, _) = exchange(&self.communicator, &packed, &counts)?;
        let mut wanted = vec![0.0; self.receive_positions.len() * width];
        for (row, position) in self.receive_positions.iter().enumerate() {
            wanted[position * width..(position + 1) * width]
                .copy_from_slice(&received[row * width..(row + 1) * width]);
        }
        Ok(wanted)
    }
}

/// Whether over all ranks each id below `total` is held exactly once, without an exchange of ids: the ids that are
/// held must have the same sum of hashes as the ids below `total`; others have it with a probability of 2^-64. Collective.
pub fn are_whole(communicator: &impl Communicator, total: u64, held: &[u64]) -> bool {
    let hashes = |ids: &mut dyn Iterator<Item = u64>| {
        ids.fold(0_u64, |sum, id| sum.wrapping_add(xxh3_64(&id.to_le_bytes())))
    };
    let (part, parts) = (communicator.rank() as usize, communicator.size() as usize);
    let mut share = first_of_part(total, part, parts)..first_of_part(total, part + 1, parts);
    let own = hashes(&mut held.iter().copied()).wrapping_sub(hashes(&mut share));
    let mut sum = 0_u64;
    communicator.all_reduce_into(&own, &mut sum, SystemOperation::sum());
    sum == 0
}

/// The first of the rows that part `part` of `parts` owns of `total` rows; part `parts` starts at the end.
pub fn first_of_part(total: u64, part: usize, parts: usize) -> u64 {
    (u128::from(total) * part as u128).div_ceil(parts as u128) as u64
}

fn part_of(total: u64, row: u64, parts: usize) -> usize {
    (u128::from(row) * parts as u128 / u128::from(total)) as usize
}

/// The holders of the ids: the block of the directory on this rank.
struct Directory {
    total: u64,
    first: u64,
    /// Rank and row, in the order of the ids.
    places: Vec<[u64; 2]>,
}

impl Directory {
    fn new(communicator: &SimpleCommunicator, total: u64, held: &[u64]) -> Result<Self, Agreed> {
        const NOBODY: [u64; 2] = [u64::MAX; 2];
        let (rank, size) = (communicator.rank() as usize, communicator.size() as usize);
        let grouped = Grouped::new(size, held.iter().map(|id| part_of(total, *id, size)));
        let entries: Vec<u64> = grouped.order.iter().flat_map(|row| [held[*row], *row as u64]).collect();
        let counts: Vec<usize> = grouped.counts.iter().map(|count| 2 * count).collect();
        let (entries, counts) = exchange(communicator, &entries, &counts)?;

        let first = first_of_part(total, rank, size);
        let mut places = vec![NOBODY; (first_of_part(total, rank + 1, size) - first) as usize];
        let mut fault = Ok(());
        let senders = counts.iter().enumerate().flat_map(|(sender, count)| vec![sender; count / 2]);
        for (entry, sender) in entries.chunks_exact(2).zip(senders) {
            let place = &mut places[(entry[0] - first) as usize];
            if *place != NOBODY {
                fault = Err(Error::Refused(format!("row {} occurs twice", entry[0])));
            }
            *place = [sender as u64, entry[1]];
        }
        if let Some(position) = places.iter().position(|place| *place == NOBODY) {
            fault = Err(Error::Refused(format!("row {} is missing", first + position as u64)));
        }
        agree(communicator, fault)?;
        Ok(Self { total, first, places })
    }

    /// Rank and row that hold each of these ids.
    fn look_up(&self, communicator: &SimpleCommunicator, ids: &[u64]) -> Result<Vec<[u64; 2]>, Agreed> {
        let size = communicator.size() as usize;
        let grouped = Grouped::new(size, ids.iter().map(|id| part_of(self.total, *id, size)));
        let questions: Vec<u64> = grouped.order.iter().map(|position| ids[*position]).collect();
        let (questions, counts) = exchange(communicator, &questions, &grouped.counts)?;
        let answers: Vec<u64> =
            questions.iter().flat_map(|id| self.places[(id - self.first) as usize]).collect();
        let counts: Vec<usize> = counts.iter().map(|count| 2 * count).collect();
        let (answers, _) = exchange(communicator, &answers, &counts)?;
        let mut places = vec![[0; 2]; ids.len()];
        for (position, answer) in grouped.order.iter().zip(answers.chunks_exact(2)) {
            places[*position] = [answer[0], answer[1]];
        }
        Ok(places)
    }
}

/// Positions of a list, grouped by the rank each belongs to.
struct Grouped {
    order: Vec<usize>,
    counts: Vec<usize>,
}

impl Grouped {
    fn new(ranks: usize, rank_of: impl Iterator<Item = usize> + Clone) -> Self {
        let mut counts = vec![0; ranks];
        for rank in rank_of.clone() {
            counts[rank] += 1;
        }
        let mut next = offsets(&counts);
        let mut order = vec![0; counts.iter().sum()];
        for (position, rank) in rank_of.enumerate() {
            order[next[rank]] = position;
            next[rank] += 1;
        }
        Self { order, counts }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_cover_all_rows_and_each_row_lies_in_its_part() {
        for total in [1, 2, 5, 16, 1001] {
            for parts in 1..7 {
                assert_eq!(first_of_part(total, 0, parts), 0);
                assert_eq!(first_of_part(total, parts, parts), total);
                for row in 0..total {
                    let part = part_of(total, row, parts);
                    assert!(first_of_part(total, part, parts) <= row);
                    assert!(row < first_of_part(total, part + 1, parts));
                }
            }
        }
    }

    #[test]
    fn grouping_keeps_the_order_within_a_rank() {
        let grouped = Grouped::new(3, [2, 0, 2, 0].into_iter());
        assert_eq!(grouped.order, [1, 3, 0, 2]);
        assert_eq!(grouped.counts, [2, 0, 2]);
    }
}
