use super::{DistributedVector, callback::USER_ERROR, check, library::communicator, sys};
use crate::error::{Error, Result};
use std::{ffi::c_void, fmt, ptr};

/// What stands behind a shell matrix.
pub(super) trait Action {
    /// `y = A x`. Collective.
    fn multiply(&self, x: &DistributedVector, y: &mut DistributedVector) -> Result<()>;

    /// `y = A^T x`. Collective.
    fn multiply_transposed(&self, _x: &DistributedVector, _y: &mut DistributedVector) -> Result<()> {
        Err(Error::Internal("a product with a transpose that nothing was made for".into()))
    }

    /// Bytes of this rank that a product moves at the least.
    fn bytes(&self) -> u64;
}

/// A matrix of PETSc's that is known by its products.
pub(super) struct Shell {
    pub raw: sys::Mat,
    action: Box<Box<dyn Action>>,
}

impl fmt::Debug for Shell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Shell")
    }
}

type Callback = unsafe extern "C" fn(sys::Mat, sys::Vec, sys::Vec) -> sys::PetscErrorCode;

impl Shell {
    /// A shell laid out like `matrix`. Once this handle is dropped, products with it are errors. Collective.
    pub fn new(matrix: sys::Mat, action: Box<dyn Action>) -> Result<Self> {
        let mut shell = Self { raw: ptr::null_mut(), action: Box::new(action) };
        let (mut rows, mut columns, mut blocks) = (0, 0, [0; 2]);
        // SAFETY: live matrix. The handle owns one reference to the shell, whose context stays in its box for as long as the
        // handle. The callbacks have the types that PETSc documents for these operations.
        unsafe {
            check(sys::MatGetLocalSize(matrix, &mut rows, &mut columns))?;
            let [high, wide] = &mut blocks;
            check(sys::MatGetBlockSizes(matrix, high, wide))?;
            let (context, all) = (ptr::from_ref(&*shell.action).cast_mut().cast(), sys::PETSC_DETERMINE);
            check(sys::MatCreateShell(communicator(), rows, columns, all, all, context, &mut shell.raw))?;
            check(sys::MatSetBlockSizes(shell.raw, blocks[0], blocks[1]))?;
            for (operation, callback) in [
                (sys::MATOP_MULT, multiply as Callback),
                (sys::MATOP_MULT_TRANSPOSE, multiply_transposed as Callback),
            ] {
                let callback: unsafe extern "C" fn() = std::mem::transmute(callback);
                check(sys::MatShellSetOperation(shell.raw, operation, Some(callback)))?;
            }
        }
        Ok(shell)
    }

    /// Bytes of this rank that a product moves at the least.
    pub fn bytes(&self) -> u64 {
        self.action.bytes()
    }
}

impl Drop for Shell {
    fn drop(&mut self) {
        if self.raw.is_null() {
            return;
        }
        // SAFETY: this handle owns one reference; a matrix that PETSc keeps beyond it has no context to multiply with.
        unsafe {
            sys::MatShellSetContext(self.raw, ptr::null_mut());
            sys::MatDestroy(&mut self.raw);
        }
    }
}

unsafe extern "C" fn multiply(matrix: sys::Mat, x: sys::Vec, y: sys::Vec) -> sys::PetscErrorCode {
    // SAFETY: a live shell made here and its vectors, which differ.
    unsafe { act(matrix, x, y, |action, x, y| action.multiply(x, y)) }
}

unsafe extern "C" fn multiply_transposed(matrix: sys::Mat, x: sys::Vec, y: sys::Vec) -> sys::PetscErrorCode {
    // SAFETY: as in `multiply`.
    unsafe { act(matrix, x, y, |action, x, y| action.multiply_transposed(x, y)) }
}

/// # Safety
/// A live shell made here, live vectors that differ.
unsafe fn act(
    matrix: sys::Mat,
    x: sys::Vec,
    y: sys::Vec,
    act: impl FnOnce(&dyn Action, &DistributedVector, &mut DistributedVector) -> Result<()>,
) -> sys::PetscErrorCode {
    let mut context: *mut c_void = ptr::null_mut();
    // SAFETY: PETSc writes its context pointer, which the handle keeps alive; its vectors live for the call.
    let (action, x, mut y) = unsafe {
        if sys::MatShellGetContext(matrix, ptr::from_mut(&mut context).cast()) != 0 || context.is_null() {
            return USER_ERROR;
        }
        (&**context.cast::<Box<dyn Action>>(), DistributedVector::view(x), DistributedVector::view(y))
    };
    act(action, &x, &mut y).map_or(USER_ERROR, |()| 0)
}
