use super::{check, index, sys};
use crate::error::{Error, Result};
use std::{marker::PhantomData, ptr};

/// Cholesky factors of a dense matrix that is whole on this rank.
#[derive(Debug)]
pub struct DenseCholesky {
    factor: sys::Mat,
    vectors: [sys::Vec; 2],
    size: usize,
    not_send: PhantomData<*mut ()>,
}

impl DenseCholesky {
    /// Factors a symmetric positive definite matrix, given column after column.
    pub fn new(size: usize, columns: &[f64]) -> Result<Self> {
        let (factor, vectors) = (sequential(size, columns)?, [ptr::null_mut(); 2]);
        let mut dense = Self { factor, vectors, size, not_send: PhantomData };
        // SAFETY: live objects that the handle owns; without a row permutation none is read.
        unsafe {
            check(sys::MatSetOption(dense.factor, sys::MAT_SPD, 1))?;
            check(sys::MatCholeskyFactor(dense.factor, ptr::null_mut(), ptr::null()))?;
            check(sys::MatCreateVecs(dense.factor, &mut dense.vectors[0], &mut dense.vectors[1]))?;
        }
        Ok(dense)
    }

    /// Replaces a right-hand side by the solution.
    pub fn solve(&mut self, values: &mut [f64]) -> Result<()> {
        let [given, found] = self.vectors;
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
            check(sys::MatSolve(self.factor, given, found))?;
            check(sys::VecGetArray(found, &mut array))?;
            ptr::copy_nonoverlapping(array, values.as_mut_ptr(), values.len());
            check(sys::VecRestoreArray(found, &mut array))
        }
    }
}

impl Drop for DenseCholesky {
    fn drop(&mut self) {
        // SAFETY: this handle owns one reference to each.
        unsafe {
            self.vectors.iter_mut().for_each(|vector| {
                sys::VecDestroy(vector);
            });
            sys::MatDestroy(&mut self.factor);
        }
    }
}

/// `L L^T` column after column, for a matrix given in the same way.
pub fn times_own_transpose(size: usize, columns: &[f64]) -> Result<Vec<f64>> {
    let mut matrix = sequential(size, columns)?;
    let (mut product, mut array) = (ptr::null_mut(), ptr::null());
    let mut values = vec![0.0; size * size];
    // SAFETY: live matrices; the product is as large as the copy, and both are destroyed before this returns.
    unsafe {
        let code = sys::MatMatTransposeMult(matrix, matrix, sys::MAT_INITIAL_MATRIX, 1.0, &mut product);
        sys::MatDestroy(&mut matrix);
        check(code)?;
        check(sys::MatDenseGetArrayRead(product, &mut array))?;
        ptr::copy_nonoverlapping(array, values.as_mut_ptr(), values.len());
        check(sys::MatDenseRestoreArrayRead(product, &mut array))?;
        check(sys::MatDestroy(&mut product))?;
    }
    Ok(values)
}

fn sequential(size: usize, columns: &[f64]) -> Result<sys::Mat> {
    if columns.len() != size * size {
        return Err(Error::Internal(format!("{} numbers for {size} columns of {size}", columns.len())));
    }
    let size = index(size, "unknowns of contact")?;
    let (mut matrix, mut array) = (ptr::null_mut(), ptr::null_mut());
    // SAFETY: PETSc allocates the array of the new matrix, which holds as many numbers.
    unsafe {
        check(sys::MatCreateSeqDense(sys::RSMPI_COMM_SELF, size, size, ptr::null_mut(), &mut matrix))?;
        check(sys::MatDenseGetArray(matrix, &mut array))?;
        ptr::copy_nonoverlapping(columns.as_ptr(), array, columns.len());
        check(sys::MatDenseRestoreArray(matrix, &mut array))?;
    }
    Ok(matrix)
}
