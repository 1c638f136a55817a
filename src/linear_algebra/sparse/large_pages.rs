//! Large pages for factors: a solve reads the whole factor, and with pages of 4 KiB much of its time is spent on address
//! translation.

use super::sys;
use std::ffi::c_int;

/// Bytes of a large page.
const PAGE: usize = 1 << 21;
/// Linux 6.1's advice to make large pages now; older headers don't have it.
const MADV_COLLAPSE: c_int = 25;

/// Advises the system to put these values on large pages.
pub(super) fn put<T>(values: &[T]) {
    let range = values.as_ptr_range();
    let first = range.start.addr().next_multiple_of(PAGE);
    let Some(bytes) = (range.end.addr() / PAGE * PAGE).checked_sub(first).filter(|bytes| *bytes > 0) else {
        return;
    };
    let start = range.start.with_addr(first).cast_mut().cast();
    for advice in [sys::MADV_HUGEPAGE as c_int, MADV_COLLAPSE] {
        // SAFETY: pages within the values, whose contents stay; a refusal changes nothing.
        unsafe { sys::madvise(start, bytes, advice) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_stay_what_they_are() {
        let values: Vec<f64> = (0..1_000_000).map(f64::from).collect();
        put(&values);
        put(&values[..100]);
        assert!(values.iter().enumerate().all(|(i, value)| *value == i as f64));
    }
}
