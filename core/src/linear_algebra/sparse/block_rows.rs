//! Sparse matrices of dense blocks by rows.

use crate::{
    error::{Error, Result},
    linear_algebra::bindings::PetscInt,
};

/// Bits of PETSc's indices: 32 or 64, as it was built.
pub const INDEX_BITS: u32 = PetscInt::BITS;

/// A count as PETSc's index, or an error that says which count is too large.
pub(crate) fn index(count: usize, what: &str) -> Result<PetscInt> {
    PetscInt::try_from(count).map_err(|_| {
        Error::Refused(format!(
            "{what}: {count} exceeds the {INDEX_BITS}-bit indices of this PETSc; use more ranks, a coarser mesh or a PETSc with \
             64-bit indices"
        ))
    })
}

/// The rows this rank owns of a sparse matrix of dense blocks.
#[derive(Debug, Clone, Default)]
pub struct BlockRows {
    /// Where each owned block row starts in `columns`; one more entry than rows.
    pub offsets: Vec<usize>,
    /// Global block columns, ascending within a row.
    pub columns: Vec<u32>,
    /// `block * block` values for each column, row by row.
    pub values: Vec<f64>,
}

impl BlockRows {
    /// Fails unless these are rows of a matrix with this number of block columns, and of a size that PETSc's indices can count. Ranks
    /// have to agree on the outcome before they make a matrix.
    pub fn check(&self, block: usize, block_columns: usize) -> Result<()> {
        index(block_columns * block, "unknowns")?;
        index(self.columns.len() * block * block, "matrix entries of a rank")?;
        let starts = self.offsets.first() == Some(&0) && self.offsets.is_sorted();
        let sizes = self.offsets.last() == Some(&self.columns.len())
            && self.values.len() == self.columns.len() * block * block;
        let row = |range: &[usize]| {
            let columns = &self.columns[range[0]..range[1]];
            columns.is_sorted_by(|a, b| a < b) && columns.last().is_none_or(|&c| (c as usize) < block_columns)
        };
        if starts && sizes && self.offsets.windows(2).all(row) {
            return Ok(());
        }
        Err(Error::Internal(format!("{} block rows that are none of a matrix", self.offsets.len())))
    }

    /// The `block * block` values of a row of this rank and a global column, if they are stored.
    pub fn block_mut(&mut self, row: usize, column: u32, block: usize) -> Option<&mut [f64]> {
        let range = self.offsets[row]..self.offsets[row + 1];
        let place = range.start + self.columns[range].binary_search(&column).ok()?;
        self.values.get_mut(place * block * block..(place + 1) * block * block)
    }

    /// Adds the entries of other rows that are stored in these, too.
    pub fn add(&mut self, other: &Self, block: usize) {
        for (row, range) in other.offsets.windows(2).enumerate() {
            for at in range[0]..range[1] {
                let Some(sum) = self.block_mut(row, other.columns[at], block) else { continue };
                let more = &other.values[at * block * block..][..block * block];
                sum.iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_have_ascending_columns_of_the_matrix_and_a_block_for_each() {
        let rows = |columns: &[u32]| BlockRows {
            offsets: vec![0, columns.len()],
            columns: columns.to_vec(),
            values: vec![1.0; columns.len() * 4],
        };
        assert!(rows(&[0, 2, 3]).check(2, 4).is_ok());
        for wrong in [[0, 2, 2], [0, 3, 2], [0, 2, 4]] {
            assert!(rows(&wrong).check(2, 4).is_err(), "{wrong:?}");
        }
        assert!(BlockRows { values: vec![1.0; 11], ..rows(&[0, 2, 3]) }.check(2, 4).is_err());
        assert!(BlockRows { offsets: vec![1, 3], ..rows(&[0, 2, 3]) }.check(2, 4).is_err());
    }
}
