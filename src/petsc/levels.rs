//! The levels of PETSc's multigrid multiply with copies of their matrices in single precision: smoothers need no more, and are
//! bound by the memory that they read.

use super::{block_product::BlockProduct, callback::USER_ERROR, check, library::communicator, sys};
use crate::error::Result;
use std::{ffi::CStr, ffi::c_void, fmt, ptr};

/// What the smoother of a level multiplies with.
pub(super) struct Level {
    shell: sys::Mat,
    product: Box<BlockProduct>,
}

impl fmt::Debug for Level {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "level of {} bytes", self.product.bytes())
    }
}

/// Sets the preconditioner up and gives each smoother of algebraic multigrid such a copy; nothing for other preconditioners. The
/// preconditioner must not be applied once the levels are dropped. Collective.
pub(super) fn in_single_precision(pc: sys::PC) -> Result<Vec<Level>> {
    let (mut kind, mut count, mut levels) = (ptr::null(), 0, Vec::new());
    // SAFETY: live objects, which own what they show; PETSc keeps its own references to the shells.
    unsafe {
        check(sys::PCGetType(pc, &mut kind))?;
        if kind.is_null() || CStr::from_ptr(kind) != c"gamg" {
            return Ok(levels);
        }
        check(sys::PCSetUp(pc))?;
        check(sys::PCMGGetLevels(pc, &mut count))?;
        for level in 1..count {
            let (mut smoother, mut matrix) = (ptr::null_mut(), ptr::null_mut());
            check(sys::PCMGGetSmoother(pc, level, &mut smoother))?;
            check(sys::KSPGetOperators(smoother, ptr::null_mut(), &mut matrix))?;
            if let Some(product) = BlockProduct::new::<f32>(matrix)? {
                let made = Level::new(matrix, product)?;
                check(sys::KSPSetOperators(smoother, made.shell, matrix))?;
                check(sys::PCMGSetResidual(pc, level, Some(sys::PCMGResidualDefault), made.shell))?;
                levels.push(made);
            }
        }
    }
    Ok(levels)
}

impl Level {
    fn new(matrix: sys::Mat, product: BlockProduct) -> Result<Self> {
        let mut level = Self { shell: ptr::null_mut(), product: Box::new(product) };
        let (mut rows, mut columns, mut block, mut comm) = (0, 0, 0, communicator());
        // SAFETY: live matrix. The handle owns one reference to the shell, whose context stays in its box for as long as the
        // handle.
        unsafe {
            check(sys::PetscObjectGetComm(matrix.cast(), &mut comm))?;
            check(sys::MatGetLocalSize(matrix, &mut rows, &mut columns))?;
            check(sys::MatGetBlockSize(matrix, &mut block))?;
            let (context, all) = (ptr::from_ref(&*level.product).cast_mut(), sys::PETSC_DETERMINE);
            check(sys::MatCreateShell(comm, rows, columns, all, all, context.cast(), &mut level.shell))?;
            check(sys::MatSetBlockSize(level.shell, block))?;
            let multiply: unsafe extern "C" fn(sys::Mat, sys::Vec, sys::Vec) -> sys::PetscErrorCode =
                multiply;
            let multiply: unsafe extern "C" fn() = std::mem::transmute(multiply);
            check(sys::MatShellSetOperation(level.shell, sys::MATOP_MULT, Some(multiply)))?;
            check(sys::MatSetOption(level.shell, sys::MAT_SYMMETRIC, 1))?;
        }
        Ok(level)
    }
}

impl Drop for Level {
    fn drop(&mut self) {
        // SAFETY: this handle owns one reference.
        unsafe { sys::MatDestroy(&mut self.shell) };
    }
}

unsafe extern "C" fn multiply(matrix: sys::Mat, x: sys::Vec, y: sys::Vec) -> sys::PetscErrorCode {
    let mut context: *mut c_void = ptr::null_mut();
    // SAFETY: a live shell matrix; PETSc writes its context pointer, which its level keeps alive.
    let product = unsafe {
        if sys::MatShellGetContext(matrix, ptr::from_mut(&mut context).cast()) != 0 || context.is_null() {
            return USER_ERROR;
        }
        &*context.cast::<BlockProduct>()
    };
    // SAFETY: PETSc's vectors live for the call and differ.
    match unsafe { product.multiply(x, y) } {
        Ok(()) => 0,
        Err(_) => USER_ERROR,
    }
}
