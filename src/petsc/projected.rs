use super::{
    DistributedVector, Ksp, LinearOutcome, Matrix,
    callback::{Callback, USER_ERROR, spoil},
    check, index,
    library::communicator,
    sys,
};
use crate::error::Result;
use std::{ffi::c_void, ptr};

/// A symmetric operator on a subspace, given by its action.
pub trait ProjectedOperator {
    /// `y = P B x` for an `x` of the subspace.
    fn apply(&mut self, x: &DistributedVector, y: &mut DistributedVector) -> Result<()>;

    /// `x = P x`: the orthogonal projection on the subspace.
    fn project(&mut self, x: &mut DistributedVector) -> Result<()>;
}

/// A Krylov solver on a subspace, preconditioned by a constant matrix that knows nothing of the subspace.
///
/// To PETSc the operator is a shell matrix whose null space is the complement of the subspace: it projects every result
/// of the preconditioner. The preconditioner is set up once for as long as the constant matrix stands.
#[derive(Debug)]
pub struct ProjectedKsp {
    ksp: Ksp,
    fallback: Option<Ksp>,
    shell: sys::Mat,
    complement: sys::MatNullSpace,
    tolerances: (f64, f64, usize),
    symmetric: bool,
}

/// How a solve on a subspace ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProjectedOutcome {
    /// The outcome, iterations of both methods together.
    pub linear: LinearOutcome,
    /// Whether CG met negative curvature, so that GMRES had to solve.
    pub indefinite: bool,
}

/// PETSc's reasons of CG for negative curvature: of the preconditioner, of the matrix.
const INDEFINITE: [i32; 2] = [-8, -10];

impl ProjectedKsp {
    /// A solver for vectors laid out like `like` (block size `block`), whose options carry this prefix.
    pub fn new(prefix: &str, like: &DistributedVector, block: usize) -> Result<Self> {
        let ksp = Ksp::new(prefix)?;
        let local = index(like.owned()?.len(), "unknowns of a rank")?;
        let mut solver = Self {
            ksp,
            fallback: None,
            shell: ptr::null_mut(),
            complement: ptr::null_mut(),
            tolerances: (1e-5, 0.0, 10_000),
            symmetric: true,
        };
        // SAFETY: the handle owns one reference each to the shell matrix and the null space from their creation on; the
        // shell is only multiplied inside `solve`, which sets its context.
        unsafe {
            check(sys::MatCreateShell(
                communicator(),
                local,
                local,
                sys::PETSC_DETERMINE,
                sys::PETSC_DETERMINE,
                ptr::null_mut(),
                &mut solver.shell,
            ))?;
            check(sys::MatSetBlockSize(solver.shell, index(block, "block size")?))?;
            let multiply: unsafe extern "C" fn(sys::Mat, sys::Vec, sys::Vec) -> sys::PetscErrorCode =
                multiply;
            let multiply: unsafe extern "C" fn() = std::mem::transmute(multiply);
            check(sys::MatShellSetOperation(solver.shell, sys::MATOP_MULT, Some(multiply)))?;
            check(sys::MatSetOption(solver.shell, sys::MAT_SYMMETRIC, 1))?;
            check(sys::MatNullSpaceCreate(communicator(), 0, 0, ptr::null(), &mut solver.complement))?;
        }
        Ok(solver)
    }

    /// The solver inside, to choose method, preconditioner and tolerances.
    pub fn linear_solver(&mut self) -> &mut Ksp {
        &mut self.ksp
    }

    /// Says whether the operators are symmetric; they are unless this says otherwise. Others are left to GMRES.
    pub fn set_symmetric(&mut self, symmetric: bool) {
        self.symmetric = symmetric;
    }

    /// Stops at `relative * |r|` or at `absolute`, whichever is larger, or after this many iterations.
    pub fn set_tolerances(&mut self, relative: f64, absolute: f64, iterations: usize) -> Result<()> {
        self.tolerances = (relative, absolute, iterations);
        self.ksp.set_tolerances(relative, absolute, iterations)
    }

    /// Takes the constant matrix and sets up its preconditioner. Collective.
    ///
    /// The preconditioner is set up with the constant matrix alone: multigrid would smooth with the operator otherwise.
    pub fn set_constant(&mut self, constant: &Matrix) -> Result<()> {
        self.fallback = None;
        // SAFETY: live objects; PETSc keeps its own references.
        unsafe {
            check(sys::KSPSetReusePreconditioner(self.ksp.raw, 0))?;
            check(sys::KSPSetOperators(self.ksp.raw, constant.raw, constant.raw))?;
            check(sys::KSPSetUp(self.ksp.raw))?;
            check(sys::KSPSetReusePreconditioner(self.ksp.raw, 1))?;
            check(sys::KSPSetOperators(self.ksp.raw, self.shell, constant.raw))
        }
    }

    /// Solves `P B x = r` for an `r` of the subspace. Collective. Non-convergence is an outcome, not an error.
    ///
    /// A panic in a callback is resumed here; an error in a callback on this rank is returned on this rank.
    pub fn solve(
        &mut self,
        operator: &mut dyn ProjectedOperator,
        right_hand_side: &DistributedVector,
        solution: &mut DistributedVector,
    ) -> Result<ProjectedOutcome> {
        let callback = Callback::new(operator);
        // SAFETY: the context lives on this frame until it is detached below; PETSc calls the trampolines only inside
        // KSPSolve. The null space is attached for the solve alone, so that its function is never called without.
        unsafe {
            check(sys::MatNullSpaceSetFunction(self.complement, Some(project), callback.pointer()))?;
            check(sys::MatSetNullSpace(self.shell, self.complement))?;
            check(sys::MatShellSetContext(self.shell, callback.pointer()))?;
        }
        let outcome = self.solve_attached(right_hand_side, solution);
        // SAFETY: as above.
        unsafe {
            check(sys::MatShellSetContext(self.shell, ptr::null_mut()))?;
            check(sys::MatSetNullSpace(self.shell, ptr::null_mut()))?;
            check(sys::MatNullSpaceSetFunction(self.complement, None, ptr::null_mut()))?;
        }
        callback.finish()?;
        outcome
    }

    fn solve_attached(
        &mut self,
        right_hand_side: &DistributedVector,
        solution: &mut DistributedVector,
    ) -> Result<ProjectedOutcome> {
        if !self.symmetric {
            let linear = self.solve_by_gmres(right_hand_side, solution)?;
            return Ok(ProjectedOutcome { linear, indefinite: false });
        }
        let first = self.ksp.solve(right_hand_side, solution)?;
        if !INDEFINITE.contains(&first.reason) {
            return Ok(ProjectedOutcome { linear: first, indefinite: false });
        }
        let second = self.solve_by_gmres(right_hand_side, solution)?;
        let linear = LinearOutcome { iterations: first.iterations + second.iterations, ..second };
        Ok(ProjectedOutcome { linear, indefinite: true })
    }

    fn solve_by_gmres(
        &mut self,
        right_hand_side: &DistributedVector,
        solution: &mut DistributedVector,
    ) -> Result<LinearOutcome> {
        if self.fallback.is_none() {
            self.fallback = Some(self.ksp.sharing_preconditioner("indefinite_", "gmres")?);
        }
        let Some(fallback) = &mut self.fallback else { unreachable!("it was just made") };
        let (relative, absolute, iterations) = self.tolerances;
        let relative = relative.max(absolute / right_hand_side.norm()?).min(relative.max(1e-3));
        fallback.set_tolerances(relative, 0.0, iterations)?;
        fallback.solve(right_hand_side, solution)
    }
}

impl Drop for ProjectedKsp {
    fn drop(&mut self) {
        // SAFETY: this handle owns one reference to each.
        unsafe {
            sys::MatDestroy(&mut self.shell);
            sys::MatNullSpaceDestroy(&mut self.complement);
        }
    }
}

type Context<'a> = Callback<'a, dyn ProjectedOperator + 'a>;

unsafe extern "C" fn multiply(matrix: sys::Mat, x: sys::Vec, y: sys::Vec) -> sys::PetscErrorCode {
    let mut context: *mut c_void = ptr::null_mut();
    // SAFETY: a live shell matrix; PETSc writes its context pointer.
    let code = unsafe { sys::MatShellGetContext(matrix, ptr::from_mut(&mut context).cast()) };
    if code != 0 || context.is_null() {
        return USER_ERROR;
    }
    // SAFETY: `solve` set the context to its live frame; PETSc's vectors live for the call. The second view of `y` is
    // used only after the first is done.
    let (context, x, mut y, mut spoilt) = unsafe {
        let view = |raw| DistributedVector::view(raw);
        (&*context.cast::<Context<'_>>(), view(x), view(y), view(y))
    };
    context.run(|operator| operator.apply(&x, &mut y), || spoil(&mut spoilt))
}

unsafe extern "C" fn project(_: sys::MatNullSpace, x: sys::Vec, context: *mut c_void) -> sys::PetscErrorCode {
    if context.is_null() {
        return USER_ERROR;
    }
    // SAFETY: as in `multiply`.
    let (context, mut x, mut spoilt) =
        unsafe { (&*context.cast::<Context<'_>>(), DistributedVector::view(x), DistributedVector::view(x)) };
    context.run(|operator| operator.project(&mut x), || spoil(&mut spoilt))
}
