use super::{
    DistributedVector, Interpolation, Matrix, c_string, check,
    coarse_space::{self, CoarseSpace},
    index,
    levels::{self, Level},
    library::communicator,
    own_preconditioner::{self, Own, OwnPreconditioner},
    reference::Reference,
    subspace::Restriction,
    sys,
};
use crate::error::Result;
use std::cell::RefCell;

/// Growth of the residual that counts as divergence: with CG the residual may grow by the square root of the condition number
/// before it decreases, and the condition number of a body supported by contact alone is large.
const DIVERGENCE: f64 = 1e12;

/// A Krylov solver with its preconditioner.
///
/// The preconditioner is set up at the first solve (or by [`Ksp::set_up`]) and reused until the matrix is replaced.
#[derive(Debug)]
pub struct Ksp {
    pub(super) raw: Reference<sys::_p_KSP>,
    /// The matrices used by the smoothers and transfers of multigrid.
    pub(super) levels: Vec<Level>,
    /// The preconditioner, if it is not PETSc's.
    pub(super) own: Option<Box<Own>>,
    /// The coarse space of multigrid, if it is not PETSc's choice.
    pub(super) coarse: Option<CoarseSpace>,
    applications: u64,
}

/// Outcome of a linear solve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinearOutcome {
    /// PETSc's reason: positive is converged, negative is not.
    pub reason: i32,
    /// Krylov iterations.
    pub iterations: usize,
    /// Residual norm at the end.
    pub residual: f64,
}

impl LinearOutcome {
    /// Whether the tolerance was reached.
    pub fn converged(&self) -> bool {
        self.reason > 0
    }

    /// The reason as text.
    pub fn description(&self) -> &'static str {
        linear_reason(self.reason)
    }

    /// The combined outcome of two consecutive solves.
    pub fn followed_by(self, next: Self) -> Self {
        Self { iterations: self.iterations + next.iterations, ..next }
    }
}

/// PETSc's reason for a solve that has reached the maximum number of iterations.
pub(super) const TOO_MANY: i32 = -3;

/// PETSc's `KSPConvergedReason` as text.
pub(super) fn linear_reason(reason: i32) -> &'static str {
    match reason {
        1.. => "converged",
        0 => "still iterating",
        TOO_MANY => "too many linear iterations",
        -4 => "the linear residual grew beyond the divergence limit",
        -5 | -6 => "breakdown of the Krylov method",
        -8 => "the preconditioner is not positive definite",
        -9 => "not a number in the linear solve",
        -10 => "the matrix is not positive definite",
        -11 => "the preconditioner could not be set up",
        _ => "the linear solve diverged",
    }
}

impl Ksp {
    /// A solver with this prefix of its options.
    pub fn new(prefix: &str) -> Result<Self> {
        let prefix = c_string(prefix)?;
        // SAFETY: PETSc copies the prefix.
        unsafe {
            let raw = Reference::new(|raw| sys::KSPCreate(communicator(), raw))?;
            check(sys::KSPSetOptionsPrefix(raw.get(), prefix.as_ptr()))?;
            Ok(Self { raw, levels: Vec::new(), own: None, coarse: None, applications: 0 })
        }
    }

    /// A solver by another method with the same operator and preconditioner, with this prefix of its options. It tests the norm of
    /// the preconditioned residual.
    pub(super) fn sharing_preconditioner(&self, prefix: &str, method: &str) -> Result<Self> {
        let other = Self::new(prefix)?;
        let (pc, method) = (self.preconditioner()?, c_string(method)?);
        // SAFETY: live objects; PETSc counts its own reference to the shared preconditioner, copies the name.
        unsafe {
            check(sys::KSPSetPC(other.raw.get(), pc))?;
            check(sys::KSPSetType(other.raw.get(), method.as_ptr()))?;
        }
        Ok(other)
    }

    /// The preconditioner, which belongs to the solver.
    pub(super) fn preconditioner(&self) -> Result<sys::PC> {
        // SAFETY: live object.
        unsafe { levels::preconditioner_of(self.raw.get()) }
    }

    /// Sets the first matrix as that of the system; the preconditioner is built from the second, and rebuilt if that has changed.
    pub fn set_matrices(&mut self, matrix: &Matrix, preconditioned: &Matrix) -> Result<()> {
        // SAFETY: live objects; PETSc keeps its own references.
        check(unsafe { sys::KSPSetOperators(self.raw.get(), matrix.operator(), preconditioned.raw.get()) })
    }

    /// Sets the Krylov method by PETSc's name, such as `cg`; it tests the norm of the unpreconditioned residual.
    pub fn set_method(&mut self, name: &str) -> Result<()> {
        let name = c_string(name)?;
        // SAFETY: live object; PETSc copies the name.
        unsafe {
            check(sys::KSPSetType(self.raw.get(), name.as_ptr()))?;
            check(sys::KSPSetNormType(self.raw.get(), sys::KSP_NORM_UNPRECONDITIONED))
        }
    }

    /// Sets the preconditioner by PETSc's name; for a factorisation, with the package that computes it.
    pub fn set_preconditioner(&mut self, name: &str, package: Option<&str>) -> Result<()> {
        let (name, pc) = (c_string(name)?, self.preconditioner()?);
        // SAFETY: live object; PETSc copies the names.
        unsafe {
            check(sys::PCSetType(pc, name.as_ptr()))?;
            if let Some(package) = package {
                check(sys::PCFactorSetMatSolverType(pc, c_string(package)?.as_ptr()))?;
            }
        }
        Ok(())
    }

    /// Uses a preconditioner that is not PETSc's, unless options of the user choose another.
    pub fn precondition_by(&mut self, own: Box<dyn OwnPreconditioner>) -> Result<()> {
        self.set_preconditioner("shell", None)?;
        let own = Box::new(RefCell::new(own));
        // SAFETY: a shell preconditioner; its context stays in its box for as long as this solver and those that share its
        // preconditioner.
        unsafe { own_preconditioner::attach(self.preconditioner()?, &own)? };
        self.own = Some(own);
        Ok(())
    }

    /// Preconditions by multigrid of two levels, whose coarse solver is one cycle of algebraic multigrid with options of the prefix
    /// `mg_coarse_`. The coarse space is set by [`Ksp::set_coarse_space`].
    pub fn precondition_on_two_levels(&mut self) -> Result<()> {
        // SAFETY: the preconditioner of this solver.
        unsafe { coarse_space::two_levels(self.preconditioner()?) }
    }

    /// Sets the coarse space of multigrid with two levels, for fields of `block` values for each node. Collective.
    pub fn set_coarse_space(&mut self, block: usize, interpolation: Interpolation) -> Result<()> {
        let mut coarse = CoarseSpace::new(block, interpolation)?;
        if let Some(before) = self.coarse.take() {
            // PETSc uses these matrices until the next set-up.
            coarse.levels = before.levels;
        }
        self.coarse = Some(coarse);
        Ok(())
    }

    /// Stops at `relative * |b|` or at `absolute`, whichever is larger, or after this many iterations.
    pub fn set_tolerances(&mut self, relative: f64, absolute: f64, iterations: usize) -> Result<()> {
        let iterations = index(iterations, "linear iterations")?;
        // SAFETY: live object.
        check(unsafe { sys::KSPSetTolerances(self.raw.get(), relative, absolute, DIVERGENCE, iterations) })
    }

    /// Starts from the current values of the solution; divergence is then measured relative to the residual of these values.
    pub fn start_from_solution(&mut self) -> Result<()> {
        // SAFETY: live object with PETSc's own test of convergence.
        check(unsafe { sys::KSPConvergedDefaultSetUIRNorm(self.raw.get()) })?;
        self.start(true)
    }

    /// Starts from the current values of the solution, or from zero.
    pub(super) fn start(&mut self, from_solution: bool) -> Result<()> {
        // SAFETY: live object.
        check(unsafe {
            sys::KSPSetInitialGuessNonzero(self.raw.get(), i32::from(from_solution) as sys::PetscBool)
        })
    }

    /// PETSc options override the settings made so far.
    pub fn apply_options(&mut self) -> Result<()> {
        // SAFETY: live object.
        check(unsafe { sys::KSPSetFromOptions(self.raw.get()) })
    }

    /// Sets up the preconditioner; required after each change of its matrix. Collective.
    pub fn set_up(&mut self) -> Result<()> {
        let pc = self.preconditioner()?;
        let is_multigrid = levels::is_type(pc, c"mg")?;
        levels::restore(pc, &self.levels)?;
        if let Some(own) = &self.own
            && levels::is_type(pc, c"shell")?
        {
            // SAFETY: the preconditioner of this solver, whose matrices are set.
            unsafe { own_preconditioner::set_up(pc, own)? };
        }
        let mut coarse = self.coarse.as_mut().filter(|_| is_multigrid);
        if let Some(coarse) = &mut coarse {
            // SAFETY: multigrid with a coarse space has two levels; its matrices are set.
            unsafe { coarse.set_up(pc)? };
        }
        // SAFETY: live object.
        check(unsafe { sys::KSPSetUp(self.raw.get()) })?;
        self.levels = levels::in_single_precision(pc)?;
        if let Some(coarse) = coarse {
            // SAFETY: as before, and it is set up.
            unsafe { coarse.reduce_precision(pc)? };
        }
        Ok(())
    }

    /// Whether the preconditioner is multigrid that [`Ksp::restrict`] can restrict, on all ranks alike.
    pub(super) fn can_be_restricted(&self) -> bool {
        let coarse = self.coarse.as_ref().map_or(&[][..], |coarse| &coarse.levels);
        levels::can_be_restricted(&self.levels) && (coarse.is_empty() || levels::can_be_restricted(coarse))
    }

    /// Restricts multigrid to a subspace, for the applications during which it is [used](Ksp::use_subspace). Collective.
    pub(super) fn restrict(&mut self, restriction: Restriction) -> Result<()> {
        let coarse = levels::restrict(&mut self.levels, restriction)?;
        if let Some(levels) = self.coarse.as_mut().map(|coarse| &mut coarse.levels) {
            levels::restrict(levels, coarse)?;
        }
        Ok(())
    }

    /// Lets multigrid act on the subspace that was set last, or on the whole space. On all ranks alike.
    pub(super) fn use_subspace(&self, in_use: bool) {
        levels::use_subspace(&self.levels, in_use);
        if let Some(coarse) = &self.coarse {
            levels::use_subspace(&coarse.levels, in_use);
        }
    }

    /// Solves for `solution`. Collective. Non-convergence is an outcome, not an error.
    pub fn solve(
        &mut self,
        right_hand_side: &DistributedVector,
        solution: &mut DistributedVector,
    ) -> Result<LinearOutcome> {
        // SAFETY: live objects of matching layout; the two vectors differ.
        check(unsafe { sys::KSPSolve(self.raw.get(), right_hand_side.raw.get(), solution.raw.get()) })?;
        let outcome = self.outcome()?;
        self.applications += outcome.iterations as u64 + 1;
        Ok(outcome)
    }

    /// Restarts the count of applications of the preconditioner.
    pub fn restart_applications(&mut self) {
        self.applications = 0;
    }

    /// Applications of the preconditioner since [`Ksp::restart_applications`], for CG and GMRES: one for each iteration and one at the
    /// start of each solve.
    pub fn applications(&self) -> u64 {
        self.applications
    }

    /// `z = P^-1 r` with the preconditioner, which must be set up. Collective.
    pub fn precondition(&mut self, r: &DistributedVector, z: &mut DistributedVector) -> Result<()> {
        // SAFETY: live objects; the two vectors differ.
        check(unsafe { sys::PCApply(self.preconditioner()?, r.raw.get(), z.raw.get()) })
    }

    /// The outcome of the last solve.
    pub fn outcome(&self) -> Result<LinearOutcome> {
        let (mut reason, mut iterations, mut residual) = (0, 0, 0.0);
        // SAFETY: live object, live numbers.
        unsafe {
            check(sys::KSPGetConvergedReason(self.raw.get(), &mut reason))?;
            check(sys::KSPGetIterationNumber(self.raw.get(), &mut iterations))?;
            check(sys::KSPGetResidualNorm(self.raw.get(), &mut residual))?;
        }
        Ok(LinearOutcome { reason, iterations: usize::try_from(iterations).unwrap_or(0), residual })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_solves_count_the_iterations_of_both_and_end_as_the_second() {
        let [first, second] = [(2, 5, 1e-3), (-3, 4, 1e-9)]
            .map(|(reason, iterations, residual)| LinearOutcome { reason, iterations, residual });
        let both = first.followed_by(second);
        assert_eq!(both, LinearOutcome { iterations: 9, ..second });
        assert!(first.converged() && !both.converged());
    }
}
