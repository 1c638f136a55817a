use super::{
    DistributedVector, c_string,
    callback::{Callback, USER_ERROR, spoil},
    check, index,
    library::communicator,
    sys,
};
use crate::error::Result;
use std::{
    ffi::{CString, c_void},
    marker::PhantomData,
    ptr,
};

/// A system of nonlinear equations `residual(x) = 0` with a generalised Jacobian given by its action and its solution.
pub trait NonlinearProblem {
    /// Writes the residual at `x`. `x` carries no ghost values of its own.
    fn residual(&mut self, x: &DistributedVector, residual: &mut DistributedVector) -> Result<()>;

    /// Takes `x` as the point of linearisation.
    fn linearise(&mut self, x: &DistributedVector) -> Result<()>;

    /// Writes the Jacobian at the last point of linearisation times `direction`.
    fn apply_jacobian(&mut self, direction: &DistributedVector, result: &mut DistributedVector)
    -> Result<()>;

    /// Writes the `direction` that the Jacobian at the last point of linearisation takes to `residual`, as closely as
    /// Newton's method needs it.
    fn solve_jacobian(
        &mut self,
        residual: &DistributedVector,
        direction: &mut DistributedVector,
    ) -> Result<()>;
}

/// How a nonlinear solve ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NonlinearOutcome {
    /// PETSc's reason: positive is converged, negative is not.
    pub reason: i32,
    /// Newton iterations.
    pub iterations: usize,
    /// Residual norm at the end.
    pub residual: f64,
}

impl NonlinearOutcome {
    /// How the last solve of a live solver ended.
    pub(super) fn of(raw: sys::SNES) -> Result<Self> {
        let (mut reason, mut iterations, mut residual) = (0, 0, 0.0);
        // SAFETY: live object, live numbers.
        unsafe {
            check(sys::SNESGetConvergedReason(raw, &mut reason))?;
            check(sys::SNESGetIterationNumber(raw, &mut iterations))?;
            check(sys::SNESGetFunctionNorm(raw, &mut residual))?;
        }
        let iterations = usize::try_from(iterations).unwrap_or(0);
        Ok(Self { reason, iterations, residual })
    }

    /// Whether the tolerance was reached.
    pub fn converged(&self) -> bool {
        self.reason > 0
    }

    /// The reason in words.
    pub fn words(&self) -> &'static str {
        match self.reason {
            1.. => "converged",
            -3 => "no direction was found that reduces the residual",
            -4 => "the residual is not a number",
            -5 => "too many Newton iterations",
            -6 => "the line search found no decrease of the residual",
            -8 => "the residual has a local minimum that is not a solution",
            _ => "Newton's method diverged",
        }
    }
}

/// Newton's method; the problem applies its Jacobian and solves with it.
///
/// To PETSc the linear solve is a shell preconditioner, applied once; its own options carry the prefix `newton_`.
#[derive(Debug)]
pub struct Snes {
    raw: sys::SNES,
    jacobian: sys::Mat,
    /// Inside `raw`, which owns it.
    preconditioner: sys::PC,
    residual: DistributedVector,
    not_send: PhantomData<*mut ()>,
}

type Context<'a> = Callback<'a, dyn NonlinearProblem + 'a>;

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
            let mut snes =
                Self { raw, jacobian, preconditioner: ptr::null_mut(), residual, not_send: PhantomData };
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
            // A full step may take the residual up by orders of magnitude while the branches settle.
            check(sys::SNESSetDivergenceTolerance(raw, -1.0))?;
            let (mut ksp, mut pc) = (ptr::null_mut(), ptr::null_mut());
            check(sys::SNESGetKSP(raw, &mut ksp))?;
            check(sys::KSPSetOptionsPrefix(ksp, c"newton_".as_ptr()))?;
            check(sys::KSPSetType(ksp, c"preonly".as_ptr()))?;
            check(sys::KSPGetPC(ksp, &mut pc))?;
            check(sys::PCSetType(pc, c"shell".as_ptr()))?;
            check(sys::PCShellSetApply(pc, Some(solve_jacobian)))?;
            snes.preconditioner = pc;
            check(sys::SNESGetLineSearch(raw, &mut search))?;
            check(sys::SNESLineSearchSetType(search, c"bt".as_ptr()))?;
            Ok(snes)
        }
    }

    /// Takes every step in full, or searches along it for a decrease of the residual.
    pub fn search_along_steps(&mut self, search: bool) -> Result<()> {
        let mut line_search = ptr::null_mut();
        // SAFETY: live object, which owns its line search; the names are static.
        unsafe {
            check(sys::SNESGetLineSearch(self.raw, &mut line_search))?;
            check(sys::SNESLineSearchSetType(line_search, if search { c"bt" } else { c"basic" }.as_ptr()))
        }
    }

    /// Lets PETSc options override what was set.
    pub fn apply_options(&mut self) -> Result<()> {
        // SAFETY: live object.
        check(unsafe { sys::SNESSetFromOptions(self.raw) })
    }

    /// Solves `problem` from and into `x`, down to a residual norm of `absolute`, or of `relative` times the first one.
    /// Collective.
    ///
    /// A panic in a callback is resumed here; an error in a callback on this rank is returned on this rank, while the
    /// other ranks get an outcome that is not converged, unless this rank owns no values: agree on the result afterwards.
    pub fn solve(
        &mut self,
        problem: &mut dyn NonlinearProblem,
        x: &mut DistributedVector,
        (absolute, relative): (f64, f64),
        iterations: usize,
    ) -> Result<NonlinearOutcome> {
        let callback = Callback::new(problem);
        let pointer = callback.pointer();
        let unlimited = sys::PetscInt::MAX;
        // SAFETY: the context lives on this frame until after SNESSolve; PETSc calls the trampolines only inside
        // SNESSolve, and the context is detached before the frame ends.
        let code = unsafe {
            check(sys::SNESSetFunction(self.raw, self.residual.raw, Some(residual), pointer))?;
            check(sys::SNESSetJacobian(self.raw, self.jacobian, self.jacobian, Some(linearise), pointer))?;
            check(sys::MatShellSetContext(self.jacobian, pointer))?;
            check(sys::PCShellSetContext(self.preconditioner, pointer))?;
            check(sys::SNESSetTolerances(
                self.raw,
                absolute,
                relative,
                0.0,
                index(iterations, "Newton iterations")?,
                unlimited,
            ))?;
            let code = sys::SNESSolve(self.raw, ptr::null_mut(), x.raw);
            check(sys::MatShellSetContext(self.jacobian, ptr::null_mut()))?;
            check(sys::PCShellSetContext(self.preconditioner, ptr::null_mut()))?;
            code
        };
        callback.finish()?;
        check(code)?;
        NonlinearOutcome::of(self.raw)
    }

    /// The residual at the end of the last solve.
    pub fn residual(&self) -> &DistributedVector {
        &self.residual
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

unsafe extern "C" fn residual(
    _: sys::SNES,
    x: sys::Vec,
    f: sys::Vec,
    context: *mut c_void,
) -> sys::PetscErrorCode {
    // SAFETY: `solve` passed a pointer to its live context; PETSc's vectors live for the call. The second view of `f` is
    // used only after the first is done.
    let (context, x, mut f, mut spoilt) = unsafe { views(context, x, f) };
    context.run(|problem| problem.residual(&x, &mut f), || spoil(&mut spoilt))
}

unsafe extern "C" fn linearise(
    _: sys::SNES,
    x: sys::Vec,
    _jacobian: sys::Mat,
    _constant: sys::Mat,
    context: *mut c_void,
) -> sys::PetscErrorCode {
    // SAFETY: as in `residual`.
    let (context, x) = unsafe { (&*context.cast::<Context<'_>>(), DistributedVector::view(x)) };
    context.run(|problem| problem.linearise(&x), || ())
}

unsafe extern "C" fn multiply(matrix: sys::Mat, x: sys::Vec, y: sys::Vec) -> sys::PetscErrorCode {
    let mut context: *mut c_void = ptr::null_mut();
    // SAFETY: a live shell matrix; PETSc writes its context pointer.
    let code = unsafe { sys::MatShellGetContext(matrix, ptr::from_mut(&mut context).cast()) };
    if code != 0 || context.is_null() {
        return USER_ERROR;
    }
    // SAFETY: as in `residual`.
    let (context, x, mut y, mut spoilt) = unsafe { views(context, x, y) };
    context.run(|problem| problem.apply_jacobian(&x, &mut y), || spoil(&mut spoilt))
}

unsafe extern "C" fn solve_jacobian(pc: sys::PC, x: sys::Vec, y: sys::Vec) -> sys::PetscErrorCode {
    let mut context: *mut c_void = ptr::null_mut();
    // SAFETY: a live shell preconditioner; PETSc writes its context pointer.
    let code = unsafe { sys::PCShellGetContext(pc, ptr::from_mut(&mut context).cast()) };
    if code != 0 || context.is_null() {
        return USER_ERROR;
    }
    // SAFETY: as in `residual`.
    let (context, x, mut y, mut spoilt) = unsafe { views(context, x, y) };
    context.run(|problem| problem.solve_jacobian(&x, &mut y), || spoil(&mut spoilt))
}

type View = std::mem::ManuallyDrop<DistributedVector>;

/// The context, the input, and the output twice.
///
/// # Safety
/// `context` must point to a live [`Context`], the vectors must live while the views are used, and the views of the
/// output must not be used at once.
unsafe fn views<'a>(context: *mut c_void, x: sys::Vec, y: sys::Vec) -> (&'a Context<'a>, View, View, View) {
    // SAFETY: the caller's promise.
    unsafe {
        let view = |raw| DistributedVector::view(raw);
        (&*context.cast::<Context<'a>>(), view(x), view(y), view(y))
    }
}
