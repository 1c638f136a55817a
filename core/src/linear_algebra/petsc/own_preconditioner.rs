//! Preconditioners that are not PETSc's.

use super::{
    BlockRows, DistributedVector,
    callback::{USER_ERROR, context_of_preconditioner},
    check,
    reduced::block_rows,
    reference::Reference,
    sys,
};
use crate::error::Result;
use std::{cell::RefCell, fmt::Debug, ptr};

/// A preconditioner for a matrix that PETSc holds.
pub trait OwnPreconditioner: Debug {
    /// Prepares applications for the matrix with these rows on this rank. Collective, with the same outcome on all ranks.
    fn set_up(&mut self, rows: &BlockRows) -> Result<()>;

    /// Writes `P^-1 r` for the values of this rank. Collective.
    fn apply(&mut self, r: &[f64], z: &mut [f64]) -> Result<()>;

    /// Least number of bytes that an application moves on this rank.
    fn bytes(&self) -> u64;
}

/// The context of a shell preconditioner.
pub(super) type Own = RefCell<Box<dyn OwnPreconditioner>>;

/// Lets a shell preconditioner apply this one.
///
/// # Safety
/// `pc` is a live shell preconditioner; `own` is neither moved nor dropped while it is applied.
pub(super) unsafe fn attach(pc: sys::PC, own: &Own) -> Result<()> {
    // SAFETY: the caller's promises.
    unsafe {
        check(sys::PCShellSetContext(pc, ptr::from_ref(own).cast_mut().cast()))?;
        check(sys::PCShellSetApply(pc, Some(apply)))
    }
}

/// Prepares the preconditioner for the matrix from which PETSc would build one. Collective.
///
/// # Safety
/// `pc` is a live preconditioner with matrices.
pub(super) unsafe fn set_up(pc: sys::PC, own: &Own) -> Result<()> {
    let mut raw = ptr::null_mut();
    // SAFETY: the caller's promise; the matrix is shared while its rows are read.
    let matrix = unsafe {
        check(sys::PCGetOperators(pc, ptr::null_mut(), &mut raw))?;
        Reference::to(raw)?
    };
    own.borrow_mut().set_up(&block_rows(matrix.get())?)
}

unsafe extern "C" fn apply(pc: sys::PC, r: sys::Vec, z: sys::Vec) -> sys::PetscErrorCode {
    // SAFETY: a live shell preconditioner, whose context `attach` set; PETSc's vectors live for the call and differ.
    let (own, r, z) = unsafe {
        let own = context_of_preconditioner(pc).cast::<Own>().as_ref();
        (own, DistributedVector::view(r), DistributedVector::view(z))
    };
    let (Some(own), Ok(r), Ok(mut z)) = (own, r, z) else { return USER_ERROR };
    let (Ok(r), Ok(mut z)) = (r.owned(), z.owned_mut()) else { return USER_ERROR };
    own.borrow_mut().apply(&r, &mut z).map_or(USER_ERROR, |()| 0)
}
