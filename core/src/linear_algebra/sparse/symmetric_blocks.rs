//! Symmetric matrices of small dense blocks whose lower half is stored: a product reads half the entries, and one column index for
//! each block.

use super::sys;
use crate::linear_algebra::tensor::larger;
use std::array;

/// The type in which entries are stored; products are summed in double precision.
pub(crate) trait Stored: Copy + Default + Into<f64> + 'static {
    fn round(value: f64) -> Self;
}

impl Stored for f64 {
    fn round(value: f64) -> Self {
        value
    }
}

impl Stored for f32 {
    fn round(value: f64) -> Self {
        value as Self
    }
}

/// Rows of scalars as PETSc keeps them: where each starts, ascending columns, values.
#[derive(Clone, Copy)]
pub(crate) struct ScalarRows<'a> {
    pub starts: &'a [sys::PetscInt],
    pub columns: &'a [sys::PetscInt],
    pub values: &'a [f64],
}

impl<'a> ScalarRows<'a> {
    pub(crate) fn row(self, row: usize) -> impl Iterator<Item = (usize, f64)> + 'a {
        let range = self.starts[row] as usize..self.starts[row + 1] as usize;
        self.columns[range.clone()]
            .iter()
            .map(|&column| column as usize)
            .zip(self.values[range].iter().copied())
    }
}

/// A product with a square matrix.
pub(crate) trait Product {
    /// `y = A x`.
    fn multiply(&self, x: &[f64], y: &mut [f64]);

    /// Bytes that a product moves at the least: the matrix and both vectors.
    fn bytes(&self) -> u64;
}

/// The symmetric matrix of these rows in blocks of this size, with entries stored as `T`. `None` for sizes that products are not
/// compiled for, and where the number of rows is no multiple of the size.
pub(crate) fn product<T: Stored>(block: usize, rows: ScalarRows<'_>) -> Option<Box<dyn Product>> {
    if !(rows.starts.len() - 1).is_multiple_of(block.max(1)) {
        return None;
    }
    match block {
        1 => Some(Box::new(SymmetricBlocks::<1, T>::new(rows))),
        2 => Some(Box::new(SymmetricBlocks::<2, T>::new(rows))),
        3 => Some(Box::new(SymmetricBlocks::<3, T>::new(rows))),
        6 => Some(Box::new(SymmetricBlocks::<6, T>::new(rows))),
        _ => None,
    }
}

struct SymmetricBlocks<const B: usize, T> {
    /// Where each row of blocks starts; its diagonal block is the last one.
    starts: Vec<usize>,
    columns: Vec<u32>,
    /// Column after column.
    blocks: Vec<[[T; B]; B]>,
    /// The unit of the stored entries.
    unit: f64,
}

/// A power of two near the largest of these numbers: multiples of it don't overflow in a small format.
pub(super) fn unit_of(values: &[f64]) -> f64 {
    let largest = values.iter().fold(0.0, |largest, value| larger(largest, value.abs()));
    if largest > 0.0 && largest.is_finite() { largest.log2().round().exp2() } else { 1.0 }
}

impl<const B: usize, T: Stored> SymmetricBlocks<B, T> {
    fn new(rows: ScalarRows<'_>) -> Self {
        let unit = unit_of(rows.values);
        let count = (rows.starts.len() - 1) / B;
        let mut matrix = Self { starts: vec![0], columns: Vec::new(), blocks: Vec::new(), unit };
        let capacity = rows.columns.len() / (2 * B * B) + count;
        matrix.columns.reserve(capacity);
        matrix.blocks.reserve(capacity);
        let mut columns: Vec<u32> = Vec::new();
        for row in 0..count {
            columns.clear();
            columns.push(row as u32);
            for scalar in row * B..(row + 1) * B {
                columns.extend(
                    rows.row(scalar).map(|(column, _)| (column / B) as u32).filter(|&c| (c as usize) < row),
                );
            }
            columns.sort_unstable();
            columns.dedup();
            let first = matrix.blocks.len();
            matrix.columns.extend_from_slice(&columns);
            matrix.blocks.resize(first + columns.len(), [[T::default(); B]; B]);
            for i in 0..B {
                for (column, value) in rows.row(row * B + i).filter(|(column, _)| column / B <= row) {
                    let at = columns.partition_point(|&c| (c as usize) < column / B);
                    matrix.blocks[first + at][column % B][i] = T::round(value / unit);
                }
            }
            matrix.starts.push(matrix.columns.len());
        }
        matrix.columns.shrink_to_fit();
        matrix.blocks.shrink_to_fit();
        matrix
    }
}

impl<const B: usize, T: Stored> Product for SymmetricBlocks<B, T> {
    fn multiply(&self, x: &[f64], y: &mut [f64]) {
        let (x, _) = x.as_chunks::<B>();
        let (y, _) = y.as_chunks_mut::<B>();
        y.fill([0.0; B]);
        for (row, range) in self.starts.windows(2).enumerate() {
            let (Some((_, columns)), Some((diagonal, blocks))) =
                (self.columns[range[0]..range[1]].split_last(), self.blocks[range[0]..range[1]].split_last())
            else {
                continue;
            };
            let mine = x[row];
            let mut sum = y[row];
            for (&column, block) in columns.iter().zip(blocks) {
                let (theirs, other) = (x[column as usize], &mut y[column as usize]);
                for j in 0..B {
                    let block: [f64; B] = array::from_fn(|i| block[j][i].into());
                    let mut across = 0.0;
                    for i in 0..B {
                        sum[i] += block[i] * theirs[j];
                        across += block[i] * mine[i];
                    }
                    other[j] += across;
                }
            }
            for j in 0..B {
                for i in 0..B {
                    sum[i] += diagonal[j][i].into() * mine[j];
                }
            }
            y[row] = sum;
        }
        if self.unit != 1.0 {
            y.as_flattened_mut().iter_mut().for_each(|value| *value *= self.unit);
        }
    }

    fn bytes(&self) -> u64 {
        let vectors = 2 * (self.starts.len() - 1) * B * size_of::<f64>();
        bytes_of(&self.starts, &self.columns, &self.blocks) + vectors as u64
    }
}

/// Bytes of a matrix's arrays.
pub(super) fn bytes_of<T>(starts: &[usize], columns: &[u32], blocks: &[T]) -> u64 {
    (size_of_val(starts) + size_of_val(columns) + size_of_val(blocks)) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A symmetric matrix of so many blocks, dense but for blocks far from the diagonal and single zeros, and its rows.
    fn matrix<const B: usize>(
        blocks: usize,
        size: f64,
    ) -> (Vec<Vec<f64>>, [Vec<sys::PetscInt>; 2], Vec<f64>) {
        let n = blocks * B;
        let entry = |i: usize, j: usize| {
            let (i, j) = (i.min(j), i.max(j));
            if j / B - i / B > 2 || (7 * i + 3 * j) % 5 == 1 {
                0.0
            } else {
                size * ((13 * i + 29 * j) as f64).sin()
            }
        };
        let dense: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect();
        let (mut starts, mut columns, mut values) = (vec![0], Vec::new(), Vec::new());
        for row in &dense {
            for (j, &value) in row.iter().enumerate().filter(|(_, value)| **value != 0.0) {
                columns.push(j as sys::PetscInt);
                values.push(value);
            }
            starts.push(columns.len() as sys::PetscInt);
        }
        (dense, [starts, columns], values)
    }

    fn differs<const B: usize, T: Stored>(size: f64) -> f64 {
        let (dense, [starts, columns], values) = matrix::<B>(7, size);
        let rows = ScalarRows { starts: &starts, columns: &columns, values: &values };
        let x: Vec<f64> = (0..7 * B).map(|i| (i as f64).cos()).collect();
        let mut y = vec![f64::NAN; x.len()];
        product::<T>(B, rows).unwrap().multiply(&x, &mut y);
        let known = dense.iter().map(|row| row.iter().zip(&x).map(|(a, x)| a * x).sum::<f64>());
        known.zip(&y).map(|(known, y)| (known - y).abs()).fold(0.0, larger) / size
    }

    #[test]
    fn products_are_those_of_the_whole_matrix() {
        for found in [
            differs::<1, f64>(1.0),
            differs::<2, f64>(3e7),
            differs::<3, f64>(1e-9),
            differs::<6, f64>(1e300),
        ] {
            assert!(found < 1e-14, "{found}");
        }
    }

    #[test]
    fn single_precision_rounds_the_matrix_alone_whatever_its_size() {
        for found in [
            differs::<2, f32>(1e60),
            differs::<3, f32>(1e-60),
            differs::<6, f32>(1.0),
            differs::<1, f32>(5.0),
        ] {
            assert!(found > 1e-12 && found < 1e-6, "{found}");
        }
    }

    #[test]
    fn a_product_moves_half_the_matrix_and_two_vectors() {
        let rows =
            ScalarRows { starts: &[0, 4, 8, 12, 16], columns: &[0, 1, 2, 3].repeat(4), values: &[1.0; 16] };
        let bytes = product::<f32>(2, rows).unwrap().bytes();
        // Three starts, three column numbers, three blocks of four numbers; twice four numbers.
        assert_eq!(bytes, 3 * 8 + 3 * 4 + 3 * 4 * 4 + 2 * 4 * 8);
    }

    #[test]
    fn blocks_of_other_sizes_and_broken_ones_are_left_to_others() {
        let (_, [starts, columns], values) = matrix::<1>(7, 1.0);
        let rows = ScalarRows { starts: &starts, columns: &columns, values: &values };
        assert!(product::<f64>(5, rows).is_none());
        assert!(product::<f64>(2, rows).is_none());
    }
}
