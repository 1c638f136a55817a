//! A subspace of its own as the first coarse level of multigrid.

use super::{
    check, index,
    levels::{self, Level},
    matrix::{declare_positive_definite, in_compressed_rows, set_rigid_motions},
    reference::Reference,
    sys,
};
use crate::error::Result;
use std::ptr;

/// The rows on this rank of the matrix that interpolates a coarse field to a fine one.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Interpolation {
    /// Where each row starts in `columns`; one more entry than rows.
    pub starts: Vec<usize>,
    /// Global coarse unknowns, ascending within a row.
    pub columns: Vec<usize>,
    /// The values at the columns.
    pub values: Vec<f64>,
    /// The coordinates of the coarse nodes of this rank, one for each coarse unknown.
    pub coordinates: Vec<f64>,
}

/// A coarse space whose matrix is the Galerkin product `P^T A P`, solved by one cycle of algebraic multigrid.
#[derive(Debug)]
pub(super) struct CoarseSpace {
    interpolation: Reference<sys::_p_Mat>,
    coordinates: Vec<f64>,
    block: sys::PetscInt,
    /// The matrices of the levels of the coarse solver.
    pub(super) levels: Vec<Level>,
}

impl CoarseSpace {
    /// The coarse space of this interpolation between fields of `block` values for each node. Collective.
    pub(super) fn new(block: usize, rows: Interpolation) -> Result<Self> {
        let Interpolation { starts, columns, values, coordinates } = rows;
        let own = index(starts.len() - 1, "unknowns of a rank")?;
        let coarse = index(coordinates.len(), "coarse unknowns of a rank")?;
        let block = index(block, "block size")?;
        let counts = |list: &[usize], what| list.iter().map(|&i| index(i, what)).collect::<Result<Vec<_>>>();
        let starts = counts(&starts, "entries of an interpolation")?;
        let columns = counts(&columns, "global coarse unknown")?;
        // SAFETY: the arrays describe `own` rows with ascending global columns.
        let interpolation =
            unsafe { in_compressed_rows([own, coarse], block, (&starts, &columns, &values))? };
        Ok(Self { interpolation, coordinates, block, levels: Vec::new() })
    }

    /// Computes the coarse matrix from that of the preconditioner. Collective.
    ///
    /// # Safety
    /// `pc` is a live multigrid preconditioner of two levels with matrices.
    pub(super) unsafe fn set_up(&mut self, pc: sys::PC) -> Result<()> {
        let (mut fine, mut smoother, mut coarse) = (ptr::null_mut(), ptr::null_mut(), ptr::null_mut());
        // SAFETY: the caller's promise; PETSc keeps its own references to the matrices.
        unsafe {
            check(sys::PCGetOperators(pc, ptr::null_mut(), &mut fine))?;
            check(sys::PCMGGetSmoother(pc, 1, &mut smoother))?;
            check(sys::PCMGGetCoarseSolve(pc, &mut coarse))?;
            // The smoother may still have the matrix of the set-up before.
            check(sys::KSPSetOperators(smoother, fine, fine))?;
            levels::set_interpolation(pc, 1, self.interpolation.get())?;
            levels::restore(levels::preconditioner_of(coarse)?, &self.levels)?;
            let matrix = Reference::new(|raw| {
                let (p, first) = (self.interpolation.get(), sys::MAT_INITIAL_MATRIX);
                sys::MatPtAP(fine, p, first, f64::from(sys::PETSC_DEFAULT), raw)
            })?;
            let raw = matrix.get();
            check(sys::MatSetBlockSize(raw, self.block))?;
            declare_positive_definite(raw)?;
            set_rigid_motions(raw, self.block, &self.coordinates)?;
            check(sys::KSPSetOperators(coarse, raw, raw))
        }
    }

    /// Lets the levels of the coarse solver use matrices in single precision.
    ///
    /// # Safety
    /// `pc` is a live multigrid preconditioner that is set up.
    pub(super) unsafe fn reduce_precision(&mut self, pc: sys::PC) -> Result<()> {
        // SAFETY: the caller's promise.
        self.levels = levels::in_single_precision(unsafe { solver_of_levels(pc)? })?;
        Ok(())
    }
}

/// The preconditioner of the coarse solver of multigrid.
///
/// # Safety
/// `pc` is a live multigrid preconditioner.
pub(super) unsafe fn solver_of_levels(pc: sys::PC) -> Result<sys::PC> {
    let mut coarse = ptr::null_mut();
    // SAFETY: the caller's promise; the solver belongs to the preconditioner.
    unsafe {
        check(sys::PCMGGetCoarseSolve(pc, &mut coarse))?;
        levels::preconditioner_of(coarse)
    }
}

/// Makes a preconditioner multigrid of two levels, whose coarse solver is one cycle of algebraic multigrid.
///
/// # Safety
/// A live preconditioner.
pub(super) unsafe fn two_levels(pc: sys::PC) -> Result<()> {
    let mut coarse = ptr::null_mut();
    // SAFETY: the caller's promise; PETSc copies the names.
    unsafe {
        check(sys::PCSetType(pc, c"mg".as_ptr()))?;
        check(sys::PCMGSetLevels(pc, 2, ptr::null_mut()))?;
        check(sys::PCMGGetCoarseSolve(pc, &mut coarse))?;
        check(sys::KSPSetType(coarse, c"preonly".as_ptr()))?;
        check(sys::PCSetType(levels::preconditioner_of(coarse)?, c"gamg".as_ptr()))
    }
}
