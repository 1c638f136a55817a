//! Dense symmetric matrices that each rank has as a whole, by packed columns, and Cholesky factors of such matrices.

use super::panel::Real;
use multiversion::multiversion;
use std::ops::Range;

/// A symmetric matrix: column after column from the diagonal down.
#[derive(Debug)]
pub struct PackedSymmetric {
    size: usize,
    entries: Vec<f64>,
}

/// Columns of a product that are computed at a time.
const WIDTH: usize = 128;

impl PackedSymmetric {
    /// With these entries.
    pub fn of(size: usize, entries: Vec<f64>) -> Self {
        assert_eq!(entries.len(), size * (size + 1) / 2);
        Self { size, entries }
    }

    /// `L L^T`, given packed columns of `L`. Unknown `i` of the product is unknown `places[i]` of `L`.
    pub fn times_own_transpose(lower: &[f64], places: &[usize]) -> Self {
        let size = places.len();
        let mut square = vec![0.0; size * size];
        for (at, column) in columns(lower, size).enumerate() {
            square[at * size + at..(at + 1) * size].copy_from_slice(column);
        }
        let mut number = vec![0; size];
        places.iter().enumerate().for_each(|(unknown, &place)| number[place] = unknown);
        let mut entries = vec![0.0; lower.len()];
        let mut block = Vec::new();
        for first in (0..size).step_by(WIDTH) {
            let (height, width) = (size - first, WIDTH.min(size - first));
            block.resize(width * height, 0.0);
            f64::own_product(&square[..(first + width) * size], size, first, width, &mut block);
            for (column, values) in block.chunks_exact(height).enumerate() {
                let one = number[first + column];
                for (value, &other) in values[column..].iter().zip(&number[first + column..]) {
                    entries[index(size, one.max(other), one.min(other))] = *value;
                }
            }
        }
        Self { size, entries }
    }

    /// The entries of a column from the diagonal down.
    pub fn column(&self, at: usize) -> &[f64] {
        column(&self.entries, self.size, at)
    }

    /// All entries, column after column.
    pub fn full(&self) -> Vec<f64> {
        let size = self.size;
        let mut full = vec![0.0; size * size];
        for at in 0..size {
            for (row, value) in (at..size).zip(self.column(at)) {
                full[at * size + row] = *value;
                full[row * size + at] = *value;
            }
        }
        full
    }
}

/// The packed columns of a lower triangle, of this many, whose entries a rank multiplies: each nearly as many.
pub fn share(size: usize, rank: usize, ranks: usize) -> Range<usize> {
    // Entries from the column `size - n` on: about half the square of n.
    let start = |rank: usize| {
        let left = (ranks - rank) as f64 / ranks as f64;
        size - (left.sqrt() * size as f64).round() as usize
    };
    start(rank)..start(rank + 1)
}

/// Bytes of these columns.
pub fn bytes_of_columns(size: usize, columns: Range<usize>) -> u64 {
    let entries: usize = columns.map(|at| size - at).sum();
    (entries * size_of::<f64>()) as u64
}

/// Adds the product of these columns of `L` and their transpose with `x`: those of all columns add up to `L L^T x`.
pub fn add_times_own_transpose(lower: &[f64], columns: Range<usize>, x: &[f64], product: &mut [f64]) {
    add_products(&lower[index(x.len(), columns.start, columns.start)..], columns, x, product);
}

/// Each entry is read from memory once: a column stays in the cache between its two products.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2+fma", "x86_64+avx2"))]
fn add_products(mut entries: &[f64], columns: Range<usize>, x: &[f64], product: &mut [f64]) {
    const LANES: usize = 16;
    for at in columns {
        let (column, rest) = entries.split_at(x.len() - at);
        entries = rest;
        let (values, values_rest) = x[at..].as_chunks::<LANES>();
        let (below, below_rest) = column.as_chunks::<LANES>();
        let mut lanes = [0.0; LANES];
        for (l, x) in below.iter().zip(values) {
            (0..LANES).for_each(|i| lanes[i] += l[i] * x[i]);
        }
        let rest: f64 = below_rest.iter().zip(values_rest).map(|(l, x)| l * x).sum();
        let dot = lanes.iter().sum::<f64>() + rest;
        product[at..].iter_mut().zip(column).for_each(|(sum, l)| *sum += l * dot);
    }
}

/// A column of packed columns, from the diagonal down.
pub fn column(packed: &[f64], size: usize, at: usize) -> &[f64] {
    &packed[index(size, at, at)..][..size - at]
}

/// The columns, from the diagonal down.
pub fn columns(packed: &[f64], size: usize) -> impl Iterator<Item = &[f64]> {
    (0..size).map(move |at| column(packed, size, at))
}

/// Where an entry on or below the diagonal is.
fn index(size: usize, row: usize, column: usize) -> usize {
    column * size - column * column.saturating_sub(1) / 2 + row - column
}

/// Cholesky factors of dense matrices of any size up to the largest, one after the other in the same memory, for preconditioners: those of
/// large ones are in single precision, where rounding errors leave them as they are.
#[derive(Debug)]
pub struct LocalCholesky {
    size: usize,
    /// The scaled matrix or its factor, column after column; entries above the diagonal are not used.
    columns: Vec<f64>,
    /// Its factor in single precision, in place of the other.
    single: Vec<f32>,
    /// Factors of rows and columns, with which all diagonal entries are one.
    scales: Vec<f64>,
    values: Vec<f64>,
    single_values: Vec<f32>,
}

/// Unknowns from which reading a factor takes longer than the iterations that rounding errors may add.
const SINGLE_FROM: usize = 1024;
/// The smallest pivot of a factor in single precision over the diagonal entry: below, the matrix is nearly singular.
const LEAST_PIVOT: f64 = 1e-4;

impl LocalCholesky {
    /// Memory for matrices of this size at most.
    pub fn with_capacity(most: usize) -> Self {
        let singles = if most < SINGLE_FROM { 0 } else { most };
        Self {
            size: 0,
            columns: Vec::with_capacity(most * most),
            single: Vec::with_capacity(singles * singles),
            scales: Vec::with_capacity(most),
            values: Vec::with_capacity(most),
            single_values: Vec::with_capacity(singles),
        }
    }

    /// Zeros for the entries of a matrix to be factored, column after column; those above the diagonal are not used.
    pub fn columns_of(&mut self, size: usize) -> &mut [f64] {
        self.size = size;
        self.columns.clear();
        self.columns.resize(size * size, 0.0);
        &mut self.columns
    }

    /// Factors the matrix of these entries; `None` where it is not positive definite.
    pub fn factor(&mut self) -> Option<()> {
        let Self { size, columns, single, scales, .. } = self;
        scales.clear();
        scales.extend(columns.iter().step_by(*size + 1).map(|entry| 1.0 / entry.sqrt()));
        for (column, factor) in columns.chunks_exact_mut((*size).max(1)).zip(&*scales) {
            column.iter_mut().zip(&*scales).for_each(|(entry, scale)| *entry *= factor * scale);
        }
        single.clear();
        if *size >= SINGLE_FROM {
            single.extend(columns.iter().map(|entry| f32::rounded(*entry)));
            let is_accurate = f32::factor(single, *size).is_some()
                && single.iter().step_by(*size + 1).all(|pivot| pivot.exact().powi(2) >= LEAST_PIVOT);
            if is_accurate {
                return Some(());
            }
            single.clear();
        }
        if *size == 0 { Some(()) } else { f64::factor(columns, *size) }
    }

    /// Replaces a right-hand side by the solution.
    pub fn solve(&mut self, values: &mut [f64]) {
        let Self { size, columns, single, scales, values: scaled, single_values } = self;
        assert_eq!(values.len(), *size);
        scaled.clear();
        scaled.extend(values.iter().zip(&*scales).map(|(value, scale)| value * scale));
        if !single.is_empty() {
            // Right-hand sides may be smaller than the least number in single precision.
            let largest = scaled.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
            let unit = if largest > 0.0 && largest.is_finite() { largest } else { 1.0 };
            single_values.clear();
            single_values.extend(scaled.iter().map(|value| f32::rounded(value / unit)));
            f32::forward(single, *size, single_values);
            f32::backward(single, *size, single_values);
            scaled.iter_mut().zip(&*single_values).for_each(|(scaled, value)| *scaled = unit * value.exact());
        } else if *size > 0 {
            f64::forward(columns, *size, scaled);
            f64::backward(columns, *size, scaled);
        }
        let solution = scaled.iter().zip(&*scales).map(|(scaled, scale)| scaled * scale);
        values.iter_mut().zip(solution).for_each(|(value, solution)| *value = solution);
    }

    /// Bytes that a solve reads.
    pub fn bytes(&self) -> u64 {
        let number = if self.single.is_empty() { size_of::<f64>() } else { size_of::<f32>() };
        (self.size * (self.size + 1) * number) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A lower triangle with small whole numbers, packed, that of unknown units.
    fn lower(size: usize) -> Vec<f64> {
        let entry = |row: usize, column: usize| match row == column {
            true => 4.0 + (row % 3) as f64,
            false => ((3 * row + 5 * column) % 5) as f64 - 2.0,
        };
        (0..size).flat_map(|column| (column..size).map(move |row| entry(row, column))).collect()
    }

    fn vector(size: usize) -> Vec<f64> {
        (0..size).map(|i| (i % 7) as f64 - 3.0).collect()
    }

    /// `L L^T x` by loops, in the order of the unknowns.
    fn expected(lower: &[f64], places: &[usize], x: &[f64]) -> Vec<f64> {
        let size = places.len();
        let entry =
            |row: usize, column: usize| if row < column { 0.0 } else { lower[index(size, row, column)] };
        let mut upper = vec![0.0; size];
        for (column, sum) in upper.iter_mut().enumerate() {
            *sum = (0..size).map(|i| entry(places[i], column) * x[i]).sum();
        }
        places.iter().map(|&row| (0..size).map(|column| entry(row, column) * upper[column]).sum()).collect()
    }

    #[test]
    fn products_are_those_of_the_factor_whatever_the_order_and_the_number_of_ranks() {
        for size in [0, 1, 2, 5, 40, 302] {
            let places: Vec<usize> = (0..size).map(|i| (i * 7 + 3) % size).collect();
            assert!(size == 0 || size % 7 != 0);
            let (lower, x) = (lower(size), vector(size));
            let matrix = PackedSymmetric::times_own_transpose(&lower, &places);
            for ranks in [1, 2, 3] {
                let mut product = vec![0.0; size];
                for rank in 0..ranks {
                    add_times_own_transpose(&lower, share(size, rank, ranks), &x, &mut product);
                }
                let in_order: Vec<usize> = (0..size).collect();
                assert_eq!(product, expected(&lower, &in_order, &x), "{size} unknowns, {ranks} ranks");
            }
            let full = matrix.full();
            let column =
                |at: usize| full[at * size..][..size].iter().zip(&x).map(|(a, x)| a * x).sum::<f64>();
            assert_eq!((0..size).map(column).collect::<Vec<_>>(), expected(&lower, &places, &x));
        }
    }

    #[test]
    fn ranks_share_the_entries_evenly() {
        let bytes: Vec<u64> = (0..3).map(|rank| bytes_of_columns(302, share(302, rank, 3))).collect();
        assert_eq!(bytes.iter().sum::<u64>(), 8 * 302 * 303 / 2);
        assert!(bytes.iter().all(|bytes| (*bytes as f64) < 1.02 * 8.0 * 302.0 * 151.5 / 3.0), "{bytes:?}");
    }

    /// A matrix of these units with ones and small numbers beside its diagonal.
    fn spread(size: usize, units: impl Fn(usize) -> f64) -> Vec<f64> {
        let entry = |row: usize, column: usize| match row == column {
            true => 1.0,
            false => 0.4 / (1.0 + (row as f64 - column as f64).powi(2)),
        };
        (0..size * size).map(|at| entry(at % size, at / size) * units(at % size) * units(at / size)).collect()
    }

    #[test]
    fn factors_solve_in_any_units_up_to_the_rounding_of_their_precision() {
        let units = |i: usize| [1.0, 1e-40, 1e40][i % 3];
        let mut factor = LocalCholesky::with_capacity(SINGLE_FROM);
        for (size, tolerance) in [(0, 0.0), (1, 1e-15), (100, 1e-13), (SINGLE_FROM, 1e-5), (99, 1e-13)] {
            let matrix = spread(size, units);
            let x: Vec<f64> =
                vector(size).iter().enumerate().map(|(i, value)| value * 1e-60 / units(i)).collect();
            let mut values: Vec<f64> =
                (0..size).map(|row| (0..size).map(|at| matrix[at * size + row] * x[at]).sum()).collect();
            factor.columns_of(size).copy_from_slice(&matrix);
            factor.factor().unwrap();
            assert_eq!(!factor.single.is_empty(), size >= SINGLE_FROM);
            factor.solve(&mut values);
            let errors =
                values.iter().zip(&x).enumerate().map(|(i, (value, x))| (value - x).abs() * units(i) / 3e-60);
            let worst =
                errors.fold(0.0, |most, error| if error > most || error.is_nan() { error } else { most });
            assert!(worst <= tolerance, "{size} unknowns: {worst:e}");
        }
    }

    #[test]
    fn nearly_singular_matrices_are_factored_in_double_precision_and_indefinite_ones_not_at_all() {
        let size = SINGLE_FROM;
        let with_pair = |entry: f64| {
            let mut matrix = spread(size, |_| 1.0);
            for at in 0..size {
                (matrix[at], matrix[at * size], matrix[size + at], matrix[at * size + 1]) =
                    (0.0, 0.0, 0.0, 0.0);
            }
            (matrix[0], matrix[1], matrix[size], matrix[size + 1]) = (1.0, entry, entry, 1.0);
            let mut factor = LocalCholesky::with_capacity(size);
            factor.columns_of(size).copy_from_slice(&matrix);
            factor.factor().map(|()| !factor.single.is_empty())
        };
        let factored = [0.5, 1.0 - 5e-6, 1.0 - 1e-9, 1.0 + 1e-9].map(with_pair);
        assert_eq!(factored, [Some(true), Some(false), Some(false), None]);
    }
}
