//! The matrix of a step with its solver.

use super::{
    bounded::{self, Bounded},
    equations::Scratch,
    flow::{Flow, FlowStart},
    linear_solver::{LINEAR_ITERATIONS, Method, Preconditioner, SolverSettings},
    newton::{Newton, REMEDY, Task, failed},
    rungs::{self, Krylov, Rung, Rungs},
    stepper::StepOutcome,
};
use crate::{
    body::Body,
    effect::Step,
    error::{Error, Result},
    petsc::{DistributedVector, Ksp, Matrix, Snes, has_option},
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
pub(super) enum Solver {
    Linear(Ksp),
    Newton(Box<Newton>),
}

/// A step's length with the length of the rung whose preconditioner serves it, both as matrices have them, in s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Lengths {
    pub matrix: f64,
    pub rung: f64,
}

/// The matrix for steps of one length, and what solves with it.
pub(super) struct StepSolver {
    settings: SolverSettings,
    /// The matrix that the preconditioner in use is of.
    rung: Option<(f64, Matrix)>,
    /// The matrix of steps that are of no rung's length.
    between: Option<(f64, Matrix)>,
    /// Norm of the matrix in use in N s/m.
    matrix_norm: f64,
    solver: Solver,
    /// What else is kept.
    rungs: Option<Rungs>,
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
            Solver::Linear(rungs::linear(session, preconditioner, unknowns)?)
        } else {
            let mut snes = Snes::new("", &state.velocity, D)?;
            snes.apply_options()?;
            let linear_solver = rungs::projected::<D>(session, preconditioner, unknowns, &state.velocity)?;
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
            rung: None,
            between: None,
            matrix_norm: 0.0,
            solver,
            rungs: None,
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

    /// Whether the matrices are those of these lengths.
    pub fn is_prepared_for(&self, lengths: Lengths) -> bool {
        let length = |matrix: &Option<(f64, Matrix)>| matrix.as_ref().map(|(length, _)| *length);
        let rung = length(&self.rung);
        rung == Some(lengths.rung) && length(&self.between).or(rung) == Some(lengths.matrix)
    }

    /// Assembles the matrix of this length and sets the preconditioner of its rung up, unless they are there; says whether a
    /// preconditioner was made. `like` is laid out as velocities are. Collective.
    pub fn prepare<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &Body<D, S>,
        lengths: Lengths,
        like: &DistributedVector,
    ) -> Result<bool> {
        self.between = None;
        let made = self.rung.as_ref().is_none_or(|(known, _)| *known != lengths.rung)
            && self.change_rung(session, body, lengths.rung, like)?;
        if lengths.matrix != lengths.rung {
            self.between = Some((lengths.matrix, assembled(session, body, lengths.matrix)?));
        }
        self.matrix_norm = self.matrix()?.norm()?;
        if let (Solver::Linear(ksp), Some((_, rung))) = (&mut self.solver, &self.rung) {
            ksp.set_matrices(self.between.as_ref().map_or(rung, |(_, matrix)| matrix), rung)?;
        }
        Ok(made)
    }

    /// Brings the rung of this length into use; says whether it had to be made. Collective.
    fn change_rung<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &Body<D, S>,
        length: f64,
        like: &DistributedVector,
    ) -> Result<bool> {
        let (chosen, unknowns) = (self.settings.preconditioner, body.mesh.total_nodes * D);
        let found = self.rungs.as_mut().and_then(|rungs| rungs.take(length));
        let (is_there, mut next) = match found {
            Some(Rung { matrix, krylov, .. }) => (Some(matrix), Some(krylov)),
            None => (None, None),
        };
        if let Some((length, matrix)) = self.rung.take() {
            let rungs = match &mut self.rungs {
                Some(rungs) => rungs,
                none => {
                    let bytes = 12.0 * matrix.stored_entries()?;
                    let kept = chosen.kept(D, unknowns, session.ranks(), bytes);
                    none.insert(Rungs::new(kept - 1))
                }
            };
            let mut krylov = match next.take() {
                Some(krylov) => krylov,
                None => Krylov::another::<D>(&self.solver, session, chosen, unknowns, like)?,
            };
            krylov.exchange(&mut self.solver);
            rungs.put(Rung { length, matrix, krylov });
        }
        if let Some(matrix) = is_there {
            self.rung = Some((length, matrix));
            return Ok(false);
        }
        let mut matrix = assembled(session, body, length)?;
        if chosen == Preconditioner::Gamg {
            let coordinates = body.mesh.nodes[..body.mesh.owned].as_flattened();
            matrix.attach_rigid_motions(D, coordinates)?;
        }
        match &mut self.solver {
            Solver::Linear(ksp) => {
                ksp.set_matrices(&matrix, &matrix)?;
                session.agree(ksp.set_up())?;
            }
            Solver::Newton(newton) => {
                session.agree(newton.linear_solver.set_constant(&matrix))?;
                session.agree(newton.linear_solver.linear_solver().set_up())?;
                newton.choose_scales(session, &body.contacts, like, &matrix)?;
            }
        }
        self.rung = Some((length, matrix));
        Ok(true)
    }

    /// The matrix in use.
    fn matrix(&self) -> Result<&Matrix> {
        let unprepared = || Error::Internal("a matrix was asked for before it was assembled".into());
        self.between.as_ref().or(self.rung.as_ref()).map(|(_, matrix)| matrix).ok_or_else(unprepared)
    }

    /// `y = K x`. Collective.
    pub fn multiply(&self, x: &DistributedVector, y: &mut DistributedVector) -> Result<()> {
        self.matrix()?.multiply(x, y)
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
        let Some((_, matrix)) = self.between.as_ref().or(self.rung.as_ref()) else {
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

/// The matrix of a length. Collective.
fn assembled<const D: usize, const S: usize>(
    session: &Session,
    body: &Body<D, S>,
    length: f64,
) -> Result<Matrix> {
    let rows = session.agree(body.matrix(session, length))?;
    session.agree(Matrix::symmetric(D, &rows))
}
