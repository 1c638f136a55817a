//! Callbacks from PETSc: an error is stored and returned, and a panic is resumed, after PETSc has returned.

use super::{DistributedVector, sys};
use crate::error::{Error, Result};
use std::{
    any::Any,
    cell::{Cell, RefCell},
    ffi::c_void,
    panic::{AssertUnwindSafe, catch_unwind, resume_unwind},
    ptr,
};

/// The return code of a callback that stops PETSc.
pub(super) const USER_ERROR: sys::PetscErrorCode = sys::PETSC_ERR_USER as sys::PetscErrorCode;

/// The object on which the callbacks of a solve operate; it is on the stack frame of the solve.
pub(super) struct Callback<'a, T: ?Sized> {
    target: RefCell<&'a mut T>,
    error: RefCell<Option<Error>>,
    panic: Cell<Option<Box<dyn Any + Send>>>,
}

impl<'a, T: ?Sized> Callback<'a, T> {
    pub(super) fn new(target: &'a mut T) -> Self {
        Self { target: RefCell::new(target), error: RefCell::new(None), panic: Cell::new(None) }
    }

    /// The context that PETSc passes to callbacks; valid while `self` is not moved.
    pub(super) fn pointer(&self) -> *mut c_void {
        ptr::from_ref(self).cast_mut().cast()
    }

    /// Runs a callback; stores the first error, or a panic.
    pub(super) fn run(&self, body: impl FnOnce(&mut T) -> Result<()>) -> sys::PetscErrorCode {
        match catch_unwind(AssertUnwindSafe(|| body(&mut self.target.borrow_mut()))) {
            Ok(result) => {
                if let Err(error) = result {
                    self.error.borrow_mut().get_or_insert(error);
                }
                0
            }
            Err(panic) => {
                self.panic.set(Some(panic));
                USER_ERROR
            }
        }
    }

    /// Resumes a panic, returns the first error.
    pub(super) fn finish(self) -> Result<()> {
        if let Some(panic) = self.panic.take() {
            resume_unwind(panic);
        }
        self.error.into_inner().map_or(Ok(()), Err)
    }
}

/// Runs a callback that changes `y`. After the first error in a solve every `y` of this rank is filled with NaN, so that the norms
/// of all ranks become NaN.
///
/// # Safety
/// `context` is null or the pointer of a [`Callback`] that works on a `T` and stays for the call; `y` is alive.
pub(super) unsafe fn change<T: ?Sized>(
    context: *mut c_void,
    y: sys::Vec,
    body: impl FnOnce(&mut T, &mut DistributedVector) -> Result<()>,
) -> sys::PetscErrorCode {
    // SAFETY: the caller's promises.
    let (callback, y) = unsafe { (context.cast::<Callback<'_, T>>().as_ref(), DistributedVector::view(y)) };
    let (Some(callback), Ok(mut y)) = (callback, y) else { return USER_ERROR };
    let code = callback.run(|target| body(target, &mut y));
    if callback.error.borrow().is_some()
        && let Ok(mut values) = y.owned_mut()
    {
        values.fill(f64::NAN);
    }
    code
}

/// The same for a callback that writes `y` from `x`.
///
/// # Safety
/// As of [`change`]; `x` is alive and not `y`.
pub(super) unsafe fn write<T: ?Sized>(
    context: *mut c_void,
    x: sys::Vec,
    y: sys::Vec,
    body: impl FnOnce(&mut T, &DistributedVector, &mut DistributedVector) -> Result<()>,
) -> sys::PetscErrorCode {
    // SAFETY: the caller's promises.
    unsafe {
        let Ok(x) = DistributedVector::view(x) else { return USER_ERROR };
        change(context, y, |target: &mut T, y| body(target, &x, y))
    }
}

/// The context of a shell preconditioner; null where it has none.
///
/// # Safety
/// `pc` is a live shell preconditioner.
pub(super) unsafe fn context_of_preconditioner(pc: sys::PC) -> *mut c_void {
    let mut context: *mut c_void = ptr::null_mut();
    // SAFETY: the caller's promise; PETSc writes its context pointer.
    unsafe { sys::PCShellGetContext(pc, ptr::from_mut(&mut context).cast()) };
    context
}
