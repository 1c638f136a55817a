use super::{
    DistributedVector, HAS_MUMPS, Matrix, NonlinearOutcome, c_string,
    callback::{self, Callback},
    check, index,
    library::communicator,
    reference::Reference,
    require, set_default_option, sys,
};
use crate::error::Result;
use std::{ffi::c_void, ptr};

/// PETSc's infinity: the upper bound of an entry without an upper bound; its negative is the lower bound.
pub const UNBOUNDED: f64 = f64::MAX / 4.0;

/// PETSc's reduced-space active set method (`vinewtonrsls`) for a symmetric linear system with bounds:
/// `lower <= x <= upper`, and `K x - b` is zero inside, not negative at `lower`, not positive at `upper`.
#[derive(Debug)]
pub struct BoundedSnes {
    raw: Reference<sys::_p_SNES>,
    residual: DistributedVector,
}

/// Stopping criteria of a nonlinear solver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Norm of the residual that counts as zero.
    pub absolute: f64,
    /// The same relative to the first norm.
    pub relative: f64,
    /// Maximum number of iterations.
    pub iterations: usize,
}

/// `K x - b`.
struct Linear<'a> {
    matrix: &'a Matrix,
    right_hand_side: &'a DistributedVector,
}

impl BoundedSnes {
    /// A solver for vectors with the layout of `like`, with this prefix of its options. It factors the rows without active
    /// bounds again each time the active set changes.
    pub fn new(prefix: &str, like: &DistributedVector) -> Result<Self> {
        require(HAS_MUMPS, "[solver] method = \"vinewtonrsls\"", "MUMPS", "use \"newton\"")?;
        let name = c_string(prefix)?;
        let (mut ksp, mut pc) = (ptr::null_mut(), ptr::null_mut());
        // The default is an absolute distance, independent of the unit of `x`; the method sets entries exactly to their bounds.
        set_default_option(&format!("{prefix}snes_vi_zero_tolerance"), "0")?;
        // SAFETY: linear solver and preconditioner belong to the solver; PETSc copies the names.
        let raw = unsafe {
            let solver = Reference::new(|raw| sys::SNESCreate(communicator(), raw))?;
            let raw = solver.get();
            check(sys::SNESSetOptionsPrefix(raw, name.as_ptr()))?;
            check(sys::SNESSetType(raw, c"vinewtonrsls".as_ptr()))?;
            check(sys::SNESGetKSP(raw, &mut ksp))?;
            check(sys::KSPSetType(ksp, c"preonly".as_ptr()))?;
            check(sys::KSPGetPC(ksp, &mut pc))?;
            check(sys::PCSetType(pc, c"cholesky".as_ptr()))?;
            check(sys::PCFactorSetMatSolverType(pc, c"mumps".as_ptr()))?;
            check(sys::SNESSetFromOptions(raw))?;
            solver
        };
        Ok(Self { raw, residual: like.like()? })
    }

    /// Solves for `x`, starting from its values; the norms are those of the residual of the entries that are not at their bounds.
    /// Collective.
    pub fn solve(
        &mut self,
        matrix: &Matrix,
        right_hand_side: &DistributedVector,
        [lower, upper]: [&DistributedVector; 2],
        x: &mut DistributedVector,
        limits: Limits,
    ) -> Result<NonlinearOutcome> {
        let Limits { absolute, relative, iterations } = limits;
        let mut linear = Linear { matrix, right_hand_side };
        let callback = Callback::new(&mut linear);
        let (raw, matrix, pointer) = (self.raw.get(), matrix.raw.get(), callback.pointer());
        let (iterations, unlimited) = (index(iterations, "Newton iterations")?, sys::PetscInt::MAX);
        // SAFETY: the context lives on this frame until after SNESSolve; PETSc calls the trampolines only inside
        // SNESSolve. The vectors of bounds and the matrix are counted references of PETSc's own.
        let code = unsafe {
            check(sys::SNESSetFunction(raw, self.residual.raw.get(), Some(residual), pointer))?;
            check(sys::SNESSetJacobian(raw, matrix, matrix, Some(constant), ptr::null_mut()))?;
            check(sys::SNESVISetVariableBounds(raw, lower.raw.get(), upper.raw.get()))?;
            check(sys::SNESSetTolerances(raw, absolute, relative, 0.0, iterations, unlimited))?;
            sys::SNESSolve(raw, ptr::null_mut(), x.raw.get())
        };
        callback.finish()?;
        check(code)?;
        NonlinearOutcome::of(raw)
    }

    /// `K x - b` at the end of the last solve: the reactions of the bounds.
    pub fn residual(&self) -> &DistributedVector {
        &self.residual
    }
}

unsafe extern "C" fn residual(
    _: sys::SNES,
    x: sys::Vec,
    f: sys::Vec,
    context: *mut c_void,
) -> sys::PetscErrorCode {
    // SAFETY: `solve` passed a pointer to its live context; PETSc's vectors live for the call.
    unsafe {
        callback::write::<Linear<'_>>(context, x, f, |linear, x, f| {
            linear.matrix.multiply(x, f)?;
            f.add_scaled(-1.0, linear.right_hand_side)
        })
    }
}

/// The Jacobian is constant.
unsafe extern "C" fn constant(
    _: sys::SNES,
    _: sys::Vec,
    _: sys::Mat,
    _: sys::Mat,
    _: *mut c_void,
) -> sys::PetscErrorCode {
    0
}
