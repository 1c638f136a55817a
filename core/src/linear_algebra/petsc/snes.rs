use super::{
    DistributedVector, c_string,
    callback::{self, Callback, USER_ERROR, context_of_preconditioner},
    check, index,
    library::communicator,
    reference::Reference,
    shell::{context_of_matrix, symmetric_shell},
    sys,
};
use crate::error::Result;
use std::{ffi::c_void, ptr};

/// A system of nonlinear equations `residual(x) = 0` with a generalised Jacobian defined by its products and its solves.
pub trait NonlinearProblem {
    /// Writes the residual at `x`. `x` has no ghost values of its own.
    fn residual(&mut self, x: &DistributedVector, residual: &mut DistributedVector) -> Result<()>;

    /// Whether the last residual consists of rounding errors alone, so that its point counts as a solution; the same on all ranks.
    fn is_exact(&self) -> bool {
        false
    }

    /// Whether to end without a solution, as after the last iteration; the same on all ranks.
    fn gives_up(&self) -> bool {
        false
    }

    /// Sets `x` as the point of linearisation.
    fn linearise(&mut self, x: &DistributedVector) -> Result<()>;

    /// Writes the Jacobian at the last point of linearisation times `direction`.
    fn apply_jacobian(&mut self, direction: &DistributedVector, result: &mut DistributedVector)
    -> Result<()>;

    /// Solves for the `direction` whose product with the Jacobian at the last point of linearisation is `residual`, with the
    /// accuracy that Newton's method requires.
    fn solve_jacobian(
        &mut self,
        residual: &DistributedVector,
        direction: &mut DistributedVector,
    ) -> Result<()>;
}

/// Outcome of a nonlinear solve.
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
    /// The outcome of the last solve of a live solver.
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

    /// The reason as text.
    pub fn description(&self) -> &'static str {
        match self.reason {
            1.. => "converged",
            -3 => "no direction was found that reduces the residual",
            -4 => "the residual is not a number",
            // Evaluations of the residual are limited only where the problem gives up.
            -2 | -5 => "too many Newton iterations",
            -6 => "the line search found no decrease of the residual",
            -8 => "the residual has a local minimum that is not a solution",
            _ => "Newton's method diverged",
        }
    }
}

/// Newton's method; the problem computes products with its Jacobian and solves with it.
///
/// For PETSc the linear solve is a shell preconditioner, applied once; its own options have the prefix `newton_`.
#[derive(Debug)]
pub struct Snes {
    raw: Reference<sys::_p_SNES>,
    jacobian: Reference<sys::_p_Mat>,
    /// Inside `raw`, which owns it.
    preconditioner: sys::PC,
    residual: DistributedVector,
}

impl Snes {
    /// A solver for vectors with the layout of `like` (block size `block`), with this prefix of its options.
    pub fn new(prefix: &str, like: &DistributedVector, block: usize) -> Result<Self> {
        let prefix = c_string(prefix)?;
        let (mut ksp, mut pc, mut search) = (ptr::null_mut(), ptr::null_mut(), ptr::null_mut());
        let jacobian = symmetric_shell(like, block, multiply)?;
        // SAFETY: PETSc copies the names; linear solver, preconditioner and line search belong to `raw`.
        let raw = unsafe {
            let solver = Reference::new(|raw| sys::SNESCreate(communicator(), raw))?;
            let raw = solver.get();
            check(sys::SNESSetOptionsPrefix(raw, prefix.as_ptr()))?;
            check(sys::SNESSetType(raw, c"newtonls".as_ptr()))?;
            // A full step may increase the residual by orders of magnitude while the branches settle.
            check(sys::SNESSetDivergenceTolerance(raw, -1.0))?;
            check(sys::SNESGetKSP(raw, &mut ksp))?;
            check(sys::KSPSetOptionsPrefix(ksp, c"newton_".as_ptr()))?;
            check(sys::KSPSetType(ksp, c"preonly".as_ptr()))?;
            check(sys::KSPGetPC(ksp, &mut pc))?;
            check(sys::PCSetType(pc, c"shell".as_ptr()))?;
            check(sys::PCShellSetApply(pc, Some(solve_jacobian)))?;
            check(sys::SNESGetLineSearch(raw, &mut search))?;
            check(sys::SNESLineSearchSetType(search, c"bt".as_ptr()))?;
            solver
        };
        Ok(Self { raw, jacobian, preconditioner: pc, residual: like.like()? })
    }

    /// Takes each step in full, or uses a line search for a decrease of the residual.
    pub fn search_along_steps(&mut self, search: bool) -> Result<()> {
        let mut line_search = ptr::null_mut();
        // SAFETY: live object, which owns its line search; the names are static.
        unsafe {
            check(sys::SNESGetLineSearch(self.raw.get(), &mut line_search))?;
            check(sys::SNESLineSearchSetType(line_search, if search { c"bt" } else { c"basic" }.as_ptr()))
        }
    }

    /// PETSc options override the settings made so far.
    pub fn apply_options(&mut self) -> Result<()> {
        // SAFETY: live object.
        check(unsafe { sys::SNESSetFromOptions(self.raw.get()) })
    }

    /// Solves `problem`, starting from `x`, where it writes the solution, down to a residual norm of `absolute`, or of `relative`
    /// times the first one. Collective.
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
        let (raw, jacobian, pointer) = (self.raw.get(), self.jacobian.get(), callback.pointer());
        let (iterations, unlimited) = (index(iterations, "Newton iterations")?, sys::PetscInt::MAX);
        // SAFETY: the context lives on this frame until after SNESSolve; PETSc calls the trampolines only inside
        // SNESSolve, and the context is detached before the frame ends.
        let code = unsafe {
            check(sys::SNESSetFunction(raw, self.residual.raw.get(), Some(residual), pointer))?;
            check(sys::SNESSetJacobian(raw, jacobian, jacobian, Some(linearise), pointer))?;
            check(sys::MatShellSetContext(jacobian, pointer))?;
            check(sys::PCShellSetContext(self.preconditioner, pointer))?;
            check(sys::SNESSetTolerances(raw, absolute, relative, 0.0, iterations, unlimited))?;
            let code = sys::SNESSolve(raw, ptr::null_mut(), x.raw.get());
            check(sys::MatShellSetContext(jacobian, ptr::null_mut()))?;
            check(sys::PCShellSetContext(self.preconditioner, ptr::null_mut()))?;
            code
        };
        callback.finish()?;
        check(code)?;
        NonlinearOutcome::of(raw)
    }

    /// The residual at the end of the last solve.
    pub fn residual(&self) -> &DistributedVector {
        &self.residual
    }
}

unsafe extern "C" fn residual(
    snes: sys::SNES,
    x: sys::Vec,
    f: sys::Vec,
    context: *mut c_void,
) -> sys::PetscErrorCode {
    let [mut is_exact, mut gives_up] = [false; 2];
    // SAFETY: `solve` passed a pointer to its live context; PETSc's vectors live for the call.
    let code = unsafe {
        callback::write::<dyn NonlinearProblem>(context, x, f, |problem, x, f| {
            problem.residual(x, f)?;
            (is_exact, gives_up) = (problem.is_exact(), problem.gives_up());
            Ok(())
        })
    };
    if code != 0 || !(is_exact || gives_up) {
        return code;
    }
    let (same, unchanged) = (f64::from(sys::PETSC_DEFAULT), sys::PETSC_DEFAULT as sys::PetscInt);
    if !is_exact {
        // SAFETY: PETSc's live solver; the other tolerances remain.
        return unsafe { sys::SNESSetTolerances(snes, same, same, same, unchanged, 0) };
    }
    let mut norm = 0.0;
    // SAFETY: PETSc's live solver and vector; the other tolerances remain.
    unsafe {
        let code = sys::VecNorm(f, sys::NORM_2, &mut norm);
        if code != 0 {
            return code;
        }
        // PETSc's test asks for less than the tolerance.
        sys::SNESSetTolerances(snes, norm * (1.0 + 1e-6), same, same, unchanged, unchanged)
    }
}

unsafe extern "C" fn linearise(
    _: sys::SNES,
    x: sys::Vec,
    _jacobian: sys::Mat,
    _constant: sys::Mat,
    context: *mut c_void,
) -> sys::PetscErrorCode {
    // SAFETY: as in `residual`.
    let (callback, x) =
        unsafe { (&*context.cast::<Callback<'_, dyn NonlinearProblem + '_>>(), DistributedVector::view(x)) };
    x.map_or(USER_ERROR, |x| callback.run(|problem| problem.linearise(&x)))
}

unsafe extern "C" fn multiply(matrix: sys::Mat, x: sys::Vec, y: sys::Vec) -> sys::PetscErrorCode {
    // SAFETY: a live shell matrix; the rest as in `residual`.
    unsafe {
        let context = context_of_matrix(matrix);
        callback::write::<dyn NonlinearProblem>(context, x, y, |problem, x, y| problem.apply_jacobian(x, y))
    }
}

unsafe extern "C" fn solve_jacobian(pc: sys::PC, x: sys::Vec, y: sys::Vec) -> sys::PetscErrorCode {
    // SAFETY: a live shell preconditioner; the rest as in `residual`.
    unsafe {
        let context = context_of_preconditioner(pc);
        callback::write::<dyn NonlinearProblem>(context, x, y, |problem, x, y| problem.solve_jacobian(x, y))
    }
}
