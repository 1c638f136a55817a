//! The scheme of Wang and Cheng (2022), (24)-(25): backward difference for inertia, implicit viscosity and contact,
//! elastic and viscoplastic stress from the step before.
//!
//! ```text
//! H_n = H_{n-1} + k G(s_{n-1}),   s_n = E e(u_{n-1}) + H_n
//! (1/k) M (v_n - v_{n-1}) + A v_n + C(v_n) + B^T s_n = f_n
//! u_n = u_{n-1} + k v_n,          sigma_n = A e(v_n) + s_n
//! ```

use super::{
    bounded::{self, Bounded},
    equations::Scratch,
    linear_solver::{LINEAR_ITERATIONS, Method, Preconditioner, SolverSettings},
    newton::{Newton, REMEDY, Task, failed},
};
use crate::{
    body::Body,
    effect::{Energy, PointCount, Step},
    error::{Error, Result},
    petsc::{DistributedVector, Ksp, Matrix, ProjectedKsp, Snes, Stage, has_option},
    session::Session,
    state::State,
};
use std::time::{Duration, Instant};

/// Linear solves stop at this share of what the step needs.
const LINEAR_SHARE: f64 = 0.3;
/// First linear solves of a step reduce their residual by this factor only, while branches may still change.
const LINEAR_REDUCTION: f64 = 1e-3;

/// What a step cost and how well it was solved.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StepOutcome {
    /// Newton iterations; 0 where a step is linear.
    pub newton_iterations: usize,
    /// Krylov iterations.
    pub linear_iterations: usize,
    /// Contact points that changed their branch, over all ranks.
    pub active_changes: usize,
    /// Contact points by what happens there, over all ranks.
    pub points: PointCount,
    /// Linear systems that were not positive definite, so that GMRES had to solve them.
    pub indefinite_solves: usize,
    /// Largest scaled distance to the contact graphs.
    pub inclusion_residual: f64,
    /// Energies of the step, over all ranks.
    pub energy: Energy,
}

/// Seconds spent by phase.
#[derive(Debug, Clone, Copy, Default)]
pub struct StepClock {
    /// Explicit stress, history and forces.
    pub history: Duration,
    /// Newton and linear solves.
    pub solve: Duration,
    /// Energy balance and certificates of the step.
    pub balance: Duration,
    /// Matrix assembly and preconditioner, whenever the step length changes.
    pub assembly: Duration,
    /// The part of `assembly` before the first step.
    pub first_assembly: Duration,
}

/// Stages of PETSc's `-log_view`.
struct Stages {
    assembly: Stage,
    history: Stage,
    solve: Stage,
    balance: Stage,
}

impl Stages {
    fn register() -> Result<Self> {
        Ok(Self {
            assembly: Stage::register("assembly")?,
            history: Stage::register("history")?,
            solve: Stage::register("solve")?,
            balance: Stage::register("balance")?,
        })
    }
}

/// The solver of a linear or of a nonlinear step: only the one that is needed exists.
enum Solver {
    Linear(Ksp),
    Newton(Box<Newton>),
}

/// The scheme with its matrix, solver and work vectors.
pub struct LaggedEuler {
    settings: SolverSettings,
    stages: Stages,
    matrix: Option<(f64, Matrix)>,
    solver: Solver,
    load: Option<DistributedVector>,
    load_is_current: bool,
    right_hand_side: DistributedVector,
    trial: DistributedVector,
    /// Seconds by phase.
    pub clock: StepClock,
}

impl LaggedEuler {
    /// Prepares the vectors and the solver; the matrix comes with the first step. Collective.
    pub fn new<const D: usize, const S: usize>(
        session: &Session,
        body: &Body<D, S>,
        state: &State,
        settings: SolverSettings,
    ) -> Result<Self> {
        let unknowns = body.mesh.total_nodes * D;
        let preconditioner = settings.preconditioner.resolve(D, unknowns);
        let solver = if body.contacts.is_empty() {
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
            let scratch = Scratch::new(&state.velocity, &body.contacts)?;
            let (before, after, scales) = (Vec::new(), Vec::new(), Vec::new());
            let bounded = match settings.method {
                Method::Newton => None,
                Method::VariationalInequality => {
                    session.agree(bounded::refuse(body))?;
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
            }))
        };
        Ok(Self {
            settings: SolverSettings { preconditioner, ..settings },
            stages: Stages::register()?,
            matrix: None,
            solver,
            load: if body.load.is_empty() { None } else { Some(state.velocity.like()?) },
            load_is_current: false,
            right_hand_side: state.velocity.like()?,
            trial: state.velocity.like()?,
            clock: StepClock::default(),
        })
    }

    /// Whether steps are solved by Newton's method.
    pub fn is_nonlinear(&self) -> bool {
        matches!(self.solver, Solver::Newton(_))
    }

    /// Whether a vector of nodal loads exists.
    pub fn has_load(&self) -> bool {
        self.load.is_some()
    }

    /// The preconditioner in use.
    pub fn preconditioner(&self) -> Preconditioner {
        self.settings.preconditioner
    }

    /// Assembles the matrix for steps of this length, if the last one was of another. Collective.
    pub fn prepare_length<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &Body<D, S>,
        length: f64,
    ) -> Result<()> {
        if self.matrix.as_ref().is_some_and(|(known, _)| *known == length) {
            return Ok(());
        }
        let start = Instant::now();
        let _stage = self.stages.assembly.enter()?;
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
                newton.choose_scales(session, &body.contacts, &self.right_hand_side, &matrix)?;
            }
        }
        self.matrix = Some((length, matrix));
        self.clock.assembly += start.elapsed();
        if self.clock.first_assembly.is_zero() {
            self.clock.first_assembly = self.clock.assembly;
        }
        Ok(())
    }

    /// `y = K x` with the matrix in use, which must be assembled. Collective.
    pub fn multiply(&self, x: &DistributedVector, y: &mut DistributedVector) -> Result<()> {
        let Some((_, matrix)) = &self.matrix else {
            return Err(Error::Internal("a product was asked for before the matrix was assembled".into()));
        };
        matrix.multiply(x, y)
    }

    /// Applies the preconditioner of the matrix in use. Collective.
    pub fn precondition(&mut self, r: &DistributedVector, z: &mut DistributedVector) -> Result<()> {
        match &mut self.solver {
            Solver::Linear(ksp) => ksp.precondition(r, z),
            Solver::Newton(newton) => newton.linear_solver.linear_solver().precondition(r, z),
        }
    }

    /// Takes a step and commits it; on failure the state stays as it was. Collective.
    pub fn advance<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        state: &mut State,
        step: Step,
    ) -> Result<StepOutcome> {
        self.prepare_length(session, body, step.length)?;
        let start = Instant::now();
        let stage = self.stages.history.enter()?;
        let explicit = self.write_right_hand_side(session, body, state, step)?;
        self.extrapolate(state, step)?;
        session.agree(prepare_contacts(body, state, step))?;
        drop(stage);
        let solving = Instant::now();
        self.clock.history += solving - start;
        let stage = self.stages.solve.enter()?;
        let mut outcome = self.solve(session, body, state, step)?;
        state.commit(&self.trial, step.time, step.length)?;
        commit_tractions(body, state)?;
        body.commit();
        drop(stage);
        let balancing = Instant::now();
        self.clock.solve += balancing - solving;
        let _stage = self.stages.balance.enter()?;
        let mut energy = body.energy(state, step)?;
        energy += explicit;
        {
            let velocity = state.velocity.local()?;
            for contact in &body.contacts {
                let [given, numerical] = contact.release(&velocity, step.length);
                energy.contact += given;
                energy.numerical += numerical;
            }
        }
        outcome.energy = Energy::from_array(session.sum(energy.to_array()));
        if let Some(load) = &self.load {
            outcome.energy.work = step.length * load.dot(&state.velocity)?;
        }
        self.clock.balance += balancing.elapsed();
        Ok(outcome)
    }

    /// `b = f_n + M v_{n-1} / k - B^T s_n`, zero at held components.
    fn write_right_hand_side<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        state: &State,
        step: Step,
    ) -> Result<Energy> {
        if let Some(load) = &mut self.load
            && !self.load_is_current
        {
            session.agree(body.write_loads(step.time, load))?;
            self.load_is_current = body.load.is_steady();
        }
        let energy = {
            let mut forces = self.right_hand_side.local_mut()?;
            forces.fill(0.0);
            body.add_explicit_forces(state, step, &mut forces)?
        };
        self.right_hand_side.add_ghosts_to_owners()?;
        if let Some(load) = &self.load {
            self.right_hand_side.add_scaled(1.0, load)?;
        }
        let mut values = self.right_hand_side.owned_mut()?;
        values.iter_mut().zip(&body.fixed).filter(|(_, fixed)| **fixed).for_each(|(value, _)| *value = 0.0);
        Ok(energy)
    }

    /// Starts from the velocity extrapolated linearly in time.
    fn extrapolate(&mut self, state: &State, step: Step) -> Result<()> {
        self.trial.copy_from(&state.velocity)?;
        if step.previous_length > 0.0 && state.step > 1 {
            let ratio = step.length / step.previous_length;
            self.trial.add_scaled(ratio, &state.velocity)?;
            self.trial.add_scaled(-ratio, &state.previous_velocity)?;
        }
        Ok(())
    }

    fn solve<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        state: &State,
        step: Step,
    ) -> Result<StepOutcome> {
        let norm = self.right_hand_side.norm()?;
        if !norm.is_finite() {
            return Err(failed(
                step,
                "the forces are not finite",
                "check loads and initial values; use smaller steps",
            ));
        }
        let tolerance = (self.settings.tolerance * norm).max(f64::MIN_POSITIVE);
        let Some((_, matrix)) = &self.matrix else {
            return Err(Error::Internal("a step was taken before its matrix was assembled".into()));
        };
        match &mut self.solver {
            Solver::Linear(ksp) => {
                ksp.set_tolerances(0.0, tolerance, LINEAR_ITERATIONS)?;
                let outcome = session.agree(ksp.solve(&self.right_hand_side, &mut self.trial))?;
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
                let (right_hand_side, settings) = (&self.right_hand_side, self.settings);
                let task = Task { step, matrix, right_hand_side, tolerance, settings };
                newton.solve(session, body, state, task, &mut self.trial)
            }
        }
    }
}

/// Takes in what the step brings to the points of all contacts.
fn prepare_contacts<const D: usize, const S: usize>(
    body: &mut Body<D, S>,
    state: &State,
    step: Step,
) -> Result<()> {
    if body.contacts.is_empty() {
        return Ok(());
    }
    let displacement = state.displacement.local()?;
    for contact in &mut body.contacts {
        contact.prepare(step.time, step.length, &displacement)?;
    }
    if let Some(traction) = &state.contact_traction {
        let traction = traction.owned()?;
        body.contacts.iter_mut().for_each(|contact| contact.recall(&traction));
    }
    Ok(())
}

/// Puts the pressures of the step just taken into the state.
fn commit_tractions<const D: usize, const S: usize>(body: &Body<D, S>, state: &mut State) -> Result<()> {
    let Some(traction) = &mut state.contact_traction else { return Ok(()) };
    let (velocity, mut traction) = (state.velocity.local()?, traction.owned_mut()?);
    traction.fill(0.0);
    body.contacts.iter().for_each(|contact| contact.add_tractions(&velocity, &mut traction));
    Ok(())
}
