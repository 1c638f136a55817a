//! The matrix of a step and its solver.

use super::{
    StepOutcome,
    bounded::{self, Bounded},
    condensed::Condensed,
    contacts::{multiple_to_touch, restore_pressures},
    corrections::correct,
    equations::{Floor, StepMatrix},
    factor_cache::{FactorCache, Prepared},
    flow::Flow,
    flow_corrections::{Corrected, Factored, FlowCorrections},
    force_scale::size_of,
    linear_solver::{LINEAR_ITERATIONS, Method, Preconditioner, ProblemSize, SolverSettings},
    newton::Newton,
    problem::{REMEDY, StepProblem, System},
    resistance::{resistances, set_reference_values},
    solver::{Assembled, LinearSolver},
    springs::{RowsWithSprings, Springs},
    step_clock::CountedMatrix,
    whole::Whole,
};
use crate::{
    error::{Error, Result},
    fem::{body::Body, effect::Contact, space::linear_subspace, state::State},
    linear_algebra::{
        petsc::{BlockRows, DistributedVector, Ksp, Matrix, Precision, has_option},
        tensor::larger,
    },
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
/// The least force in N by which pressures are measured: the least residual at a node that stands for next to no area is below the accuracy
/// of its pressure.
const LEAST_REFERENCE: f64 = 1e-130;
/// Share of the rounding errors of the forces to which a step is solved. At rest, steps start from velocities that leave about these
/// errors; solved to all of them, velocity and pressure may be off their graph by more than the accuracy of pressures.
const ROUNDING_SHARE: f64 = 0.1;
/// Share of the forces of a step above which no residual counts as rounding errors, unless those of `K v` are as large.
const LARGEST_FLOOR: f64 = 1e-4;
/// The largest residual at which Newton's method stagnates by rounding errors, as a multiple of those of `K v`.
const STAGNANT: f64 = 4.0;

/// Number of factors with derivatives at velocities of a step after which Newton's method solves it.
const MOST_FACTORS: usize = 6;

/// A body that only contact holds flies away if it moves by more than this multiple of its size in a step.
const FAR: f64 = 1e3;
const FLIGHT: &str =
    "a body moves by more than a thousand times its size, so that rounding errors hide the forces on it";
const NO_FLIGHT: &str = "check the loads and the gap";

/// How accurately a step is solved, in N.
#[derive(Debug, Clone, Copy)]
struct Accuracy {
    /// The residual norm at which it counts as solved.
    tolerance: f64,
    /// The size of the forces, of those that drive obstacles, too.
    size: f64,
    /// The rounding errors of `K v` at the start.
    product: f64,
    /// The forces to which its residual is compared: not below those of which rounding errors are the tolerance.
    reference: f64,
}

/// The matrix for steps of one length, and its solver.
pub(super) struct StepSolver {
    settings: SolverSettings,
    /// The reason for the choice of the preconditioner.
    reason: String,
    /// A solver of the kind in use without a matrix, from which those with one are made.
    kind: Box<dyn LinearSolver>,
    /// Newton's method, unless steps are linear.
    newton: Option<Box<Newton>>,
    /// Corrections of condensed steps, if cells flow.
    flowing: Option<Box<FlowCorrections>>,
    /// The precision of the next factors: double after single precision has failed.
    precision: Precision,
    /// The matrix to which the preconditioner in use belongs.
    active: Option<Prepared>,
    /// The matrix of the step, if its length is not that of the preconditioner.
    step_matrix: Option<Matrix>,
    /// The lengths for which matrix and preconditioner are prepared.
    prepared: Option<Lengths>,
    /// Norm of the matrix in use in N s/m.
    matrix_norm: f64,
    /// The velocity from which a step with a factor in single precision was started.
    start: Option<DistributedVector>,
    /// Products with the matrix since the count of traffic was restarted, without those of PETSc's Krylov solver for linear steps.
    products: Cell<u64>,
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
        let like = &state.velocity;
        let kind: Box<dyn LinearSolver> = if can_condense(&settings, problem)? {
            Box::new(Condensed::new(session, body)?)
        } else {
            Box::new(Whole::new(session, body, like, &settings)?)
        };
        let (newton, flowing) = nonlinear(session, body, &*kind, like, &settings)?;
        Ok(Self {
            settings,
            reason,
            kind,
            newton,
            flowing,
            precision: problem.factor_precision(),
            active: None,
            step_matrix: None,
            prepared: None,
            matrix_norm: 0.0,
            start: None,
            products: Cell::new(0),
            cache: None,
            springs: Springs::default(),
        })
    }

    /// Whether steps are solved by Newton's method.
    pub(super) fn is_nonlinear(&self) -> bool {
        self.newton.is_some()
    }

    /// The preconditioner in use, and the reason for it.
    pub(super) fn preconditioner(&self) -> (Preconditioner, &str) {
        (self.settings.preconditioner, &self.reason)
    }

    /// The precision of factors, if steps are condensed to the contact.
    pub(super) fn factor_precision(&self) -> Option<Precision> {
        self.kind.precision().map(|_| self.precision)
    }

    /// Lets the next factors of condensed steps be in double precision.
    pub(super) fn use_double_precision(&mut self) {
        self.precision = Precision::Double;
    }

    /// Forgets factors with derivatives at velocities of earlier steps, so that the next step is solved as after a restart.
    pub(super) fn forget_tangents(&mut self) {
        if self.active.as_ref().is_some_and(|active| active.has_tangents) {
            (self.active, self.step_matrix, self.prepared) = (None, None, None);
        }
        self.cache.iter_mut().for_each(FactorCache::forget_tangents);
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
        // A condensed matrix is valid only for its own length, but where cells flow its factor preconditions Newton's method for nearby
        // lengths.
        let is_exact = self.kind.precision().is_some() && self.flowing.is_none();
        let length = if is_exact { lengths.matrix } else { lengths.cached };
        let mut is_new = false;
        if self.active.as_ref().is_none_or(|active| active.length != length) {
            let cached = self.cache.as_mut().and_then(|cache| cache.remove(length));
            self.store_active::<D>(session, body.mesh.total_nodes * D)?;
            is_new = cached.is_none();
            self.active = match cached {
                None => Some(self.set_up(session, body, length, like)?),
                cached => cached,
            };
        }
        if lengths.matrix != length || self.active.as_ref().is_some_and(|active| active.has_tangents) {
            let rows = matrix_rows(session, body, lengths.matrix)?;
            self.step_matrix = Some(session.agree(Matrix::symmetric(D, &rows))?);
        }
        self.matrix_norm = self.matrix()?.norm()?;
        set_reference_values(session, &mut body.contacts, like, self.matrix()?)?;
        if let (None, Some(Prepared { matrix, solver, .. })) = (&self.newton, &mut self.active) {
            let ksp = solver.krylov().linear_solver();
            ksp.set_matrices(self.step_matrix.as_ref().unwrap_or(matrix), matrix)?;
        }
        self.prepared = Some(lengths);
        Ok(is_new)
    }

    /// Stores the matrix in use with its preconditioner in the cache, for a body with this number of unknowns. Collective.
    fn store_active<const D: usize>(&mut self, session: &Session, unknowns: usize) -> Result<()> {
        let Some(active) = self.active.take() else { return Ok(()) };
        let cache = match &mut self.cache {
            Some(cache) => cache,
            none => {
                let bytes = 12.0 * active.matrix.stored_entries()?;
                let chosen = self.settings.preconditioner;
                let capacity = chosen.cache_capacity(D, unknowns, session.ranks(), bytes);
                none.insert(FactorCache::new(capacity - 1))
            }
        };
        cache.insert(active);
        Ok(())
    }

    /// Assembles the matrix of steps of this length in s and sets up a linear solver with it. Collective.
    fn set_up<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        length: f64,
        like: &DistributedVector,
    ) -> Result<Prepared> {
        let rows = matrix_rows(session, body, length)?;
        let matrix = session.agree(Matrix::symmetric(D, &rows))?;
        let rows = self.springs.add(session, body, (rows, length))?;
        let solver = self.kind.another(like)?;
        let mut prepared = Prepared { length, matrix, has_tangents: false, solver, scales: Vec::new() };
        if !self.complete(session, body, &mut prepared, rows, like)? {
            self.kind = Box::new(Whole::new(session, body, like, &self.settings)?);
            (self.newton, self.flowing) = nonlinear(session, body, &*self.kind, like, &self.settings)?;
            prepared.solver = self.kind.another(like)?;
            let rows = self.springs.rows(session, body, length)?;
            self.complete(session, body, &mut prepared, rows, like)?;
        }
        Ok(prepared)
    }

    /// Prepares a linear solver, and chooses the parameters of the graphs of contacts; returns whether it can solve the equations.
    /// Collective.
    fn complete<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &Body<D, S>,
        Prepared { matrix, solver, scales, .. }: &mut Prepared,
        rows: RowsWithSprings,
        like: &DistributedVector,
    ) -> Result<bool> {
        let has_coarse = self.settings.preconditioner == Preconditioner::Gamg && body.mesh.order() == 2;
        let coarse = if has_coarse {
            Some(session.agree(linear_subspace(session, &body.mesh, &body.held))?)
        } else {
            None
        };
        let coordinates = body.mesh.nodes[..body.mesh.owned].as_flattened();
        let assembled = Assembled { matrix, rows, precision: self.precision, coordinates, coarse };
        if !solver.prepare(session, assembled)? {
            return Ok(false);
        }
        self.precision = solver.precision().unwrap_or(self.precision);
        // Forces at the surface resist motions of single nodes, which a condensed matrix does not do.
        let is_stiffened = self.newton.as_ref().is_some_and(|newton| newton.flow.is_some());
        *scales = resistances(session, &body.contacts, like, |motion| match is_stiffened {
            true => StepMatrix::power(&*matrix, motion),
            false => solver.power(matrix, motion),
        })?;
        Ok(true)
    }

    /// The matrix of the step.
    fn matrix(&self) -> Result<&Matrix> {
        let of_length = self.active.as_ref().map(|active| &active.matrix);
        self.step_matrix.as_ref().or(of_length).ok_or_else(unassembled)
    }

    /// `y = K x`. Collective.
    pub(super) fn multiply(&self, x: &DistributedVector, y: &mut DistributedVector) -> Result<()> {
        self.matrix()?.multiply(x, y)
    }

    /// Restarts the count of traffic.
    pub(super) fn restart_traffic(&mut self) {
        self.products.set(0);
        self.active.iter_mut().for_each(|active| active.solver.restart_traffic());
    }

    /// Least number of bytes moved on this rank since then; `None` where they are not counted: cells that flow, PETSc's solver
    /// for variational inequalities, preconditioners of unknown size.
    pub(super) fn traffic(&mut self, ranks: usize) -> Result<Option<u64>> {
        let product = self.matrix()?.bytes_of_a_product()?;
        let Some(Prepared { solver, .. }) = &mut self.active else { return Ok(None) };
        let is_uncounted = |newton: &Newton| newton.flow.is_some() || newton.bounded.is_some();
        if self.flowing.is_some() || self.newton.as_deref().is_some_and(is_uncounted) {
            return Ok(None);
        }
        Ok(solver.traffic(ranks, product)?.map(|bytes| bytes + self.products.get() * product))
    }

    /// Applies the preconditioner. Collective.
    pub(super) fn precondition(&mut self, r: &DistributedVector, z: &mut DistributedVector) -> Result<()> {
        self.active.as_mut().ok_or_else(unassembled)?.solver.solve(r, z)
    }

    /// Solves a step from the velocity in `trial`, and writes the new one there. If it fails, it is repeated with a factor in
    /// double precision, from the solution on soft springs where contact alone holds a body, and with the tolerance that rounding errors
    /// of the solution allow. Collective.
    pub(super) fn solve<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        trial: &mut DistributedVector,
    ) -> Result<StepOutcome> {
        let (session, converged, forces) = (problem.session, problem.converged, problem.forces);
        let Accuracy { mut tolerance, size, product, reference } = self.accuracy(problem, trial)?;
        let slope = STAGNANT * f64::EPSILON * self.matrix_norm;
        let floor = Floor { slope, largest: (LARGEST_FLOOR * size).max(STAGNANT * product) };
        let (mut is_relaxed, mut is_pressed_on) = (false, false);
        // What is monotone stiffens the body: its derivatives may be part of a factor.
        let stiffens = problem.body.flows() && !problem.body.flows_beside_viscosity();
        let (mut factors, mut earlier) = (0, StepOutcome::default());
        loop {
            let is_replaceable = stiffens && factors < MOST_FACTORS;
            let Self { active, step_matrix, newton, flowing, start, products, springs, .. } = &mut *self;
            let Prepared { matrix, has_tangents, solver, scales, .. } =
                active.as_mut().ok_or_else(unassembled)?;
            let (solver, is_own) = (&mut **solver, step_matrix.is_none());
            let is_single = solver.precision() == Some(Precision::Single);
            if is_single {
                keep(trial, start)?;
            }
            let other = &CountedMatrix { matrix: &*matrix, products };
            let other: Option<&dyn StepMatrix> = if *has_tangents { Some(other) } else { None };
            let matrix = &CountedMatrix { matrix: step_matrix.as_ref().unwrap_or(matrix), products };
            let right_hand_side = forces;
            // Where contact alone holds a body, a direction may be any rigid motion, whose rounding errors hide that nothing holds it.
            let is_held = is_pressed_on || !springs.are_needed();
            let floor = if is_held { floor } else { Floor::default() };
            let system = System { matrix, right_hand_side, tolerance, floor, converged, scales };
            let solved = match (newton, flowing) {
                (None, _) => solve_linear(solver.krylov().linear_solver(), problem, system, trial),
                (Some(newton), None) => correct(newton, solver, problem, system, trial),
                (Some(newton), Some(flowing)) => {
                    let factored = Factored { solver: &mut *solver, other, is_replaceable };
                    let corrected = match is_own || *has_tangents {
                        true => flowing.correct(newton, factored, problem, system, trial),
                        false => Ok(Corrected::Unfinished(StepOutcome::default(), false)),
                    };
                    match corrected {
                        Ok(Corrected::Solved(outcome)) => Ok(earlier.followed_by(outcome)),
                        Ok(Corrected::Unfinished(work, has_progressed))
                            if is_replaceable && (has_progressed || factors == 0) =>
                        {
                            (factors, earlier) = (factors + 1, earlier.followed_by(work));
                            if !session.agree(self.refactor_with_tangents(problem, trial))? {
                                session.agree(self.refactor(problem))?;
                                factors = MOST_FACTORS;
                            }
                            continue;
                        }
                        Ok(Corrected::Unfinished(work, _)) => flowing
                            .solve_whole(solver, problem, system, trial)
                            .map(|outcome| earlier.followed_by(work).followed_by(outcome)),
                        Err(error) => Err(error),
                    }
                }
            };
            let solved = match session.agree(solved) {
                Ok(_) if self.springs.are_needed() && flies_away(problem, trial)? => {
                    session.agree(Err(problem.failed(FLIGHT, NO_FLIGHT)))
                }
                solved => solved,
            };
            let failure = match solved {
                Err(failure) if failure.is_failure() => failure,
                Ok(solved) => {
                    // Where only an obstacle moves the body, its forces are those with which the step begins.
                    let first = self.newton.as_ref().map_or(0.0, |newton| newton.first_residual());
                    let reference = reference.max(first);
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
                // Foundations that nothing presses on yet do not resist: start where springs bear the loads, or farther on in the same
                // direction where the gaps are closed. Dashpots, which bear less and less of a faster motion, resist most at rest.
                let are_dashpots = |contact: &Contact<D>| !contact.law.depends_on_displacement();
                match problem.body.contacts.iter().all(are_dashpots) {
                    true => trial.fill(0.0)?,
                    false => {
                        trial.copy_from(&solution)?;
                        let multiple = multiple_to_touch(session, problem.body, trial)?;
                        trial.scale(multiple)?;
                    }
                }
                restore_pressures(problem.body, problem.state)?;
                is_pressed_on = true;
                continue;
            }
            let floor = f64::EPSILON * self.matrix_norm * solution.norm()?;
            if !floor.is_finite() || floor <= tolerance || floor > LARGEST_FLOOR * size {
                return Err(self.springs.explain(failure));
            }
            if !self.is_nonlinear() {
                trial.copy_from(&solution)?;
            }
            (tolerance, is_relaxed) = (floor, true);
        }
    }

    /// How accurately a step is to be solved; refuses forces that are not finite. Sets the reference forces of the contacts.
    /// Collective.
    fn accuracy<const D: usize, const S: usize>(
        &self,
        problem: &mut StepProblem<'_, D, S>,
        start: &DistributedVector,
    ) -> Result<Accuracy> {
        let mut norm = problem.norm;
        if !norm.is_finite() {
            let remedy = "check loads and initial values; use smaller steps";
            return Err(problem.failed("the forces are not finite", remedy));
        }
        let StepProblem { session, body, scale, rounding, .. } = problem;
        if norm == 0.0 && !body.contacts.is_empty() {
            // Nothing but gaps that close sets the body in motion.
            let square = body.contacts.iter().map(Contact::square_of_closing_forces).sum();
            norm = session.sum([square])[0].sqrt();
            *scale = norm;
        }
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
        let size = if size > 0.0 { size.max(LEAST_REFERENCE) } else { 0.0 };
        let total = size * ((body.mesh.total_nodes * D) as f64).sqrt();
        // The forces that drive obstacles are among those of the step.
        let mut driving = 0.0;
        for contact in &mut body.contacts {
            let [along, _] = contact.driven();
            let own = along.map_or(0.0, |motion| motion.driving().abs());
            contact.reference.forces = total.max(own);
            driving = larger(driving, own);
        }
        let size = size_of(norm, *scale);
        let all = size.max(driving);
        let tolerance =
            (self.settings.tolerance * size).max(LEAST_FORCE).max(ROUNDING_SHARE * *rounding).max(product);
        let rounded = rounding.max(product).max(LEAST_FORCE);
        let reference = all.max(rounded / self.settings.tolerance);
        Ok(Accuracy { tolerance, size: all, product, reference })
    }

    /// Replaces the factor by one of the matrix with the derivatives of what cells add to the stress at this velocity; returns whether there
    /// is one. Collective.
    fn refactor_with_tangents<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        velocity: &DistributedVector,
    ) -> Result<bool> {
        let (Some(flowing), Some(mut prepared)) = (&mut self.flowing, self.active.take()) else {
            return Err(unassembled());
        };
        let tangents = flowing.tangents(problem, velocity)?;
        let (session, body, like) = (problem.session, &*problem.body, problem.forces);
        let Some(Lengths { matrix: length, .. }) = self.prepared else { return Err(unassembled()) };
        let rows = body.matrix_with(session, length, &tangents)?;
        let matrix = session.agree(Matrix::symmetric(D, &rows))?;
        let of_step = std::mem::replace(&mut prepared.matrix, matrix);
        self.step_matrix.get_or_insert(of_step);
        prepared.has_tangents = true;
        let rows = self.springs.add(session, body, (rows, length))?;
        let is_factored = self.complete(session, body, &mut prepared, rows, like)?;
        self.active = Some(prepared);
        Ok(is_factored)
    }

    /// Replaces the factor by one without derivatives, in the precision of the next factors. Collective.
    fn refactor<const D: usize, const S: usize>(&mut self, problem: &StepProblem<'_, D, S>) -> Result<()> {
        let Some(mut prepared) = self.active.take() else { return Err(unassembled()) };
        let (session, body, like) = (problem.session, &*problem.body, problem.forces);
        let rows = matrix_rows(session, body, prepared.length)?;
        if std::mem::take(&mut prepared.has_tangents) {
            prepared.matrix = session.agree(Matrix::symmetric(D, &rows))?;
            let is_of_step = self.prepared.is_some_and(|lengths| lengths.matrix == prepared.length);
            self.step_matrix = self.step_matrix.take().filter(|_| !is_of_step);
        }
        let rows = self.springs.add(session, body, (rows, prepared.length))?;
        self.complete(session, body, &mut prepared, rows, like)?;
        self.active = Some(prepared);
        Ok(())
    }

    /// Replaces a factor whose single precision was insufficient, and resets the step to its start. Collective.
    fn refactor_in_double<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        trial: &mut DistributedVector,
    ) -> Result<()> {
        if let Some(start) = &self.start {
            trial.copy_from(start)?;
        }
        restore_pressures(problem.body, problem.state)?;
        self.precision = Precision::Double;
        self.refactor(problem)
    }
}

/// Whether the mean motion in the step at these velocities is a flight. Collective.
fn flies_away<const D: usize, const S: usize>(
    problem: &StepProblem<'_, D, S>,
    velocity: &DistributedVector,
) -> Result<bool> {
    let body = &*problem.body;
    let Some(contact) = body.contacts.first() else { return Ok(false) };
    let way = problem.step.length * velocity.norm()? / (body.mesh.total_nodes as f64).sqrt();
    Ok(way > FAR * contact.body_size())
}

fn unassembled() -> Error {
    Error::Internal("a matrix was requested before it was assembled".into())
}

/// Copies a vector to another, which it creates if there is none.
fn keep(from: &DistributedVector, to: &mut Option<DistributedVector>) -> Result<()> {
    match to {
        Some(to) => to.copy_from(from),
        none => none.insert(from.like()?).copy_from(from),
    }
}

/// Whether all unknowns except the motions of contact nodes are eliminated.
fn can_condense(settings: &SolverSettings, problem: ProblemSize) -> Result<bool> {
    Ok(settings.preconditioner == Preconditioner::Cholesky
        && settings.method == Method::Newton
        && problem.is_condensed()
        && !has_option("pc_type")?
        && !has_option("ksp_type")?)
}

/// Newton's method and flow corrections, where they are needed.
type Nonlinear = (Option<Box<Newton>>, Option<Box<FlowCorrections>>);

/// Newton's method for a body with this kind of linear solver, and corrections of condensed steps in which cells flow; nothing if its steps
/// are linear. Vectors have the layout of `like`. Collective.
fn nonlinear<const D: usize, const S: usize>(
    session: &Session,
    body: &Body<D, S>,
    solver: &dyn LinearSolver,
    like: &DistributedVector,
    settings: &SolverSettings,
) -> Result<Nonlinear> {
    if body.contacts.is_empty() && !body.flows() {
        return Ok((None, None));
    }
    let mut newton = Box::new(Newton::new(solver.unknowns(like), &body.contacts, settings)?);
    if settings.method == Method::Vinewtonrsls {
        session.agree(bounded::refuse_other_contacts(body))?;
        if body.flows() {
            return Err(Error::Refused(
                "[solver] method = \"vinewtonrsls\" does not support viscoplastic flow, damage, adhesion or contact memory at the end of a step, nor a viscosity \
                 that is a formula; use method = \"newton\" or, without such a viscosity, [time] scheme = \"lagged_euler\""
                    .into(),
            ));
        }
        newton.bounded = Some(Bounded::new(like, settings)?);
    }
    let mut flowing = None;
    if body.only_surface_acts() && solver.precision().is_some() {
        let nodes = body.contact_nodes().iter().map(|contact| contact.node).collect();
        newton.flow = Some(Flow::at_nodes(like, solver.unknowns(like), nodes)?);
    } else if body.flows() && solver.precision().is_some() {
        flowing = Some(Box::new(FlowCorrections::new(like, settings, !body.flows_beside_viscosity())?));
    } else if body.flows() {
        newton.flow = Some(Flow::new(like)?);
    }
    Ok((Some(newton), flowing))
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
