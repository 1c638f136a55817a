//! The solution on the coarsest level of multigrid for a subspace and with what contact adds.

use super::{
    check,
    compressed_rows::{Parts, own_rows},
    slopes::Slopes,
    sys,
};
use crate::{error::Result, linear_algebra::sparse::Real};

/// Most unknowns; PETSc coarsens to about 50.
const MOST_UNKNOWNS: usize = 300;
/// Share of the diagonal that is added to it.
const SHIFT: f64 = 1e-12;

/// The matrix `A` of the coarsest level, of which one rank has all rows.
#[derive(Debug)]
pub(super) struct Coarsest {
    size: usize,
    /// Row by row.
    matrix: Vec<f64>,
    /// The lower factor of `P (A + S) P` on the subspace.
    factor: Option<Vec<f64>>,
    work: Vec<f64>,
}

impl Coarsest {
    /// Reads a matrix; `None` on ranks that have none of its rows, and where ranks share it or it is large.
    pub(super) fn of(matrix: sys::Mat) -> Result<Option<Self>> {
        let (mut own, mut all) = (0, 0);
        // SAFETY: live matrix, live integers.
        unsafe {
            check(sys::MatGetLocalSize(matrix, &mut own, std::ptr::null_mut()))?;
            check(sys::MatGetSize(matrix, &mut all, std::ptr::null_mut()))?;
        }
        let size = own as usize;
        let Some(parts) = Parts::of(matrix)?.filter(|_| own == all && size <= MOST_UNKNOWNS) else {
            return Ok(None);
        };
        let mut entries = vec![0.0; size * size];
        own_rows(parts.own, |rows| {
            for row in 0..size {
                rows.row(row).for_each(|(column, value)| entries[row * size + column] = value);
            }
            Some(())
        })?;
        Ok(Some(Self { size, matrix: entries, factor: None, work: vec![0.0; size] }))
    }

    /// Factors the matrix of a subspace with this projection, if there is one, with additions, unless there are neither.
    pub(super) fn set(&mut self, project: Option<impl Fn(&mut [f64])>, slopes: &Slopes) {
        let Self { size, matrix, factor, .. } = self;
        *factor = None;
        if project.is_none() && slopes.iter().next().is_none() {
            return;
        }
        let project = |x: &mut [f64]| project.iter().for_each(|project| project(x));
        let size = *size;
        let mut sum = matrix.clone();
        let mean = (0..size).map(|i| matrix[i * size + i]).sum::<f64>() / size as f64;
        // Symmetric: rows are columns.
        let mut column = vec![0.0; size];
        for j in 0..size {
            column.fill(0.0);
            column[j] = 1.0;
            project(&mut column);
            let mut image: Vec<f64> = matrix
                .chunks_exact(size)
                .map(|row| row.iter().zip(&column).map(|(entry, x)| entry * x).sum())
                .collect();
            slopes.add_product(&column, &mut image);
            project(&mut image);
            // What is removed stays zero; the body may be free to move.
            image.iter_mut().zip(&column).for_each(|(value, x)| *value -= mean * x);
            image[j] += mean + SHIFT * matrix[j * size + j];
            sum[j * size..][..size].copy_from_slice(&image);
        }
        *factor = f64::factor(&mut sum, size).map(|()| sum);
    }

    /// Replaces a solution for the matrix alone by that on the subspace with additions.
    pub(super) fn correct(&mut self, project: impl Fn(&mut [f64]), x: &mut [f64]) {
        let Self { size, matrix, factor, work } = self;
        let Some(factor) = factor else { return project(x) };
        for (value, row) in work.iter_mut().zip(matrix.chunks_exact(*size)) {
            *value = row.iter().zip(&*x).map(|(entry, x)| entry * x).sum();
        }
        project(work);
        f64::forward(factor, *size, work);
        f64::backward(factor, *size, work);
        x.copy_from_slice(work);
        project(x);
    }
}
