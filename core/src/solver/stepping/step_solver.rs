//! The matrix of a step and its solver.

mod attempts;

use super::{
    bounded::{self, Bounded},
    condensed::Condensed,
    equations::StepMatrix,
    factor_cache::{FactorCache, Prepared},
    flow::Flow,
    flow_corrections::FlowCorrections,
    linear_solver::{Method, Preconditioner, ProblemSize, SolverSettings},
    newton::Newton,
    problem::StepProblem,
    resistance::{resistances, set_reference_values},
    solver::{Assembled, LinearSolver},
    springs::{RowsWithSprings, Springs},
    whole::Whole,
};
use crate::{
    error::{Error, Result},
    fem::{body::Body, space::linear_subspace, state::State},
    linear_algebra::petsc::{BlockRows, DistributedVector, Matrix, Precision, has_option},
    parallel::{agreement::Agreed, session::Session},
};
use std::{
    cell::Cell,
    time::{Duration, Instant},
};

/// The length of a step, and the length of the steps for which its preconditioner is set up, both as used in matrices, in s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Lengths {
    pub matrix: f64,
    pub cached: f64,
}

/// With friction, the least parameters of graphs relative to the resistance of a boundary that moves alone: a whole body on soft supports
/// resists hardly at all, and unknowns would be so much larger than velocities, which are differences of them, that these lose their digits.
const LEAST_RESISTANCE: f64 = 0.4;

/// The matrix for steps of one length, and its solver.
pub struct StepSolver {
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
    /// A matrix with derivatives of what cells add to the stress at a velocity, where a step needed one.
    with_tangents: Option<Prepared>,
    /// The matrix of the step, if its length is not that of the preconditioner.
    step_matrix: Option<Matrix>,
    /// The lengths for which matrix and preconditioner are prepared.
    pub(super) prepared: Option<Lengths>,
    /// Norm of the matrix in use in N s/m.
    matrix_norm: f64,
    /// The velocity from which a step with a factor in single precision, or of a body that softens, was started.
    start: Option<DistributedVector>,
    /// The velocity from which the last step was first started in which contact alone holds a body.
    first_start: Option<DistributedVector>,
    /// Products with the matrix since the count of traffic was restarted, without those of PETSc's Krylov solver for linear steps.
    products: Cell<u64>,
    /// Matrices with preconditioners that are not in use.
    cache: Option<FactorCache>,
    /// Time spent on factors with derivatives at velocities of steps, until it is taken.
    pub(super) refactoring: Duration,
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
            with_tangents: None,
            step_matrix: None,
            prepared: None,
            matrix_norm: 0.0,
            start: None,
            first_start: None,
            products: Cell::new(0),
            cache: None,
            refactoring: Duration::ZERO,
            springs: Springs::default(),
        })
    }

    /// Whether steps are solved by Newton's method.
    pub fn is_nonlinear(&self) -> bool {
        self.newton.is_some()
    }

    /// The preconditioner in use, and the reason for it.
    pub fn preconditioner(&self) -> (Preconditioner, &str) {
        (self.settings.preconditioner, &self.reason)
    }

    /// The precision of factors, if steps are condensed to the contact.
    pub fn factor_precision(&self) -> Option<Precision> {
        self.kind.precision().map(|_| self.precision)
    }

    /// Lets the next factors of condensed steps be in double precision.
    pub fn use_double_precision(&mut self) {
        self.precision = Precision::Double;
    }

    /// Forgets factors with derivatives at velocities of earlier steps, so that the next step is solved as after a restart.
    pub fn forget_tangents(&mut self) {
        self.with_tangents = None;
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
            self.with_tangents = None;
            self.store_active::<D>(session, body.mesh.total_nodes * D)?;
            is_new = cached.is_none();
            self.active = match cached {
                None => Some(self.set_up(session, body, length, like)?),
                cached => cached,
            };
        }
        if lengths.matrix != length {
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
        let mut prepared = Prepared { length, matrix, solver, scales: Vec::new() };
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
        let is_multigrid = self.settings.preconditioner == Preconditioner::Gamg;
        let has_coarse = is_multigrid && body.mesh.order() == 2;
        let coarse = if has_coarse {
            Some(session.agree(linear_subspace(session, &body.mesh, &body.held))?)
        } else {
            None
        };
        let coordinates = body.mesh.nodes[..body.mesh.owned].as_flattened();
        let rigid_motions = if is_multigrid && !has_coarse { body.common_rigid_motions() } else { None };
        let precision = self.precision;
        let assembled = Assembled { matrix, rows, precision, coordinates, rigid_motions, coarse };
        if !solver.prepare(session, assembled)? {
            return Ok(false);
        }
        self.precision = solver.precision().unwrap_or(self.precision);
        // Forces at the surface resist motions of single nodes, which a condensed matrix does not do.
        let is_stiffened = self.newton.as_ref().is_some_and(|newton| newton.flow.is_some());
        let rubs = body.contacts.iter().any(|contact| contact.friction.is_some());
        *scales = resistances(session, &body.contacts, like, |motion| match (is_stiffened, rubs) {
            (true, _) => StepMatrix::power(&*matrix, motion),
            (false, false) => solver.power(matrix, motion),
            (false, true) => {
                let alone = StepMatrix::power(&*matrix, motion)?;
                Ok(solver.power(matrix, motion)?.max(LEAST_RESISTANCE * alone))
            }
        })?;
        Ok(true)
    }

    /// The matrix of the step.
    fn matrix(&self) -> Result<&Matrix> {
        let of_length = self.active.as_ref().map(|active| &active.matrix);
        self.step_matrix.as_ref().or(of_length).ok_or_else(unassembled)
    }

    /// `y = K x`. Collective.
    pub fn multiply(&self, x: &DistributedVector, y: &mut DistributedVector) -> Result<()> {
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
    pub fn precondition(&mut self, r: &DistributedVector, z: &mut DistributedVector) -> Result<()> {
        self.active.as_mut().ok_or_else(unassembled)?.solver.solve(r, z)
    }

    /// Factors the matrix with the derivatives of what cells add to the stress at this velocity; returns whether it has a factor. Collective.
    fn refactor_with_tangents<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        velocity: &DistributedVector,
    ) -> Result<bool> {
        let (Some(flowing), Some(Lengths { matrix: length, .. })) = (&mut self.flowing, self.prepared) else {
            return Err(unassembled());
        };
        let began = Instant::now();
        let tangents = flowing.tangents(problem, velocity)?;
        let (session, body, like) = (problem.session, &*problem.body, problem.forces);
        let rows = body.matrix_with(session, length, &tangents)?;
        let matrix = session.agree(Matrix::symmetric(D, &rows))?;
        let rows = self.springs.add(session, body, (rows, length))?;
        let solver = match self.with_tangents.take() {
            Some(last) => last.solver,
            None => self.kind.another(like)?,
        };
        let mut prepared = Prepared { length, matrix, solver, scales: Vec::new() };
        let is_factored = match session.agree(self.complete(session, body, &mut prepared, rows, like)) {
            // Where the flow softens, its derivatives may make the matrix indefinite.
            Err(error) if error.is_failure() => false,
            is_factored => is_factored?,
        };
        self.with_tangents = is_factored.then_some(prepared);
        self.refactoring += began.elapsed();
        Ok(is_factored)
    }

    /// Factors the matrix again, in the precision of the next factors. Collective.
    fn refactor<const D: usize, const S: usize>(&mut self, problem: &StepProblem<'_, D, S>) -> Result<()> {
        let Some(mut prepared) = self.active.take() else { return Err(unassembled()) };
        let (session, body, like) = (problem.session, &*problem.body, problem.forces);
        let rows = matrix_rows(session, body, prepared.length)?;
        let rows = self.springs.add(session, body, (rows, prepared.length))?;
        self.complete(session, body, &mut prepared, rows, like)?;
        self.active = Some(prepared);
        Ok(())
    }
}

fn unassembled() -> Error {
    Error::Internal("a matrix was requested before it was assembled".into())
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
        flowing = Some(Box::new(FlowCorrections::new(like, settings)?));
    } else if body.flows() {
        newton.flow = Some(Flow::new(like)?);
    }
    Ok((Some(newton), flowing))
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
