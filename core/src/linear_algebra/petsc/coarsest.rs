//! The solution on the coarsest level of multigrid for a subspace and with what contact adds.

use super::{
    check,
    compressed_rows::{Parts, own_rows},
    slopes::Slopes,
    sys,
};
use crate::error::Result;

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
        *factor = is_factored(&mut sum, size).then_some(sum);
    }

    /// Replaces a solution for the matrix alone by that on the subspace with additions.
    pub(super) fn correct(&mut self, project: impl Fn(&mut [f64]), x: &mut [f64]) {
        let Self { size, matrix, factor, work } = self;
        let Some(factor) = factor else { return project(x) };
        let size = *size;
        for (value, row) in work.iter_mut().zip(matrix.chunks_exact(size)) {
            *value = row.iter().zip(&*x).map(|(entry, x)| entry * x).sum();
        }
        project(work);
        for i in 0..size {
            let row = &factor[i * size..][..i];
            let before: f64 = row.iter().zip(&*work).map(|(entry, x)| entry * x).sum();
            work[i] = (work[i] - before) / factor[i * size + i];
        }
        for i in (0..size).rev() {
            work[i] /= factor[i * size + i];
            let value = work[i];
            let row = &factor[i * size..][..i];
            work[..i].iter_mut().zip(row).for_each(|(x, entry)| *x -= entry * value);
        }
        x.copy_from_slice(work);
        project(x);
    }
}

/// Replaces the lower half of a matrix by its factor; false where it is not positive definite.
fn is_factored(matrix: &mut [f64], size: usize) -> bool {
    for i in 0..size {
        for j in 0..=i {
            let (above, row) = matrix.split_at_mut(i * size);
            let other = if j < i { &above[j * size..][..=j] } else { &[][..] };
            if j < i {
                let before: f64 = row[..j].iter().zip(other).map(|(x, y)| x * y).sum();
                row[j] = (row[j] - before) / other[j];
            } else {
                let square = row[j] - row[..j].iter().map(|x| x * x).sum::<f64>();
                if square.is_nan() || square <= 0.0 {
                    return false;
                }
                row[j] = square.sqrt();
            }
        }
    }
    true
}
