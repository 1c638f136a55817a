//! The matrix of a step and its solver.

use super::{
    StepOutcome,
    contacts::restore_pressures,
    equations::Floor,
    factor_cache::{Cached, FactorCache, Krylov},
    force_scale::size_of,
    linear_solver::{LINEAR_ITERATIONS, Preconditioner, ProblemSize, SolverSettings},
    problem::{REMEDY, StepProblem, System},
    resistance::{resistances_of_body, set_reference_values},
    solver::Solver,
    springs::{RowsWithSprings, Springs},
    step_clock::CountedMatrix,
};
use crate::{
    error::{Error, Result},
    fem::{body::Body, effect::Contact, space::linear_subspace, state::State},
    linear_algebra::petsc::{BlockRows, DistributedVector, Ksp, Matrix, Precision},
    parallel::{agreement::Agreed, session::Session},
};
use std::cell::Cell;

/// The length of a step, and the length of the steps for which its preconditioner is set up, both as used in matrices, in s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Lengths {
    pub matrix: f64,
    pub cached: f64,
}

/// The least force in N by which equations are measured: the square of a smaller one underflows.
const LEAST_FORCE: f64 = 1e-150;
/// Share of the rounding errors of the forces to which a step is solved. At rest, steps start from velocities that leave about these
/// errors; solved to all of them, velocity and pressure may be off their graph by more than the accuracy of pressures.
const ROUNDING_SHARE: f64 = 0.1;
/// Share of the forces of a step above which no residual counts as rounding errors.
const LARGEST_FLOOR: f64 = 1e-4;

/// How accurately a step is solved, in N.
#[derive(Debug, Clone, Copy)]
struct Accuracy {
    /// The residual norm at which it counts as solved.
    tolerance: f64,
    /// The size of the forces.
    size: f64,
    /// The forces to which its residual is compared: not below those at which rounding errors matter to pressures.
    reference: f64,
}

/// The matrix for steps of one length, and its solver.
pub(super) struct StepSolver {
    settings: SolverSettings,
    /// The reason for the choice of the preconditioner.
    reason: String,
    /// The matrix to which the preconditioner in use belongs.
    cached: Option<(f64, Matrix)>,
    /// The matrix of the step, if its length is not that of the preconditioner.
    step_matrix: Option<(f64, Matrix)>,
    /// The lengths for which matrix and preconditioner are prepared.
    prepared: Option<Lengths>,
    /// Norm of the matrix in use in N s/m.
    matrix_norm: f64,
    solver: Solver,
    /// Products with the matrix since the count of traffic was restarted, without those of PETSc's Krylov solver for linear steps.
    products: Cell<u64>,
    /// Whether a set-up failed: the linear solver in use must be replaced.
    set_up_failed: bool,
    /// Matrices with preconditioners that are not in use.
    cache: Option<FactorCache>,
    /// Springs that keep the factors of bodies supported by contact alone regular.
    springs: Springs,
}

impl StepSolver {
    /// Chooses the solver for steps of which about `steps` share a matrix; the matrix is set by [`StepSolver::prepare`]. Collective.
    pub(super) fn new<const D: usize, const S: usize>(
        session: &Session,
        body: &mut Body<D, S>,
        state: &State,
        settings: &SolverSettings,
        steps: u64,
    ) -> Result<Self> {
        let problem = ProblemSize::of(session, body, steps, settings.factor_precision)?;
        let (preconditioner, reason) = settings.preconditioner.resolve(problem);
        let settings = SolverSettings { preconditioner, ..settings.clone() };
        let solver = Solver::new(session, body, &state.velocity, &settings, problem)?;
        Ok(Self {
            settings,
            reason,
            cached: None,
            step_matrix: None,
            prepared: None,
            matrix_norm: 0.0,
            solver,
            products: Cell::new(0),
            set_up_failed: false,
            cache: None,
            springs: Springs::default(),
        })
    }

    /// Whether steps are solved by Newton's method.
    pub(super) fn is_nonlinear(&self) -> bool {
        !matches!(self.solver, Solver::Linear(_))
    }

    /// The preconditioner in use, and the reason for it.
    pub(super) fn preconditioner(&self) -> (Preconditioner, &str) {
        (self.settings.preconditioner, &self.reason)
    }

    /// The precision of factors, if steps are condensed to the contact.
    pub(super) fn factor_precision(&self) -> Option<Precision> {
        match &self.solver {
            Solver::Condensed(condensed) => Some(condensed.precision),
            _ => None,
        }
    }

    /// Lets the next factors of condensed steps be in double precision.
    pub(super) fn use_double_precision(&mut self) {
        if let Solver::Condensed(condensed) = &mut self.solver {
            condensed.precision = Precision::Double;
        }
    }

    /// Whether the matrices belong to these lengths.
    pub(super) fn is_prepared_for(&self, lengths: Lengths) -> bool {
        self.prepared == Some(lengths)
    }

    /// Assembles the matrix of this length and sets up its preconditioner, unless they are available; returns whether a
    /// preconditioner was built. `like` has the layout of velocities. Collective.
    pub(super) fn prepare<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        lengths: Lengths,
        like: &DistributedVector,
    ) -> Result<bool> {
        (self.prepared, self.step_matrix) = (None, None);
        let length = self.cached_length(lengths);
        let mut is_new = false;
        if self.cached.as_ref().is_none_or(|(known, _)| *known != length) {
            let cached = self.cache.as_mut().and_then(|cache| cache.remove(length));
            is_new = cached.is_none();
            let (matrix, krylov) = cached.map(|Cached { matrix, krylov, .. }| (matrix, krylov)).unzip();
            self.activate_solver(session, body, krylov, like)?;
            let matrix = match matrix {
                Some(matrix) => matrix,
                None => {
                    self.set_up_failed = true;
                    self.set_up(session, body, length, like)?
                }
            };
            self.set_up_failed = false;
            self.cached = Some((length, matrix));
        }
        if lengths.matrix != length {
            let rows = matrix_rows(session, body, lengths.matrix)?;
            self.step_matrix = Some((lengths.matrix, session.agree(Matrix::symmetric(D, &rows))?));
        }
        self.matrix_norm = self.matrix()?.norm()?;
        set_reference_values(session, &mut body.contacts, like, self.matrix()?)?;
        if let (Solver::Linear(ksp), Some((_, cached))) = (&mut self.solver, &self.cached) {
            ksp.set_matrices(self.step_matrix.as_ref().map_or(cached, |(_, matrix)| matrix), cached)?;
        }
        self.prepared = Some(lengths);
        Ok(is_new)
    }

    /// The length whose preconditioner is set up: a condensed matrix is valid only for its own length, but where cells flow its factor
    /// preconditions Newton's method for nearby lengths.
    fn cached_length(&self, lengths: Lengths) -> f64 {
        match &self.solver {
            Solver::Condensed(condensed) if !condensed.flows() => lengths.matrix,
            _ => lengths.cached,
        }
    }

    /// Activates another linear solver: `next`, or a new one that is not set up. The matrix in use, if there is one, is stored in
    /// the cache with its preconditioner; the objects of a failed set-up are dropped. Collective.
    fn activate_solver<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &Body<D, S>,
        next: Option<Krylov>,
        like: &DistributedVector,
    ) -> Result<()> {
        let (chosen, unknowns) = (self.settings.preconditioner, body.mesh.total_nodes * D);
        let mut krylov = match next {
            Some(krylov) => krylov,
            None if self.cached.is_none() && !self.set_up_failed => return Ok(()),
            None => Krylov::new_like(&self.solver, session, chosen, &body.mesh, like)?,
        };
        krylov.swap_with(&mut self.solver);
        let Some((length, matrix)) = self.cached.take() else { return Ok(()) };
        let cache = match &mut self.cache {
            Some(cache) => cache,
            none => {
                let bytes = 12.0 * matrix.stored_entries()?;
                let capacity = chosen.cache_capacity(D, unknowns, session.ranks(), bytes);
                none.insert(FactorCache::new(capacity - 1))
            }
        };
        cache.insert(Cached { length, matrix, krylov });
        Ok(())
    }

    /// Assembles the matrix of steps of this length in s and sets up the preconditioner of the linear solver in use with it.
    /// Collective.
    fn set_up<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        length: f64,
        like: &DistributedVector,
    ) -> Result<Matrix> {
        let rows = matrix_rows(session, body, length)?;
        let mut matrix = session.agree(Matrix::symmetric(D, &rows))?;
        let mut rows_with_springs = self.springs.add(session, body, rows)?;
        if let Solver::Condensed(condensed) = &mut self.solver {
            if condensed.prepare(session, body, rows_with_springs, &matrix, like)? {
                if condensed.active_precision()? == Precision::Single {
                    matrix.multiply_often()?;
                }
                return Ok(matrix);
            }
            self.solver = Solver::whole(session, body, like, &self.settings)?;
            rows_with_springs = self.springs.rows(session, body, length)?;
        }
        let RowsWithSprings { rows, springs } = rows_with_springs;
        // The matrix for the preconditioner, if it differs from the matrix of the step.
        let mut with_springs = None;
        if springs.is_some() {
            with_springs = Some(session.agree(Matrix::symmetric(D, &rows))?);
        }
        drop(rows);
        if self.settings.preconditioner == Preconditioner::Gamg {
            let ksp = match &mut self.solver {
                Solver::Linear(ksp) => Some(ksp),
                Solver::Newton(newton) => Some(newton.linear_solver.linear_solver()),
                Solver::Condensed(_) => None,
            };
            if let Some(ksp) = ksp.filter(|_| body.mesh.order() == 2) {
                let interpolation = session.agree(linear_subspace(session, &body.mesh, &body.held))?;
                ksp.set_coarse_space(D, interpolation)?;
            }
            let coordinates = body.mesh.nodes[..body.mesh.owned].as_flattened();
            with_springs.as_mut().unwrap_or(&mut matrix).attach_rigid_motions(D, coordinates)?;
        }
        if self.settings.preconditioner != Preconditioner::Cholesky {
            matrix.multiply_often()?;
        }
        match &mut self.solver {
            Solver::Linear(ksp) => {
                ksp.set_matrices(&matrix, &matrix)?;
                session.agree(ksp.set_up())?;
            }
            Solver::Newton(newton) => {
                let constant = with_springs.as_ref().unwrap_or(&matrix);
                session.agree(newton.linear_solver.set_constant(constant))?;
                newton.scales = resistances_of_body(session, &body.contacts, like, &matrix)?;
            }
            Solver::Condensed(_) => {}
        }
        Ok(matrix)
    }

    /// The matrix in use.
    fn matrix(&self) -> Result<&Matrix> {
        let unprepared = || Error::Internal("a matrix was requested before it was assembled".into());
        self.step_matrix.as_ref().or(self.cached.as_ref()).map(|(_, matrix)| matrix).ok_or_else(unprepared)
    }

    /// `y = K x`. Collective.
    pub(super) fn multiply(&self, x: &DistributedVector, y: &mut DistributedVector) -> Result<()> {
        self.matrix()?.multiply(x, y)
    }

    /// Restarts the count of traffic.
    pub(super) fn restart_traffic(&mut self) {
        self.products.set(0);
        match &mut self.solver {
            Solver::Condensed(condensed) => condensed.restart_traffic(),
            Solver::Linear(ksp) => ksp.restart_applications(),
            Solver::Newton(newton) => newton.linear_solver.restart_applications(),
        }
    }

    /// Least number of bytes moved on this rank since then; `None` where they are not counted: cells that flow, PETSc's solver
    /// for variational inequalities, preconditioners of unknown size.
    pub(super) fn traffic(&mut self, ranks: usize) -> Result<Option<u64>> {
        let product = self.matrix()?.bytes_of_a_product()?;
        let products = self.products.get() * product;
        match &mut self.solver {
            Solver::Condensed(condensed) => Ok(condensed.traffic().map(|bytes| products + bytes)),
            Solver::Newton(newton) if newton.flow.is_some() || newton.bounded.is_some() => Ok(None),
            Solver::Newton(newton) => {
                let applications = newton.linear_solver.applications();
                let applied = newton.linear_solver.linear_solver().bytes_applied(ranks)?;
                Ok(applied.map(|bytes| products + applications * bytes))
            }
            Solver::Linear(ksp) => {
                // PETSc multiplies the same number of times: for the first residual, and in each iteration.
                let (applications, applied) = (ksp.applications(), ksp.bytes_applied(ranks)?);
                Ok(applied.map(|bytes| applications * (product + bytes)))
            }
        }
    }

    /// Applies the preconditioner. Collective.
    pub(super) fn precondition(&mut self, r: &DistributedVector, z: &mut DistributedVector) -> Result<()> {
        match &mut self.solver {
            Solver::Condensed(condensed) => condensed.solve_linear(r, z),
            Solver::Linear(ksp) => ksp.precondition(r, z),
            Solver::Newton(newton) => newton.linear_solver.linear_solver().precondition(r, z),
        }
    }

    /// Solves a step from the velocity in `trial`, and writes the new one there. If it fails, it is repeated with a factor in
    /// double precision, from the solution on soft springs where contact alone holds a body, and with the tolerance that rounding errors
    /// of the solution allow. Collective.
    pub(super) fn solve<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        trial: &mut DistributedVector,
    ) -> Result<StepOutcome> {
        let (session, state, forces) = (problem.session, problem.state, problem.forces);
        let Accuracy { mut tolerance, size, reference } = self.accuracy(problem, trial)?;
        let floor = Floor { slope: f64::EPSILON * self.matrix_norm, largest: LARGEST_FLOOR * size };
        let (mut is_relaxed, mut is_pressed_on) = (false, false);
        loop {
            let is_single = self.active_precision()? == Some(Precision::Single);
            let (_, matrix) =
                self.step_matrix.as_ref().or(self.cached.as_ref()).ok_or_else(|| {
                    Error::Internal("a step was solved before its matrix was assembled".into())
                })?;
            let matrix = &CountedMatrix { matrix, products: &self.products };
            let (right_hand_side, converged) = (forces, &state.velocity);
            let system = System { matrix, right_hand_side, tolerance, floor, converged };
            let solved = match &mut self.solver {
                Solver::Linear(ksp) => solve_linear(ksp, problem, system, trial),
                Solver::Newton(newton) => newton.solve(problem, system, trial),
                Solver::Condensed(condensed) if is_single => condensed.refine(problem, system, trial),
                Solver::Condensed(condensed) => {
                    let is_own = self.step_matrix.is_none();
                    condensed.solve(problem, system, trial, is_own)
                }
            };
            let failure = match session.agree(solved) {
                Err(failure) if failure.is_failure() => failure,
                Ok(solved) => {
                    let residual = if reference > 0.0 { solved.residual / reference } else { 0.0 };
                    return Ok(StepOutcome { residual, ..solved });
                }
                Err(error) => return Err(self.springs.explain(error)),
            };
            if is_single {
                session.agree(self.refactor_in_double(problem, trial))?;
                continue;
            }
            if is_relaxed {
                return Err(self.springs.explain(failure));
            }
            // The start value may be much smaller than the solution, especially at rest.
            let mut solution = forces.like()?;
            self.precondition(forces, &mut solution)?;
            if self.springs.are_needed() && !is_pressed_on {
                // Foundations that nothing presses on yet do not resist: start where springs bear the loads.
                trial.copy_from(&solution)?;
                restore_pressures(problem.body, problem.state)?;
                is_pressed_on = true;
                continue;
            }
            let floor = f64::EPSILON * self.matrix_norm * solution.norm()?;
            if !floor.is_finite() || floor <= tolerance {
                return Err(self.springs.explain(failure));
            }
            if !self.is_nonlinear() {
                trial.copy_from(&solution)?;
            }
            (tolerance, is_relaxed) = (floor, true);
        }
    }

    /// The share of the forces at which a step counts as solved.
    pub(super) fn relative_tolerance(&self) -> f64 {
        self.settings.tolerance
    }

    /// How accurately a step is to be solved; refuses forces that are not finite. Sets the reference forces of the contacts.
    /// Collective.
    fn accuracy<const D: usize, const S: usize>(
        &self,
        problem: &mut StepProblem<'_, D, S>,
        start: &DistributedVector,
    ) -> Result<Accuracy> {
        let norm = problem.forces.norm()?;
        if !norm.is_finite() {
            let remedy = "check loads and initial values; use smaller steps";
            return Err(problem.failed("the forces are not finite", remedy));
        }
        let StepProblem { session, body, scale, rounding, .. } = problem;
        // The tolerance is never below the rounding error of `K v`, even if the remaining forces are small; friction on a moving
        // obstacle rounds `v` as a difference from the obstacle's velocity.
        let mut motion = start.norm()?;
        if body.contacts.iter().any(Contact::has_moving_obstacle) {
            let mine = body.contacts.iter().map(Contact::obstacle_velocity_square).sum();
            motion += session.sum([mine])[0].sqrt();
        }
        let product = f64::EPSILON * self.matrix_norm * motion;
        // An estimate of the forces as if they were equal in all unknowns. At rest under steady loads the forces cancel, and a body that
        // its obstacle has released has none: the accuracy of pressures is then limited by rounding errors.
        let accuracy = self.settings.inclusion_tolerance;
        let size = norm.max(rounding.max(product) / accuracy);
        let size = if size > 0.0 { size.max(LEAST_FORCE / accuracy) } else { 0.0 };
        let total = size * ((body.mesh.total_nodes * D) as f64).sqrt();
        body.contacts.iter_mut().for_each(|contact| contact.reference.forces = total);
        let size = size_of(norm, *scale);
        let tolerance =
            (self.settings.tolerance * size).max(LEAST_FORCE).max(ROUNDING_SHARE * *rounding).max(product);
        Ok(Accuracy { tolerance, size, reference: size.max(rounding.max(product) / accuracy) })
    }

    /// The precision of the factor in use, if steps are condensed to the contact.
    fn active_precision(&mut self) -> Result<Option<Precision>> {
        match &mut self.solver {
            Solver::Condensed(condensed) => condensed.active_precision().map(Some),
            _ => Ok(None),
        }
    }

    /// Replaces a factor whose single precision was insufficient, and resets the step to its start. Collective.
    fn refactor_in_double<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        trial: &mut DistributedVector,
    ) -> Result<()> {
        let (length, matrix) =
            self.step_matrix.as_ref().or(self.cached.as_ref()).map_or((0.0, None), |(l, m)| (*l, Some(m)));
        let (Solver::Condensed(condensed), Some(matrix)) = (&mut self.solver, matrix) else { return Ok(()) };
        condensed.restore_start(trial)?;
        restore_pressures(problem.body, problem.state)?;
        condensed.precision = Precision::Double;
        let rows = self.springs.rows(problem.session, problem.body, length)?;
        condensed.prepare(problem.session, problem.body, rows, matrix, problem.forces)?;
        Ok(())
    }
}

/// Solves a step without contact and flow. Collective.
fn solve_linear<const D: usize, const S: usize>(
    ksp: &mut Ksp,
    problem: &StepProblem<'_, D, S>,
    system: System<'_>,
    trial: &mut DistributedVector,
) -> Result<StepOutcome> {
    ksp.set_tolerances(0.0, system.tolerance, LINEAR_ITERATIONS)?;
    let outcome = problem.session.agree(ksp.solve(problem.forces, trial))?;
    let mut residual = outcome.residual;
    if !outcome.converged() {
        let mut left = trial.like()?;
        system.write_residual(trial, &mut left)?;
        residual = left.norm()?;
        if !system.floor.is_reached(residual, trial.norm()?) {
            return Err(problem.failed(outcome.description(), REMEDY));
        }
    }
    Ok(StepOutcome { linear_iterations: outcome.iterations, residual, ..StepOutcome::default() })
}

/// The rows of the matrix on this rank. PETSc's integers can count them. Collective.
fn matrix_rows<const D: usize, const S: usize>(
    session: &Session,
    body: &Body<D, S>,
    length: f64,
) -> Result<BlockRows, Agreed> {
    let rows = body.matrix(session, length)?;
    session.agree(rows.check(D, body.mesh.total_nodes))?;
    Ok(rows)
}
