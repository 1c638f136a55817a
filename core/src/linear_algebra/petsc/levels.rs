//! Copies in single precision of the matrices of PETSc's multigrid: the speed of smoothers and interpolations is limited by memory
//! bandwidth, and single precision is accurate enough for them.

use super::{
    block_product::BlockProduct,
    block_transfer::{BlockTransfer, TransferShell},
    check,
    coarsest::Coarsest,
    diagonal::InverseDiagonal,
    reference::Reference,
    shell::Shell,
    subspace::{Fields, OnLevel, Restriction},
    sys,
};
use crate::error::Result;
use std::{ffi::CStr, ptr, rc::Rc};

/// A level's matrices, and the subspaces on this level and on the coarser one.
#[derive(Debug, Default)]
pub(super) struct Level {
    smoother: Option<Shell>,
    /// The preconditioner of the smoother, in place of PETSc's.
    diagonal: Option<Box<InverseDiagonal>>,
    transfer: Option<Interpolated>,
    fine: Rc<OnLevel>,
    coarse: Rc<OnLevel>,
}

/// The interpolation from the coarser level.
#[derive(Debug)]
struct Interpolated {
    copy: TransferShell,
    original: Reference<sys::_p_Mat>,
    /// Read at the first solve on a subspace.
    fields: Option<Fields>,
}

impl Level {
    /// Whether the products of this level can be those on a subspace, on all ranks alike.
    fn can_be_restricted(&self) -> bool {
        self.smoother.is_some() && self.transfer.is_some()
    }

    /// Sets the subspace of this level, and returns that of the coarser one. Collective.
    fn restrict(&mut self, restriction: Restriction) -> Result<Restriction> {
        let Some(Interpolated { copy: TransferShell { blocks, others, .. }, original, fields }) =
            &mut self.transfer
        else {
            return Ok(restriction);
        };
        let (raw, others) = (original.get(), others.as_deref());
        let fields = match fields {
            Some(fields) => fields,
            none => none.insert(Fields::new(raw, *blocks, others)?),
        };
        let coarser = fields.coarser(raw, others, &restriction)?;
        self.fine.set(restriction);
        self.coarse.set(coarser.clone());
        Ok(coarser)
    }

    /// Bytes moved on this rank by a product of the smoother and a restriction or interpolation; `None` for PETSc's own matrices.
    pub(super) fn bytes(&self) -> [Option<u64>; 2] {
        [
            self.smoother.as_ref().map(Shell::bytes),
            self.transfer.as_ref().map(|transfer| transfer.copy.shell.bytes()),
        ]
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

/// Whether a solver has this type.
fn is_type_of_solver(solver: sys::KSP, name: &CStr) -> Result<bool> {
    let mut kind = ptr::null();
    // SAFETY: live solver; PETSc's names are NUL-terminated and live as long as their object.
    unsafe {
        check(sys::KSPGetType(solver, &mut kind))?;
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
        let mut coarser: Rc<OnLevel> = Rc::default();
        if is_type(pc, c"gamg")? {
            let (mut solver, mut matrix) = (ptr::null_mut(), ptr::null_mut());
            check(sys::PCMGGetCoarseSolve(pc, &mut solver))?;
            check(sys::KSPGetOperators(solver, ptr::null_mut(), &mut matrix))?;
            coarser.set_coarsest(Coarsest::of(matrix)?);
        }
        for number in 1..count {
            let mut level = Level { coarse: coarser, ..Level::default() };
            coarser = level.fine.clone();
            let (mut smoother, mut matrix) = (ptr::null_mut(), ptr::null_mut());
            check(sys::PCMGGetSmoother(pc, number, &mut smoother))?;
            check(sys::KSPGetOperators(smoother, ptr::null_mut(), &mut matrix))?;
            if let Some(shell) = BlockProduct::shell::<f32>(matrix, &level.fine)? {
                check(sys::KSPSetOperators(smoother, shell.raw.get(), matrix))?;
                // Chebyshev's bounds hold with what is added to both the matrix and its diagonal.
                let jacobi = preconditioner_of(smoother)?;
                if is_type(jacobi, c"jacobi")? && is_type_of_solver(smoother, c"chebyshev")? {
                    // PETSc keeps the bounds that it knows from the set-up for its own preconditioner alone.
                    check(sys::KSPSetUp(smoother))?;
                    let diagonal = Box::new(InverseDiagonal::of(matrix, &level.fine)?);
                    diagonal.attach(jacobi)?;
                    level.diagonal = Some(diagonal);
                }
                check(sys::PCMGSetResidual(pc, number, Some(sys::PCMGResidualDefault), shell.raw.get()))?;
                level.smoother = Some(shell);
            }
            let mut interpolation = ptr::null_mut();
            check(sys::PCMGGetInterpolation(pc, number, &mut interpolation))?;
            if let Some(copy) = BlockTransfer::shell(interpolation, [&level.fine, &level.coarse])? {
                let original = Reference::to(interpolation)?;
                set_interpolation(pc, number, copy.shell.raw.get())?;
                level.transfer = Some(Interpolated { copy, original, fields: None });
            }
            levels.push(level);
        }
    }
    Ok(levels)
}

/// Whether all levels, of which there are some, can be restricted to a subspace, on all ranks alike.
pub(super) fn can_be_restricted(levels: &[Level]) -> bool {
    !levels.is_empty() && levels.iter().all(Level::can_be_restricted)
}

/// Restricts levels to a subspace of the finest, the last of them, for solves during which they are [used](use_subspace); returns the
/// projection of the coarsest level, which has none of these matrices. Collective.
pub(super) fn restrict(levels: &mut [Level], finest: Restriction) -> Result<Restriction> {
    levels.iter_mut().rev().try_fold(finest, |restriction, level| level.restrict(restriction))
}

/// Lets products be those on the subspace, or on the whole space. On all ranks alike.
pub(super) fn use_subspace(levels: &[Level], in_use: bool) {
    for level in levels {
        level.fine.set_in_use(in_use);
        level.coarse.set_in_use(in_use);
    }
}

/// Restores PETSc's own interpolations, from which PETSc computes coarse matrices, and its smoothers.
pub(super) fn restore(pc: sys::PC, levels: &[Level]) -> Result<()> {
    for (level, number) in levels.iter().zip(1..) {
        if let Some(Interpolated { original, .. }) = &level.transfer {
            // SAFETY: live objects of this preconditioner.
            unsafe { set_interpolation(pc, number, original.get())? };
        }
        if level.diagonal.is_some() {
            let mut smoother = ptr::null_mut();
            // SAFETY: as before; PETSc sets the matrices of the smoother anew.
            unsafe {
                check(sys::PCMGGetSmoother(pc, number, &mut smoother))?;
                check(sys::PCSetType(preconditioner_of(smoother)?, c"jacobi".as_ptr()))?;
            }
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
