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
    /// Cholesky factors of a symmetric positive definite matrix, given column by column.
    pub fn cholesky(size: usize, columns: &[f64]) -> Result<Self> {
        let factor = sequential(size, columns)?;
        let raw = factor.get();
        // SAFETY: live matrix; without a row permutation none is read.
        unsafe {
            check(sys::MatSetOption(raw, sys::MAT_SPD, 1))?;
            check(sys::MatCholeskyFactor(raw, ptr::null_mut(), ptr::null()))?;
        }
        Self::of(factor)
    }

    /// LU factors of a matrix, given column by column.
    pub fn lu(size: usize, columns: &[f64]) -> Result<Self> {
        let factor = sequential(size, columns)?;
        // SAFETY: live matrix; LAPACK chooses the pivots itself and reads no permutation.
        check(unsafe { sys::MatLUFactor(factor.get(), ptr::null_mut(), ptr::null_mut(), ptr::null()) })?;
        Self::of(factor)
    }

    fn of(factor: Reference<sys::_p_Mat>) -> Result<Self> {
        let raw = factor.get();
        // SAFETY: live matrix.
        unsafe {
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

/// `L L^T` of a square matrix `L`; both are stored column by column.
pub fn times_own_transpose(size: usize, columns: &[f64]) -> Result<Vec<f64>> {
    let matrix = sequential(size, columns)?;
    let mut array = ptr::null();
    let mut values = vec![0.0; size * size];
    // SAFETY: live matrices; the product is as large as the copy.
    unsafe {
        let product = Reference::new(|raw| {
            sys::MatMatTransposeMult(matrix.get(), matrix.get(), sys::MAT_INITIAL_MATRIX, 1.0, raw)
        })?;
        drop(matrix);
        check(sys::MatDenseGetArrayRead(product.get(), &mut array))?;
        ptr::copy_nonoverlapping(array, values.as_mut_ptr(), values.len());
        check(sys::MatDenseRestoreArrayRead(product.get(), &mut array))?;
    }
    Ok(values)
}

fn sequential(size: usize, columns: &[f64]) -> Result<Reference<sys::_p_Mat>> {
    if columns.len() != size * size {
        return Err(Error::Internal(format!("{} numbers for {size} columns of {size}", columns.len())));
    }
    let size = index(size, "unknowns of contact")?;
    let (none, mut array) = (ptr::null_mut(), ptr::null_mut());
    // SAFETY: PETSc allocates the array of the new matrix, which holds as many numbers.
    unsafe {
        let matrix =
            Reference::new(|raw| sys::MatCreateSeqDense(sys::RSMPI_COMM_SELF, size, size, none, raw))?;
        check(sys::MatDenseGetArray(matrix.get(), &mut array))?;
        ptr::copy_nonoverlapping(columns.as_ptr(), array, columns.len());
        check(sys::MatDenseRestoreArray(matrix.get(), &mut array))?;
        Ok(matrix)
    }
}
