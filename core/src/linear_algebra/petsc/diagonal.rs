//! Jacobi's preconditioner of a level of multigrid, with what contact adds to the diagonal.

use super::{
    DistributedVector,
    callback::{USER_ERROR, context_of_preconditioner},
    check,
    subspace::OnLevel,
    sys,
};
use crate::error::Result;
use std::{ptr, rc::Rc};

/// The inverse of the diagonal of a matrix.
#[derive(Debug)]
pub(super) struct InverseDiagonal {
    inverse: Vec<f32>,
    subspace: Rc<OnLevel>,
}

impl InverseDiagonal {
    /// Reads the diagonal of a matrix, which the level gets, too. Collective.
    pub(super) fn of(matrix: sys::Mat, level: &Rc<OnLevel>) -> Result<Self> {
        let mut diagonal = DistributedVector::of_rows(matrix)?;
        // SAFETY: live objects of one layout.
        check(unsafe { sys::MatGetDiagonal(matrix, diagonal.raw.get()) })?;
        diagonal.owned_mut()?.iter_mut().filter(|entry| **entry == 0.0).for_each(|entry| *entry = 1.0);
        let entries = diagonal.owned()?.to_vec();
        let inverse = entries.iter().map(|entry| (1.0 / entry) as f32).collect();
        level.set_diagonal(entries);
        Ok(Self { inverse, subspace: level.clone() })
    }

    /// Becomes this preconditioner.
    ///
    /// # Safety
    /// `pc` is a live preconditioner, which is not applied after this is moved or dropped.
    pub(super) unsafe fn attach(&self, pc: sys::PC) -> Result<()> {
        // SAFETY: the caller's promises; the context stays where it is.
        unsafe {
            check(sys::PCSetType(pc, c"shell".as_ptr()))?;
            check(sys::PCShellSetContext(pc, ptr::from_ref(self).cast_mut().cast()))?;
            check(sys::PCShellSetApply(pc, Some(apply)))
        }
    }

    fn solve(&self, r: &DistributedVector, z: &mut DistributedVector) -> Result<()> {
        let (r, mut z) = (r.owned()?, z.owned_mut()?);
        for ((z, r), inverse) in z.iter_mut().zip(&*r).zip(&self.inverse) {
            *z = r * f64::from(*inverse);
        }
        self.subspace.solve_stiffened(&r, &mut z);
        Ok(())
    }
}

unsafe extern "C" fn apply(pc: sys::PC, r: sys::Vec, z: sys::Vec) -> sys::PetscErrorCode {
    // SAFETY: a live shell preconditioner, whose context `attach` set; PETSc's vectors live for the call and differ.
    let (own, r, z) = unsafe {
        let own = context_of_preconditioner(pc).cast::<InverseDiagonal>().as_ref();
        (own, DistributedVector::view(r), DistributedVector::view(z))
    };
    let (Some(own), Ok(r), Ok(mut z)) = (own, r, z) else { return USER_ERROR };
    own.solve(&r, &mut z).map_or(USER_ERROR, |()| 0)
}
