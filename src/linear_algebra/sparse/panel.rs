//! Solves with one panel of a supernodal factor in single precision: columns of the same length, a triangle on top of a rectangle.
//!
//! A panel is read once, column after column, beside a vector that stays in the fastest cache.

use multiversion::multiversion;

/// Number of partial sums.
const LANES: usize = 16;

/// Solves with the triangle: the first entries of `values` hold the right-hand side and receive the solution; the product of the
/// rectangle with the solution is subtracted from the others.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
pub(super) fn forward(panel: &[f32], columns: usize, values: &mut [f32]) {
    let rows = values.len();
    assert_eq!(panel.len(), columns * rows);
    for (at, column) in panel.chunks_exact(rows).enumerate() {
        let x = values[at] / column[at];
        values[at] = x;
        values[at + 1..].iter_mut().zip(&column[at + 1..]).for_each(|(value, l)| *value -= l * x);
    }
}

/// Subtracts the product of the transposed rectangle with the values of its rows, then solves with the transpose of the triangle.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
pub(super) fn backward(panel: &[f32], columns: usize, values: &mut [f32]) {
    let rows = values.len();
    assert_eq!(panel.len(), columns * rows);
    for (at, column) in panel.chunks_exact(rows).enumerate().rev() {
        values[at] = (values[at] - dot(&column[at + 1..], &values[at + 1..])) / column[at];
    }
}

/// From the end on: columns are read from the last one on, and memory is fetched ahead where addresses go one way.
#[inline(always)]
fn dot(a: &[f32], b: &[f32]) -> f32 {
    let (a_rest, a) = a.as_rchunks::<LANES>();
    let (b_rest, b) = b.as_rchunks::<LANES>();
    let mut sums = [0.0; LANES];
    for (a, b) in a.iter().zip(b).rev() {
        (0..LANES).for_each(|i| sums[i] += a[i] * b[i]);
    }
    let rest: f32 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f32>() + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A panel with small whole numbers, exact in single precision, and ones on the diagonal.
    fn panel(columns: usize, rows: usize) -> Vec<f32> {
        let entry = |column: usize, row: usize| match row.cmp(&column) {
            std::cmp::Ordering::Less => f32::NAN,
            std::cmp::Ordering::Equal => 2.0,
            std::cmp::Ordering::Greater => ((3 * row + 5 * column) % 5) as f32 - 2.0,
        };
        (0..columns).flat_map(|column| (0..rows).map(move |row| entry(column, row))).collect()
    }

    fn whole_numbers(count: usize) -> Vec<f32> {
        (0..count).map(|i| (i % 7) as f32 - 3.0).collect()
    }

    #[test]
    fn solves_take_products_back_whatever_the_shape() {
        for (columns, rows) in [(1, 1), (1, 40), (3, 5), (4, 4), (5, 21), (8, 64), (11, 12), (18, 83)] {
            let panel = panel(columns, rows);
            let x = whole_numbers(columns);
            let lower = |row: usize, column: usize| {
                if row < column { 0.0 } else { panel[column * rows + row] }
            };
            let product = |row: usize| (0..columns).map(|column| lower(row, column) * x[column]).sum();
            let mut values: Vec<f32> = (0..rows).map(product).collect();
            forward(&panel, columns, &mut values);
            assert_eq!(values[..columns], x, "{columns} columns of {rows}");
            assert!(values[columns..].iter().all(|&value| value == 0.0), "{columns} columns of {rows}");

            let all = whole_numbers(rows);
            let product = |column: usize| (column..rows).map(|row| lower(row, column) * all[row]).sum();
            let mut values: Vec<f32> = (0..columns).map(product).chain(all[columns..].to_vec()).collect();
            backward(&panel, columns, &mut values);
            assert_eq!(values, all, "{columns} columns of {rows}");
        }
    }
}
