//! Newton's method for the contact equations of one step.

use super::{
    StepOutcome,
    bounded::Bounded,
    contacts::restore_pressures,
    descent::{DIRECTIONS_PER_ITERATION, Descent, SHORT_DESCENT},
    equations::{CellForces, ContactEquations, Floor, PATIENCE, Scratch, SolveCounts, cycle_message},
    fallbacks::{Conditions, Fallback, Search},
    flow::Flow,
    linear_solver::{FrictionIteration, LINEAR_ITERATIONS, SolverSettings},
    obstacle_motions::ObstacleMotions,
    problem::{StepProblem, System},
    solver::Reduced,
};
use crate::{
    error::Result,
    fem::{
        body::Body,
        effect::{COUNTS, Contact, PointCount},
    },
    linear_algebra::{
        petsc::{DistributedVector, Snes, has_option},
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
            has_user_search: has_option("snes_linesearch_type")?,
            flow: None,
        })
    }

    /// Solves equations from their start value: tries one fallback after the other, then checks that velocities and pressures lie on
    /// the contact graphs. Collective.
    pub(super) fn solve<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        mut equations: Reduced<'_>,
    ) -> Result<StepOutcome> {
        self.counts.restart();
        let system = equations.system;
        if let Some(bounded) = &mut self.bounded {
            write_branches(problem.body, system.converged, &mut self.branches_before)?;
            self.counts.newton_iterations = bounded.solve(problem, system, equations.velocity)?;
            let inclusion = self.inclusion_residual(problem, equations.velocity)?;
            return self.check_inclusion(problem, equations.velocity, inclusion);
        }
        self.start(problem, &mut equations)?;
        let conditions = self.conditions(problem.body);
        // With these parameters, whatever those of the last step were: a restarted run does not know them.
        if let Some(first) = conditions.fallbacks().next() {
            self.set_graph_parameters(&mut problem.body.contacts, system.scales, first);
        }
        write_branches(problem.body, system.converged, &mut self.branches_before)?;
        let mut failure = String::new();
        for fallback in conditions.fallbacks() {
            match self.attempt_with_parameters(problem, &mut equations, fallback)? {
                Some(reason) => failure = reason,
                None => return self.finish(problem, &mut equations, fallback.search),
            }
        }
        Err(problem.explain(&failure, conditions.softens))
    }

    /// Prepares obstacles, linear solves and parameters of friction graphs for new equations. Collective.
    fn start<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        equations: &mut Reduced<'_>,
    ) -> Result<()> {
        let (session, contacts, system) = (problem.session, &mut problem.body.contacts, equations.system);
        self.start.copy_from(equations.velocity)?;
        let multiply = |x: &DistributedVector, y: &mut DistributedVector| system.matrix.multiply(x, y);
        self.obstacles.start(session, contacts, equations.velocity, system.tolerance, multiply)?;
        self.set_linear_tolerances(equations, 1.0)?;
        write_steepest_decreases(session, contacts, &mut self.steepest_decreases);
        Ok(())
    }

    /// Sets the tolerances of linear solves, for equations that are solved to this share of their tolerance.
    fn set_linear_tolerances(&self, equations: &mut Reduced<'_>, sharpness: f64) -> Result<()> {
        let [reduction, share] =
            if self.obstacles.is_empty() { [LINEAR_REDUCTION, LINEAR_SHARE] } else { WITH_OBSTACLES };
        let tolerance = sharpness * share * equations.system.tolerance;
        equations.krylov.set_tolerances(reduction, tolerance, LINEAR_ITERATIONS)
    }

    /// Tries one fallback, again while obstacles touch or part unexpectedly, or while pressures rise so much that friction decreases
    /// faster than the parameters of its graphs permit; returns the reason for failure, if it fails. Collective.
    fn attempt_with_parameters<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        equations: &mut Reduced<'_>,
        fallback: Fallback,
    ) -> Result<Option<String>> {
        let system = equations.system;
        let multiply = |x: &DistributedVector, y: &mut DistributedVector| system.matrix.multiply(x, y);
        loop {
            self.set_graph_parameters(&mut problem.body.contacts, system.scales, fallback);
            let failure = self.attempt_with_bounds(problem, equations, fallback)?;
            let (session, contacts) = (problem.session, &mut problem.body.contacts);
            if failure.is_none() {
                write_steepest_decreases(session, contacts, &mut self.steepest_decreases);
                let mut pairs = contacts.iter().zip(&self.steepest_decreases);
                if pairs
                    .all(|(contact, decrease)| *decrease <= LARGEST_DECREASE_RATIO * contact.friction_scale())
                {
                    return Ok(None);
                }
                continue;
            }
            self.go_back(problem, equations)?;
            let (contacts, velocity) = (&mut problem.body.contacts, &*equations.velocity);
            if !self.obstacles.follow_new_contacts(session, contacts, velocity, multiply)? {
                return Ok(failure);
            }
        }
    }

    /// Sets velocity and pressures to those from which the step was started.
    fn go_back<const D: usize, const S: usize>(
        &self,
        problem: &mut StepProblem<'_, D, S>,
        equations: &mut Reduced<'_>,
    ) -> Result<()> {
        equations.velocity.copy_from(&self.start)?;
        restore_pressures(problem.body, problem.state)
    }

    /// Solves the equations with given parameters of the graphs. A fixed-point iteration solves with friction bounds at fixed pressures,
    /// and updates these until the solution also solves the equations with its own pressures. Returns the reason for failure, if it
    /// fails. Collective.
    fn attempt_with_bounds<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        equations: &mut Reduced<'_>,
        Fallback { search, iteration, .. }: Fallback,
    ) -> Result<Option<String>> {
        if search == Search::Yielding {
            self.solve_yielding(problem, equations)?;
        }
        self.scratch.restart();
        if iteration == FrictionIteration::Newton {
            return self.attempt(problem, equations, search, 1.0);
        }
        for round in 0..MAX_FIXED_POINT_ITERATIONS {
            self.fix_bounds(problem, equations.system)?;
            let failure = self.attempt(problem, equations, search, 1.0)?;
            let is_unchanged = self.counts.sets.is_empty();
            // Where nothing was to be done, the solution for the last bounds also solves the equations with its own bounds.
            if failure.is_some() || (is_unchanged && round > 0) {
                return Ok(failure);
            }
            self.counts.newton_iterations += usize::from(is_unchanged);
            self.scratch.go_on();
        }
        Ok(Some(format!(
            "friction bounds still change after {MAX_FIXED_POINT_ITERATIONS} fixed-point iterations"
        )))
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
    /// none. Collective.
    fn solve_yielding<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        equations: &mut Reduced<'_>,
    ) -> Result<()> {
        let system = self.loosened(equations.system);
        let equations = &mut Reduced { system, krylov: equations.krylov, velocity: equations.velocity };
        let mut reached = None;
        let (mut ratio, mut factor) = (FIRST_RATIO, RATIO_FACTOR);
        set_give(problem.body, ratio);
        write_unknowns(&problem.body.contacts, equations.velocity)?;
        write_velocities(&mut problem.body.contacts, equations.velocity)?;
        self.fix_bounds(problem, system)?;
        loop {
            set_give(problem.body, ratio);
            self.scratch.restart();
            let failure = self.attempt(problem, equations, Search::ShortDescent, 1.0)?;
            if failure.is_none() {
                self.fix_bounds(problem, system)?;
                self.keep_reached(&problem.body.contacts, equations.velocity)?;
                reached = Some(ratio);
                factor = f64::max(RATIO_FACTOR, factor * factor);
            } else {
                factor = factor.sqrt();
            }
            let Some(last) = reached else {
                self.go_back(problem, equations)?;
                break;
            };
            if failure.is_some() {
                set_give(problem.body, last);
                self.go_to_reached(problem, equations)?;
            }
            if last <= LAST_RATIO || factor > LARGEST_RATIO_FACTOR {
                break;
            }
            ratio = last * factor;
        }
        problem.body.contacts.iter_mut().for_each(|contact| contact.set_give(0.0));
        Ok(())
    }

    /// The equations with the tolerance of solutions with points that yield.
    fn loosened<'a>(&self, system: System<'a>) -> System<'a> {
        let tolerance = system.tolerance.max(self.settings.tolerance * self.counts.first);
        let enough = YIELDING_TOLERANCE * tolerance;
        // The first residual may be much larger than all forces.
        let tolerance = if system.floor.largest > 0.0 { enough.min(system.floor.largest) } else { enough };
        System { tolerance, ..system }
    }

    /// Keeps the unknowns of this velocity, and the motions of obstacles.
    fn keep_reached<const D: usize>(
        &mut self,
        contacts: &[Contact<D>],
        velocity: &DistributedVector,
    ) -> Result<()> {
        let unknowns = match &mut self.reached {
            Some(unknowns) => unknowns,
            none => none.insert(velocity.like()?),
        };
        unknowns.copy_from(velocity)?;
        write_unknowns(contacts, unknowns)?;
        self.obstacles.keep(contacts);
        Ok(())
    }

    /// Sets velocities, pressures and motions of obstacles to those kept last. Collective.
    fn go_to_reached<const D: usize, const S: usize>(
        &self,
        problem: &mut StepProblem<'_, D, S>,
        equations: &mut Reduced<'_>,
    ) -> Result<()> {
        let Some(unknowns) = &self.reached else { return Ok(()) };
        let contacts = &mut problem.body.contacts;
        problem.session.agree(self.obstacles.restore(contacts))?;
        equations.velocity.copy_from(unknowns)?;
        write_velocities(contacts, equations.velocity)
    }

    fn conditions<const D: usize, const S: usize>(&self, body: &Body<D, S>) -> Conditions {
        let contacts = &body.contacts;
        let follows = |contact: &Contact<D>| contact.friction().is_some_and(|f| f.follows_pressure());
        let flows = self.flow.is_some();
        let rubs = contacts.iter().any(|contact| contact.friction().is_some());
        Conditions {
            follows_pressure: contacts.iter().any(follows),
            friction: self.settings.friction,
            has_user_search: self.has_user_search,
            // Motions of obstacles are not in equilibrium with those of the contact points alone.
            interior_is_linear: !flows
                && !contacts.iter().any(|contact| contact.needs_ghosts() || contact.obstacle.is_some()),
            rubs,
            rubs_obstacles: rubs && !self.obstacles.is_empty(),
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

    /// Solves equations by one search from the velocity in them, where it writes the solution, to this share of their tolerance; returns
    /// the reason for failure, if it fails. Collective.
    fn attempt<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        equations: &mut Reduced<'_>,
        search: Search,
        sharpness: f64,
    ) -> Result<Option<String>> {
        self.has_descended = search.minimises();
        if self.has_descended {
            self.prepare_descent(problem, equations)?;
        }
        write_unknowns(&problem.body.contacts, equations.velocity)?;
        let solved = self.search(problem, equations, search, sharpness);
        self.counts.newton_iterations += self.counts.sets.len();
        let mut failure = self.agree_on_failure(problem.session, solved)?;
        if search == Search::Equilibrated {
            equations.velocity.copy_from(&self.scratch.velocity)?;
        } else {
            write_velocities(&mut problem.body.contacts, equations.velocity)?;
            if self.is_at_floor(problem, equations, failure.is_none())? {
                failure = None;
            }
        }
        if failure.is_none() {
            failure = self.obstacles.failure(self.last_residual().norm()?, self.settings.tolerance);
        }
        Ok(failure)
    }

    /// Prepares the minimisation of energies. Collective.
    fn prepare_descent<const D: usize, const S: usize>(
        &mut self,
        problem: &StepProblem<'_, D, S>,
        Reduced { system, krylov, velocity }: &mut Reduced<'_>,
    ) -> Result<()> {
        krylov.set_tolerances(DESCENT_REDUCTION, LINEAR_SHARE * system.tolerance, LINEAR_ITERATIONS)?;
        let mut descent = match self.descent.take() {
            Some(descent) => descent,
            None => Descent::new(velocity)?,
        };
        descent.has_other_start = self.writes_steady_start(problem, velocity, &mut descent.other_start)?;
        self.descent = Some(descent);
        Ok(())
    }

    /// Solves equations for the unknowns in them; returns the reason for failure, if it fails. Collective.
    fn search<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        Reduced { system, krylov, velocity: unknowns }: &mut Reduced<'_>,
        search: Search,
        sharpness: f64,
    ) -> Result<Option<&'static str>> {
        if !self.has_user_search {
            self.snes.search_along_steps(search != Search::FullSteps)?;
        }
        // A tolerance relative to the first residual of the step suffices: the right-hand side is almost zero where only an obstacle
        // moves the body.
        let absolute = sharpness * system.tolerance.max(self.settings.tolerance * self.counts.first);
        let tolerances = (absolute, self.settings.tolerance);
        let limit = self.settings.max_newton_iterations as usize;
        let most = DIRECTIONS_PER_ITERATION * limit;
        let directions = match search {
            Search::ShortDescent => SHORT_DESCENT,
            _ if self.flow.is_some() || problem.body.contacts.iter().any(may_fall) => most,
            _ => limit,
        };
        let [iterations, patience] = match search {
            Search::FullSteps if limit >= PATIENCE && sharpness == 1.0 => [most, PATIENCE],
            _ => [limit, usize::MAX],
        };
        self.counts.restart_search();
        let (cells, contacts) = problem.body.cells_and_contacts();
        let mut cells = self.flow.as_mut().map(|flow| flow.of(cells, problem.flow_start));
        let is_equilibrated = search == Search::Equilibrated;
        let mut equations = ContactEquations {
            matrix: system.matrix,
            cells: cells.as_mut().map(|cells| cells as &mut dyn CellForces),
            contacts,
            obstacles: &mut self.obstacles,
            right_hand_side: system.right_hand_side,
            floor: if is_equilibrated { Floor::default() } else { system.floor },
            scratch: &mut self.scratch,
            linear_solver: krylov,
            session: problem.session,
            stop_at_cycles: search == Search::FullSteps,
            patience,
            equilibrated: is_equilibrated,
            counts: std::mem::take(&mut self.counts),
        };
        let solved = match self.descent.as_mut().filter(|_| search.minimises()) {
            Some(descent) => {
                let solved = descent.solve(&mut equations, unknowns, tolerances, directions);
                equations.set_softening(1.0);
                solved.map(|converged| (!converged).then_some(NO_MINIMUM))
            }
            None => {
                let solved = self.snes.solve(&mut equations, unknowns, tolerances, iterations);
                solved.map(|outcome| (!outcome.converged()).then(|| outcome.description()))
            }
        };
        self.counts = equations.counts;
        solved
    }

    /// The reason why a search failed, if it failed on any rank. Collective.
    fn agree_on_failure(
        &self,
        session: &Session,
        solved: Result<Option<&'static str>>,
    ) -> Result<Option<String>> {
        let has_failed = !matches!(&solved, Ok(None));
        // All ranks take the same branch, on whichever rank the failure occurred.
        if session.total(usize::from(has_failed)) == 0 {
            return Ok(None);
        }
        match session.agree(solved) {
            Ok(reason) => Ok(Some(explain(reason.unwrap_or("another rank failed"), &self.counts))),
            Err(error) if error.is_failure() => Ok(Some(error.to_string())),
            Err(error) => Err(error.into()),
        }
    }

    /// Whether a search that converged or failed has ended at the rounding errors of the forces. These limit the accuracy of pressures,
    /// too: sets the reference forces of the contacts accordingly. Collective.
    fn is_at_floor<const D: usize, const S: usize>(
        &self,
        problem: &mut StepProblem<'_, D, S>,
        equations: &Reduced<'_>,
        has_converged: bool,
    ) -> Result<bool> {
        if has_converged && !self.scratch.is_at_floor {
            return Ok(false);
        }
        let (contacts, floor) = (&mut problem.body.contacts, equations.system.floor);
        let speed = equations.velocity.norm()? + self.obstacles.speed(contacts);
        if !has_converged && !floor.is_reached(self.last_residual().norm()?, speed) {
            return Ok(false);
        }
        let forces = floor.at(speed) / self.settings.inclusion_tolerance
            * ((problem.body.mesh.total_nodes * D) as f64).sqrt();
        contacts.iter_mut().for_each(|c| c.reference.forces = c.reference.forces.max(forces));
        Ok(true)
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
        write_unknowns(&problem.body.contacts, start)?;
        Ok(true)
    }

    /// Solves to smaller residuals until the velocity and the pressures of the contacts lie on the graphs, and summarises the work of the
    /// step. Collective.
    fn finish<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        equations: &mut Reduced<'_>,
        search: Search,
    ) -> Result<StepOutcome> {
        let mut inclusion = self.inclusion_residual(problem, equations.velocity)?;
        for times in 1..=MOST_SHARPER {
            if inclusion <= self.settings.inclusion_tolerance {
                break;
            }
            let sharpness = SHARPER.powi(times);
            self.set_linear_tolerances(equations, sharpness)?;
            self.scratch.restart();
            // Where rounding errors end it, its last iterate is a solution with the residual of a search that is not sharper; otherwise it
            // is none, even if it is on the graphs.
            if let Some(reason) = self.attempt(problem, equations, search, sharpness)? {
                let residual = self.last_residual().norm()?;
                let is_balanced = self.obstacles.failure(residual, self.settings.tolerance).is_none();
                if !(is_balanced && residual <= equations.system.tolerance) {
                    return Err(problem.failed(&reason, INCLUSION_REMEDY));
                }
            }
            inclusion = self.inclusion_residual(problem, equations.velocity)?;
        }
        let outcome = self.check_inclusion(problem, equations.velocity, inclusion)?;
        // With points that yield nothing falls: the energies are those of fixed friction bounds.
        let may_have_fallen = self.has_descended && search != Search::Yielding;
        Ok(StepOutcome { fell: may_have_fallen && self.counts.unstable > 0, ..outcome })
    }

    /// Checks the distance from the graphs of this solution, whose ghosts are updated, and summarises the work of the step. Collective.
    fn check_inclusion<const D: usize, const S: usize>(
        &mut self,
        problem: &StepProblem<'_, D, S>,
        trial: &DistributedVector,
        inclusion: f64,
    ) -> Result<StepOutcome> {
        let (session, body) = (problem.session, &*problem.body);
        if inclusion.is_nan() || inclusion > self.settings.inclusion_tolerance {
            let reason = format!("velocity and pressure deviate from the contact graph by {inclusion:.1e}");
            return Err(problem.failed(&reason, INCLUSION_REMEDY));
        }
        write_branches(body, trial, &mut self.branches_after)?;
        let changes = self.branches_before.iter().zip(&self.branches_after).filter(|(a, b)| a != b).count();
        let residual = self.last_residual().norm()?;
        let velocity = trial.local()?;
        let mut points = [0.0; COUNTS];
        for contact in &body.contacts {
            let counts = contact.count(&velocity).to_array();
            points.iter_mut().zip(counts).for_each(|(sum, count)| *sum += count);
        }
        Ok(StepOutcome {
            newton_iterations: self.counts.newton_iterations,
            linear_iterations: self.counts.linear_iterations,
            active_changes: session.total(changes),
            points: PointCount::from_array(session.sum(points)),
            indefinite_solves: self.counts.indefinite,
            inclusion_residual: inclusion,
            residual,
            ..StepOutcome::default()
        })
    }

    /// The norm of the first residual of the last solve, in N.
    pub(super) fn first_residual(&self) -> f64 {
        self.counts.first
    }

    /// The residual at the end of the last solve, in N.
    fn last_residual(&self) -> &DistributedVector {
        match (&self.bounded, &self.descent) {
            (Some(bounded), _) => bounded.residual(),
            (None, Some(descent)) if self.has_descended => &descent.residual,
            _ => self.snes.residual(),
        }
    }

    /// The largest distance of the velocity in `trial` and of the pressures of the contacts from the graphs. Collective.
    fn inclusion_residual<const D: usize, const S: usize>(
        &self,
        problem: &StepProblem<'_, D, S>,
        trial: &mut DistributedVector,
    ) -> Result<f64> {
        trial.update_ghosts()?;
        let (velocity, residual) = (trial.local()?, self.last_residual().owned()?);
        let mut largest = 0.0;
        for contact in &problem.body.contacts {
            let range = problem.session.largest(contact.range(&velocity));
            let distance = contact.inclusion_residual(&velocity, &residual, range);
            largest = larger(largest, distance);
        }
        Ok(problem.session.largest([largest])[0])
    }
}

/// Converts velocities into unknowns.
fn write_unknowns<const D: usize>(contacts: &[Contact<D>], velocities: &mut DistributedVector) -> Result<()> {
    let mut values = velocities.owned_mut()?;
    contacts.iter().for_each(|contact| contact.unmap(&mut values));
    Ok(())
}

/// Converts unknowns into velocities, and sets the pressures of the contacts.
fn write_velocities<const D: usize>(
    contacts: &mut [Contact<D>],
    unknowns: &mut DistributedVector,
) -> Result<()> {
    let mut values = unknowns.owned_mut()?;
    contacts.iter_mut().for_each(|contact| contact.map(&mut values));
    Ok(())
}

/// Lets friction points yield by this ratio of the compliance of the body.
fn set_give<const D: usize, const S: usize>(body: &mut Body<D, S>, ratio: f64) {
    body.contacts.iter_mut().for_each(|contact| contact.set_give(ratio / contact.friction_scale()));
}

/// Whether pressure or friction of a contact decrease with the motion.
fn decreases<const D: usize>(contact: &Contact<D>) -> bool {
    contact.monotonicity_constant() > 0.0 || contact.has_decreasing_friction()
}

/// Whether a contact may have several equilibria: not where pressures depend on the velocity alone.
fn may_fall<const D: usize>(contact: &Contact<D>) -> bool {
    contact.law.depends_on_displacement() || contact.friction().is_some()
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
