use super::{
    DistributedVector, Ksp, Matrix, c_string, check, index, ksp::linear_reason, library::communicator, sys,
};
use crate::error::{Error, Result};
use std::{
    any::Any,
    cell::{Cell, RefCell},
    ffi::{CString, c_void},
    marker::PhantomData,
    panic::{AssertUnwindSafe, catch_unwind, resume_unwind},
    ptr,
};

/// A system of nonlinear equations `residual(x) = 0` with a generalised Jacobian given by its action.
pub trait NonlinearProblem {
    /// Writes the residual at `x`. `x` carries no ghost values of its own.
    fn residual(&mut self, x: &DistributedVector, residual: &mut DistributedVector) -> Result<()>;

    /// Takes `x` as the point of linearisation.
    fn linearise(&mut self, x: &DistributedVector) -> Result<()>;

    /// Writes the Jacobian at the last point of linearisation times `direction`.
    fn apply_jacobian(&mut self, direction: &DistributedVector, result: &mut DistributedVector)
    -> Result<()>;
}

/// How a nonlinear solve ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NonlinearOutcome {
    /// PETSc's reason: positive is converged, negative is not.
    pub reason: i32,
    /// Newton iterations.
    pub iterations: usize,
    /// Linear iterations of all Newton iterations together.
    pub linear_iterations: usize,
    /// Residual norm at the end.
    pub residual: f64,
    /// PETSc's reason of the last linear solve.
    pub linear_reason: i32,
}

impl NonlinearOutcome {
    /// Whether the tolerance was reached.
    pub fn converged(&self) -> bool {
        self.reason > 0
    }

    /// The reason in words.
    pub fn words(&self) -> &'static str {
        match self.reason {
            1.. => "converged",
            -3 => linear_reason(self.linear_reason),
            -4 => "the residual is not a number",
            -5 => "too many Newton iterations",
            -6 => "the line search found no decrease of the residual",
            -8 => "the residual has a local minimum that is not a solution",
            _ => "Newton's method diverged",
        }
    }
}

/// Newton's method with backtracking, the Jacobian applied by the problem, preconditioned by a constant matrix.
#[derive(Debug)]
pub struct Snes {
    raw: sys::SNES,
    jacobian: sys::Mat,
    residual: DistributedVector,
    not_send: PhantomData<*mut ()>,
}

struct Context<'a> {
    problem: RefCell<&'a mut dyn NonlinearProblem>,
    error: RefCell<Option<Error>>,
    panic: Cell<Option<Box<dyn Any + Send>>>,
}

impl Snes {
    /// A solver for vectors laid out like `like` (block size `block`), whose options carry this prefix.
    pub fn new(prefix: &str, like: &DistributedVector, block: usize) -> Result<Self> {
        let prefix: CString = c_string(prefix)?;
        let residual = like.like()?;
        let local = index(residual.owned()?.len(), "unknowns of a rank")?;
        let (mut raw, mut jacobian, mut search) = (ptr::null_mut(), ptr::null_mut(), ptr::null_mut());
        // SAFETY: the handle owns one reference each to `raw` and `jacobian` from their creation on; the shell matrix
        // is only multiplied inside `solve`, which sets its context.
        unsafe {
            check(sys::SNESCreate(communicator(), &mut raw))?;
            let mut snes = Self { raw, jacobian, residual, not_send: PhantomData };
            check(sys::MatCreateShell(
                communicator(),
                local,
                local,
                sys::PETSC_DETERMINE,
                sys::PETSC_DETERMINE,
                ptr::null_mut(),
                &mut jacobian,
            ))?;
            snes.jacobian = jacobian;
            check(sys::MatSetBlockSize(jacobian, index(block, "block size")?))?;
            let multiply: unsafe extern "C" fn(sys::Mat, sys::Vec, sys::Vec) -> sys::PetscErrorCode =
                multiply;
            let multiply: unsafe extern "C" fn() = std::mem::transmute(multiply);
            check(sys::MatShellSetOperation(jacobian, sys::MATOP_MULT, Some(multiply)))?;
            check(sys::MatSetOption(jacobian, sys::MAT_SYMMETRIC, 1))?;
            check(sys::SNESSetOptionsPrefix(raw, prefix.as_ptr()))?;
            check(sys::SNESSetType(raw, c"newtonls".as_ptr()))?;
            check(sys::SNESGetLineSearch(raw, &mut search))?;
            check(sys::SNESLineSearchSetType(search, c"bt".as_ptr()))?;
            Ok(snes)
        }
    }

    /// The linear solver inside.
    pub fn linear_solver(&mut self) -> Result<Ksp> {
        let mut raw = ptr::null_mut();
        // SAFETY: the solver belongs to this live object; callers drop the handle before `self`, since it only
        // serves for set-up in the same scope.
        unsafe {
            check(sys::SNESGetKSP(self.raw, &mut raw))?;
            Ok(Ksp::inside(raw))
        }
    }

    /// Lets PETSc options override what was set, also in the linear solver.
    pub fn apply_options(&mut self) -> Result<()> {
        // SAFETY: live object.
        check(unsafe { sys::SNESSetFromOptions(self.raw) })
    }

    /// Solves `problem` from and into `x`, down to a residual norm of `tolerance`, preconditioned by `constant`.
    /// Collective.
    ///
    /// A panic in a callback is resumed here; an error in a callback on this rank is returned on this rank, while the
    /// other ranks get an outcome that is not converged, unless this rank owns no values: agree on the result afterwards.
    pub fn solve(
        &mut self,
        problem: &mut dyn NonlinearProblem,
        constant: &Matrix,
        x: &mut DistributedVector,
        tolerance: f64,
        iterations: usize,
    ) -> Result<NonlinearOutcome> {
        let context =
            Context { problem: RefCell::new(problem), error: RefCell::new(None), panic: Cell::new(None) };
        let pointer: *mut c_void = ptr::from_ref(&context).cast_mut().cast();
        let unlimited = sys::PetscInt::MAX;
        // SAFETY: the context lives on this frame until after SNESSolve; PETSc calls the trampolines only inside
        // SNESSolve, and the context is detached before the frame ends.
        let code = unsafe {
            check(sys::SNESSetFunction(self.raw, self.residual.raw, Some(residual), pointer))?;
            check(sys::SNESSetJacobian(self.raw, self.jacobian, constant.raw, Some(linearise), pointer))?;
            check(sys::MatShellSetContext(self.jacobian, pointer))?;
            check(sys::SNESSetTolerances(
                self.raw,
                tolerance,
                0.0,
                0.0,
                index(iterations, "Newton iterations")?,
                unlimited,
            ))?;
            let code = sys::SNESSolve(self.raw, ptr::null_mut(), x.raw);
            check(sys::MatShellSetContext(self.jacobian, ptr::null_mut()))?;
            code
        };
        if let Some(panic) = context.panic.take() {
            resume_unwind(panic);
        }
        if let Some(error) = context.error.into_inner() {
            return Err(error);
        }
        check(code)?;
        self.outcome()
    }

    /// The residual at the end of the last solve.
    pub fn residual(&self) -> &DistributedVector {
        &self.residual
    }

    fn outcome(&mut self) -> Result<NonlinearOutcome> {
        let (mut reason, mut iterations, mut linear_iterations, mut residual) = (0, 0, 0, 0.0);
        // SAFETY: live object, live numbers.
        unsafe {
            check(sys::SNESGetConvergedReason(self.raw, &mut reason))?;
            check(sys::SNESGetIterationNumber(self.raw, &mut iterations))?;
            check(sys::SNESGetLinearSolveIterations(self.raw, &mut linear_iterations))?;
            check(sys::SNESGetFunctionNorm(self.raw, &mut residual))?;
        }
        Ok(NonlinearOutcome {
            reason,
            iterations: usize::try_from(iterations).unwrap_or(0),
            linear_iterations: usize::try_from(linear_iterations).unwrap_or(0),
            residual,
            linear_reason: self.linear_solver()?.outcome()?.reason,
        })
    }
}

impl Drop for Snes {
    fn drop(&mut self) {
        // SAFETY: this handle owns one reference to each.
        unsafe {
            sys::MatDestroy(&mut self.jacobian);
            sys::SNESDestroy(&mut self.raw);
        }
    }
}

/// What a callback returns to make PETSc stop.
const USER_ERROR: sys::PetscErrorCode = sys::PETSC_ERR_USER as sys::PetscErrorCode;

/// Runs a callback; an error is kept and from then on `spoil` marks every output, so that all ranks see the same failure.
fn guard(context: &Context, body: impl FnOnce() -> Result<()>, spoil: impl FnOnce()) -> sys::PetscErrorCode {
    match catch_unwind(AssertUnwindSafe(body)) {
        Ok(Ok(())) => {
            if context.error.borrow().is_some() {
                spoil();
            }
            0
        }
        Ok(Err(error)) => {
            context.error.borrow_mut().get_or_insert(error);
            spoil();
            0
        }
        Err(panic) => {
            context.panic.set(Some(panic));
            USER_ERROR
        }
    }
}

/// Fills the values of this rank with NaN, which norms carry to all ranks.
fn spoil(vector: &mut DistributedVector) {
    if let Ok(mut values) = vector.owned_mut() {
        values.fill(f64::NAN);
    }
}

unsafe extern "C" fn residual(
    _: sys::SNES,
    x: sys::Vec,
    f: sys::Vec,
    context: *mut c_void,
) -> sys::PetscErrorCode {
    // SAFETY: `solve` passed a pointer to its live context; PETSc's vectors live for the call.
    let (context, x, mut f) =
        unsafe { (&*context.cast::<Context>(), DistributedVector::view(x), DistributedVector::view(f)) };
    // SAFETY: a second view of the same live vector, used only after the first is done.
    let mut spoilt = unsafe { DistributedVector::view(f.raw) };
    guard(context, || context.problem.borrow_mut().residual(&x, &mut f), || spoil(&mut spoilt))
}

unsafe extern "C" fn linearise(
    _: sys::SNES,
    x: sys::Vec,
    _jacobian: sys::Mat,
    _constant: sys::Mat,
    context: *mut c_void,
) -> sys::PetscErrorCode {
    // SAFETY: as in `residual`.
    let (context, x) = unsafe { (&*context.cast::<Context>(), DistributedVector::view(x)) };
    guard(context, || context.problem.borrow_mut().linearise(&x), || ())
}

unsafe extern "C" fn multiply(matrix: sys::Mat, x: sys::Vec, y: sys::Vec) -> sys::PetscErrorCode {
    let mut context: *mut c_void = ptr::null_mut();
    // SAFETY: a live shell matrix; PETSc writes its context pointer.
    let code = unsafe { sys::MatShellGetContext(matrix, ptr::from_mut(&mut context).cast()) };
    if code != 0 || context.is_null() {
        return USER_ERROR;
    }
    // SAFETY: `solve` set the context to its live frame; PETSc's vectors live for the call.
    let (context, x, mut y) =
        unsafe { (&*context.cast::<Context>(), DistributedVector::view(x), DistributedVector::view(y)) };
    // SAFETY: a second view of the same live vector, used only after the first is done.
    let mut spoilt = unsafe { DistributedVector::view(y.raw) };
    guard(context, || context.problem.borrow_mut().apply_jacobian(&x, &mut y), || spoil(&mut spoilt))
}
