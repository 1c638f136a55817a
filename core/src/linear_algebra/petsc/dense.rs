use super::{DistributedVector, check, index, reference::Reference, sys};
use crate::error::{Error, Result};
use std::ptr;

/// Factors of a dense matrix that is stored completely on this rank.
#[derive(Debug)]
pub struct LocalFactor {
    factor: Reference<sys::_p_Mat>,
    /// Right-hand side and solution.
    vectors: [DistributedVector; 2],
}

impl LocalFactor {
    /// LU factors of a matrix, given column by column.
    pub fn lu(size: usize, columns: &[f64]) -> Result<Self> {
        if columns.len() != size * size {
            return Err(Error::Internal(format!("{} numbers for {size} columns of {size}", columns.len())));
        }
        let size = index(size, "unknowns of contact")?;
        let (none, mut array) = (ptr::null_mut(), ptr::null_mut());
        // SAFETY: PETSc allocates the array of the new matrix, which holds as many numbers; LAPACK chooses the pivots itself and reads no
        // permutation.
        unsafe {
            let factor =
                Reference::new(|raw| sys::MatCreateSeqDense(sys::RSMPI_COMM_SELF, size, size, none, raw))?;
            let raw = factor.get();
            check(sys::MatDenseGetArray(raw, &mut array))?;
            ptr::copy_nonoverlapping(columns.as_ptr(), array, columns.len());
            check(sys::MatDenseRestoreArray(raw, &mut array))?;
            check(sys::MatLUFactor(raw, ptr::null_mut(), ptr::null_mut(), ptr::null()))?;
            let right_hand_side = Reference::new(|vector| sys::MatCreateVecs(raw, vector, ptr::null_mut()))?;
            let solution = Reference::new(|vector| sys::MatCreateVecs(raw, ptr::null_mut(), vector))?;
            Ok(Self { factor, vectors: [right_hand_side, solution].map(|raw| DistributedVector { raw }) })
        }
    }

    /// Replaces a right-hand side by the solution.
    pub fn solve(&mut self, values: &mut [f64]) -> Result<()> {
        let [right_hand_side, solution] = &mut self.vectors;
        let rows = right_hand_side.owned()?.len();
        if values.len() != rows {
            return Err(Error::Internal(format!("{} values for a factor of {rows} rows", values.len())));
        }
        right_hand_side.owned_mut()?.copy_from_slice(values);
        // SAFETY: live objects of one size; the two vectors differ.
        check(unsafe { sys::MatSolve(self.factor.get(), right_hand_side.raw.get(), solution.raw.get()) })?;
        values.copy_from_slice(&solution.owned()?);
        Ok(())
    }
}
