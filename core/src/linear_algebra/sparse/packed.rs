//! Dense symmetric matrices that each rank has as a whole, by packed columns.

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
}
