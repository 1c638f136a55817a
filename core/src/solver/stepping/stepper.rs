//! The sequence of a step, common to all schemes: matrix, right-hand side, contact, solution, commit, energy balance.

use super::{
    StepOutcome, Work,
    contacts::{commit_tractions, keep_closeness, prepare_contacts, refuse_passage},
    factor_cache::nearest_cached_length,
    force_scale::ForceScale,
    heat::HeatStep,
    integrator::{Integrator, refuse_fast_flow},
    linear_solver::SolverSettings,
    multistart::solve_and_search,
    problem::StepProblem,
    step_clock::{Stages, StepClock, StepTraffic},
    step_error::{ErrorWorkspace, SolvedStep, StepError, TemperatureError},
    step_range::StepRange,
    step_solver::{Lengths, StepSolver},
    support_motion::MovingSupports,
};
use crate::{
    error::{Error, Result},
    fem::{
        body::{Body, PassBytes},
        effect::{
            CONTACT, Contact, ELASTIC, Energy, Form, Freedom, Heat, NUMERICAL, Role, SLIP_BETWEEN_PAIRINGS,
            Step, THERMAL_WORK, VISCOUS, WORK,
        },
        resultants::BalancedMotion,
        state::State,
    },
    job::{Accept, Scheme},
    linear_algebra::petsc::DistributedVector,
    parallel::{agreement::Agreed, session::Session},
};
use std::time::Instant;

/// Residuals of the start of a step beyond this multiple of its forces are those of supports that have moved ahead of the body.
const FAR: f64 = 1e3;

/// A step that is longer than the last one by more than this factor does not start from its velocity where nothing resists velocities.
const MUCH_LONGER: f64 = 10.0;

/// Share of what damage and bonds dissipate up to which a step may generate the energy for it.
const LARGEST_SHARE_GENERATED: f64 = 0.2;
/// Share of the energy turned over below which what they dissipate does not matter.
const NEGLIGIBLE_SHARE: f64 = 0.01;

/// The choices of a job that determine a [`Stepper`].
#[derive(Debug, Clone, Copy)]
pub struct StepperSettings<'a> {
    /// The time scheme.
    pub scheme: Scheme,
    /// The solver of its steps.
    pub solver: &'a SolverSettings,
    /// Estimated number of steps that share a matrix.
    pub steps: u64,
}

/// A time scheme with its solver and work vectors.
pub struct Stepper {
    /// The scheme.
    pub scheme: Scheme,
    integrator: Integrator,
    stages: Stages,
    /// The linear equations, and the choices for them.
    pub solver: StepSolver,
    /// The nodal loads of the last step, if there are loads.
    pub load: Option<DistributedVector>,
    load_is_current: bool,
    /// Powers in W at the end of the last step, over all ranks.
    pub powers: Energy,
    /// The largest energy in J before the next step.
    pub turnover: f64,
    /// Work space for a product with the elastic part of the matrix, of bodies without mass that soften.
    product: Option<DistributedVector>,
    right_hand_side: DistributedVector,
    moving_supports: Option<MovingSupports>,
    force_scale: ForceScale,
    /// The temperature, of bodies with heat.
    heat: Option<HeatStep>,
    /// The energies of heat in the last attempted step, over all ranks, once its temperature is found.
    heat_of_step: Option<Energy>,
    /// The work in J of thermal expansion at the start of the step, from then until it is accepted.
    thermal_work: Option<f64>,
    trial: DistributedVector,
    /// The work done since the last step that was accepted.
    work: Work,
    /// The velocity of the converged state in the unknowns of a step, with contact between bodies.
    converged: Option<DistributedVector>,
    /// Whether the scheme has completed the last attempted step, so that trial histories belong to its solution.
    is_finished: bool,
    /// Work space for the error of a step.
    workspace: ErrorWorkspace,
    /// The base length in s: lengths with preconditioners are powers of two times this one.
    base_length: f64,
    /// Number of other start velocities in the search for further solutions of steps with contact.
    other_starts: usize,
    /// Whether steps may exceed the stability bound of explicit flow at the actual stresses.
    accepts_fast_flow: bool,
    /// The lengths of the steps attempted so far, the same on all ranks; none before the first.
    pub attempted: Option<StepRange>,
    /// Number of preconditioners built.
    pub set_ups: u64,
    /// How often what sliding bodies face was found anew.
    pub pairings: u64,
    /// The energy in J that contacts store more since then, until the step is accepted.
    energy_of_pairing: f64,
    settings: SolverSettings,
    /// Estimated number of steps that share a matrix.
    steps: u64,
    /// Seconds by phase.
    pub clock: StepClock,
    /// Bytes by phase.
    pub traffic: StepTraffic,
    passes: PassBytes,
}

/// The assembled matrix `K` of a step, with its preconditioner.
pub struct MatrixOfStep<'a> {
    /// The time scheme of the step.
    pub scheme: Scheme,
    /// Length of the step in s.
    pub length: f64,
    /// The range that contains this step only.
    pub range: StepRange,
    /// Multiplies by it, and preconditions it.
    pub solver: &'a mut StepSolver,
}

impl Stepper {
    /// Prepares the vectors and the solver; the matrix is set by the first step. Collective.
    pub fn new<const D: usize, const S: usize>(
        session: &Session,
        body: &mut Body<D, S>,
        state: &State,
        StepperSettings { scheme, solver: settings, steps }: StepperSettings<'_>,
    ) -> Result<Self> {
        Ok(Self {
            scheme,
            integrator: Integrator::new(scheme, state)?,
            stages: Stages::register()?,
            solver: StepSolver::new(session, body, state, settings, steps)?,
            load: if body.is_loaded() { Some(state.velocity.like()?) } else { None },
            load_is_current: false,
            powers: Energy::default(),
            turnover: 0.0,
            product: match body.softens() && !body.has_form(Form::Mass) {
                true => Some(state.velocity.like()?),
                false => None,
            },
            right_hand_side: state.velocity.like()?,
            moving_supports: MovingSupports::new(body, state)?,
            force_scale: ForceScale::new(body, &state.velocity)?,
            heat: HeatStep::new(session, body, settings.preconditioner)?,
            heat_of_step: None,
            thermal_work: None,
            trial: state.velocity.like()?,
            work: Work::default(),
            converged: if body.coupling.is_some() { Some(state.velocity.like()?) } else { None },
            is_finished: false,
            workspace: ErrorWorkspace::default(),
            base_length: 1.0,
            other_starts: settings.guesses as usize,
            accepts_fast_flow: settings.accept.contains(&Accept::ExplicitStability),
            attempted: None,
            set_ups: 0,
            pairings: 0,
            energy_of_pairing: 0.0,
            settings: settings.clone(),
            steps,
            clock: StepClock::default(),
            traffic: StepTraffic::default(),
            passes: PassBytes::of(body),
        })
    }

    /// The work done since the last step that was accepted, which it then no longer counts.
    pub fn take_work(&mut self) -> Work {
        std::mem::take(&mut self.work)
    }

    /// The motion at which the forces of the step just committed to the state are balanced.
    pub fn balanced_motion<'a>(&'a self, state: &'a State) -> BalancedMotion<'a> {
        self.integrator.balanced_motion(state, &self.trial)
    }

    /// The matrix of a first step of this length in s. Preconditioners are built for this length and powers of two times it.
    /// Collective.
    pub fn matrix<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        length: f64,
    ) -> Result<MatrixOfStep<'_>> {
        self.base_length = length;
        let step = Step { time: length, length, previous_length: 0.0 };
        self.prepare_matrix(session, body, step)?;
        let range = StepRange::of(self.scheme, step);
        Ok(MatrixOfStep { scheme: self.scheme, length, range, solver: &mut self.solver })
    }

    /// Assembles the matrix of a step, if the previous step had another length. Collective.
    fn prepare_matrix<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        step: Step,
    ) -> Result<()> {
        let cached = self.integrator.steady_length(nearest_cached_length(self.base_length, step.length));
        let lengths = Lengths { matrix: self.integrator.matrix_length(step), cached };
        if self.solver.prepared == Some(lengths) {
            return Ok(());
        }
        let start = Instant::now();
        let _stage = self.stages.assembly.enter()?;
        let is_new = self.solver.prepare(session, body, lengths, &self.right_hand_side)?;
        self.set_ups += u64::from(is_new);
        self.clock.assembly += start.elapsed();
        if self.clock.first_assembly.is_zero() {
            self.clock.first_assembly = self.clock.assembly;
        }
        Ok(())
    }

    /// Whether the last attempted step generates much of the energy that damage and bonds of a body without mass dissipate in it, as one in
    /// which bonds break as a whole. Where they fail as fast as energy is supplied or released, as in jumps, a step dissipates energy.
    /// Collective.
    ///
    /// A step of implicit Euler generates what the effects count, less the `k^2/2 v . E v` that elastic stresses at its end dissipate.
    pub fn generates_failure<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        state: &State,
        step: Step,
    ) -> Result<bool> {
        if self.product.is_none() {
            return Ok(false);
        }
        self.finish(body, state, step)?;
        let [failed, counted] = session.sum(self.integrator.failed_and_generated());
        if failed <= NEGLIGIBLE_SHARE * self.turnover || counted <= LARGEST_SHARE_GENERATED * failed {
            return Ok(false);
        }
        let Some(product) = &mut self.product else { return Ok(false) };
        self.trial.update_ghosts()?;
        {
            let (velocity, mut product) = (self.trial.local()?, product.local_mut()?);
            product.fill(0.0);
            body.add_form_of_matrix(Form::Elasticity, &velocity, &mut product);
        }
        product.add_ghosts_to_owners()?;
        let dissipated = 0.5 * step.length * step.length * product.dot(&self.trial)?;
        Ok(counted - dissipated > LARGEST_SHARE_GENERATED * failed)
    }

    /// Takes a step and commits it; on failure the state is unchanged. Collective.
    pub fn advance<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        state: &mut State,
        step: Step,
    ) -> Result<StepOutcome> {
        let mut outcome = self.attempt(session, body, state, step)?;
        self.accept(session, body, state, step, &mut outcome)?;
        Ok(outcome)
    }

    /// Solves a step without changing the state; another attempt may follow. Collective.
    pub fn attempt<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        state: &State,
        step: Step,
    ) -> Result<StepOutcome> {
        let outcome = self.solve_expanded(session, body, state, step);
        if outcome.is_err() {
            self.contract(body);
        }
        outcome
    }

    /// Takes back the expansion of a step that has failed.
    pub fn contract<const D: usize, const S: usize>(&mut self, body: &mut Body<D, S>) {
        if self.thermal_work.take().is_some() {
            body.contract();
        }
    }

    /// Solves a step of the body at the temperature that is expected of it. Collective.
    fn solve_expanded<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        state: &State,
        step: Step,
    ) -> Result<StepOutcome> {
        let range = StepRange::of(self.scheme, step);
        self.attempted = Some(self.attempted.map_or(range, |attempted| attempted.or(range)));
        self.follow_sliding(session, body, state)?;
        self.expand(session, body, state, step)?;
        self.prepare_matrix(session, body, step)?;
        (self.is_finished, self.heat_of_step) = (false, None);
        let start = Instant::now();
        let stage = self.stages.history.enter()?;
        self.write_right_hand_side(session, body, state, step)?;
        if !self.accepts_fast_flow {
            refuse_fast_flow(session, body, step)?;
        }
        self.start(session, body, state, step)?;
        drop(stage);
        self.count_history(body, state, step);
        self.solver.restart_traffic();
        let solving = Instant::now();
        self.clock.history += solving - start;
        let stage = self.stages.solve.enter()?;
        let outcome = self.solve(session, body, state, step);
        if let Some(coupling) = &body.coupling {
            coupling.make_absolute(&body.held, &mut self.trial)?;
        }
        if let Some(supports) = &self.moving_supports {
            supports.set(body, &mut self.trial)?;
        }
        drop(stage);
        let assembly = std::mem::take(&mut self.solver.refactoring);
        self.clock.assembly += assembly;
        self.clock.solve += solving.elapsed().saturating_sub(assembly);
        self.traffic.add_solve(self.solver.traffic(session.ranks())?);
        let outcome = outcome?;
        if body.contacts.iter().any(|contact| contact.normal.law.depends_on_displacement()) {
            if body.coupling.is_some() || body.contacts.iter().any(|contact| contact.normal.needs_ghosts) {
                self.trial.update_ghosts()?;
            }
            session.agree(refuse_passage(body, state, step, &self.trial))?;
        }
        Ok(outcome)
    }

    /// Lets the body expand to the temperature that is expected of a step, in place of that of another attempt. Collective.
    fn expand<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        state: &State,
        step: Step,
    ) -> Result<()> {
        let Some(heat) = self.heat.as_mut().filter(|_| body.heat.as_ref().is_some_and(Heat::is_seen)) else {
            return Ok(());
        };
        if self.thermal_work.take().is_some() {
            body.contract();
        }
        heat.expect(session, body, step, self.integrator.share_of_stresses(step))?;
        self.thermal_work = Some(0.0);
        let work = session.agree(body.expand(state))?;
        self.thermal_work = Some(session.sum([work])[0]);
        Ok(())
    }

    /// Solves the started step. Collective.
    fn solve<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        state: &State,
        step: Step,
    ) -> Result<StepOutcome> {
        let mut scale = self.size_of_forces(session, body, state, step)?;
        let mut converged = &state.velocity;
        if let (Some(coupling), Some(unknowns)) = (&body.coupling, &mut self.converged) {
            unknowns.copy_from(converged)?;
            coupling.make_relative(&body.held, unknowns)?;
            coupling.make_relative(&body.held, &mut self.trial)?;
            coupling.reduce_forces(&body.held, &mut self.right_hand_side)?;
            converged = unknowns;
        }
        let mut norm = self.right_hand_side.norm()?;
        if let Some(supports) = &mut self.moving_supports {
            let open = supports.write_residual(&self.solver, (&self.trial, &self.right_hand_side))?;
            if open > FAR * scale && !body.has_form(Form::Mass) {
                let length = self.integrator.matrix_length(step);
                let begin = (&self.trial, &self.right_hand_side);
                let (followed, following) = supports.follow(&mut self.solver, body, begin, length)?;
                // That a body comes loose from bonds or a falling law, and follows freely, is a solution, too: the one in which it is still
                // held is near where it was.
                if !body.may_come_loose() {
                    self.trial.copy_from(&followed)?;
                }
                (norm, scale) = (supports.known.norm()?.max(following), scale.max(following));
            } else {
                scale = scale.max(open);
            }
        }
        let may_rest =
            step.previous_length > 0.0 && self.moving_supports.is_none() && !body.has_form(Form::Mass);
        let mut problem = StepProblem {
            session,
            may_rest,
            body,
            state,
            converged,
            step,
            forces: &self.right_hand_side,
            norm,
            scale,
            rounding: self.integrator.rounding(session),
            flow_start: self.integrator.flow_start(state),
            work: &mut self.work,
        };
        if self.other_starts == 0 || problem.body.contacts.is_empty() {
            self.solver.solve(&mut problem, &mut self.trial)
        } else {
            solve_and_search(&mut self.solver, &mut problem, &mut self.trial, self.other_starts)
        }
    }

    /// The size in N of the forces of the started step, without what only carries the body along. Collective.
    fn size_of_forces<const D: usize, const S: usize>(
        &self,
        session: &Session,
        body: &Body<D, S>,
        state: &State,
        step: Step,
    ) -> Result<f64> {
        let known = self.moving_supports.as_ref().map_or(&self.right_hand_side, |supports| &supports.known);
        let length = self.integrator.matrix_length(step);
        self.force_scale.without_translation(session, body, state, (known, length))
    }

    /// The error of the last attempted step: of the velocity, of the strain that it causes, and of the resulting histories of
    /// cells and nodes. Collective.
    pub fn error<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        state: &State,
        step: Step,
    ) -> Result<StepError> {
        self.finish(body, state, step)?;
        self.trial.update_ghosts()?;
        let blend = self.integrator.blend();
        let solved = SolvedStep {
            step,
            velocity: &self.trial,
            flow_start: self.integrator.flow_start(state),
            blend,
            order: self.scheme.order(),
        };
        self.workspace.error(session, body, state, solved)
    }

    /// Computes displacement, trial histories and energies of the last attempted step, unless they are available. Collective.
    fn finish<const D: usize, const S: usize>(
        &mut self,
        body: &mut Body<D, S>,
        state: &State,
        step: Step,
    ) -> Result<()> {
        if self.is_finished {
            return Ok(());
        }
        self.integrator.finish(body, state, &mut self.trial, step)?;
        if self.scheme.is_implicit() {
            self.traffic.add_solve(Some(self.passes.finish));
        }
        self.is_finished = true;
        Ok(())
    }

    /// The error of the temperature in the last attempted step, once it is found; none without heat. Collective.
    pub fn temperature_error<const D: usize, const S: usize>(
        &self,
        session: &Session,
        body: &Body<D, S>,
        step: Step,
    ) -> Result<Option<TemperatureError>> {
        let heat = self.heat.as_ref().zip(body.heat.as_ref());
        heat.map(|(of_step, heat)| of_step.error(session, heat, step)).transpose()
    }

    /// Finds the temperature at the end of the last attempted step, unless it is known. Collective.
    pub fn find_temperature<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        state: &State,
        step: Step,
    ) -> Result<()> {
        if self.heat_of_step.is_some() {
            return Ok(());
        }
        self.finish(body, state, step)?;
        let found = self.solve_heat(session, body, state, step);
        if found.is_err() {
            self.contract(body);
        }
        self.heat_of_step = Some(found?);
        Ok(())
    }

    /// The heat in J that rounding errors may generate in the step just committed. Collective.
    pub fn rounding_of_heat<const D: usize, const S: usize>(
        &self,
        session: &Session,
        body: &Body<D, S>,
    ) -> Result<f64, Agreed> {
        let (Some(step), Some(heat)) = (&self.heat, &body.heat) else { return Ok(0.0) };
        step.rounding(session, heat)
    }

    /// Finds the temperature at the end of the step just solved; gives the energies of heat. Collective.
    fn solve_heat<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        state: &State,
        step: Step,
    ) -> Result<Energy> {
        let Some(heat) = &mut self.heat else { return Ok(Energy::default()) };
        self.trial.update_ghosts()?;
        session.agree(body.release_heat(state, &self.trial))?;
        let averages = self.integrator.averages_powers();
        Ok(heat.solve(session, body, step, averages)?.map_values(|values| session.sum(values)))
    }

    /// Commits the last attempted step, and completes its outcome. Collective.
    pub fn accept<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        state: &mut State,
        step: Step,
        outcome: &mut StepOutcome,
    ) -> Result<()> {
        let Work { newton, linear } = self.take_work();
        (outcome.newton_iterations, outcome.linear_iterations) = (newton, linear);
        let solving = Instant::now();
        let stage = self.stages.solve.enter()?;
        self.finish(body, state, step)?;
        let mut work = 0.0;
        if let Some(supports) = &mut self.moving_supports {
            if body.flows() {
                self.trial.update_ghosts()?;
            }
            let start = self.integrator.flow_start(state);
            work = supports.work(session, body, step, &self.trial, start)?;
        }
        let mut of_obstacles = Energy::default();
        for motion in body.obstacle_motions() {
            of_obstacles += motion.energy_of_step(state.time);
        }
        self.find_temperature(session, body, state, step)?;
        self.integrator.commit(state, &self.trial, step)?;
        state.fallback = outcome.fallback;
        commit_tractions(body, state)?;
        keep_closeness(session, body, state, step)?;
        body.commit();
        drop(stage);
        let balancing = Instant::now();
        self.clock.solve += balancing - solving;
        let _stage = self.stages.balance.enter()?;
        let mut powers;
        (outcome.energy, outcome.peaks, powers) = self.integrator.complete(session, body, state, step)?;
        self.traffic.balance += self.passes.energy;
        outcome.energy[WORK] += work;
        powers[WORK] += work / step.length;
        let [of_loads, power] = self.work_of_loads(body, state, step)?;
        outcome.energy[WORK] += of_loads;
        outcome.energy[NUMERICAL] += step.length * power - of_loads;
        if !body.load.is_steady() {
            powers[WORK] += power;
        }
        if self.integrator.averages_powers() {
            for kind in [VISCOUS, CONTACT, WORK] {
                let more = 0.5 * step.length * (self.powers[kind] - powers[kind]);
                outcome.energy[kind] += more;
                outcome.energy[NUMERICAL] += if kind.role == Role::Work { -more } else { more };
            }
        }
        (self.powers, outcome.powers) = (powers, powers);
        outcome.energy += of_obstacles;
        self.clock.balance += balancing.elapsed();
        outcome.energy[NUMERICAL] += std::mem::take(&mut self.energy_of_pairing);
        body.contacts.iter_mut().for_each(Contact::forget_found);
        outcome.energy += self.heat_of_step.take().unwrap_or_default();
        if let Some(heat) = &self.heat {
            heat.commit(body)?;
        }
        self.finish_expansion(session, body, state, &mut outcome.energy)
    }

    /// Adds the work of thermal expansion in the step just committed, on the mean of the stresses at its start and at its end: the body has
    /// expanded at the start or, if the end is extrapolated, half at the start and half at the end. Collective.
    fn finish_expansion<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        state: &State,
        energy: &mut Energy,
    ) -> Result<()> {
        let Some(at_start) = self.thermal_work.take() else { return Ok(()) };
        let extrapolates = self.integrator.blend().extrapolates();
        let work = if extrapolates {
            body.heat.iter_mut().try_for_each(|heat| heat.see(None))?;
            body.expand(state)
        } else {
            body.work_of_expansion(state)
        };
        let [at_end] = session.sum([session.agree(work)?]);
        if extrapolates {
            energy[ELASTIC] += at_end;
            energy[THERMAL_WORK] += at_start + at_end;
        } else {
            let mean = 0.5 * (at_start + at_end);
            energy[THERMAL_WORK] += mean;
            energy[NUMERICAL] -= mean - at_start;
        }
        Ok(())
    }

    /// Finds anew what bodies face that have slid along each other. The energy that contacts store changes with it, by an error of the
    /// scheme. Collective.
    fn follow_sliding<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        state: &State,
    ) -> Result<()> {
        if body.slip(session, &state.displacement.local()?)? <= SLIP_BETWEEN_PAIRINGS {
            return Ok(());
        }
        let faced = body.faced_nodes(session);
        let before = body.energy_of_contacts(state.time, &state.displacement)?;
        body.form_pairs(session, &state.displacement, true)?;
        if faced + body.faced_nodes(session) == 0 {
            return Ok(());
        }
        let after = body.energy_of_contacts(state.time, &state.displacement)?;
        self.energy_of_pairing += session.sum([after - before])[0];
        self.pairings += 1;
        self.renew(session, body, state)
    }

    /// Forgets all matrices, after what bodies face has changed. Collective.
    pub fn renew<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        state: &State,
    ) -> Result<()> {
        self.solver = StepSolver::new(session, body, state, &self.settings, self.steps)?;
        Ok(())
    }

    /// The work of the loads in J in the step just committed, and their power in W in its equations. Collective.
    fn work_of_loads<const D: usize, const S: usize>(
        &mut self,
        body: &Body<D, S>,
        state: &State,
        step: Step,
    ) -> Result<[f64; 2]> {
        let Some(load) = &self.load else { return Ok([0.0; 2]) };
        let power = load.dot(&self.trial)?;
        self.traffic.balance += 2 * vector_bytes(body);
        // The work of steady loads is the change of their potential.
        let is_exact = self.integrator.averages_powers() && body.load.is_steady();
        let Some(before) = state.previous_displacement.as_ref().filter(|_| is_exact) else {
            return Ok([step.length * power, power]);
        };
        // No longer needed in this step.
        let way = &mut self.right_hand_side;
        way.copy_from(&state.displacement)?;
        way.add_scaled(-1.0, before)?;
        self.traffic.balance += 7 * vector_bytes(body);
        Ok([load.dot(way)?, power])
    }

    /// Loads and all other forces that are known before the step, zero at prescribed components.
    fn write_right_hand_side<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        state: &State,
        step: Step,
    ) -> Result<()> {
        if let Some(load) = &mut self.load
            && !self.load_is_current
        {
            session.agree(body.write_loads(self.integrator.balanced_time(step), load))?;
            self.load_is_current = body.load.is_steady();
        }
        {
            let mut forces = self.right_hand_side.local_mut()?;
            forces.fill(0.0);
            self.integrator.start(body, state, step, &mut forces)?;
        }
        self.right_hand_side.add_ghosts_to_owners()?;
        if let Some(load) = &self.load {
            self.right_hand_side.add_scaled(1.0, load)?;
        }
        let forces = &mut self.right_hand_side;
        if let Some(supports) = &mut self.moving_supports {
            let start = self.integrator.flow_start(state);
            supports.impose(session, body, step, start, forces)?;
        }
        body.held.clear(&mut forces.owned_mut()?);
        if let Some(supports) = &mut self.moving_supports {
            self.solver.multiply(&supports.relative, &mut supports.held)?;
            forces.add_scaled(1.0, &supports.held)?;
        }
        Ok(())
    }

    /// Sets the start velocity by linear extrapolation in time, and prepares the contacts. Collective.
    fn start<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        state: &State,
        step: Step,
    ) -> Result<()> {
        self.extrapolate(body, state, step)?;
        if let Some(supports) = &self.moving_supports {
            supports.set(body, &mut self.trial)?;
            supports.show_contacts(body)?;
        }
        let (blend, time) = (self.integrator.blend(), self.integrator.balanced_time(step));
        let ratio = extrapolates(state, step).then(|| step.length / step.previous_length);
        for (number, contact) in body.contacts.iter_mut().enumerate() {
            for (cause, freedom) in [("force", Freedom::Translation), ("moment", Freedom::Rotation)] {
                let Some(motion) = &mut contact.obstacle.motions[freedom as usize] else { continue };
                motion.start(blend, time, ratio);
                let value = motion.driving;
                if !value.is_finite() {
                    return Err(Error::Failed(format!(
                        "the {cause} on the obstacle of contact.{number} is {value} at t = {time} s; correct the expression in the job"
                    )));
                }
            }
        }
        let start = self.integrator.flow_start(state).displacement;
        Ok(session.agree(prepare_contacts(body, state, step, (blend, start)))?)
    }

    /// Counts the pass over the cells, and the vectors: forces set to zero, addition of the load, copy and extrapolation of the
    /// start value.
    fn count_history<const D: usize, const S: usize>(
        &mut self,
        body: &Body<D, S>,
        state: &State,
        step: Step,
    ) {
        let load = if self.load.is_some() { 3 } else { 0 };
        let start = if extrapolates(state, step) { 8 } else { 2 };
        self.traffic.history += self.passes.explicit + (1 + load + start) * vector_bytes(body);
    }

    fn extrapolate<const D: usize, const S: usize>(
        &mut self,
        body: &Body<D, S>,
        state: &State,
        step: Step,
    ) -> Result<()> {
        self.trial.copy_from(&state.velocity)?;
        // The velocity of a jump in a short step is larger than that of a long one by as much, and so are its rounding errors.
        let is_much_longer = state.step_length > 0.0 && step.length > MUCH_LONGER * state.step_length;
        if step.previous_length == 0.0 && is_much_longer && !body.resists_velocities() {
            self.trial.scale(0.0)?;
        }
        if extrapolates(state, step) {
            let ratio = step.length / step.previous_length;
            self.trial.add_scaled(ratio, &state.velocity)?;
            self.trial.add_scaled(-ratio, &state.previous_velocity)?;
        }
        Ok(())
    }
}

/// Whether two velocities are available for extrapolation.
fn extrapolates(state: &State, step: Step) -> bool {
    step.previous_length > 0.0 && state.step > 1
}

/// Bytes of the owned values of a vector on this rank.
fn vector_bytes<const D: usize, const S: usize>(body: &Body<D, S>) -> u64 {
    (body.mesh.owned * D * size_of::<f64>()) as u64
}
