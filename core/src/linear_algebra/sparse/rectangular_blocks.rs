//! Matrices of small dense blocks that need not be square, in single precision: interpolations between levels.

use super::symmetric_blocks::{ScalarRows, bytes_of, unit_of};
use std::array;

/// Products with a matrix and with its transpose.
pub(crate) trait Transfer {
    /// `y = A x`.
    fn multiply(&self, x: &[f64], y: &mut [f64]);

    /// `y = A^T x`.
    fn multiply_transposed(&self, x: &[f64], y: &mut [f64]);

    /// Bytes of the matrix.
    fn bytes(&self) -> u64;
}

/// The matrix of these rows in blocks of this many rows and columns; `None` for sizes that products are not compiled for.
pub(crate) fn transfer(blocks: [usize; 2], rows: ScalarRows<'_>) -> Option<Box<dyn Transfer>> {
    if !(rows.starts.len() - 1).is_multiple_of(blocks[0].max(1)) {
        return None;
    }
    match blocks {
        [2, 2] => Some(Box::new(RectangularBlocks::<2, 2>::new(rows))),
        [2, 3] => Some(Box::new(RectangularBlocks::<2, 3>::new(rows))),
        [3, 3] => Some(Box::new(RectangularBlocks::<3, 3>::new(rows))),
        [3, 6] => Some(Box::new(RectangularBlocks::<3, 6>::new(rows))),
        [6, 6] => Some(Box::new(RectangularBlocks::<6, 6>::new(rows))),
        _ => None,
    }
}

struct RectangularBlocks<const R: usize, const C: usize> {
    starts: Vec<usize>,
    columns: Vec<u32>,
    /// Column after column.
    blocks: Vec<[[f32; R]; C]>,
    unit: f64,
}

impl<const R: usize, const C: usize> RectangularBlocks<R, C> {
    fn new(rows: ScalarRows<'_>) -> Self {
        let unit = unit_of(rows.values);
        let mut matrix = Self { starts: vec![0], columns: Vec::new(), blocks: Vec::new(), unit };
        let mut columns: Vec<u32> = Vec::new();
        for row in 0..(rows.starts.len() - 1) / R {
            columns.clear();
            for scalar in row * R..(row + 1) * R {
                columns.extend(rows.row(scalar).map(|(column, _)| (column / C) as u32));
            }
            columns.sort_unstable();
            columns.dedup();
            let first = matrix.blocks.len();
            matrix.columns.extend_from_slice(&columns);
            matrix.blocks.resize(first + columns.len(), [[0.0; R]; C]);
            for i in 0..R {
                for (column, value) in rows.row(row * R + i) {
                    let at = columns.partition_point(|&c| (c as usize) < column / C);
                    matrix.blocks[first + at][column % C][i] = (value / unit) as f32;
                }
            }
            matrix.starts.push(matrix.columns.len());
        }
        matrix.columns.shrink_to_fit();
        matrix.blocks.shrink_to_fit();
        matrix
    }

    fn rows(&self) -> impl Iterator<Item = impl Iterator<Item = (usize, &[[f32; R]; C])>> {
        self.starts.windows(2).map(|range| {
            let columns = self.columns[range[0]..range[1]].iter().map(|&column| column as usize);
            columns.zip(&self.blocks[range[0]..range[1]])
        })
    }
}

impl<const R: usize, const C: usize> Transfer for RectangularBlocks<R, C> {
    fn multiply(&self, x: &[f64], y: &mut [f64]) {
        let (x, _) = x.as_chunks::<C>();
        let (y, _) = y.as_chunks_mut::<R>();
        for (row, y) in self.rows().zip(y) {
            let mut sum = [0.0; R];
            for (column, block) in row {
                for (block, x) in block.iter().zip(&x[column]) {
                    for i in 0..R {
                        sum[i] += f64::from(block[i]) * x;
                    }
                }
            }
            *y = sum.map(|value| self.unit * value);
        }
    }

    fn multiply_transposed(&self, x: &[f64], y: &mut [f64]) {
        let (x, _) = x.as_chunks::<R>();
        y.fill(0.0);
        let (y, _) = y.as_chunks_mut::<C>();
        for (row, x) in self.rows().zip(x) {
            let x: [f64; R] = array::from_fn(|i| self.unit * x[i]);
            for (column, block) in row {
                for (y, block) in y[column].iter_mut().zip(block) {
                    *y += (0..R).map(|i| f64::from(block[i]) * x[i]).sum::<f64>();
                }
            }
        }
    }

    fn bytes(&self) -> u64 {
        bytes_of(&self.starts, &self.columns, &self.blocks)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear_algebra::bindings::PetscInt;

    #[test]
    fn both_products_are_those_of_the_whole_matrix() {
        check::<2, 2>();
        check::<2, 3>();
        check::<3, 3>();
        check::<3, 6>();
        check::<6, 6>();
    }

    fn check<const R: usize, const C: usize>() {
        let (rows, columns) = (5 * R, 2 * C);
        let entry =
            |i: usize, j: usize| if (i + j) % 4 == 1 { 0.0 } else { 1e45 * ((3 * i + 5 * j) as f64).sin() };
        let (mut starts, mut at, mut values) = (vec![0], Vec::new(), Vec::new());
        for i in 0..rows {
            for j in (0..columns).filter(|&j| entry(i, j) != 0.0) {
                at.push(j as PetscInt);
                values.push(entry(i, j));
            }
            starts.push(at.len() as PetscInt);
        }
        let matrix = transfer([R, C], ScalarRows { starts: &starts, columns: &at, values: &values }).unwrap();
        let x: Vec<f64> = (0..rows.max(columns)).map(|i| (i as f64).cos()).collect();
        let (mut y, mut z) = (vec![f64::NAN; rows], vec![f64::NAN; columns]);
        matrix.multiply(&x[..columns], &mut y);
        matrix.multiply_transposed(&x[..rows], &mut z);
        let near = |found: f64, known: f64| assert!((found - known).abs() < 1e-6 * 1e45, "{found} {known}");
        (0..rows).for_each(|i| near(y[i], (0..columns).map(|j| entry(i, j) * x[j]).sum()));
        (0..columns).for_each(|j| near(z[j], (0..rows).map(|i| entry(i, j) * x[i]).sum()));
    }
}
