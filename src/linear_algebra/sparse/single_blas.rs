//! Dense operations in single precision on the panels of supernodes: matrices column after column, a triangle on top of a rectangle.

use super::sys;
use std::ffi::{c_char, c_int};

/// Replaces a panel of this many columns by its factor; `None` where its triangle is not positive definite.
pub(super) fn factor(panel: &mut [f32], columns: usize) -> Option<()> {
    let rows = panel.len() / columns;
    assert!(panel.len() == rows * columns && columns <= rows);
    let below = rows - columns;
    let (height, width, below_count) = (rows as c_int, columns as c_int, below as c_int);
    let mut outcome = 0;
    // SAFETY: the triangle and the rectangle lie in the panel, whose columns are `rows` numbers apart.
    unsafe {
        let triangle = panel.as_mut_ptr();
        let lower = c"L".as_ptr().cast::<c_char>();
        sys::spotrf_(lower, &width, triangle, &height, &mut outcome, 1);
        if outcome == 0 && below > 0 {
            sys::cblas_strsm(
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

/// Writes the product of a panel's rows from `first` on with the first `count` of them, below its diagonal, column after column.
pub(super) fn own_product(panel: &[f32], rows: usize, first: usize, count: usize, product: &mut [f32]) {
    let height = rows - first;
    assert!(panel.len().is_multiple_of(rows) && count <= height && product.len() >= count * height);
    let (width, height_count, count_count) = ((panel.len() / rows) as c_int, height as c_int, count as c_int);
    // SAFETY: rows `first..` of the panel and the product lie in these slices.
    unsafe {
        let (from, to) = (panel.as_ptr().add(first), product.as_mut_ptr());
        sys::cblas_ssyrk(
            sys::CblasColMajor,
            sys::CblasLower,
            sys::CblasNoTrans,
            count_count,
            width,
            1.0,
            from,
            rows as c_int,
            0.0,
            to,
            height_count,
        );
        if height > count {
            sys::cblas_sgemm(
                sys::CblasColMajor,
                sys::CblasNoTrans,
                sys::CblasTrans,
                height_count - count_count,
                count_count,
                width,
                1.0,
                from.add(count),
                rows as c_int,
                from,
                rows as c_int,
                0.0,
                to.add(count),
                height_count,
            );
        }
    }
}
