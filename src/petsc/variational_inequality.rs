use super::{
    DistributedVector, HAS_MUMPS, Matrix, NonlinearOutcome, c_string,
    callback::{Callback, spoil},
    check, index, require, set_default_option, sys,
};
use crate::error::Result;
use std::{ffi::c_void, marker::PhantomData, ptr};

/// An entry without a bound, with the sign of the side that is open: PETSc knows infinity by this number alone.
pub const UNBOUNDED: f64 = f64::MAX / 4.0;

/// PETSc's reduced-space active set method (`vinewtonrsls`) for a symmetric linear system with bounds:
/// `lower <= x <= upper`, and `K x - b` is zero inside, not negative at `lower`, not positive at `upper`.
#[derive(Debug)]
pub struct BoundedSnes {
    raw: sys::SNES,
    residual: DistributedVector,
    not_send: PhantomData<*mut ()>,
}

/// `K x - b`.
struct Linear<'a> {
    matrix: &'a Matrix,
    right_hand_side: &'a DistributedVector,
}

type Context<'a> = Callback<'a, Linear<'a>>;

impl BoundedSnes {
    /// A solver for vectors laid out like `like`, whose options carry this prefix; it factors the rows without active
    /// bound anew whenever the active set changes.
    pub fn new(prefix: &str, like: &DistributedVector) -> Result<Self> {
        require(HAS_MUMPS, "[solver] method = \"vinewtonrsls\"", "MUMPS", "use \"newton\"")?;
        let name = c_string(prefix)?;
        let mut raw = ptr::null_mut();
        // The default is an absolute distance, whatever the unit of `x`; the method puts entries on their bounds exactly.
        set_default_option(&format!("{prefix}snes_vi_zero_tolerance"), "0")?;
        // SAFETY: the handle owns one reference to `raw` from its creation on; linear solver and preconditioner belong to
        // it; PETSc copies the names.
        unsafe {
            check(sys::SNESCreate(super::library::communicator(), &mut raw))?;
            let snes = Self { raw, residual: like.like()?, not_send: PhantomData };
            check(sys::SNESSetOptionsPrefix(raw, name.as_ptr()))?;
            check(sys::SNESSetType(raw, c"vinewtonrsls".as_ptr()))?;
            let (mut ksp, mut pc) = (ptr::null_mut(), ptr::null_mut());
            check(sys::SNESGetKSP(raw, &mut ksp))?;
            check(sys::KSPSetType(ksp, c"preonly".as_ptr()))?;
            check(sys::KSPGetPC(ksp, &mut pc))?;
            check(sys::PCSetType(pc, c"cholesky".as_ptr()))?;
            check(sys::PCFactorSetMatSolverType(pc, c"mumps".as_ptr()))?;
            check(sys::SNESSetFromOptions(raw))?;
            Ok(snes)
        }
    }

    /// Solves from and into `x`, down to a norm of the residual of the free entries of `absolute`, or of `relative` times
    /// the first one. Collective.
    pub fn solve(
        &mut self,
        matrix: &Matrix,
        right_hand_side: &DistributedVector,
        [lower, upper]: [&DistributedVector; 2],
        x: &mut DistributedVector,
        (absolute, relative): (f64, f64),
        iterations: usize,
    ) -> Result<NonlinearOutcome> {
        let mut linear = Linear { matrix, right_hand_side };
        let callback = Callback::new(&mut linear);
        let iterations = index(iterations, "Newton iterations")?;
        // SAFETY: the context lives on this frame until after SNESSolve; PETSc calls the trampolines only inside
        // SNESSolve. The vectors of bounds and the matrix are counted references of PETSc's own.
        let code = unsafe {
            check(sys::SNESSetFunction(self.raw, self.residual.raw, Some(residual), callback.pointer()))?;
            check(sys::SNESSetJacobian(self.raw, matrix.raw, matrix.raw, Some(constant), ptr::null_mut()))?;
            check(sys::SNESVISetVariableBounds(self.raw, lower.raw, upper.raw))?;
            check(sys::SNESSetTolerances(self.raw, absolute, relative, 0.0, iterations, sys::PetscInt::MAX))?;
            sys::SNESSolve(self.raw, ptr::null_mut(), x.raw)
        };
        callback.finish()?;
        check(code)?;
        NonlinearOutcome::of(self.raw)
    }

    /// `K x - b` at the end of the last solve: what the bounds bear.
    pub fn residual(&self) -> &DistributedVector {
        &self.residual
    }
}

impl Drop for BoundedSnes {
    fn drop(&mut self) {
        // SAFETY: this handle owns one reference.
        unsafe { sys::SNESDestroy(&mut self.raw) };
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
    let (context, x, mut f, mut spoilt) = unsafe {
        let view = |raw| DistributedVector::view(raw);
        (&*context.cast::<Context<'_>>(), view(x), view(f), view(f))
    };
    let write = |linear: &mut Linear<'_>| {
        linear.matrix.multiply(&x, &mut f)?;
        f.add_scaled(-1.0, linear.right_hand_side)
    };
    context.run(write, || spoil(&mut spoilt))
}

/// The matrix is what it is.
unsafe extern "C" fn constant(
    _: sys::SNES,
    _: sys::Vec,
    _: sys::Mat,
    _: sys::Mat,
    _: *mut c_void,
) -> sys::PetscErrorCode {
    0
}
