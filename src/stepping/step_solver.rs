//! The matrix of a step with its solver.

use super::{
    StepOutcome, choice,
    condensed::Condensed,
    factor_cache::{self, Cached, FactorCache, Krylov},
    flow::FlowStart,
    linear_solver::{LINEAR_ITERATIONS, Preconditioner, ProblemSize, SolverSettings},
    newton::{From, Newton, REMEDY, Task, failed, set_reference_values},
    springs::Springs,
};
use crate::{
    agreement::Agreed,
    body::Body,
    effect::{Contact, Step},
    error::{Error, Result},
    petsc::{BlockRows, DistributedVector, Ksp, Matrix, Precision},
    session::Session,
    state::State,
};

/// What a step brings to its solution.
#[derive(Clone, Copy)]
pub(super) struct Known<'a> {
    /// The right-hand side in N.
    pub forces: &'a DistributedVector,
    /// The least residual norm in N that means something.
    pub rounding: f64,
    /// Where the displacement starts, if stresses are those at the end of the step.
    pub start: Option<FlowStart<'a>>,
}

/// The solver of a linear or of a nonlinear step: only the one that is needed exists.
pub(super) enum Solver {
    Linear(Ksp),
    Newton(Box<Newton>),
    Condensed(Box<Condensed>),
}

/// The length of a step, and that of the steps for which its preconditioner is set up, both as matrices have them, in s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Lengths {
    pub matrix: f64,
    pub cached: f64,
}

/// The matrix for steps of one length, and what solves with it.
pub(super) struct StepSolver {
    settings: SolverSettings,
    /// Why the preconditioner is what it is.
    reason: String,
    /// The matrix that the preconditioner in use is of.
    cached: Option<(f64, Matrix)>,
    /// The matrix of steps of another length than that of the preconditioner.
    between: Option<(f64, Matrix)>,
    /// Norm of the matrix in use in N s/m.
    matrix_norm: f64,
    solver: Solver,
    /// What else is kept.
    cache: Option<FactorCache>,
    /// What keeps factors of bodies that contact alone holds from being singular.
    springs: Springs,
}

impl StepSolver {
    /// Chooses the solver; the matrix comes with [`StepSolver::prepare`]. Collective.
    pub fn new<const D: usize, const S: usize>(
        session: &Session,
        body: &Body<D, S>,
        state: &State,
        settings: SolverSettings,
    ) -> Result<Self> {
        let unknowns = body.mesh.total_nodes * D;
        let problem = ProblemSize::of(session, body, settings.steps, settings.factor_precision);
        let (preconditioner, reason) = settings.preconditioner.resolve(problem);
        let flows = body.flows();
        let solver = if body.contacts.is_empty() && !flows {
            Solver::Linear(factor_cache::linear(session, preconditioner, unknowns)?)
        } else {
            choice::newton(session, body, state, settings, (preconditioner, problem.factor_precision()))?
        };
        Ok(Self {
            settings: SolverSettings { preconditioner, ..settings },
            reason,
            cached: None,
            between: None,
            matrix_norm: 0.0,
            solver,
            cache: None,
            springs: Springs::default(),
        })
    }

    /// Whether steps are solved by Newton's method.
    pub fn is_nonlinear(&self) -> bool {
        !matches!(self.solver, Solver::Linear(_))
    }

    /// The preconditioner in use, and why it is that one.
    pub fn preconditioner(&self) -> (Preconditioner, &str) {
        (self.settings.preconditioner, &self.reason)
    }

    /// The precision of factors, where steps are solved on the contact alone.
    pub fn factor_precision(&self) -> Option<Precision> {
        match &self.solver {
            Solver::Condensed(condensed) => Some(condensed.precision),
            _ => None,
        }
    }

    /// Whether the matrices are those of these lengths.
    pub fn is_prepared_for(&self, lengths: Lengths) -> bool {
        let length = |matrix: &Option<(f64, Matrix)>| matrix.as_ref().map(|(length, _)| *length);
        let cached = length(&self.cached);
        cached == Some(self.cached_length(lengths))
            && length(&self.between).or(cached) == Some(lengths.matrix)
    }

    /// Assembles the matrix of this length and sets its preconditioner up, unless they are there; says whether a
    /// preconditioner was made. `like` is laid out as velocities are. Collective.
    pub fn prepare<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        lengths: Lengths,
        like: &DistributedVector,
    ) -> Result<bool> {
        self.between = None;
        let cached = self.cached_length(lengths);
        let mut made = false;
        if self.cached.as_ref().is_none_or(|(known, _)| *known != cached) {
            made = self.change_matrix(session, body, cached, like)?;
        }
        if lengths.matrix != cached {
            let rows = matrix_rows(session, body, lengths.matrix)?;
            self.between = Some((lengths.matrix, session.agree(Matrix::symmetric(D, &rows))?));
        }
        self.matrix_norm = self.matrix()?.norm()?;
        set_reference_values(session, &mut body.contacts, like, self.matrix()?)?;
        if let (Solver::Linear(ksp), Some((_, cached))) = (&mut self.solver, &self.cached) {
            ksp.set_matrices(self.between.as_ref().map_or(cached, |(_, matrix)| matrix), cached)?;
        }
        Ok(made)
    }

    /// The length whose matrix is set up: what is condensed serves no other.
    fn cached_length(&self, lengths: Lengths) -> f64 {
        if matches!(self.solver, Solver::Condensed(_)) { lengths.matrix } else { lengths.cached }
    }

    /// Brings the matrix and preconditioner of this length into use; says whether they had to be made. Collective.
    fn change_matrix<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        length: f64,
        like: &DistributedVector,
    ) -> Result<bool> {
        let (chosen, unknowns) = (self.settings.preconditioner, body.mesh.total_nodes * D);
        let found = self.cache.as_mut().and_then(|cache| cache.take(length));
        let (is_there, mut next) = match found {
            Some(Cached { matrix, krylov, .. }) => (Some(matrix), Some(krylov)),
            None => (None, None),
        };
        if let Some((length, matrix)) = self.cached.take() {
            let cache = match &mut self.cache {
                Some(cache) => cache,
                none => {
                    let bytes = 12.0 * matrix.stored_entries()?;
                    let kept = chosen.kept(D, unknowns, session.ranks(), bytes);
                    none.insert(FactorCache::new(kept - 1))
                }
            };
            let mut krylov = match next.take() {
                Some(krylov) => krylov,
                None => Krylov::another::<D>(&self.solver, session, chosen, unknowns, like)?,
            };
            krylov.exchange(&mut self.solver);
            cache.put(Cached { length, matrix, krylov });
        }
        if let Some(matrix) = is_there {
            self.cached = Some((length, matrix));
            return Ok(false);
        }
        let mut rows = matrix_rows(session, body, length)?;
        let mut matrix = session.agree(Matrix::symmetric(D, &rows))?;
        let springs = self.springs.add(session, body, &mut rows)?;
        if let Solver::Condensed(condensed) = &mut self.solver {
            if condensed.prepare(session, body, rows, springs.as_deref(), (&matrix, like))? {
                if condensed.precision_in_use()? == Precision::Single {
                    matrix.multiply_often()?;
                }
                self.cached = Some((length, matrix));
                return Ok(true);
            }
            self.solver = choice::whole_newton(session, body, like, self.settings, chosen)?;
            (rows, _) = self.springs.rows(session, body, length)?;
        }
        // What the preconditioner is made of, if it is not the matrix itself.
        let mut sprung = None;
        if springs.is_some() {
            sprung = Some(session.agree(Matrix::symmetric(D, &rows))?);
        }
        drop(rows);
        if chosen == Preconditioner::Gamg {
            let coordinates = body.mesh.nodes[..body.mesh.owned].as_flattened();
            sprung.as_mut().unwrap_or(&mut matrix).attach_rigid_motions(D, coordinates)?;
        }
        if chosen != Preconditioner::Cholesky {
            matrix.multiply_often()?;
        }
        match &mut self.solver {
            Solver::Linear(ksp) => {
                ksp.set_matrices(&matrix, &matrix)?;
                session.agree(ksp.set_up())?;
            }
            Solver::Newton(newton) => {
                let constant = sprung.as_ref().unwrap_or(&matrix);
                session.agree(newton.linear_solver.set_constant(constant))?;
                newton.choose_scales(session, &body.contacts, like, &matrix)?;
            }
            Solver::Condensed(_) => {}
        }
        self.cached = Some((length, matrix));
        Ok(true)
    }

    /// The matrix in use.
    fn matrix(&self) -> Result<&Matrix> {
        let unprepared = || Error::Internal("a matrix was asked for before it was assembled".into());
        self.between.as_ref().or(self.cached.as_ref()).map(|(_, matrix)| matrix).ok_or_else(unprepared)
    }

    /// `y = K x`. Collective.
    pub fn multiply(&self, x: &DistributedVector, y: &mut DistributedVector) -> Result<()> {
        self.matrix()?.multiply(x, y)
    }

    /// Counts traffic from here on.
    pub fn restart_traffic(&mut self) {
        self.matrices().for_each(Matrix::restart_products);
        match &mut self.solver {
            Solver::Condensed(condensed) => condensed.restart_traffic(),
            Solver::Linear(ksp) => ksp.restart_applications(),
            Solver::Newton(newton) => newton.linear_solver.restart_applications(),
        }
    }

    /// Bytes that were moved on this rank since then, at the least; `None` where that is not counted: cells that flow, PETSc's solver
    /// for variational inequalities, preconditioners that don't tell their size.
    pub fn traffic(&mut self, ranks: usize) -> Result<Option<u64>> {
        let products: u64 = self.matrices().map(Matrix::product_bytes).sum();
        match &mut self.solver {
            Solver::Condensed(condensed) => Ok(Some(products + condensed.traffic())),
            Solver::Newton(newton) if newton.flow.is_some() || newton.bounded.is_some() => Ok(None),
            Solver::Newton(newton) => {
                let applications = newton.linear_solver.applications();
                let applied = newton.linear_solver.linear_solver().bytes_applied(ranks)?;
                Ok(applied.map(|bytes| products + applications * bytes))
            }
            Solver::Linear(ksp) => {
                // PETSc multiplies as often: for the first residual, and in each iteration.
                let (applications, applied) = (ksp.applications(), ksp.bytes_applied(ranks)?);
                let matrix = self.matrix()?.bytes_of_a_product();
                Ok(applied.map(|bytes| applications * (matrix + bytes)))
            }
        }
    }

    fn matrices(&self) -> impl Iterator<Item = &Matrix> {
        [&self.cached, &self.between].into_iter().flatten().map(|(_, matrix)| matrix)
    }

    /// Applies the preconditioner. Collective.
    pub fn precondition(&mut self, r: &DistributedVector, z: &mut DistributedVector) -> Result<()> {
        match &mut self.solver {
            Solver::Condensed(condensed) => condensed.solve_linear(r, z),
            Solver::Linear(ksp) => ksp.precondition(r, z),
            Solver::Newton(newton) => newton.linear_solver.linear_solver().precondition(r, z),
        }
    }

    /// Solves a step from the velocity in `trial`, and leaves the new one there. Collective.
    pub fn solve<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        state: &State,
        step: Step,
        known: Known<'_>,
        trial: &mut DistributedVector,
    ) -> Result<StepOutcome> {
        let Known { forces, rounding, start } = known;
        let norm = forces.norm()?;
        if !norm.is_finite() {
            return Err(failed(
                step,
                "the forces are not finite",
                "check loads and initial values; use smaller steps",
            ));
        }
        // As many newtons as if all unknowns bore alike. At rest under steady loads the forces cancel: pressures are told apart
        // no better than what rounding leaves of them.
        let told = norm.max(rounding / self.settings.inclusion_tolerance);
        let total = told * ((body.mesh.total_nodes * D) as f64).sqrt();
        body.contacts.iter_mut().for_each(|contact| contact.reference.forces = total);
        // No residual below the rounding of `K v` is asked for, however small the forces that are left; friction on a moving
        // obstacle rounds `v` as a difference from its velocity.
        let mut motion = trial.norm()?;
        if body.contacts.iter().any(Contact::may_drift) {
            let mine = body.contacts.iter().map(Contact::drift_square).sum();
            motion += session.sum([mine])[0].sqrt();
        }
        let product = f64::EPSILON * self.matrix_norm * motion;
        let tolerance = (self.settings.tolerance * norm).max(f64::MIN_POSITIVE).max(rounding).max(product);
        let solved = self.solve_to(session, body, state, (step, start), (forces, tolerance), trial);
        let solved = session.agree(solved);
        if !solved.as_ref().is_err_and(Agreed::is_failure) {
            return Ok(solved?);
        }
        // The start may be much less than the solution, above all at rest.
        let mut answer = forces.like()?;
        self.precondition(forces, &mut answer)?;
        let floor = f64::EPSILON * self.matrix_norm * answer.norm()?;
        if floor.is_finite() && floor > tolerance {
            if !self.is_nonlinear() {
                trial.copy_from(&answer)?;
            }
            let solved = self.solve_to(session, body, state, (step, start), (forces, floor), trial);
            return session.agree(solved).map_err(|failure| self.springs.explain(failure));
        }
        solved.map_err(|failure| self.springs.explain(failure))
    }

    /// Solves a step to this residual norm in N. Collective.
    fn solve_to<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        state: &State,
        (step, start): (Step, Option<FlowStart<'_>>),
        (forces, tolerance): (&DistributedVector, f64),
        trial: &mut DistributedVector,
    ) -> Result<StepOutcome> {
        let Some((length, matrix)) = self.between.as_ref().or(self.cached.as_ref()) else {
            return Err(Error::Internal("a step was taken before its matrix was assembled".into()));
        };
        let from = From { velocity: &state.velocity, traction: state.contact_traction.as_ref() };
        let task =
            Task { step, matrix, right_hand_side: forces, tolerance, settings: self.settings, flow: start };
        match &mut self.solver {
            Solver::Linear(ksp) => {
                ksp.set_tolerances(0.0, tolerance, LINEAR_ITERATIONS)?;
                let outcome = session.agree(ksp.solve(forces, trial))?;
                if !outcome.converged() {
                    return Err(failed(step, outcome.words(), REMEDY));
                }
                Ok(StepOutcome { linear_iterations: outcome.iterations, ..StepOutcome::default() })
            }
            Solver::Newton(newton) => newton.solve(session, body, from, task, trial),
            Solver::Condensed(condensed) => {
                if let Some(outcome) = condensed.solve(session, body, from, task, trial)? {
                    return Ok(outcome);
                }
                condensed.precision = Precision::Double;
                let (rows, springs) = self.springs.rows(session, body, *length)?;
                condensed.prepare(session, body, rows, springs.as_deref(), (matrix, forces))?;
                let solved = condensed.solve(session, body, from, task, trial)?;
                solved.ok_or_else(|| Error::Internal("a factor in double precision was not enough".into()))
            }
        }
    }
}

/// The rows of the matrix here, which PETSc can count. Collective.
fn matrix_rows<const D: usize, const S: usize>(
    session: &Session,
    body: &mut Body<D, S>,
    length: f64,
) -> Result<BlockRows, Agreed> {
    let rows = body.matrix(session, length)?;
    session.agree(rows.check(D, body.mesh.total_nodes))?;
    Ok(rows)
}
