//! Dense operations on one panel of a supernodal factor: columns of the same length, a triangle on top of a rectangle, column after
//! column.
//!
//! Solves read a panel once, column after column, beside a vector that stays in the fastest cache.

use super::sys;
use crate::error::Error;
use multiversion::multiversion;
use std::{
    ffi::{c_char, c_int},
    fmt::Debug,
    ops::{AddAssign, SubAssign},
};

/// Single or double precision.
pub(crate) trait Real: Copy + Debug + Default + AddAssign + SubAssign + 'static {
    fn rounded(value: f64) -> Self;

    fn exact(self) -> f64;

    /// Solves with the triangle: the first entries of `values` hold the right-hand side and receive the solution; the product of
    /// the rectangle with the solution is subtracted from the others.
    fn forward(panel: &[Self], columns: usize, values: &mut [Self]);

    /// Subtracts the product of the transposed rectangle with the values of its rows, then solves with the transpose of the triangle.
    fn backward(panel: &[Self], columns: usize, values: &mut [Self]);

    /// Subtracts the product of a rectangle with these numbers, one a column, from the values of its rows.
    fn subtract_product(rectangle: &[Self], numbers: &[f64], values: &mut [f64]);

    /// Adds the product of the transposed rectangle with the values of its rows to sums, one a column.
    fn add_transposed_product(rectangle: &[Self], values: &[f64], sums: &mut [f64]);

    /// Replaces a panel of this many columns by its factor; `None` where its triangle is not positive definite.
    fn factor(panel: &mut [Self], columns: usize) -> Option<()>;

    /// Writes the product of a panel's rows from `first` on with the first `count` of them, below its diagonal, column after column.
    fn own_product(panel: &[Self], rows: usize, first: usize, count: usize, product: &mut [Self]);

    /// Subtracts the same from such columns.
    fn subtract_own_product(panel: &[Self], rows: usize, first: usize, count: usize, from: &mut [Self]);
}

macro_rules! real {
    ($real:ident, $lanes:literal, $potrf:ident, $trsm:ident, $syrk:ident, $gemm:ident, $solves:ident) => {
        mod $solves {
            use super::{c_int, multiversion, sys};

            #[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
            pub(super) fn forward(panel: &[$real], columns: usize, values: &mut [$real]) {
                let rows = values.len();
                assert_eq!(panel.len(), columns * rows);
                for (at, column) in panel.chunks_exact(rows).enumerate() {
                    let x = values[at] / column[at];
                    values[at] = x;
                    values[at + 1..].iter_mut().zip(&column[at + 1..]).for_each(|(value, l)| *value -= l * x);
                }
            }

            #[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
            pub(super) fn backward(panel: &[$real], columns: usize, values: &mut [$real]) {
                let rows = values.len();
                assert_eq!(panel.len(), columns * rows);
                for (at, column) in panel.chunks_exact(rows).enumerate().rev() {
                    values[at] = (values[at] - dot(&column[at + 1..], &values[at + 1..])) / column[at];
                }
            }

            #[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
            pub(super) fn subtract_product(rectangle: &[$real], numbers: &[f64], values: &mut [f64]) {
                assert_eq!(rectangle.len(), numbers.len() * values.len());
                for (column, x) in rectangle.chunks_exact(values.len().max(1)).zip(numbers) {
                    values.iter_mut().zip(column).for_each(|(value, l)| *value -= f64::from(*l) * x);
                }
            }

            #[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
            pub(super) fn add_transposed_product(rectangle: &[$real], values: &[f64], sums: &mut [f64]) {
                assert_eq!(rectangle.len(), sums.len() * values.len());
                let (values, values_rest) = values.as_chunks::<8>();
                let rows = 8 * values.len() + values_rest.len();
                for (column, sum) in rectangle.chunks_exact(rows.max(1)).zip(sums) {
                    let (column, column_rest) = column.as_chunks::<8>();
                    let mut lanes = [0.0; 8];
                    for (l, value) in column.iter().zip(values) {
                        (0..8).for_each(|i| lanes[i] += f64::from(l[i]) * value[i]);
                    }
                    let rest: f64 = column_rest.iter().zip(values_rest).map(|(l, v)| f64::from(*l) * v).sum();
                    *sum += lanes.iter().sum::<f64>() + rest;
                }
            }

            /// From the end on: columns are read from the last one on, and memory is fetched ahead where addresses go one way.
            #[inline(always)]
            fn dot(a: &[$real], b: &[$real]) -> $real {
                let (a_rest, a) = a.as_rchunks::<$lanes>();
                let (b_rest, b) = b.as_rchunks::<$lanes>();
                let mut sums = [0.0; $lanes];
                for (a, b) in a.iter().zip(b).rev() {
                    (0..$lanes).for_each(|i| sums[i] += a[i] * b[i]);
                }
                let rest: $real = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
                sums.iter().sum::<$real>() + rest
            }

            /// Replaces columns by a share of themselves and a factor times the product of a panel's rows from the first of these on with
            /// these, below its diagonal.
            pub(super) fn combine(
                panel: &[$real],
                rows: usize,
                columns: std::ops::Range<usize>,
                [factor, share]: [$real; 2],
                product: &mut [$real],
            ) {
                let (first, count, height) = (columns.start, columns.len(), rows - columns.start);
                assert!(
                    panel.len().is_multiple_of(rows) && count <= height && product.len() >= count * height
                );
                let (width, height_count, count_count) =
                    ((panel.len() / rows) as c_int, height as c_int, count as c_int);
                // SAFETY: rows `first..` of the panel and the product lie in these slices.
                unsafe {
                    let (from, to) = (panel.as_ptr().add(first), product.as_mut_ptr());
                    sys::$syrk(
                        sys::CblasColMajor,
                        sys::CblasLower,
                        sys::CblasNoTrans,
                        count_count,
                        width,
                        factor,
                        from,
                        rows as c_int,
                        share,
                        to,
                        height_count,
                    );
                    if height > count {
                        sys::$gemm(
                            sys::CblasColMajor,
                            sys::CblasNoTrans,
                            sys::CblasTrans,
                            height_count - count_count,
                            count_count,
                            width,
                            factor,
                            from.add(count),
                            rows as c_int,
                            from,
                            rows as c_int,
                            share,
                            to.add(count),
                            height_count,
                        );
                    }
                }
            }
        }

        impl Real for $real {
            fn rounded(value: f64) -> Self {
                value as $real
            }

            fn exact(self) -> f64 {
                f64::from(self)
            }

            fn forward(panel: &[Self], columns: usize, values: &mut [Self]) {
                $solves::forward(panel, columns, values);
            }

            fn backward(panel: &[Self], columns: usize, values: &mut [Self]) {
                $solves::backward(panel, columns, values);
            }

            fn subtract_product(rectangle: &[Self], numbers: &[f64], values: &mut [f64]) {
                $solves::subtract_product(rectangle, numbers, values);
            }

            fn add_transposed_product(rectangle: &[Self], values: &[f64], sums: &mut [f64]) {
                $solves::add_transposed_product(rectangle, values, sums);
            }

            fn factor(panel: &mut [Self], columns: usize) -> Option<()> {
                let rows = panel.len() / columns;
                assert!(panel.len() == rows * columns && columns <= rows);
                let below = rows - columns;
                let (height, width, below_count) = (rows as c_int, columns as c_int, below as c_int);
                let mut outcome = 0;
                // SAFETY: the triangle and the rectangle lie in the panel, whose columns are `rows` numbers apart.
                unsafe {
                    let triangle = panel.as_mut_ptr();
                    let lower = c"L".as_ptr().cast::<c_char>();
                    sys::$potrf(lower, &width, triangle, &height, &mut outcome, 1);
                    if outcome == 0 && below > 0 {
                        sys::$trsm(
                            sys::CblasColMajor,
                            sys::CblasRight,
                            sys::CblasLower,
                            sys::CblasTrans,
                            sys::CblasNonUnit,
                            below_count,
                            width,
                            1.0,
                            triangle,
                            height,
                            triangle.add(columns),
                            height,
                        );
                    }
                }
                (outcome == 0).then_some(())
            }

            fn own_product(panel: &[Self], rows: usize, first: usize, count: usize, product: &mut [Self]) {
                $solves::combine(panel, rows, first..first + count, [1.0, 0.0], product);
            }

            fn subtract_own_product(
                panel: &[Self],
                rows: usize,
                first: usize,
                count: usize,
                from: &mut [Self],
            ) {
                $solves::combine(panel, rows, first..first + count, [-1.0, 1.0], from);
            }
        }
    };
}

real!(f32, 16, spotrf_, cblas_strsm, cblas_ssyrk, cblas_sgemm, single);
real!(f64, 8, dpotrf_, cblas_dtrsm, cblas_dsyrk, cblas_dgemm, double);

/// The failure of a factorisation.
pub(super) fn not_positive_definite() -> Error {
    Error::Failed(
        "the matrix of the step is not positive definite: check densities, viscosities and moduli, and whether supports, springs or friction \
         hold each body in each direction, also bodies that touch and could move together"
            .into(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A panel with small whole numbers, exact in both precisions, and ones on the diagonal.
    fn panel(columns: usize, rows: usize) -> Vec<f64> {
        let entry = |column: usize, row: usize| match row.cmp(&column) {
            std::cmp::Ordering::Less => f64::NAN,
            std::cmp::Ordering::Equal => 2.0,
            std::cmp::Ordering::Greater => ((3 * row + 5 * column) % 5) as f64 - 2.0,
        };
        (0..columns).flat_map(|column| (0..rows).map(move |row| entry(column, row))).collect()
    }

    fn whole_numbers(count: usize) -> Vec<f64> {
        (0..count).map(|i| (i % 7) as f64 - 3.0).collect()
    }

    #[test]
    fn solves_take_products_back_whatever_the_shape() {
        solves_take_products_back::<f32>();
        solves_take_products_back::<f64>();
    }

    fn solves_take_products_back<R: Real>() {
        let rounded = |values: &[f64]| values.iter().map(|&value| R::rounded(value)).collect::<Vec<R>>();
        let exact = |values: &[R]| values.iter().map(|value| value.exact()).collect::<Vec<f64>>();
        for (columns, rows) in [(1, 1), (1, 40), (3, 5), (4, 4), (5, 21), (8, 64), (11, 12), (18, 83)] {
            let panel = panel(columns, rows);
            let x = whole_numbers(columns);
            let lower = |row: usize, column: usize| {
                if row < column { 0.0 } else { panel[column * rows + row] }
            };
            let product = |row: usize| (0..columns).map(|column| lower(row, column) * x[column]).sum();
            let mut values = rounded(&(0..rows).map(product).collect::<Vec<f64>>());
            R::forward(&rounded(&panel), columns, &mut values);
            let values = exact(&values);
            assert_eq!(values[..columns], x, "{columns} columns of {rows}");
            assert!(values[columns..].iter().all(|&value| value == 0.0), "{columns} columns of {rows}");

            let all = whole_numbers(rows);
            let product = |column: usize| (column..rows).map(|row| lower(row, column) * all[row]).sum();
            let mut values =
                rounded(&(0..columns).map(product).chain(all[columns..].to_vec()).collect::<Vec<f64>>());
            R::backward(&rounded(&panel), columns, &mut values);
            assert_eq!(exact(&values), all, "{columns} columns of {rows}");
        }
    }
}
