//! Large pages for the factors of CHOLMOD: a solve reads all of a factor, and with pages of 4 KiB a quarter of its time goes into
//! finding them.

use super::sys;
use std::{ffi::c_void, ptr};

/// Bytes of a large page.
const PAGE: usize = 1 << 21;
/// Bytes from which on memory is given in large pages.
const LARGE: usize = 2 * PAGE;

/// Lets CHOLMOD have them from now on, where the system has any to give.
pub(super) fn allow() {
    // SAFETY: one thread, and the memory is such that the `free` that CHOLMOD calls takes it.
    unsafe { sys::SuiteSparse_config.malloc_func = Some(allocate) };
}

unsafe extern "C" fn allocate(bytes: usize) -> *mut c_void {
    // SAFETY: as `malloc` is; the advice is about memory that was just given, and may be ignored.
    unsafe {
        if bytes < LARGE {
            return sys::malloc(bytes as u64);
        }
        let mut memory = ptr::null_mut();
        if sys::posix_memalign(&mut memory, PAGE, bytes) != 0 {
            return ptr::null_mut();
        }
        sys::madvise(memory, bytes, sys::MADV_HUGEPAGE as i32);
        memory
    }
}
