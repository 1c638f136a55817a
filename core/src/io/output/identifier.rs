//! Identifiers of HDF5 that are closed on drop, for the calls that the safe HDF5 crate lacks.
#![allow(unsafe_code)]

use hdf5_sys::h5::herr_t;
use hdf5_sys::h5i::hid_t;

/// An HDF5 identifier and the call that closes it.
pub(super) struct Open(pub(super) hid_t, pub(super) unsafe extern "C" fn(hid_t) -> herr_t);

impl Drop for Open {
    fn drop(&mut self) {
        if self.0 >= 0 {
            // SAFETY: the identifier is open, of the kind the call closes, and closed only here.
            unsafe { (self.1)(self.0) };
        }
    }
}

/// Turns HDF5's status into a result with its words.
pub(super) fn check(status: herr_t) -> hdf5::Result<()> {
    if status < 0 { Err(hdf5::Error::query()?) } else { Ok(()) }
}
