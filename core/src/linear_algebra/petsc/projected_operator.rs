use super::{
    DistributedVector, LinearOutcome,
    callback::{self, context_of_preconditioner},
    shell::context_of_matrix,
    sys,
};
use crate::error::{Error, Result};
use std::ffi::c_void;

/// An operator on a subspace, given by its action.
pub trait ProjectedOperator {
    /// `y = P B x` for an `x` of the subspace.
    fn apply(&mut self, x: &DistributedVector, y: &mut DistributedVector) -> Result<()>;

    /// `x = P x`: the orthogonal projection on the subspace, node by node.
    fn project(&mut self, x: &mut DistributedVector) -> Result<()>;

    /// `y += S x`: what is added to the constant matrix, as far as that can be told node by node. It serves to precondition.
    fn add_at_nodes(&mut self, _x: &DistributedVector, _y: &mut DistributedVector) -> Result<()> {
        Ok(())
    }

    /// Whether the subspace may differ from the whole space.
    fn may_project(&self) -> bool {
        true
    }

    /// `z = M^-1 r`, if [`super::ProjectedKsp::precondition_by_operator`] was called.
    fn precondition(&mut self, _r: &DistributedVector, _z: &mut DistributedVector) -> Result<()> {
        Err(Error::Internal("an operator without a preconditioner was asked for one".into()))
    }
}

/// Outcome of a solve on a subspace.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProjectedOutcome {
    /// The outcome, iterations of both methods together.
    pub linear: LinearOutcome,
    /// Whether CG found negative curvature, so that GMRES was used.
    pub indefinite: bool,
    /// Whether the preconditioner was rebuilt.
    pub refreshed: bool,
}

pub(super) unsafe extern "C" fn multiply(matrix: sys::Mat, x: sys::Vec, y: sys::Vec) -> sys::PetscErrorCode {
    // SAFETY: a live shell matrix, whose context `solve` set to its live frame; PETSc's vectors live for the call.
    unsafe {
        let context = context_of_matrix(matrix);
        callback::write::<dyn ProjectedOperator>(context, x, y, |operator, x, y| operator.apply(x, y))
    }
}

pub(super) unsafe extern "C" fn precondition(pc: sys::PC, r: sys::Vec, z: sys::Vec) -> sys::PetscErrorCode {
    // SAFETY: a live shell preconditioner; the rest as in `multiply`.
    unsafe {
        let context = context_of_preconditioner(pc);
        callback::write::<dyn ProjectedOperator>(context, r, z, |operator, r, z| operator.precondition(r, z))
    }
}

pub(super) unsafe extern "C" fn project(
    _: sys::MatNullSpace,
    x: sys::Vec,
    context: *mut c_void,
) -> sys::PetscErrorCode {
    // SAFETY: as in `multiply`.
    unsafe { callback::change::<dyn ProjectedOperator>(context, x, |operator, x| operator.project(x)) }
}
