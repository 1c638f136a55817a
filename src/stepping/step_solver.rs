//! The matrix of a step with its solver.

use super::{
    bounded::{self, Bounded},
    equations::Scratch,
    flow::{Flow, FlowStart},
    linear_solver::{LINEAR_ITERATIONS, Method, Preconditioner, SolverSettings},
    newton::{Newton, REMEDY, Task, failed},
    stepper::StepOutcome,
};
use crate::{
    body::Body,
    effect::Step,
    error::{Error, Result},
    petsc::{DistributedVector, Ksp, Matrix, ProjectedKsp, Snes, has_option},
    session::Session,
    state::State,
};

/// Linear solves stop at this share of what the step needs.
const LINEAR_SHARE: f64 = 0.3;
/// First linear solves of a step reduce their residual by this factor only, while branches may still change.
const LINEAR_REDUCTION: f64 = 1e-3;

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
        let preconditioner = settings.preconditioner.resolve(D, unknowns);
        let flows = body.flows();
        let solver = if body.contacts.is_empty() && !flows {
            let mut ksp = Ksp::new("")?;
            preconditioner.configure(&mut ksp, session.ranks(), unknowns)?;
            ksp.start_from_solution()?;
            ksp.apply_options()?;
            Solver::Linear(ksp)
        } else {
            let mut snes = Snes::new("", &state.velocity, D)?;
            snes.apply_options()?;
            let mut linear_solver = ProjectedKsp::new("", &state.velocity, D)?;
            preconditioner.configure(linear_solver.linear_solver(), session.ranks(), unknowns)?;
            linear_solver.linear_solver().apply_options()?;
            let flow = if flows { Some(Flow::new(&state.velocity)?) } else { None };
            let scratch = Scratch::new(&state.velocity, &body.contacts)?;
            let (before, after, scales) = (Vec::new(), Vec::new(), Vec::new());
            let bounded = match settings.method {
                Method::Newton => None,
                Method::VariationalInequality => {
                    session.agree(bounded::refuse(body))?;
                    if flows {
                        return Err(Error::Refused(
                            "[solver] method = \"vinewtonrsls\" knows no flow at the end of a step: use method = \"newton\" or \
                             [time] scheme = \"lagged_euler\""
                                .into(),
                        ));
                    }
                    Some(Bounded::new(&state.velocity)?)
                }
            };
            linear_solver.set_patience(preconditioner.patience(D));
            let (start, chosen_search) = (state.velocity.like()?, has_option("snes_linesearch_type")?);
            Solver::Newton(Box::new(Newton {
                snes,
                bounded,
                linear_solver,
                scratch,
                before,
                after,
                scales,
                start,
                chosen_search,
                flow,
            }))
        };
        Ok(Self {
            settings: SolverSettings { preconditioner, ..settings },
            matrix: None,
            matrix_norm: 0.0,
            solver,
        })
    }

    /// Whether steps are solved by Newton's method.
    pub fn is_nonlinear(&self) -> bool {
        matches!(self.solver, Solver::Newton(_))
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
        body: &Body<D, S>,
        length: f64,
        like: &DistributedVector,
    ) -> Result<()> {
        self.matrix = None;
        let rows = session.agree(body.matrix(session, length))?;
        let mut matrix = session.agree(Matrix::symmetric(D, &rows))?;
        drop(rows);
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
        match &mut self.solver {
            Solver::Linear(ksp) => {
                ksp.set_tolerances(0.0, tolerance, LINEAR_ITERATIONS)?;
                let outcome = session.agree(ksp.solve(forces, trial))?;
                if !outcome.converged() {
                    return Err(failed(step, outcome.words(), REMEDY));
                }
                Ok(StepOutcome { linear_iterations: outcome.iterations, ..StepOutcome::default() })
            }
            Solver::Newton(newton) => {
                newton.linear_solver.set_tolerances(
                    LINEAR_REDUCTION,
                    LINEAR_SHARE * tolerance,
                    LINEAR_ITERATIONS,
                )?;
                let (right_hand_side, settings) = (forces, self.settings);
                let task = Task { step, matrix, right_hand_side, tolerance, settings, flow: start };
                newton.solve(session, body, state, task, trial)
            }
        }
    }
}
