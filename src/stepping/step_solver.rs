//! The matrix of a step with its solver.

use super::{
    bounded::{self, Bounded},
    condensed::Condensed,
    flow::{Flow, FlowStart},
    linear_solver::{LINEAR_ITERATIONS, Method, Preconditioner, Service, SolverSettings},
    newton::{From, Newton, REMEDY, Task, failed},
    stepper::StepOutcome,
};
use crate::{
    body::Body,
    effect::{Contact, Step},
    error::{Error, Result},
    petsc::{DistributedVector, Ksp, Matrix, has_option},
    session::Session,
    state::State,
};

/// Motions of contact nodes whose dense matrix costs no more than the factorisation.
const MOST_MOTIONS: usize = 4_000;

/// What a step brings to its solution.
pub(super) struct Known<'a> {
    /// The right-hand side in N.
    pub forces: &'a DistributedVector,
    /// The least residual norm in N that means something.
    pub rounding: f64,
    /// Where the displacement starts, if stresses are those at the end of the step.
    pub start: Option<FlowStart<'a>>,
}

/// The solver of a linear or of a nonlinear step: only the one that is needed exists.
enum Solver {
    Linear(Ksp),
    Newton(Box<Newton>),
    Condensed(Box<Condensed>),
}

/// The matrix for steps of one length, and what solves with it.
pub(super) struct StepSolver {
    settings: SolverSettings,
    matrix: Option<(f64, Matrix)>,
    /// Norm of the matrix in N s/m.
    matrix_norm: f64,
    solver: Solver,
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
        let preconditioner = settings.preconditioner.resolve(Service {
            dimension: D,
            unknowns,
            ranks: session.ranks(),
            steps: settings.steps,
        });
        let flows = body.flows();
        let solver = if body.contacts.is_empty() && !flows {
            let mut ksp = Ksp::new("")?;
            preconditioner.configure(&mut ksp, session.ranks(), unknowns)?;
            ksp.start_from_solution()?;
            ksp.apply_options()?;
            Solver::Linear(ksp)
        } else {
            Self::choose_newton(session, body, state, settings, preconditioner)?
        };
        Ok(Self {
            settings: SolverSettings { preconditioner, ..settings },
            matrix: None,
            matrix_norm: 0.0,
            solver,
        })
    }

    /// Newton's method on the contact alone, where all else can be eliminated, or on the whole body.
    fn choose_newton<const D: usize, const S: usize>(
        session: &Session,
        body: &Body<D, S>,
        state: &State,
        settings: SolverSettings,
        preconditioner: Preconditioner,
    ) -> Result<Solver> {
        let unknowns = body.mesh.total_nodes * D;
        let whole = session.ranks() == 1 || preconditioner.is_redundant(session.ranks(), unknowns);
        let chosen = has_option("pc_type")? || has_option("ksp_type")?;
        if preconditioner == Preconditioner::Cholesky
            && settings.method == Method::Newton
            && whole
            && !chosen
            && !body.flows()
            && !body.contacts.iter().any(Contact::needs_ghosts)
            && Condensed::motions_of(session, body) <= MOST_MOTIONS
        {
            let condensed = Condensed::new(session, body, state.contact_traction.is_some())?;
            return Ok(Solver::Condensed(Box::new(condensed)));
        }
        Self::whole_newton(session, body, &state.velocity, settings, preconditioner)
    }

    /// Newton's method on the whole body, for velocities laid out like `like`.
    fn whole_newton<const D: usize, const S: usize>(
        session: &Session,
        body: &Body<D, S>,
        like: &DistributedVector,
        settings: SolverSettings,
        preconditioner: Preconditioner,
    ) -> Result<Solver> {
        let unknowns = body.mesh.total_nodes * D;
        let mut newton = Newton::new(like, &body.contacts)?;
        preconditioner.configure(newton.linear_solver.linear_solver(), session.ranks(), unknowns)?;
        newton.linear_solver.linear_solver().apply_options()?;
        newton.linear_solver.set_patience(preconditioner.patience(D));
        if body.flows() {
            newton.flow = Some(Flow::new(like)?);
        }
        if settings.method == Method::VariationalInequality {
            session.agree(bounded::refuse(body))?;
            if body.flows() {
                return Err(Error::Refused(
                    "[solver] method = \"vinewtonrsls\" knows no flow at the end of a step: use method = \"newton\" or \
                     [time] scheme = \"lagged_euler\""
                        .into(),
                ));
            }
            newton.bounded = Some(Bounded::new(like)?);
        }
        Ok(Solver::Newton(Box::new(newton)))
    }

    /// Whether steps are solved by Newton's method.
    pub fn is_nonlinear(&self) -> bool {
        !matches!(self.solver, Solver::Linear(_))
    }

    /// The preconditioner in use.
    pub fn preconditioner(&self) -> Preconditioner {
        self.settings.preconditioner
    }

    /// Whether the matrix is that of this length.
    pub fn is_prepared_for(&self, length: f64) -> bool {
        self.matrix.as_ref().is_some_and(|(known, _)| *known == length)
    }

    /// Assembles the matrix of this length and sets its preconditioner up; `like` is laid out as velocities are. Collective.
    pub fn prepare<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        length: f64,
        like: &DistributedVector,
    ) -> Result<()> {
        self.matrix = None;
        let rows = session.agree(body.matrix(session, length))?;
        let mut matrix = session.agree(Matrix::symmetric(D, &rows))?;
        if let Solver::Condensed(condensed) = &mut self.solver {
            if condensed.prepare(session, body, rows)? {
                self.matrix_norm = matrix.norm()?;
                self.matrix = Some((length, matrix));
                return Ok(());
            }
            let (settings, chosen) = (self.settings, self.settings.preconditioner);
            self.solver = Self::whole_newton(session, body, like, settings, chosen)?;
        } else {
            drop(rows);
        }
        if self.settings.preconditioner == Preconditioner::Gamg {
            let coordinates = body.mesh.nodes[..body.mesh.owned].as_flattened();
            matrix.attach_rigid_motions(D, coordinates)?;
        }
        match &mut self.solver {
            Solver::Linear(ksp) => {
                ksp.set_matrix(&matrix)?;
                session.agree(ksp.set_up())?;
            }
            Solver::Newton(newton) => {
                session.agree(newton.linear_solver.set_constant(&matrix))?;
                session.agree(newton.linear_solver.linear_solver().set_up())?;
                newton.choose_scales(session, &body.contacts, like, &matrix)?;
            }
            Solver::Condensed(_) => {}
        }
        self.matrix_norm = matrix.norm()?;
        self.matrix = Some((length, matrix));
        Ok(())
    }

    /// `y = K x`. Collective.
    pub fn multiply(&self, x: &DistributedVector, y: &mut DistributedVector) -> Result<()> {
        let Some((_, matrix)) = &self.matrix else {
            return Err(Error::Internal("a product was asked for before the matrix was assembled".into()));
        };
        matrix.multiply(x, y)
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
        // No residual below the rounding of `K v` is asked for, however small the forces that are left.
        let product = f64::EPSILON * self.matrix_norm * trial.norm()?;
        let tolerance = (self.settings.tolerance * norm).max(f64::MIN_POSITIVE).max(rounding).max(product);
        let solved = self.solve_to(session, body, state, (step, start), (forces, tolerance), trial);
        let Err(Error::Failed(_)) = &solved else { return solved };
        // The start may be much less than the solution, above all at rest.
        let mut answer = forces.like()?;
        self.precondition(forces, &mut answer)?;
        let floor = f64::EPSILON * self.matrix_norm * answer.norm()?;
        if floor.is_finite() && floor > tolerance {
            if !self.is_nonlinear() {
                trial.copy_from(&answer)?;
            }
            return self.solve_to(session, body, state, (step, start), (forces, floor), trial);
        }
        solved
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
        let Some((_, matrix)) = &self.matrix else {
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
            Solver::Condensed(condensed) => condensed.solve(session, body, from, task, trial),
        }
    }
}
