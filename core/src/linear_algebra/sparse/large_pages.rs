//! Large pages for factors: a solve reads the whole factor, and with pages of 4 KiB much of its time is spent on address
//! translation.

use super::sys;
use std::ffi::c_int;

/// Bytes of a large page.
const PAGE: usize = 1 << 21;
/// Linux 6.1's advice to make large pages now; older headers don't have it.
const MADV_COLLAPSE: c_int = 25;

/// Asks the system to put what is added to these values, within their capacity, on large pages. Pages that were written before would
/// have to be copied.
pub(super) fn request<T>(values: &mut Vec<T>) {
    let range = values.spare_capacity_mut().as_mut_ptr_range();
    let first = range.start.addr().next_multiple_of(PAGE);
    let last = range.end.addr() / PAGE * PAGE;
    if first >= last {
        return;
    }
    for advice in [sys::MADV_HUGEPAGE as c_int, MADV_COLLAPSE] {
        // SAFETY: pages within the memory of the values, whose contents stay; a refusal changes nothing.
        unsafe { sys::madvise(range.start.with_addr(first).cast(), last - first, advice) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_stay_what_they_are() {
        let mut values: Vec<f64> = Vec::with_capacity(2_000_000);
        values.extend((0..1_000_000).map(f64::from));
        request(&mut values);
        values.extend((1_000_000..2_000_000).map(f64::from));
        request(&mut values);
        assert!(values.iter().enumerate().all(|(i, value)| *value == i as f64));
    }
}
