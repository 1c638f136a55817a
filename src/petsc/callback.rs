//! What all callbacks from PETSc share: errors are kept, panics are resumed outside of PETSc.

use super::{DistributedVector, sys};
use crate::error::{Error, Result};
use std::{
    any::Any,
    cell::{Cell, RefCell},
    ffi::c_void,
    panic::{AssertUnwindSafe, catch_unwind, resume_unwind},
    ptr,
};

/// What a callback returns to make PETSc stop.
pub(super) const USER_ERROR: sys::PetscErrorCode = sys::PETSC_ERR_USER as sys::PetscErrorCode;

/// The object that callbacks of one solve work on, on the frame of that solve.
pub(super) struct Callback<'a, T: ?Sized> {
    target: RefCell<&'a mut T>,
    error: RefCell<Option<Error>>,
    panic: Cell<Option<Box<dyn Any + Send>>>,
}

impl<'a, T: ?Sized> Callback<'a, T> {
    pub fn new(target: &'a mut T) -> Self {
        Self { target: RefCell::new(target), error: RefCell::new(None), panic: Cell::new(None) }
    }

    /// What PETSc hands back to the trampolines; valid while `self` stays where it is.
    pub fn pointer(&self) -> *mut c_void {
        ptr::from_ref(self).cast_mut().cast()
    }

    /// Runs a callback; an error is kept and from then on `spoil` marks every output, so that all ranks see the same
    /// failure.
    pub fn run(&self, body: impl FnOnce(&mut T) -> Result<()>, spoil: impl FnOnce()) -> sys::PetscErrorCode {
        match catch_unwind(AssertUnwindSafe(|| body(&mut self.target.borrow_mut()))) {
            Ok(Ok(())) => {
                if self.error.borrow().is_some() {
                    spoil();
                }
                0
            }
            Ok(Err(error)) => {
                self.error.borrow_mut().get_or_insert(error);
                spoil();
                0
            }
            Err(panic) => {
                self.panic.set(Some(panic));
                USER_ERROR
            }
        }
    }

    /// Resumes a panic, returns the first error.
    pub fn finish(self) -> Result<()> {
        if let Some(panic) = self.panic.take() {
            resume_unwind(panic);
        }
        self.error.into_inner().map_or(Ok(()), Err)
    }
}

/// Fills the values of this rank with NaN, which norms carry to all ranks.
pub(super) fn spoil(vector: &mut DistributedVector) {
    if let Ok(mut values) = vector.owned_mut() {
        values.fill(f64::NAN);
    }
}
