//! CHOLMOD's functions for indices as wide as PETSc's, under the names of those for 32 bits.

use super::sys;
use std::ffi::c_int;

#[cfg(not(petsc_64bit))]
pub(super) use sys::{
    cholmod_amd, cholmod_analyze_p, cholmod_finish, cholmod_free_factor, cholmod_metis, cholmod_start,
};
#[cfg(petsc_64bit)]
pub(super) use sys::{
    cholmod_l_amd as cholmod_amd, cholmod_l_analyze_p as cholmod_analyze_p,
    cholmod_l_finish as cholmod_finish, cholmod_l_free_factor as cholmod_free_factor,
    cholmod_l_metis as cholmod_metis, cholmod_l_start as cholmod_start,
};

/// How CHOLMOD's structs name these indices.
pub(super) const INDEX_KIND: c_int =
    if cfg!(petsc_64bit) { sys::CHOLMOD_LONG as c_int } else { sys::CHOLMOD_INT as c_int };
