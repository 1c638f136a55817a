//! PETSc: safe handles that own PETSc objects, one file for each PETSc class.
//!
//! Every call that can fail returns `Result` with PETSc's own message and trace. All handles are collective over
//! the ranks of the MPI universe given to [`Petsc::start`], or of the group in [`within`]: every rank creates, uses and drops them in the same order. PETSc
//! remains initialised while a handle exists; creating one while PETSc is not initialised is an error.
//! Failure of a solver to converge is not an error: read the outcome of [`Ksp::solve`] and [`Snes::solve`].
#![allow(unsafe_code)]

mod applied;
mod block_product;
mod block_transfer;
mod callback;
mod compressed_rows;
mod coarse_space;
mod coarsest;
mod dense;
mod diagonal;
mod ksp;
mod levels;
mod library;
mod matrix;
mod own_preconditioner;
mod projected;
mod projected_operator;
mod reduced;
mod reference;
mod shell;
mod slopes;
mod snes;
mod subspace;
mod variational_inequality;
mod vector;

pub use coarse_space::Interpolation;
pub use dense::LocalFactor;
pub use ksp::{Ksp, LinearOutcome};
pub use library::{
    Entered, Petsc, Stage, clear_option, has_option, launched_rank, set_default_option, set_option,
    start_fast, within,
};
pub use matrix::Matrix;
pub use own_preconditioner::OwnPreconditioner;
pub use projected::{MISSING_DIRECTIONS, ProjectedKind, ProjectedKsp};
pub use projected_operator::{ProjectedOperator, ProjectedOutcome};
pub use snes::{NonlinearOutcome, NonlinearProblem, Snes};
pub use variational_inequality::{BoundedSnes, Limits, UNBOUNDED};
pub use vector::{DistributedVector, Local, LocalRead, LocalWrite};

pub use crate::linear_algebra::sparse::{
    BlockRows, Cholesky, DenseFactor, DensePanels, Factored, INDEX_BITS, Precision, Team,
};
use crate::{
    error::{Error, Result},
    linear_algebra::{bindings as sys, sparse::index},
};
use std::{
    cell::RefCell,
    ffi::{CStr, CString, c_char, c_int, c_void},
};

thread_local! {
    static FAULT: RefCell<(String, Vec<String>)> = const { RefCell::new((String::new(), Vec::new())) };
}

fn text(pointer: *const c_char) -> String {
    if pointer.is_null() {
        return String::new();
    }
    // SAFETY: PETSc passes NUL-terminated strings that live for the call.
    unsafe { CStr::from_ptr(pointer) }.to_string_lossy().into_owned()
}

unsafe extern "C" fn keep_fault(
    _comm: sys::MPI_Comm,
    line: c_int,
    function: *const c_char,
    file: *const c_char,
    code: sys::PetscErrorCode,
    kind: sys::PetscErrorType,
    message: *const c_char,
    _context: *mut c_void,
) -> sys::PetscErrorCode {
    FAULT.with_borrow_mut(|(kept, trace)| {
        if kind == sys::PETSC_ERROR_INITIAL {
            *kept = text(message);
            trace.clear();
        }
        let file = text(file);
        trace.push(format!("{} ({}:{line})", text(function), file.rsplit('/').next().unwrap_or("")));
    });
    code
}

/// Converts a PETSc return code into a result with the message and trace that the error handler stored.
fn check(code: sys::PetscErrorCode) -> Result<()> {
    if code == 0 {
        return Ok(());
    }
    let (mut message, trace) = FAULT.with_borrow_mut(std::mem::take);
    if message.is_empty() {
        let mut words = std::ptr::null();
        // SAFETY: PETSc fills the pointer with a static string.
        unsafe { sys::PetscErrorMessage(code, &mut words, std::ptr::null_mut()) };
        message = text(words);
    }
    Err(Error::Internal(format!("PETSc error {code}: {} [{}]", message.trim(), trace.join(" <- "))))
}

fn c_string(words: &str) -> Result<CString> {
    CString::new(words).map_err(|_| Error::Refused(format!("PETSc option {words:?} has a NUL character")))
}

/// Whether PETSc was built with hypre.
pub const HAS_HYPRE: bool = cfg!(petsc_hypre);
/// Whether PETSc was built with MUMPS.
pub const HAS_MUMPS: bool = cfg!(petsc_mumps);

/// Refuses `what` if PETSc was built without the `part` that it needs.
pub fn require(there: bool, what: &str, part: &str, remedy: &str) -> Result<()> {
    let words =
        || Error::Refused(format!("{what} needs {part}, which this PETSc was built without: {remedy}"));
    if there { Ok(()) } else { Err(words()) }
}
