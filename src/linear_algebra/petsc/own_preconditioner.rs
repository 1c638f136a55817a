//! Preconditioners that are not PETSc's.

use super::{
    BlockRows, DistributedVector, Ksp,
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

impl Ksp {
    /// Uses this preconditioner, unless options of the user choose another.
    pub fn precondition_by(&mut self, own: Box<dyn OwnPreconditioner>) -> Result<()> {
        self.set_preconditioner("shell", None)?;
        let own = Box::new(RefCell::new(own));
        let context = ptr::from_ref::<Own>(&own).cast_mut().cast();
        self.own = Some(own);
        // SAFETY: the context stays in its box for as long as this solver and those that share its preconditioner.
        unsafe {
            check(sys::PCShellSetContext(self.preconditioner()?, context))?;
            check(sys::PCShellSetApply(self.preconditioner()?, Some(apply)))
        }
    }

    /// Prepares the own preconditioner, if there is one, for the matrix that PETSc would build one from. Collective.
    pub(super) fn set_up_own(&self) -> Result<()> {
        let Some(own) = &self.own else { return Ok(()) };
        let mut raw = ptr::null_mut();
        // SAFETY: live objects; PETSc counts a reference to the matrix, which is given back.
        let matrix = unsafe {
            check(sys::PCGetOperators(self.preconditioner()?, ptr::null_mut(), &mut raw))?;
            Reference::to(raw)?
        };
        own.borrow_mut().set_up(&block_rows(matrix.get())?)
    }
}

unsafe extern "C" fn apply(pc: sys::PC, r: sys::Vec, z: sys::Vec) -> sys::PetscErrorCode {
    // SAFETY: a live shell preconditioner, whose context `precondition_by` set; PETSc's vectors live for the call and differ.
    let (own, r, z) = unsafe {
        let own = context_of_preconditioner(pc).cast::<Own>().as_ref();
        (own, DistributedVector::view(r), DistributedVector::view(z))
    };
    let (Some(own), Ok(r), Ok(mut z)) = (own, r, z) else { return USER_ERROR };
    let (Ok(r), Ok(mut z)) = (r.owned(), z.owned_mut()) else { return USER_ERROR };
    own.borrow_mut().apply(&r, &mut z).map_or(USER_ERROR, |()| 0)
}
