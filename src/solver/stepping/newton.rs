//! Newton's method for the contact equations of one step.

use super::{
    StepOutcome,
    bounded::Bounded,
    contacts::restore_pressures,
    descent::{DIRECTIONS_PER_ITERATION, Descent, SHORT_DESCENT},
    equations::{CellForces, ContactEquations, Floor, Scratch, SolveCounts, cycle_message},
    fallbacks::{Conditions, Fallback, Search},
    flow::Flow,
    linear_solver::{FrictionIteration, LINEAR_ITERATIONS, SolverSettings},
    obstacle_motions::ObstacleMotions,
    problem::{MASSLESS_REMEDY, REMEDY, STEEP_RISE, StepProblem, System, rise_remedy, softening_remedy},
    solver::Reduced,
};
use crate::{
    error::{Error, Result},
    fem::{
        body::Body,
        effect::{COUNTS, Contact, Energy, Form, Peaks, PointCount},
    },
    linear_algebra::{
        petsc::{DistributedVector, ProjectedKsp, Snes, has_option},
        tensor::larger,
    },
    parallel::session::Session,
};

/// Newton's method: PETSc's solvers and work vectors.
pub(super) struct Newton {
    snes: Snes,
    settings: SolverSettings,
    /// PETSc's solver for variational inequalities, if it is selected.
    pub bounded: Option<Bounded>,
    scratch: Scratch,
    /// The motions of obstacles that forces drive.
    obstacles: ObstacleMotions,
    /// The unknowns of the last solution with friction points that yield.
    reached: Option<DistributedVector>,
    /// Branches of all contact points at the start of the step and at its end.
    branches_before: Vec<u8>,
    branches_after: Vec<u8>,
    /// The steepest decrease of each contact's friction with the sliding speed, at the pressures of the last attempt.
    steepest_decreases: Vec<f64>,
    /// The minimisation of energies, once it was needed.
    descent: Option<Descent>,
    /// Whether it solved the last equations.
    has_descended: bool,
    /// Counts of the work done for the step.
    counts: SolveCounts,
    /// The velocity from which the step was started.
    start: DistributedVector,
    /// The tolerance of residuals as a share of that of the step.
    sharpness: f64,
    /// Whether the user has set a line search.
    has_user_search: bool,
    /// Work data for cells that flow, if there are any.
    pub flow: Option<Flow>,
}

/// Largest ratio of the steepest decrease of a friction graph to its parameter while a step is solved, and the initial ratio.
const LARGEST_DECREASE_RATIO: f64 = 0.8;
const INITIAL_DECREASE_RATIO: f64 = 0.5;

/// Linear solves stop at this share of the tolerance of the step.
const LINEAR_SHARE: f64 = 0.3;
/// The first linear solves of a step reduce their residual only by this factor, while branches may still change.
const LINEAR_REDUCTION: f64 = 1e-3;

/// Both where forces move obstacles: a light one moves far under a small unbalanced force at the nodes.
const WITH_OBSTACLES: [f64; 2] = [1e-6, 0.03];
/// The same for all linear solves of a descent: near its end each direction then squares the error.
const DESCENT_REDUCTION: f64 = 1e-6;

/// The velocities per traction by which friction points yield relative to the compliance of the body: the first, the ratio of each to the
/// last, and the largest one that is worth trying, and the last.
const FIRST_RATIO: f64 = 100.0;
const RATIO_FACTOR: f64 = 0.01;
const LARGEST_RATIO_FACTOR: f64 = 0.9;
const LAST_RATIO: f64 = 1e-3;
/// The tolerance of these solutions relative to that of the step.
const YIELDING_TOLERANCE: f64 = 1e5;

/// Where nodes stand for little of the surface, their pressures need smaller residuals: the ratio of one tolerance to that before, and how
/// often it is applied.
const SHARPER: f64 = 1e-2;
const MOST_SHARPER: i32 = 2;

/// Fixed-point iterations after which an attempt fails.
const MAX_FIXED_POINT_ITERATIONS: usize = 200;

const NO_MINIMUM: &str = "no minimum of the energy was found";

const INCLUSION_REMEDY: &str = "try a smaller [time] step or a tighter [solver] tolerance; [solver] inclusion_tolerance is the largest accepted value";

/// Outcome of an attempt to solve a step.
struct Attempt {
    /// Newton iterations.
    iterations: usize,
    /// The reason for failure, if it failed.
    failure: Option<String>,
}

impl Newton {
    /// Newton's method for unknowns with the layout of `like`.
    pub(super) fn new<const D: usize>(
        like: &DistributedVector,
        contacts: &[Contact<D>],
        settings: &SolverSettings,
    ) -> Result<Self> {
        let mut snes = Snes::new("", like, D)?;
        snes.apply_options()?;
        Ok(Self {
            snes,
            settings: settings.clone(),
            bounded: None,
            scratch: Scratch::new(like, contacts)?,
            obstacles: ObstacleMotions::default(),
            reached: None,
            branches_before: Vec::new(),
            branches_after: Vec::new(),
            steepest_decreases: Vec::new(),
            descent: None,
            has_descended: false,
            // Longer solutions enlarge the list.
            counts: SolveCounts { sets: Vec::with_capacity(128), ..SolveCounts::default() },
            start: like.like()?,
            sharpness: 1.0,
            has_user_search: has_option("snes_linesearch_type")?,
            flow: None,
        })
    }

    /// Solves equations from their start value: tries one fallback after the other, then checks that velocities and pressures lie on
    /// the contact graphs. A fixed-point iteration solves with friction bounds at fixed pressures, and updates these until the solution
    /// also solves the equations with its own pressures. Collective.
    pub(super) fn solve<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        Reduced { system, krylov, velocity: trial }: Reduced<'_>,
    ) -> Result<StepOutcome> {
        self.counts.restart();
        if let Some(bounded) = &mut self.bounded {
            write_branches(problem.body, system.converged, &mut self.branches_before)?;
            let iterations = bounded.solve(problem, system, trial)?;
            return self.check_inclusion(problem, trial, iterations);
        }
        self.start.copy_from(trial)?;
        let contacts = &mut problem.body.contacts;
        self.obstacles
            .start(problem.session, contacts, trial, system.tolerance, |x, y| system.matrix.multiply(x, y))?;
        let [reduction, share] =
            if self.obstacles.is_empty() { [LINEAR_REDUCTION, LINEAR_SHARE] } else { WITH_OBSTACLES };
        krylov.set_tolerances(reduction, share * system.tolerance, LINEAR_ITERATIONS)?;
        write_steepest_decreases(problem.session, &problem.body.contacts, &mut self.steepest_decreases);
        let conditions = self.conditions(problem.body);
        let mut fallbacks = conditions.fallbacks();
        let mut next = fallbacks.next();
        // With these parameters, whatever those of the last step were: a restarted run does not know them.
        if let Some(first) = next {
            self.set_graph_parameters(&mut problem.body.contacts, system.scales, first);
        }
        write_branches(problem.body, system.converged, &mut self.branches_before)?;
        let (mut iterations, mut failure) = (0, String::new());
        while let Some(fallback) = next {
            self.set_graph_parameters(&mut problem.body.contacts, system.scales, fallback);
            let has_fixed_bounds = fallback.iteration == FrictionIteration::FixedPoint;
            let mut rounds = 0;
            if fallback.yields_at_first {
                iterations += self.solve_yielding(problem, system, krylov, trial)?;
            }
            self.scratch.restart();
            let failed = loop {
                if has_fixed_bounds {
                    self.fix_bounds(problem, system)?;
                }
                let attempt = self.attempt(problem, system, krylov, fallback.search, trial)?;
                // Where nothing was to be done, the solution for the last bounds also solves the equations with its own bounds.
                if attempt.failure.is_some() || !has_fixed_bounds || (attempt.iterations == 0 && rounds > 0) {
                    iterations += attempt.iterations;
                    break attempt.failure;
                }
                iterations += attempt.iterations.max(1);
                rounds += 1;
                self.scratch.go_on();
                if rounds == MAX_FIXED_POINT_ITERATIONS {
                    break Some(format!(
                        "friction bounds still change after {rounds} fixed-point iterations"
                    ));
                }
            };
            if let Some(reason) = failed {
                trial.copy_from(&self.start)?;
                restore_pressures(problem.body, problem.state)?;
                let contacts = &mut problem.body.contacts;
                let multiply =
                    |x: &DistributedVector, y: &mut DistributedVector| system.matrix.multiply(x, y);
                if !self.obstacles.follow_new_contacts(problem.session, contacts, trial, multiply)? {
                    (failure, next) = (reason, fallbacks.next());
                }
                continue;
            }
            // The pressure rose so much that the friction graph decreases faster than its parameter permits: repeat with a larger one.
            write_steepest_decreases(problem.session, &problem.body.contacts, &mut self.steepest_decreases);
            let mut pairs = problem.body.contacts.iter().zip(&self.steepest_decreases);
            if pairs.all(|(contact, decrease)| *decrease <= LARGEST_DECREASE_RATIO * contact.friction_scale())
            {
                if fallback.yields_at_first {
                    // Nothing has fallen: the energies were those of fixed friction bounds.
                    self.counts.unstable = 0;
                }
                for times in 1..=MOST_SHARPER {
                    if self.lies_on_graphs(problem, trial)? {
                        break;
                    }
                    self.sharpness = SHARPER.powi(times);
                    krylov.set_tolerances(
                        reduction,
                        self.sharpness * share * system.tolerance,
                        LINEAR_ITERATIONS,
                    )?;
                    self.scratch.restart();
                    let attempt = self.attempt(problem, system, krylov, fallback.search, trial);
                    self.sharpness = 1.0;
                    let attempt = attempt?;
                    iterations += attempt.iterations;
                    // Its last iterate is no solution, even if it is on the graphs.
                    if let Some(reason) = attempt.failure {
                        return Err(problem.failed(&reason, INCLUSION_REMEDY));
                    }
                }
                return self.check_inclusion(problem, trial, iterations);
            }
        }
        Err(explain_failure(problem, &failure, conditions.softens))
    }

    /// Fixes the friction bounds at the pressures of the last evaluation. Collective.
    fn fix_bounds<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        system: System<'_>,
    ) -> Result<()> {
        let contacts = &mut problem.body.contacts;
        contacts.iter_mut().for_each(Contact::fix_bounds);
        self.obstacles
            .set_columns(problem.session, contacts, &self.start, |x, y| system.matrix.multiply(x, y))
    }

    /// Solves the equations with friction points that yield less and less, each from the last solution and in shorter steps where there is
    /// none; returns the Newton iterations. Collective.
    fn solve_yielding<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        system: System<'_>,
        krylov: &mut ProjectedKsp,
        trial: &mut DistributedVector,
    ) -> Result<usize> {
        let tolerance = system.tolerance.max(self.settings.tolerance * self.counts.first);
        let enough = YIELDING_TOLERANCE * tolerance;
        // The first residual may be much larger than all forces.
        let tolerance = if system.floor.largest > 0.0 { enough.min(system.floor.largest) } else { enough };
        let system = System { tolerance, ..system };
        let (mut iterations, mut reached) = (0, None);
        let (mut ratio, mut factor) = (FIRST_RATIO, RATIO_FACTOR);
        set_give(problem.body, ratio);
        {
            let mut unknowns = trial.owned_mut()?;
            problem.body.contacts.iter().for_each(|contact| contact.unmap(&mut unknowns));
            problem.body.contacts.iter_mut().for_each(|contact| contact.map(&mut unknowns));
        }
        self.fix_bounds(problem, system)?;
        loop {
            set_give(problem.body, ratio);
            self.scratch.restart();
            let attempt = self.attempt(problem, system, krylov, Search::ShortDescent, trial)?;
            iterations += attempt.iterations;
            if attempt.failure.is_none() {
                self.fix_bounds(problem, system)?;
                let unknowns = match &mut self.reached {
                    Some(unknowns) => unknowns,
                    none => none.insert(trial.like()?),
                };
                unknowns.copy_from(trial)?;
                {
                    let mut unknowns = unknowns.owned_mut()?;
                    problem.body.contacts.iter().for_each(|contact| contact.unmap(&mut unknowns));
                }
                self.obstacles.keep(&problem.body.contacts);
                reached = Some(ratio);
                factor = f64::max(RATIO_FACTOR, factor * factor);
            } else {
                factor = factor.sqrt();
            }
            let (Some(last), Some(unknowns)) = (reached, &self.reached) else {
                trial.copy_from(&self.start)?;
                restore_pressures(problem.body, problem.state)?;
                break;
            };
            if attempt.failure.is_some() {
                set_give(problem.body, last);
                let contacts = &mut problem.body.contacts;
                problem.session.agree(self.obstacles.restore(contacts))?;
                trial.copy_from(unknowns)?;
                let mut velocity = trial.owned_mut()?;
                contacts.iter_mut().for_each(|contact| contact.map(&mut velocity));
            }
            if last <= LAST_RATIO || factor > LARGEST_RATIO_FACTOR {
                break;
            }
            ratio = last * factor;
        }
        problem.body.contacts.iter_mut().for_each(|contact| contact.set_give(0.0));
        Ok(iterations)
    }

    fn conditions<const D: usize, const S: usize>(&self, body: &Body<D, S>) -> Conditions {
        let contacts = &body.contacts;
        let follows = |contact: &Contact<D>| contact.friction().is_some_and(|f| f.follows_pressure());
        let flows = self.flow.is_some();
        Conditions {
            follows_pressure: contacts.iter().any(follows),
            friction: self.settings.friction,
            has_user_search: self.has_user_search,
            // Motions of obstacles are not in equilibrium with those of the contact points alone.
            interior_is_linear: !flows
                && !contacts.iter().any(|contact| contact.needs_ghosts() || contact.obstacle.is_some()),
            rubs_obstacles: !self.obstacles.is_empty() && contacts.iter().any(|c| c.friction().is_some()),
            softens: (flows && body.softening().next().is_some()) || contacts.iter().any(decreases),
            has_bonds: flows && body.softens_at_surface(),
        }
    }

    /// Sets the parameters of all graphs, those of friction according to its descents.
    fn set_graph_parameters<const D: usize>(
        &self,
        contacts: &mut [Contact<D>],
        scales: &[[f64; 2]],
        fallback: Fallback,
    ) {
        let follows = fallback.iteration == FrictionIteration::Newton;
        for ((contact, scales), decrease) in contacts.iter_mut().zip(scales).zip(&self.steepest_decreases) {
            let [normal, tangential] = scales.map(|scale| fallback.stiffness_factor * scale);
            contact.scale = normal.max(2.0 * contact.monotonicity_constant());
            contact.set_friction(tangential.max(decrease / INITIAL_DECREASE_RATIO), follows);
        }
    }

    /// Newton's method from the velocity in `trial`, where it writes the solution. Collective.
    fn attempt<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        system: System<'_>,
        krylov: &mut ProjectedKsp,
        search: Search,
        trial: &mut DistributedVector,
    ) -> Result<Attempt> {
        let session = problem.session;
        self.has_descended = search.minimises();
        if self.has_descended {
            let tolerance = LINEAR_SHARE * system.tolerance;
            krylov.set_tolerances(DESCENT_REDUCTION, tolerance, LINEAR_ITERATIONS)?;
            let mut descent = match self.descent.take() {
                Some(descent) => descent,
                None => Descent::new(trial)?,
            };
            descent.has_other_start = self.writes_steady_start(problem, trial, &mut descent.other_start)?;
            self.descent = Some(descent);
        }
        {
            let mut unknowns = trial.owned_mut()?;
            problem.body.contacts.iter().for_each(|contact| contact.unmap(&mut unknowns));
        }
        if !self.has_user_search {
            self.snes.search_along_steps(search != Search::FullSteps)?;
        }
        // Where pressures depend on the velocity alone, there is no other equilibrium to fall into.
        let may_fall = self.flow.is_some()
            || problem
                .body
                .contacts
                .iter()
                .any(|c| c.law.depends_on_displacement() || c.friction().is_some());
        self.counts.sets.clear();
        let may_end_at_floor = search != Search::Equilibrated;
        let floor = if may_end_at_floor { system.floor } else { Floor::default() };
        let (cells, contacts) = problem.body.cells_and_contacts();
        let mut cells = match (&mut self.flow, problem.flow_start) {
            (Some(flow), Some(start)) => Some(flow.of(cells, start)),
            _ => None,
        };
        let first = self.counts.first;
        let mut equations = ContactEquations {
            matrix: system.matrix,
            cells: cells.as_mut().map(|cells| cells as &mut dyn CellForces),
            contacts,
            obstacles: &mut self.obstacles,
            right_hand_side: system.right_hand_side,
            floor,
            scratch: &mut self.scratch,
            linear_solver: krylov,
            session,
            stop_at_cycles: search == Search::FullSteps,
            equilibrated: search == Search::Equilibrated,
            counts: std::mem::take(&mut self.counts),
        };
        // A tolerance relative to the first residual of the step suffices: the right-hand side is almost zero where only an obstacle
        // moves the body.
        let absolute = self.sharpness * system.tolerance.max(self.settings.tolerance * first);
        let tolerances = (absolute, self.settings.tolerance);
        let limit = self.settings.max_newton_iterations as usize;
        let descent = self.descent.as_mut().filter(|_| search.minimises());
        let solved = if let Some(descent) = descent {
            let directions = match search {
                Search::ShortDescent => SHORT_DESCENT,
                _ if may_fall => DIRECTIONS_PER_ITERATION * limit,
                _ => limit,
            };
            let solved = descent.solve(&mut equations, trial, tolerances, directions);
            equations.set_softening(1.0);
            solved.map(|converged| (!converged).then_some(NO_MINIMUM))
        } else {
            let solved = self.snes.solve(&mut equations, trial, tolerances, limit);
            solved.map(|outcome| (!outcome.converged()).then(|| outcome.description()))
        };
        self.counts = equations.counts;
        let at_floor = self.scratch.is_at_floor && matches!(&solved, Ok(None));
        let iterations = self.counts.sets.len();
        let not_converged = !matches!(&solved, Ok(None));
        // All ranks take the same branch, on whichever rank the failure occurred.
        let [not_converged] = session.largest([f64::from(u8::from(not_converged))]);
        let mut failure = if not_converged == 0.0 {
            None
        } else {
            match session.agree(solved) {
                Ok(reason) => Some(explain(reason.unwrap_or("another rank failed"), &self.counts)),
                Err(error) if error.is_failure() => Some(error.to_string()),
                Err(error) => return Err(error.into()),
            }
        };
        if search == Search::Equilibrated {
            trial.copy_from(&self.scratch.velocity)?;
        } else {
            let mut velocity = trial.owned_mut()?;
            problem.body.contacts.iter_mut().for_each(|contact| contact.map(&mut velocity));
        }
        if may_end_at_floor && (at_floor || failure.is_some()) {
            let speed = trial.norm()? + self.obstacles.speed(&problem.body.contacts);
            if at_floor || floor.is_reached(self.last_residual().norm()?, speed) {
                failure = None;
                // The accuracy of pressures is limited by the same errors.
                let forces = floor.at(speed) / self.settings.inclusion_tolerance
                    * ((problem.body.mesh.total_nodes * D) as f64).sqrt();
                let contacts = &mut problem.body.contacts;
                contacts.iter_mut().for_each(|c| c.reference.forces = c.reference.forces.max(forces));
            }
        }
        if failure.is_none() {
            failure = self.obstacles.failure(self.last_residual().norm()?, self.settings.tolerance);
        }
        Ok(Attempt { iterations, failure })
    }

    /// Writes the unknowns of the velocity before the last step, with that of the supports in this one: after a sudden change it is a
    /// better start than the extrapolation, which repeats the change. Returns whether there is such a velocity: Newton's method must
    /// have forces of flow or of effects at the surface. Collective.
    fn writes_steady_start<const D: usize, const S: usize>(
        &mut self,
        problem: &StepProblem<'_, D, S>,
        trial: &DistributedVector,
        start: &mut DistributedVector,
    ) -> Result<bool> {
        let has_earlier = problem.state.step > 1 && problem.body.coupling.is_none();
        let Some(flow) = self.flow.as_mut().filter(|_| has_earlier) else { return Ok(false) };
        start.copy_from(trial)?;
        flow.copy_free_parts(&problem.body.held, &problem.state.previous_velocity, start)?;
        let mut unknowns = start.owned_mut()?;
        problem.body.contacts.iter().for_each(|contact| contact.unmap(&mut unknowns));
        Ok(true)
    }

    /// Whether the velocity in `trial` and the pressures of the contacts lie on the graphs. Collective.
    fn lies_on_graphs<const D: usize, const S: usize>(
        &self,
        problem: &StepProblem<'_, D, S>,
        trial: &mut DistributedVector,
    ) -> Result<bool> {
        trial.update_ghosts()?;
        let inclusion = self.inclusion_residual(problem.session, problem.body, trial)?;
        Ok(inclusion <= self.settings.inclusion_tolerance)
    }

    /// Checks that the velocity in `trial` and the pressures of the contacts lie on the graphs, and summarises the work of the
    /// step. Collective.
    fn check_inclusion<const D: usize, const S: usize>(
        &mut self,
        problem: &StepProblem<'_, D, S>,
        trial: &mut DistributedVector,
        newton_iterations: usize,
    ) -> Result<StepOutcome> {
        let (session, body) = (problem.session, &*problem.body);
        trial.update_ghosts()?;
        write_branches(body, trial, &mut self.branches_after)?;
        let changes = self.branches_before.iter().zip(&self.branches_after).filter(|(a, b)| a != b).count();
        let inclusion = self.inclusion_residual(session, body, trial)?;
        let residual = self.last_residual().norm()?;
        if inclusion.is_nan() || inclusion > self.settings.inclusion_tolerance {
            let reason = format!("velocity and pressure deviate from the contact graph by {inclusion:.1e}");
            return Err(problem.failed(&reason, INCLUSION_REMEDY));
        }
        let velocity = trial.local()?;
        let mut points = [0.0; COUNTS];
        for contact in &body.contacts {
            let counts = contact.count(&velocity).to_array();
            points.iter_mut().zip(counts).for_each(|(sum, count)| *sum += count);
        }
        Ok(StepOutcome {
            newton_iterations,
            linear_iterations: self.counts.linear_iterations,
            active_changes: session.total(changes),
            points: PointCount::from_array(session.sum(points)),
            indefinite_solves: self.counts.indefinite,
            inclusion_residual: inclusion,
            residual,
            fell: self.has_descended && self.counts.unstable > 0,
            solutions: 0,
            solutions_differ: false,
            landed_on: None,
            energy: Energy::default(),
            powers: Energy::default(),
            peaks: Peaks::default(),
        })
    }

    /// The residual at the end of the last solve, in N.
    fn last_residual(&self) -> &DistributedVector {
        match (&self.bounded, &self.descent) {
            (Some(bounded), _) => bounded.residual(),
            (None, Some(descent)) if self.has_descended => &descent.residual,
            _ => self.snes.residual(),
        }
    }

    /// The largest of all contacts over all ranks. Collective.
    fn inclusion_residual<const D: usize, const S: usize>(
        &self,
        session: &Session,
        body: &Body<D, S>,
        velocity: &DistributedVector,
    ) -> Result<f64> {
        let (velocity, residual) = (velocity.local()?, self.last_residual().owned()?);
        let mut largest = 0.0;
        for contact in &body.contacts {
            let range = session.largest(contact.range(&velocity));
            let distance = contact.inclusion_residual(&velocity, &residual, range);
            largest = larger(largest, distance);
        }
        Ok(session.largest([largest])[0])
    }
}

/// Lets friction points yield by this ratio of the compliance of the body.
fn set_give<const D: usize, const S: usize>(body: &mut Body<D, S>, ratio: f64) {
    body.contacts.iter_mut().for_each(|contact| contact.set_give(ratio / contact.friction_scale()));
}

/// The failure of a step, which may lie at laws that soften or at friction whose bounds grow steeply. Collective.
fn explain_failure<const D: usize, const S: usize>(
    problem: &StepProblem<'_, D, S>,
    why: &str,
    softens: bool,
) -> Error {
    let contacts = &problem.body.contacts;
    let rises = contacts.iter().map(Contact::rise_of_bound);
    let [rise] = problem.session.largest([rises.fold(0.0, larger)]);
    if rise > STEEP_RISE {
        return problem.failed(why, &rise_remedy(rise));
    }
    if !softens {
        return problem.failed(why, REMEDY);
    }
    let falls = contacts.iter().any(|contact| contact.monotonicity_constant() > 0.0);
    let weakens = contacts.iter().any(Contact::has_decreasing_friction);
    let own = [falls.then_some("contact"), weakens.then_some("friction")];
    let names: Vec<&str> = problem.body.softening().chain(own.into_iter().flatten()).collect();
    let why = format!("{why}; forces of {} fall here as the body moves", names.join(", "));
    let is_massless = weakens && problem.body.redistributed_mass.is_some();
    if is_massless {
        return problem.failed(&why, MASSLESS_REMEDY);
    }
    let body = &problem.body;
    let has = [Form::Mass, Form::Viscosity].map(|form| body.has_form(form));
    problem.failed(&why, &softening_remedy(has, body.softens_at_surface()))
}

/// Whether pressure or friction of a contact decrease with the motion.
fn decreases<const D: usize>(contact: &Contact<D>) -> bool {
    contact.monotonicity_constant() > 0.0 || contact.has_decreasing_friction()
}

/// The reason why Newton's method failed, as a message.
fn explain(reason: &str, counts: &SolveCounts) -> String {
    let reason = reason.to_owned();
    counts.period().map_or(reason.clone(), |period| format!("{reason}; {}", cycle_message(period)))
}

/// Writes the steepest descent of each contact's friction at the pressures in its bounds, over all ranks. Collective.
fn write_steepest_decreases<const D: usize>(session: &Session, contacts: &[Contact<D>], out: &mut Vec<f64>) {
    let steepest_decrease = |contact: &Contact<D>| match contact.has_decreasing_friction() {
        true => session.largest([contact.steepest_friction_decrease()])[0],
        false => 0.0,
    };
    out.clear();
    out.extend(contacts.iter().map(steepest_decrease));
}

/// Writes the branches of all contact points at velocities with ghosts.
fn write_branches<const D: usize, const S: usize>(
    body: &Body<D, S>,
    velocity: &DistributedVector,
    out: &mut Vec<u8>,
) -> Result<()> {
    let velocity = velocity.local()?;
    out.clear();
    body.contacts.iter().for_each(|contact| contact.branches(&velocity, out));
    Ok(())
}
