//! Checksums of tables that do not depend on the distribution of the rows over the ranks.

use mpi::collective::SystemOperation;
use mpi::traits::CommunicatorCollectives;
use xxhash_rust::xxh3::{Xxh3, xxh3_64_with_seed};

/// The checksum of a table whose rows, identified by ids, are distributed over the ranks. It is the same for any order and any
/// number of ranks, and covers name, width, ids and values. Collective.
pub fn table_checksum(
    communicator: &impl CommunicatorCollectives,
    name: &str,
    width: usize,
    ids: &[u64],
    values: &[f64],
) -> u64 {
    let own = rows_checksum(ids, width, values);
    let mut sum = 0_u64;
    communicator.all_reduce_into(&own, &mut sum, SystemOperation::sum());
    sum.wrapping_add(title_checksum(name, width))
}

/// The contribution of these rows to the checksum of their table; contributions are added modulo 2^64.
///
/// `values` holds `width` numbers for each of `ids`.
fn rows_checksum(ids: &[u64], width: usize, values: &[f64]) -> u64 {
    let mut row = vec![0_u8; width * size_of::<f64>()];
    let mut sum = 0_u64;
    for (position, id) in ids.iter().enumerate() {
        let numbers = &values[position * width..(position + 1) * width];
        for (bytes, number) in row.chunks_exact_mut(size_of::<f64>()).zip(numbers) {
            bytes.copy_from_slice(&number.to_le_bytes());
        }
        sum = sum.wrapping_add(xxh3_64_with_seed(&row, *id));
    }
    sum
}

/// The contribution of the name and the width of a table to its checksum.
fn title_checksum(name: &str, width: usize) -> u64 {
    let mut hash = Xxh3::new();
    hash.update(name.as_bytes());
    hash.update(&(width as u64).to_le_bytes());
    hash.digest()
}

#[cfg(test)]
mod tests {
    use super::*;

    const IDS: [u64; 3] = [7, 0, 3];
    const VALUES: [f64; 6] = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];

    #[test]
    fn parts_of_a_table_add_up_to_the_whole_in_any_order() {
        let whole = rows_checksum(&IDS, 2, &VALUES);
        let last = rows_checksum(&IDS[2..], 2, &VALUES[4..]);
        let first = rows_checksum(&IDS[..2], 2, &VALUES[..4]);
        assert_eq!(whole, last.wrapping_add(first));
    }

    #[test]
    fn rows_that_trade_ids_change_the_checksum() {
        assert_ne!(rows_checksum(&IDS, 2, &VALUES), rows_checksum(&[0, 7, 3], 2, &VALUES));
    }

    #[test]
    fn a_sign_of_zero_changes_the_checksum() {
        assert_ne!(rows_checksum(&[1], 1, &[0.0]), rows_checksum(&[1], 1, &[-0.0]));
    }

    #[test]
    fn name_and_width_are_part_of_the_checksum() {
        assert_ne!(title_checksum("velocity", 2), title_checksum("velocity", 3));
        assert_ne!(title_checksum("velocity", 2), title_checksum("displacement", 2));
    }
}
