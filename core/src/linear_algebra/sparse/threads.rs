//! Threads of OpenBLAS. Dense products are small here, so that threads cost more in synchronisation than they gain, and ranks on
//! one machine would compete for its cores.

use super::sys;
use std::{
    ffi::{CStr, c_int, c_void},
    ptr,
};

/// Variables by which users choose the number of threads themselves.
const CHOICES: [&str; 3] = ["OPENBLAS_NUM_THREADS", "GOTO_NUM_THREADS", "OMP_NUM_THREADS"];

/// One thread a rank, unless the user chose another number.
pub(crate) fn one_unless_chosen() {
    if CHOICES.iter().all(|name| std::env::var_os(name).is_none()) {
        set(1);
    }
}

/// Sets the number of threads if the BLAS is OpenBLAS.
fn set(threads: c_int) {
    if let Some(function) = find(c"openblas_set_num_threads") {
        // SAFETY: OpenBLAS has this function of one integer.
        unsafe { std::mem::transmute::<*mut c_void, unsafe extern "C" fn(c_int)>(function)(threads) };
    }
}

/// A function of a library that is loaded.
fn find(name: &CStr) -> Option<*mut c_void> {
    // SAFETY: a NUL-terminated name, sought in all that is loaded.
    let found = unsafe { sys::dlsym(ptr::null_mut(), name.as_ptr()) };
    (!found.is_null()).then_some(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn openblas_takes_the_number_of_threads() {
        assert!(find(c"dgemm_").is_some(), "a BLAS is loaded");
        let is_loaded = std::fs::read_to_string("/proc/self/maps").unwrap().contains("openblas");
        let get = find(c"openblas_get_num_threads");
        assert_eq!((get.is_some(), find(c"openblas_set_num_threads").is_some()), (is_loaded, is_loaded));
        let Some(get) = get else { return };
        // SAFETY: OpenBLAS has this function without arguments.
        let get = unsafe { std::mem::transmute::<*mut c_void, unsafe extern "C" fn() -> c_int>(get) };
        for threads in [2, 1] {
            set(threads);
            // SAFETY: as above.
            assert_eq!(unsafe { get() }, threads);
        }
    }
}
