//! Copies in single precision of the matrices of PETSc's multigrid: the speed of smoothers and interpolations is limited by memory
//! bandwidth, and single precision is accurate enough for them.

use super::{
    block_product::BlockProduct, block_transfer::BlockTransfer, check, reference::Reference, shell::Shell,
    sys,
};
use crate::error::Result;
use std::{ffi::CStr, ptr};

/// A level's matrices.
#[derive(Debug, Default)]
pub(super) struct Level {
    smoother: Option<Shell>,
    transfer: Option<(Shell, Reference<sys::_p_Mat>)>,
}

impl Level {
    /// Bytes moved on this rank by a product of the smoother and a restriction or interpolation; `None` for PETSc's own matrices.
    pub(super) fn bytes(&self) -> [Option<u64>; 2] {
        [self.smoother.as_ref().map(Shell::bytes), self.transfer.as_ref().map(|(shell, _)| shell.bytes())]
    }
}

/// The preconditioner of a solver, which owns it.
///
/// # Safety
/// A live solver.
pub(super) unsafe fn preconditioner_of(solver: sys::KSP) -> Result<sys::PC> {
    let mut pc = ptr::null_mut();
    // SAFETY: the caller's promise.
    check(unsafe { sys::KSPGetPC(solver, &mut pc) })?;
    Ok(pc)
}

/// Whether a preconditioner has this type.
pub(super) fn is_type(pc: sys::PC, name: &CStr) -> Result<bool> {
    let mut kind = ptr::null();
    // SAFETY: live preconditioner; PETSc's names are NUL-terminated and live as long as their object.
    unsafe {
        check(sys::PCGetType(pc, &mut kind))?;
        Ok(!kind.is_null() && CStr::from_ptr(kind) == name)
    }
}

/// Replaces the matrices of each level of a preconditioner that is set up by copies; the list is empty for preconditioners other
/// than multigrid. The preconditioner must not be applied after the levels are dropped. Collective.
pub(super) fn in_single_precision(pc: sys::PC) -> Result<Vec<Level>> {
    let mut levels = Vec::new();
    if !is_type(pc, c"gamg")? && !is_type(pc, c"mg")? {
        return Ok(levels);
    }
    let mut count = 0;
    // SAFETY: live objects, which own what they show; PETSc keeps its own references to the shells.
    unsafe {
        check(sys::PCMGGetLevels(pc, &mut count))?;
        for number in 1..count {
            let mut level = Level::default();
            let (mut smoother, mut matrix) = (ptr::null_mut(), ptr::null_mut());
            check(sys::PCMGGetSmoother(pc, number, &mut smoother))?;
            check(sys::KSPGetOperators(smoother, ptr::null_mut(), &mut matrix))?;
            if let Some(shell) = BlockProduct::shell::<f32>(matrix)? {
                check(sys::KSPSetOperators(smoother, shell.raw.get(), matrix))?;
                check(sys::PCMGSetResidual(pc, number, Some(sys::PCMGResidualDefault), shell.raw.get()))?;
                level.smoother = Some(shell);
            }
            let mut interpolation = ptr::null_mut();
            check(sys::PCMGGetInterpolation(pc, number, &mut interpolation))?;
            if let Some(shell) = BlockTransfer::shell(interpolation)? {
                let original = Reference::to(interpolation)?;
                set_interpolation(pc, number, shell.raw.get())?;
                level.transfer = Some((shell, original));
            }
            levels.push(level);
        }
    }
    Ok(levels)
}

/// Restores PETSc's own interpolations, from which PETSc computes coarse matrices.
pub(super) fn restore_interpolations(pc: sys::PC, levels: &[Level]) -> Result<()> {
    for (level, number) in levels.iter().zip(1..) {
        if let Some((_, original)) = &level.transfer {
            // SAFETY: live objects of this preconditioner.
            unsafe { set_interpolation(pc, number, original.get())? };
        }
    }
    Ok(())
}

/// # Safety
/// A live multigrid preconditioner with this level, a live matrix of the right layout.
pub(super) unsafe fn set_interpolation(pc: sys::PC, level: sys::PetscInt, matrix: sys::Mat) -> Result<()> {
    // SAFETY: the caller's; PETSc keeps its own references.
    unsafe {
        check(sys::PCMGSetInterpolation(pc, level, matrix))?;
        check(sys::PCMGSetRestriction(pc, level, matrix))
    }
}
