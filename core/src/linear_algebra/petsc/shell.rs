use super::{
    DistributedVector, callback::USER_ERROR, check, index, library::communicator, reference::Reference, sys,
};
use crate::error::{Error, Result};
use std::{ffi::c_void, fmt, ptr};

/// The products of a shell matrix.
pub(super) trait Action {
    /// `y = A x`. Collective.
    fn multiply(&self, x: &DistributedVector, y: &mut DistributedVector) -> Result<()>;

    /// `y = A^T x`. Collective.
    fn multiply_transposed(&self, _x: &DistributedVector, _y: &mut DistributedVector) -> Result<()> {
        Err(Error::Internal("a product with a transpose that nothing was made for".into()))
    }

    /// Least number of bytes that a product moves on this rank.
    fn bytes(&self) -> u64;
}

/// A PETSc shell matrix, which is defined by its products.
pub(super) struct Shell {
    pub raw: Reference<sys::_p_Mat>,
    action: Box<Box<dyn Action>>,
}

impl fmt::Debug for Shell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Shell")
    }
}

type Multiply = unsafe extern "C" fn(sys::Mat, sys::Vec, sys::Vec) -> sys::PetscErrorCode;

impl Shell {
    /// A shell with the layout of `matrix`. After this handle is dropped, products with the shell are errors. Collective.
    pub(super) fn new(matrix: sys::Mat, action: Box<dyn Action>) -> Result<Self> {
        let action = Box::new(action);
        let (mut rows, mut columns, mut blocks) = (0, 0, [0; 2]);
        let [high, wide] = &mut blocks;
        // SAFETY: live matrix and live numbers.
        unsafe {
            check(sys::MatGetLocalSize(matrix, &mut rows, &mut columns))?;
            check(sys::MatGetBlockSizes(matrix, high, wide))?;
        }
        let operations: [(_, Multiply); 2] =
            [(sys::MATOP_MULT, multiply), (sys::MATOP_MULT_TRANSPOSE, multiply_transposed)];
        let shell = Self { raw: create([rows, columns], blocks, &operations)?, action };
        // SAFETY: live shell; the context stays in its box for as long as the handle.
        check(unsafe {
            sys::MatShellSetContext(shell.raw.get(), ptr::from_ref(&*shell.action).cast_mut().cast())
        })?;
        Ok(shell)
    }

    /// Least number of bytes that a product moves on this rank.
    pub(super) fn bytes(&self) -> u64 {
        self.action.bytes()
    }
}

impl Drop for Shell {
    fn drop(&mut self) {
        // SAFETY: live shell; if PETSc keeps it beyond this handle, it has no context to multiply with.
        unsafe { sys::MatShellSetContext(self.raw.get(), ptr::null_mut()) };
    }
}

/// A symmetric shell with the layout of a vector of this block size, usable for products while its context is set. Collective.
pub(super) fn symmetric_shell(
    like: &DistributedVector,
    block: usize,
    multiply: Multiply,
) -> Result<Reference<sys::_p_Mat>> {
    let size = index(like.owned()?.len(), "unknowns of a rank")?;
    let shell = create([size; 2], [index(block, "block size")?; 2], &[(sys::MATOP_MULT, multiply)])?;
    // SAFETY: live shell.
    check(unsafe { sys::MatSetOption(shell.get(), sys::MAT_SYMMETRIC, 1) })?;
    Ok(shell)
}

/// A shell with these numbers of rows and columns on this rank, in blocks, and without a context.
fn create(
    [rows, columns]: [sys::PetscInt; 2],
    blocks: [sys::PetscInt; 2],
    operations: &[(sys::MatOperation, Multiply)],
) -> Result<Reference<sys::_p_Mat>> {
    let (all, none) = (sys::PETSC_DETERMINE, ptr::null_mut());
    // SAFETY: the callbacks have the type that PETSc documents for these operations.
    unsafe {
        let shell =
            Reference::new(|raw| sys::MatCreateShell(communicator(), rows, columns, all, all, none, raw))?;
        check(sys::MatSetBlockSizes(shell.get(), blocks[0], blocks[1]))?;
        for (operation, callback) in operations {
            let callback = std::mem::transmute::<Multiply, unsafe extern "C" fn()>(*callback);
            check(sys::MatShellSetOperation(shell.get(), *operation, Some(callback)))?;
        }
        Ok(shell)
    }
}

/// The context of a shell; null where it has none.
///
/// # Safety
/// `matrix` is a live shell.
pub(super) unsafe fn context_of_matrix(matrix: sys::Mat) -> *mut c_void {
    let mut context: *mut c_void = ptr::null_mut();
    // SAFETY: the caller's promise; PETSc writes its context pointer.
    unsafe { sys::MatShellGetContext(matrix, ptr::from_mut(&mut context).cast()) };
    context
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
    // SAFETY: the context is an action that the handle keeps alive; PETSc's vectors live for the call.
    let (action, x, y) = unsafe {
        let context = context_of_matrix(matrix).cast::<Box<dyn Action>>().as_ref();
        (context, DistributedVector::view(x), DistributedVector::view(y))
    };
    let (Some(action), Ok(x), Ok(mut y)) = (action, x, y) else { return USER_ERROR };
    act(&**action, &x, &mut y).map_or(USER_ERROR, |()| 0)
}
