use super::{check, index, reference::Reference, sys};
use crate::error::{Error, Result};
use std::ptr;

/// Cholesky factors of a dense matrix that is stored completely on this rank.
#[derive(Debug)]
pub struct DenseCholesky {
    factor: Reference<sys::_p_Mat>,
    vectors: [Reference<sys::_p_Vec>; 2],
    size: usize,
}

impl DenseCholesky {
    /// Factors a symmetric positive definite matrix, given column by column.
    pub fn new(size: usize, columns: &[f64]) -> Result<Self> {
        let factor = sequential(size, columns)?;
        let raw = factor.get();
        // SAFETY: live matrix; without a row permutation none is read.
        unsafe {
            check(sys::MatSetOption(raw, sys::MAT_SPD, 1))?;
            check(sys::MatCholeskyFactor(raw, ptr::null_mut(), ptr::null()))?;
            let given = Reference::new(|vector| sys::MatCreateVecs(raw, vector, ptr::null_mut()))?;
            let found = Reference::new(|vector| sys::MatCreateVecs(raw, ptr::null_mut(), vector))?;
            Ok(Self { factor, vectors: [given, found], size })
        }
    }

    /// Replaces a right-hand side by the solution.
    pub fn solve(&mut self, values: &mut [f64]) -> Result<()> {
        let [given, found] = [&self.vectors[0], &self.vectors[1]].map(Reference::get);
        if values.len() != self.size {
            return Err(Error::Internal(format!(
                "{} values for a factor of {} rows",
                values.len(),
                self.size
            )));
        }
        // SAFETY: live vectors of the matrix' size, which is that of the values; arrays are given back before the next call.
        unsafe {
            let mut array = ptr::null_mut();
            check(sys::VecGetArray(given, &mut array))?;
            ptr::copy_nonoverlapping(values.as_ptr(), array, values.len());
            check(sys::VecRestoreArray(given, &mut array))?;
            check(sys::MatSolve(self.factor.get(), given, found))?;
            check(sys::VecGetArray(found, &mut array))?;
            ptr::copy_nonoverlapping(array, values.as_mut_ptr(), values.len());
            check(sys::VecRestoreArray(found, &mut array))
        }
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
