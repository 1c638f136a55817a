use super::{
    DistributedVector, LinearOutcome,
    callback::{Callback, USER_ERROR, spoil},
    sys,
};
use crate::error::{Error, Result};
use std::{ffi::c_void, ptr};

/// An operator on a subspace, given by its action.
pub trait ProjectedOperator {
    /// `y = P B x` for an `x` of the subspace.
    fn apply(&mut self, x: &DistributedVector, y: &mut DistributedVector) -> Result<()>;

    /// `x = P x`: the orthogonal projection on the subspace, node by node.
    fn project(&mut self, x: &mut DistributedVector) -> Result<()>;

    /// Whether the subspace may be less than the whole space.
    fn may_project(&self) -> bool {
        true
    }

    /// `z = M^-1 r`, where [`super::ProjectedKsp::precondition_by_operator`] asks for it.
    fn precondition(&mut self, _r: &DistributedVector, _z: &mut DistributedVector) -> Result<()> {
        Err(Error::Internal("an operator without a preconditioner was asked for one".into()))
    }
}

/// How a solve on a subspace ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProjectedOutcome {
    /// The outcome, iterations of both methods together.
    pub linear: LinearOutcome,
    /// Whether CG met negative curvature, so that GMRES had to solve.
    pub indefinite: bool,
    /// Whether the preconditioner was made anew.
    pub refreshed: bool,
}

type Context<'a> = Callback<'a, dyn ProjectedOperator + 'a>;

pub(super) unsafe extern "C" fn multiply(matrix: sys::Mat, x: sys::Vec, y: sys::Vec) -> sys::PetscErrorCode {
    let mut context: *mut c_void = ptr::null_mut();
    // SAFETY: a live shell matrix; PETSc writes its context pointer.
    let code = unsafe { sys::MatShellGetContext(matrix, ptr::from_mut(&mut context).cast()) };
    if code != 0 || context.is_null() {
        return USER_ERROR;
    }
    // SAFETY: `solve` set the context to its live frame; PETSc's vectors live for the call. The second view of `y` is
    // used only after the first is done.
    let (context, x, mut y, mut spoilt) = unsafe {
        let view = |raw| DistributedVector::view(raw);
        (&*context.cast::<Context<'_>>(), view(x), view(y), view(y))
    };
    context.run(|operator| operator.apply(&x, &mut y), || spoil(&mut spoilt))
}

pub(super) unsafe extern "C" fn precondition(pc: sys::PC, r: sys::Vec, z: sys::Vec) -> sys::PetscErrorCode {
    let mut context: *mut c_void = ptr::null_mut();
    // SAFETY: a live shell preconditioner; PETSc writes its context pointer.
    let code = unsafe { sys::PCShellGetContext(pc, ptr::from_mut(&mut context).cast()) };
    if code != 0 || context.is_null() {
        return USER_ERROR;
    }
    // SAFETY: as in `multiply`.
    let (context, r, mut z, mut spoilt) = unsafe {
        let view = |raw| DistributedVector::view(raw);
        (&*context.cast::<Context<'_>>(), view(r), view(z), view(z))
    };
    context.run(|operator| operator.precondition(&r, &mut z), || spoil(&mut spoilt))
}

pub(super) unsafe extern "C" fn project(
    _: sys::MatNullSpace,
    x: sys::Vec,
    context: *mut c_void,
) -> sys::PetscErrorCode {
    if context.is_null() {
        return USER_ERROR;
    }
    // SAFETY: as in `multiply`.
    let (context, mut x, mut spoilt) =
        unsafe { (&*context.cast::<Context<'_>>(), DistributedVector::view(x), DistributedVector::view(x)) };
    context.run(|operator| operator.project(&mut x), || spoil(&mut spoilt))
}
