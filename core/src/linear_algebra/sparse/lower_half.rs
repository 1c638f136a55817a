use super::{BlockRows, cholmod::INDEX_KIND, sys};
use crate::error::{Error, Result};
use std::{ffi::c_int, ptr};

/// The lower half of a matrix by columns.
#[derive(Default)]
pub(super) struct Lower {
    starts: Vec<sys::PetscInt>,
    indices: Vec<sys::PetscInt>,
    values: Vec<f64>,
}

impl Lower {
    /// The columns of a symmetric matrix from the diagonal down are its rows from the diagonal on. Zeros are left out: held
    /// components are coupled to nothing. Entries between these pairs of unknowns, in ascending order, are stored also where they
    /// are zero.
    pub(super) fn of(block: usize, rows: &BlockRows, mut stored: &[(usize, usize)]) -> Result<Self> {
        let entries = (rows.columns.len() + rows.offsets.len()) / 2 * block * block;
        let too_many = |_| {
            Error::Refused(format!(
                "{entries} matrix entries are more than CHOLMOD can count: use [solver] preconditioner = \"gamg\""
            ))
        };
        sys::PetscInt::try_from(entries).map_err(too_many)?;
        u32::try_from((rows.offsets.len() - 1) * block).map_err(too_many)?;
        let mut lower = Self {
            starts: Vec::with_capacity((rows.offsets.len() - 1) * block + 1),
            indices: Vec::with_capacity(entries),
            values: Vec::with_capacity(entries),
        };
        lower.starts.push(0);
        for (node, range) in rows.offsets.windows(2).enumerate() {
            for i in 0..block {
                let row = node * block + i;
                for at in range[0]..range[1] {
                    let first = rows.columns[at] as usize * block;
                    for j in (0..block).filter(|j| first + j >= row) {
                        let value = rows.values[(at * block + i) * block + j];
                        if value != 0.0 || first + j == row {
                            lower.indices.push((first + j) as sys::PetscInt);
                            lower.values.push(value);
                        }
                    }
                }
                while let Some(&(first, second)) = stored.first().filter(|pair| pair.0 <= row) {
                    stored = &stored[1..];
                    lower.store(first, second);
                }
                lower.starts.push(lower.indices.len() as sys::PetscInt);
            }
        }
        Ok(lower)
    }

    /// Stores an entry of the column that is being written, if it is not stored yet.
    fn store(&mut self, column: usize, row: usize) {
        debug_assert_eq!(column + 1, self.starts.len());
        let start = self.starts[column] as usize;
        let at = start + self.indices[start..].partition_point(|&other| (other as usize) < row);
        if self.indices.get(at).is_none_or(|&other| other as usize != row) {
            self.indices.insert(at, row as sys::PetscInt);
            self.values.insert(at, 0.0);
        }
    }

    /// Stored entries.
    pub(super) fn len(&self) -> usize {
        self.indices.len()
    }

    /// Column, row and value of each entry.
    pub(super) fn entries(&self) -> impl Iterator<Item = (usize, usize, f64)> {
        self.starts.windows(2).enumerate().flat_map(|(column, range)| {
            let range = range[0] as usize..range[1] as usize;
            let rows = self.indices[range.clone()].iter().map(|&row| row as usize);
            rows.zip(&self.values[range]).map(move |(row, &value)| (column, row, value))
        })
    }

    pub(super) fn view(&mut self) -> sys::cholmod_sparse {
        view(self.starts.len() - 1, &mut self.starts, &mut self.indices, Some(&mut self.values))
    }
}

/// CHOLMOD's view of the lower half of a symmetric matrix; it must not outlive the arrays.
pub(super) fn view(
    size: usize,
    starts: &mut [sys::PetscInt],
    indices: &mut [sys::PetscInt],
    values: Option<&mut [f64]>,
) -> sys::cholmod_sparse {
    let kind = if values.is_some() { sys::CHOLMOD_REAL } else { sys::CHOLMOD_PATTERN };
    sys::cholmod_sparse {
        nrow: size,
        ncol: size,
        nzmax: indices.len(),
        p: starts.as_mut_ptr().cast(),
        i: indices.as_mut_ptr().cast(),
        nz: ptr::null_mut(),
        x: values.map_or(ptr::null_mut(), |values| values.as_mut_ptr().cast()),
        z: ptr::null_mut(),
        stype: -1,
        itype: INDEX_KIND,
        xtype: kind as c_int,
        dtype: sys::CHOLMOD_DOUBLE as c_int,
        sorted: 1,
        packed: 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zeros_are_left_out_but_on_the_diagonal() {
        let rows = BlockRows { offsets: vec![0, 1], columns: vec![0], values: vec![0.0, 0.0, 0.0, 4.0] };
        let lower = Lower::of(2, &rows, &[]).unwrap();
        assert_eq!((&lower.starts[..], &lower.indices[..]), (&[0, 1, 2][..], &[0, 1][..]));
        assert_eq!(lower.values, [0.0, 4.0]);
        let lower = Lower::of(2, &rows, &[(0, 1), (1, 1)]).unwrap();
        assert_eq!((&lower.starts[..], &lower.indices[..]), (&[0, 2, 3][..], &[0, 1, 1][..]));
        assert_eq!(lower.values, [0.0, 0.0, 4.0]);
    }

    #[test]
    fn columns_go_from_the_diagonal_down() {
        let rows = BlockRows {
            offsets: vec![0, 2, 4],
            columns: vec![0, 1, 0, 1],
            values: vec![1.0, 2.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 4.0, 6.0, 5.0, 7.0, 8.0, 9.0, 9.0, 10.0],
        };
        let lower = Lower::of(2, &rows, &[]).unwrap();
        assert_eq!(lower.starts, [0, 4, 7, 9, 10]);
        assert_eq!(lower.indices, [0, 1, 2, 3, 1, 2, 3, 2, 3, 3]);
        assert_eq!(lower.values, [1.0, 2.0, 4.0, 5.0, 3.0, 6.0, 7.0, 8.0, 9.0, 10.0]);
    }
}
