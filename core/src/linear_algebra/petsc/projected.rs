use super::{
    BlockRows, DistributedVector, Ksp, LinearOutcome, Matrix, ProjectedOperator, ProjectedOutcome,
    callback::Callback,
    check,
    ksp::TOO_MANY,
    library::communicator,
    projected_operator::{multiply, precondition, project},
    reduced::{ReducedMatrix, block_rows, write_unit},
    reference::Reference,
    shell::symmetric_shell,
    slopes::Slopes,
    subspace::{Projections, Restriction},
    sys,
};
use crate::error::Result;
use std::ptr;

/// A Krylov solver on a subspace that changes between solves, preconditioned by a constant matrix.
///
/// PETSc treats the operator as a shell matrix whose null space is the complement of the subspace, and therefore projects every
/// result of the preconditioner. Multigrid with matrices of known block sizes is restricted to the subspace of each solve. Otherwise the first
/// solve after [`ProjectedKsp::set_tolerances`] uses the preconditioner of the constant
/// matrix or, if the dimension of the complement is [`MISSING_DIRECTIONS`] or more, one built for the subspace. In later solves the
/// preconditioner is rebuilt only if a solve has not converged within a number of iterations equal to the cost of rebuilding
/// ([`ProjectedKsp::set_refresh_threshold`]); the solve then continues from its last iterate.
#[derive(Debug)]
pub struct ProjectedKsp {
    ksp: Ksp,
    fallback: Option<Ksp>,
    shell: Reference<sys::_p_Mat>,
    complement: Reference<sys::_p_MatNullSpace>,
    /// The operator's own preconditioner, if it is in use; inside `ksp`.
    own: sys::PC,
    constant: Option<Matrix>,
    /// The same with what was added for the preconditioner alone.
    stiffened: Option<Matrix>,
    reduced: Option<ReducedMatrix>,
    /// The columns of the projection of each node, then of what is added there, and those to which multigrid is restricted.
    columns: Vec<[DistributedVector; 2]>,
    /// Whether multigrid is restricted to any.
    is_known: bool,
    /// Whether multigrid is to be restricted to the subspace of each solve, and whether it is to that of the present one.
    restricts: bool,
    restricted: bool,
    block: usize,
    tolerances: (f64, f64, usize),
    most: usize,
    /// The smallest right-hand side since the tolerances were set.
    smallest: f64,
    refresh_threshold: usize,
    stiffening_threshold: Option<usize>,
    /// Whether the next solve is the first since the tolerances were set.
    first: bool,
    /// Whether the preconditioner was built for a subspace.
    reducing: bool,
}

/// PETSc's reasons for negative curvature in CG: of the preconditioner, of the matrix.
const INDEFINITE: [i32; 2] = [-8, -10];

/// Dimension of the complement from which a preconditioner is built for the subspace. With a smaller complement the
/// preconditioner of the whole space needs at most as many additional iterations as the complement has dimensions.
pub const MISSING_DIRECTIONS: f64 = 16.0;

/// A solve without iterations.
const NOTHING: LinearOutcome = LinearOutcome { reason: TOO_MANY, iterations: 0, residual: f64::INFINITY };

/// What is known of linear equations on a subspace.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ProjectedKind {
    /// They are symmetric; where CG finds negative curvature, GMRES solves them.
    Symmetric,
    /// They may be positive definite; where CG finds negative curvature, the solve ends as indefinite.
    Definite,
    /// They are not symmetric, and are solved by GMRES.
    Unsymmetric,
}

impl ProjectedKsp {
    /// A solver for vectors with the layout of `like` (block size `block`), with this prefix of its options.
    pub fn new(prefix: &str, like: &DistributedVector, block: usize) -> Result<Self> {
        // SAFETY: a space of no vectors.
        let complement =
            unsafe { Reference::new(|raw| sys::MatNullSpaceCreate(communicator(), 0, 0, ptr::null(), raw))? };
        Ok(Self {
            ksp: Ksp::new(prefix)?,
            fallback: None,
            shell: symmetric_shell(like, block, multiply)?,
            complement,
            own: ptr::null_mut(),
            constant: None,
            stiffened: None,
            reduced: None,
            columns: Vec::new(),
            is_known: false,
            restricts: true,
            restricted: false,
            block,
            tolerances: (1e-5, 0.0, 10_000),
            most: usize::MAX,
            smallest: f64::INFINITY,
            refresh_threshold: usize::MAX,
            stiffening_threshold: None,
            first: true,
            reducing: false,
        })
    }

    /// The inner solver, to select method, preconditioner and tolerances.
    pub fn linear_solver(&mut self) -> &mut Ksp {
        &mut self.ksp
    }

    /// Restarts the count of applications of the preconditioner.
    pub fn restart_applications(&mut self) {
        self.ksp.restart_applications();
        self.fallback.iter_mut().for_each(Ksp::restart_applications);
    }

    /// Applications of the preconditioner since then, by CG and by GMRES.
    pub fn applications(&self) -> u64 {
        self.ksp.applications() + self.fallback.as_ref().map_or(0, Ksp::applications)
    }

    /// Stops at a residual norm of `relative * |r|` or `absolute`, whichever is larger, or after this many iterations. `r` is the
    /// smallest right-hand side of all solves from here on, so that the accuracy which Newton's method has reached is kept
    /// when its residual grows temporarily.
    pub fn set_tolerances(&mut self, relative: f64, absolute: f64, iterations: usize) -> Result<()> {
        self.tolerances = (relative, absolute, iterations);
        self.smallest = f64::INFINITY;
        self.first = true;
        Ok(())
    }

    /// Sets the number of iterations with the preconditioner of another subspace after which it is rebuilt for the current
    /// subspace.
    pub fn set_refresh_threshold(&mut self, iterations: usize) {
        self.refresh_threshold = iterations;
    }

    /// Lets multigrid act on the whole space in all solves.
    pub fn keep_multigrid_whole(&mut self) {
        self.restricts = false;
    }

    /// Sets the constant matrix and sets up its preconditioner. Collective.
    ///
    /// The preconditioner is set up with the constant matrix alone; otherwise multigrid would smooth with the operator.
    pub fn set_constant(&mut self, constant: &Matrix) -> Result<()> {
        self.constant = Some(constant.share()?);
        self.stiffened = None;
        self.restart_with(constant)
    }

    /// Sets the number of iterations after which the preconditioner of the constant matrix and what is added to it costs less than further
    /// ones.
    pub fn set_stiffening_threshold(&mut self, iterations: usize) {
        self.stiffening_threshold = Some(iterations);
    }

    /// This number, if it was set.
    pub fn stiffening_pays_after(&self) -> Option<usize> {
        self.stiffening_threshold
    }

    /// Preconditions later solves with these rows added to the constant matrix, whose pattern they have, in place of rows added before.
    /// Collective.
    pub fn stiffen(&mut self, rows: &BlockRows) -> Result<()> {
        let Some(constant) = &self.constant else { return Ok(()) };
        let mut sum = block_rows(constant.raw.get())?;
        sum.add(rows, self.block);
        let stiffened = Matrix::symmetric(self.block, &sum)?;
        let shared = stiffened.share()?;
        self.stiffened = Some(stiffened);
        self.restart_with(&shared)
    }

    /// Preconditions later solves with the constant matrix alone. Collective.
    pub fn forget_stiffening(&mut self) -> Result<()> {
        match (self.stiffened.take(), &self.constant) {
            (Some(_), Some(constant)) => {
                let constant = constant.share()?;
                self.restart_with(&constant)
            }
            _ => Ok(()),
        }
    }

    /// Sets up the preconditioner of a matrix on the whole space.
    fn restart_with(&mut self, matrix: &Matrix) -> Result<()> {
        (self.reduced, self.reducing, self.first) = (None, false, true);
        (self.restricted, self.is_known) = (false, false);
        self.precondition_with(matrix.raw.get())
    }

    /// Later solves use the operator's own preconditioner.
    pub fn precondition_by_operator(&mut self) -> Result<()> {
        self.ksp.set_preconditioner("shell", None)?;
        self.own = self.ksp.preconditioner()?;
        // SAFETY: live objects; the preconditioner is only applied inside `solve`, which sets its context.
        unsafe {
            check(sys::KSPSetOperators(self.ksp.raw.get(), self.shell.get(), self.shell.get()))?;
            check(sys::PCShellSetApply(self.own, Some(precondition)))
        }
    }

    fn precondition_with(&mut self, matrix: sys::Mat) -> Result<()> {
        self.fallback = None;
        // SAFETY: live objects; PETSc keeps its own references. Multigrid smooths with its own matrix: the shell can only
        // be multiplied inside `solve`, and is another operator.
        unsafe {
            check(sys::KSPSetOperators(self.ksp.raw.get(), self.shell.get(), matrix))?;
            check(sys::PCSetUseAmat(self.ksp.preconditioner()?, 0))?;
        }
        self.ksp.set_up()
    }

    /// Reads the current subspace; returns whether the preconditioner belongs to another subspace, and whether it was rebuilt for
    /// this one. Collective.
    fn update_subspace(
        &mut self,
        operator: &mut dyn ProjectedOperator,
        like: &DistributedVector,
    ) -> Result<[bool; 2]> {
        if self.restrict(operator, like)? {
            return Ok([false; 2]);
        }
        let Some(constant) = self.stiffened.as_ref().or(self.constant.as_ref()) else {
            return Ok([false; 2]);
        };
        if self.refresh_threshold == usize::MAX || !operator.may_project() {
            return Ok([false; 2]);
        }
        let reduced = match &mut self.reduced {
            Some(reduced) => reduced,
            none => none.insert(ReducedMatrix::new(constant, like, self.block)?),
        };
        let stale = reduced.update_projection(|column| operator.project(column))?;
        if !std::mem::take(&mut self.first) {
            return Ok([stale && self.reducing, false]);
        }
        // The initial preconditioner of a step depends on its own subspace alone, not on earlier steps, which a restart does not
        // have.
        let worth = reduced.removed()? >= MISSING_DIRECTIONS;
        if worth && stale {
            self.refresh()?;
        } else if !worth && self.reducing {
            let raw = constant.raw.get();
            reduced.reset_projection()?;
            self.precondition_with(raw)?;
        }
        self.reducing = worth;
        Ok([false, worth && stale])
    }

    /// Restricts multigrid to the current subspace; returns whether it can be. Collective.
    fn restrict(&mut self, operator: &mut dyn ProjectedOperator, like: &DistributedVector) -> Result<bool> {
        self.restricted = self.restricts && self.ksp.can_be_restricted() && operator.may_project();
        if self.restricted {
            while self.columns.len() < 2 * self.block {
                self.columns.push([like.like()?, like.like()?]);
            }
            let mut is_same = self.is_known;
            let (projections, slopes) = self.columns.split_at_mut(self.block);
            for (i, ([column, before], [slope, slope_before])) in
                projections.iter_mut().zip(slopes).enumerate()
            {
                write_unit(column, i, self.block)?;
                operator.project(column)?;
                slope.fill(0.0)?;
                operator.add_at_nodes(column, slope)?;
                is_same &= column.equals(before)?;
                is_same &= slope.equals(slope_before)?;
            }
            if !is_same {
                for [column, before] in &mut self.columns {
                    before.copy_from(column)?;
                }
                let (projections, slopes) = self.columns.split_at(self.block);
                self.ksp.restrict(Restriction {
                    projections: Projections::of(projections.iter().map(|[column, _]| column))?,
                    slopes: Slopes::of(slopes.iter().map(|[column, _]| column))?,
                })?;
                self.is_known = true;
            }
        }
        Ok(self.restricted)
    }

    /// Later solves take at most so many iterations, and not more than [`ProjectedKsp::set_tolerances`] allows.
    pub fn limit_iterations(&mut self, most: usize) {
        self.most = most;
    }

    /// Solves `P B x = r` for an `r` of the subspace. Collective. Non-convergence is an outcome, not an error.
    ///
    /// A panic in a callback is resumed here; an error in a callback on this rank is returned on this rank.
    pub fn solve(
        &mut self,
        operator: &mut dyn ProjectedOperator,
        kind: ProjectedKind,
        right_hand_side: &DistributedVector,
        solution: &mut DistributedVector,
    ) -> Result<ProjectedOutcome> {
        let [stale, refreshed] = self.update_subspace(operator, right_hand_side)?;
        let outcome = self.attached(operator, |solver| match kind {
            ProjectedKind::Symmetric => solver.solve_attached(right_hand_side, solution, stale),
            ProjectedKind::Definite => solver.solve_definite(right_hand_side, solution, stale),
            ProjectedKind::Unsymmetric => solver.solve_by_gmres(right_hand_side, solution, stale),
        })?;
        Ok(ProjectedOutcome { refreshed: refreshed || outcome.refreshed, ..outcome })
    }

    /// As [`ProjectedKsp::solve`] for a symmetric positive definite `P B`, to the absolute tolerance and with the present
    /// preconditioner.
    pub fn solve_accurately(
        &mut self,
        operator: &mut dyn ProjectedOperator,
        right_hand_side: &DistributedVector,
        solution: &mut DistributedVector,
    ) -> Result<LinearOutcome> {
        let (_, absolute, iterations) = self.tolerances;
        self.restrict(operator, right_hand_side)?;
        self.attached(operator, |solver| {
            solver.ksp.set_tolerances(0.0, absolute, iterations)?;
            solver.ksp.solve(right_hand_side, solution)
        })
    }

    /// Runs a solve with this operator as the context of the shell matrix.
    fn attached<T>(
        &mut self,
        operator: &mut dyn ProjectedOperator,
        solve: impl FnOnce(&mut Self) -> Result<T>,
    ) -> Result<T> {
        self.ksp.use_subspace(self.restricted);
        let callback = Callback::new(operator);
        let (shell, complement) = (self.shell.get(), self.complement.get());
        // SAFETY: the context lives on this frame until it is detached below; PETSc calls the trampolines only inside
        // KSPSolve. The null space is attached for the solve alone, so that its function is never called without.
        unsafe {
            check(sys::MatNullSpaceSetFunction(complement, Some(project), callback.pointer()))?;
            check(sys::MatSetNullSpace(shell, complement))?;
            check(sys::MatShellSetContext(shell, callback.pointer()))?;
            if !self.own.is_null() {
                check(sys::PCShellSetContext(self.own, callback.pointer()))?;
            }
        }
        let outcome = solve(self);
        // SAFETY: as above.
        unsafe {
            if !self.own.is_null() {
                check(sys::PCShellSetContext(self.own, ptr::null_mut()))?;
            }
            check(sys::MatShellSetContext(shell, ptr::null_mut()))?;
            check(sys::MatSetNullSpace(shell, ptr::null_mut()))?;
            check(sys::MatNullSpaceSetFunction(complement, None, ptr::null_mut()))?;
        }
        self.ksp.use_subspace(false);
        callback.finish()?;
        outcome
    }

    fn iterations(&self) -> usize {
        self.tolerances.2.min(self.most)
    }

    /// The residual norm at which a solve stops, and its ratio to the right-hand side.
    fn target(&mut self, right_hand_side: &DistributedVector) -> Result<(f64, f64)> {
        let norm = right_hand_side.norm()?;
        self.smallest = self.smallest.min(norm);
        let (relative, absolute, _) = self.tolerances;
        let target = (relative * self.smallest).max(absolute);
        Ok((target, (target / norm).min(1e-3)))
    }

    fn solve_attached(
        &mut self,
        right_hand_side: &DistributedVector,
        solution: &mut DistributedVector,
        stale: bool,
    ) -> Result<ProjectedOutcome> {
        let outcome = self.solve_by_cg(right_hand_side, solution, stale)?;
        if !outcome.indefinite {
            return Ok(outcome);
        }
        let (_, share) = self.target(right_hand_side)?;
        let gmres = self.gmres(share, self.iterations())?;
        let second = gmres.solve(right_hand_side, solution)?;
        Ok(ProjectedOutcome { linear: outcome.linear.followed_by(second), ..outcome })
    }

    fn solve_by_cg(
        &mut self,
        right_hand_side: &DistributedVector,
        solution: &mut DistributedVector,
        stale: bool,
    ) -> Result<ProjectedOutcome> {
        let (target, _) = self.target(right_hand_side)?;
        let iterations = self.iterations();
        let first = if stale { self.refresh_threshold.min(iterations) } else { iterations };
        let mut outcome = ProjectedOutcome { linear: NOTHING, indefinite: false, refreshed: false };
        if first > 0 {
            self.ksp.set_tolerances(0.0, target, first)?;
            outcome.linear = self.ksp.solve(right_hand_side, solution)?;
        } else {
            solution.fill(0.0)?;
        }
        if stale && outcome.linear.reason == TOO_MANY {
            outcome.refreshed = true;
            self.refresh()?;
            self.ksp.set_tolerances(0.0, target, iterations)?;
            self.ksp.start(true)?;
            let rest = self.ksp.solve(right_hand_side, solution)?;
            self.ksp.start(false)?;
            outcome.linear = outcome.linear.followed_by(rest);
        }
        Ok(ProjectedOutcome { indefinite: INDEFINITE.contains(&outcome.linear.reason), ..outcome })
    }

    /// PETSc's CG compares the signs of the curvature in its iterations with each other: where it is negative in all of them, it solves the
    /// equations, but at a maximum.
    fn solve_definite(
        &mut self,
        right_hand_side: &DistributedVector,
        solution: &mut DistributedVector,
        stale: bool,
    ) -> Result<ProjectedOutcome> {
        let mut outcome = self.solve_by_cg(right_hand_side, solution, stale)?;
        if outcome.linear.converged() && solution.dot(right_hand_side)? < 0.0 {
            outcome.linear.reason = INDEFINITE[1];
            outcome.indefinite = true;
        }
        Ok(outcome)
    }

    fn solve_by_gmres(
        &mut self,
        right_hand_side: &DistributedVector,
        solution: &mut DistributedVector,
        stale: bool,
    ) -> Result<ProjectedOutcome> {
        let (_, share) = self.target(right_hand_side)?;
        let iterations = self.iterations();
        let first = if stale { self.refresh_threshold.min(iterations).max(1) } else { iterations };
        let linear = self.gmres(share, first)?.solve(right_hand_side, solution)?;
        let outcome = ProjectedOutcome { linear, indefinite: false, refreshed: false };
        if !stale || linear.reason != TOO_MANY {
            return Ok(outcome);
        }
        self.refresh()?;
        let gmres = self.gmres(share, iterations)?;
        gmres.start(true)?;
        let rest = gmres.solve(right_hand_side, solution)?;
        gmres.start(false)?;
        Ok(ProjectedOutcome { linear: linear.followed_by(rest), refreshed: true, ..outcome })
    }

    /// GMRES with the same preconditioner, down to this share of the preconditioned right-hand side.
    fn gmres(&mut self, share: f64, iterations: usize) -> Result<&mut Ksp> {
        let gmres = match self.fallback.take() {
            Some(gmres) => gmres,
            None => self.ksp.sharing_preconditioner("indefinite_", "gmres")?,
        };
        let gmres = self.fallback.insert(gmres);
        gmres.set_tolerances(share, 0.0, iterations)?;
        Ok(gmres)
    }

    /// Builds the preconditioner for the current subspace. Collective.
    fn refresh(&mut self) -> Result<()> {
        let constant = self.stiffened.as_ref().or(self.constant.as_ref());
        let (Some(constant), Some(reduced)) = (constant, &mut self.reduced) else { return Ok(()) };
        reduced.make(constant)?;
        let raw = reduced.raw.get();
        self.precondition_with(raw)
    }
}
