//! Newton's method for the contact equations of one step.

mod acceptance;
mod falling;
mod yielding;

use super::{
    StepOutcome,
    bounded::Bounded,
    contacts::restore_pressures,
    descent::{DIRECTIONS_PER_ITERATION, Descent, SHORT_DESCENT},
    equations::{CellForces, ContactEquations, Floor, PATIENCE, Scratch, SolveCounts, cycle_message},
    fallbacks::{Fallback, Properties, Search},
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
        effect::{Contact, Friction},
    },
    linear_algebra::petsc::{DistributedVector, Snes, has_option},
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
    pub(super) counts: SolveCounts,
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

/// Fixed-point iterations after which an attempt fails.
const MAX_FIXED_POINT_ITERATIONS: usize = 200;

/// As [`PATIENCE`], where other searches are more promising than the last iterations of this one.
const LITTLE_PATIENCE: usize = 25;

/// As [`PATIENCE`], where cells flow: shorter steps then take fewer iterations.
const PATIENCE_OF_FLOW: usize = 10;

const NO_MINIMUM: &str = "no minimum of the energy was found";

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

    /// Solves equations from their start value: tries one fallback after the other, each again while obstacles touch or part unexpectedly
    /// or friction decreases too fast, then checks that velocities and pressures lie on the contact graphs. Collective.
    pub(super) fn solve<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        mut equations: Reduced<'_>,
    ) -> Result<StepOutcome> {
        self.counts.restart();
        let system = equations.system;
        if let Some(bounded) = &mut self.bounded {
            write_branches(problem.body, system.converged, &mut self.branches_before)?;
            bounded.solve(problem, system, equations.velocity)?;
            let inclusion = self.inclusion_residual(problem, equations.velocity)?;
            return self.check_inclusion(problem, equations.velocity, inclusion);
        }
        self.start(problem, &mut equations)?;
        let properties = self.properties(problem);
        // With these parameters, whatever those of the last step were: a restarted run does not know them.
        if let Some(first) = properties.fallbacks().next() {
            self.set_graph_parameters(&mut problem.body.contacts, system.scales, first);
        }
        write_branches(problem.body, system.converged, &mut self.branches_before)?;
        let mut failure = String::new();
        let is_yielding = |(_, fallback): &(usize, Fallback)| fallback.search == Search::Yielding;
        let mut rest = properties.fallbacks_after(problem.state.fallback).take(system.fallbacks);
        let (mut next, mut has_yielded) = (rest.next(), false);
        while let Some((number, fallback)) = next {
            loop {
                self.set_graph_parameters(&mut problem.body.contacts, system.scales, fallback);
                let reason = match fallback.search {
                    Search::Yielding => {
                        let found = self.solve_yielding(problem, &mut equations, fallback);
                        frictions(&mut problem.body.contacts).for_each(|friction| friction.give = 0.0);
                        match found? {
                            Some(true) => None,
                            Some(false) => match self.solve_with_bounds(problem, &mut equations, fallback)? {
                                None => self.sharpen(problem, &mut equations, fallback)?,
                                failure => failure,
                            },
                            None => Some(NO_MINIMUM.to_owned()),
                        }
                    }
                    Search::Falling => {
                        self.solve_falling(problem, &mut equations)?;
                        let contacts = &mut problem.body.contacts;
                        write_steepest_decreases(problem.session, contacts, &mut self.steepest_decreases);
                        self.set_graph_parameters(contacts, system.scales, fallback);
                        self.solve_with_bounds(problem, &mut equations, fallback)?
                    }
                    Search::Sticking => match self.solve_with_bounds(problem, &mut equations, fallback)? {
                        None => None,
                        Some(_) => {
                            let fallback = Fallback { stiffness_factor: 1.0, ..fallback };
                            self.set_graph_parameters(&mut problem.body.contacts, system.scales, fallback);
                            self.solve_with_bounds(problem, &mut equations, fallback)?
                        }
                    },
                    _ => self.solve_with_bounds(problem, &mut equations, fallback)?,
                };
                match reason {
                    None if self.suits_friction(problem) => {
                        let outcome = self.finish(problem, &mut equations, fallback.search)?;
                        return Ok(StepOutcome { fallback: number, ..outcome });
                    }
                    // From this solution, with parameters for the pressures there.
                    None => {}
                    Some(reason) => {
                        failure = reason;
                        // Where a load comes at once, the pressures at the start of the step tell nothing of how fast friction falls.
                        let contacts = &problem.body.contacts;
                        write_steepest_decreases(problem.session, contacts, &mut self.steepest_decreases);
                        self.go_back(problem, &mut equations)?;
                        if !self.follow_obstacles(problem, &equations)? {
                            break;
                        }
                    }
                }
            }
            has_yielded |= is_yielding(&(number, fallback));
            // Full steps move a body that nothing but friction holds to and fro.
            next = match self.counts.singular > 0 && !has_yielded {
                true => properties.fallbacks().enumerate().find(is_yielding),
                false => None,
            };
            next = next.or_else(|| rest.find(|fallback| !(has_yielded && is_yielding(fallback))));
        }
        Err(problem.explain(&failure, properties.softens))
    }

    /// Prepares obstacles, linear solves and parameters of friction graphs for new equations. Collective.
    fn start<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        equations: &mut Reduced<'_>,
    ) -> Result<()> {
        let (session, contacts, system) = (problem.session, &mut problem.body.contacts, equations.system);
        self.start.copy_from(equations.velocity)?;
        // An attempt that ended with an error may have left them fixed.
        for friction in frictions(contacts) {
            friction.fix_speeds(false);
            if system.awaits_pressure {
                [friction.first_bounds] = session.sum([friction.bounds()]);
            }
        }
        let multiply = |x: &DistributedVector, y: &mut DistributedVector| system.matrix.multiply(x, y);
        self.obstacles.start(session, contacts, equations.velocity, system.tolerance, multiply)?;
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

    /// Whether pressures have risen so little that no friction decreases faster with the sliding speed than the parameters of its graphs
    /// permit. Collective.
    fn suits_friction<const D: usize, const S: usize>(&mut self, problem: &StepProblem<'_, D, S>) -> bool {
        let contacts = &problem.body.contacts;
        write_steepest_decreases(problem.session, contacts, &mut self.steepest_decreases);
        let mut pairs = contacts.iter().zip(&self.steepest_decreases);
        pairs.all(|(contact, decrease)| {
            *decrease <= LARGEST_DECREASE_RATIO * contact.friction.as_ref().map_or(0.0, |f| f.scale)
        })
    }

    /// Lets unknowns follow obstacles that have touched unexpectedly, and no longer those that have parted; returns whether there are
    /// such. Collective.
    fn follow_obstacles<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        Reduced { system, velocity, .. }: &Reduced<'_>,
    ) -> Result<bool> {
        let multiply = |x: &DistributedVector, y: &mut DistributedVector| system.matrix.multiply(x, y);
        let contacts = &mut problem.body.contacts;
        self.obstacles.follow_new_contacts(problem.session, contacts, velocity, multiply)
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
    fn solve_with_bounds<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        equations: &mut Reduced<'_>,
        Fallback { search, iteration, .. }: Fallback,
    ) -> Result<Option<String>> {
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
            problem.work.newton += usize::from(is_unchanged);
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

    /// The properties of a step that determine its fallbacks.
    pub(super) fn properties<const D: usize, const S: usize>(
        &self,
        problem: &StepProblem<'_, D, S>,
    ) -> Properties {
        let (body, contacts) = (&*problem.body, &problem.body.contacts);
        let follows =
            |contact: &Contact<D>| contact.friction.as_ref().is_some_and(|f| f.law.follows_pressure());
        let flows = self.flow.is_some();
        let has_friction = contacts.iter().any(|contact| contact.friction.is_some());
        Properties {
            follows_pressure: contacts.iter().any(follows),
            friction: self.settings.friction,
            has_user_search: self.has_user_search,
            // Motions of obstacles are not in equilibrium with those of the contact points alone.
            interior_is_linear: !flows
                && !contacts
                    .iter()
                    .any(|contact| contact.normal.needs_ghosts || contact.obstacle.is_driven()),
            flows,
            has_friction,
            may_rest: problem.may_rest,
            friction_moves_obstacles: has_friction
                && contacts.iter().any(|contact| contact.obstacle.is_driven()),
            softens: (flows && body.softens()) || contacts.iter().any(decreases),
            falls_with_gap: (flows && body.softens_at_surface()) || contacts.iter().any(falls_with_gap),
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
            contact.normal.scale = normal.max(2.0 * contact.monotonicity_constant());
            if let Some(friction) = &mut contact.friction {
                friction.set_parameter(tangential.max(decrease / INITIAL_DECREASE_RATIO), follows);
            }
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
        match self.has_descended {
            true => self.prepare_descent(problem, equations)?,
            false => self.set_linear_tolerances(equations, sharpness)?,
        }
        write_unknowns(&problem.body.contacts, equations.velocity)?;
        let solved = self.search(problem, equations, search, sharpness);
        problem.work.newton += self.counts.sets.len();
        problem.work.linear += std::mem::take(&mut self.counts.linear_iterations);
        let mut failure = self.agree_on_failure(problem.session, solved)?;
        if search == Search::Equilibrated {
            equations.velocity.copy_from(&self.scratch.velocity)?;
        } else {
            // Where branches recur, no unknowns were found after these.
            if let Some(last) = self.scratch.recurring.as_ref().filter(|_| search == Search::Sticking)
                && equations.velocity.norm()?.is_nan()
            {
                equations.velocity.copy_from(last)?;
            }
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
        descent.is_convex = self.properties(problem).is_convex();
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
            self.snes.search_along_steps(!search.follows_branches())?;
        }
        // A tolerance relative to the first residual of the step suffices: the right-hand side is almost zero where only an obstacle
        // moves the body. Later searches may start from where one before has gone astray.
        let first = self.counts.first;
        let absolute = sharpness * system.tolerance.max(self.settings.tolerance * first);
        let tolerances = (absolute, if first == 0.0 { self.settings.tolerance } else { 0.0 });
        let limit = self.settings.max_newton_iterations as usize;
        let most = DIRECTIONS_PER_ITERATION * limit;
        let directions = match search {
            Search::ShortDescent => SHORT_DESCENT,
            Search::Yielding => 2 * SHORT_DESCENT,
            _ if self.flow.is_some() || problem.body.contacts.iter().any(may_fall) => most,
            _ => limit,
        };
        let [iterations, patience] = match search {
            Search::FullSteps if limit >= PATIENCE && sharpness == 1.0 => {
                [most, if self.flow.is_some() { PATIENCE_OF_FLOW } else { PATIENCE }]
            }
            Search::FewFullSteps | Search::Sticking if limit >= PATIENCE => [most, LITTLE_PATIENCE],
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
            hiding_floor: system.hiding_floor,
            scratch: &mut self.scratch,
            linear_solver: krylov,
            session: problem.session,
            stop_at_cycles: search.follows_branches(),
            lacks_hold: system.awaits_pressure && search.follows_branches(),
            halves: search == Search::HalfSteps,
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

    /// The least residual norm of the last search in N, and the norm of its last velocities in m/s. Collective.
    pub(super) fn ended_at(&self) -> Result<(f64, f64)> {
        Ok((self.counts.least.0, self.scratch.velocity.norm()?))
    }

    /// The residual at the end of the last solve, in N.
    fn last_residual(&self) -> &DistributedVector {
        match (&self.bounded, &self.descent) {
            (Some(bounded), _) => bounded.residual(),
            (None, Some(descent)) if self.has_descended => &descent.residual,
            _ => self.snes.residual(),
        }
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

/// Whether pressure or friction of a contact decrease with the motion.
fn decreases<const D: usize>(contact: &Contact<D>) -> bool {
    contact.monotonicity_constant() > 0.0 || contact.friction.as_ref().is_some_and(Friction::decreases)
}

/// Whether the pressure of a contact may fall as the body approaches, so that equilibria may be unstable.
fn falls_with_gap<const D: usize>(contact: &Contact<D>) -> bool {
    contact.normal.law.depends_on_displacement() && contact.monotonicity_constant() > 0.0
}

/// The friction of all contacts that have any.
fn frictions<const D: usize>(contacts: &mut [Contact<D>]) -> impl Iterator<Item = &mut Friction<D>> {
    contacts.iter_mut().filter_map(|contact| contact.friction.as_mut())
}

/// Whether a contact may have several equilibria: not where pressures depend on the velocity alone.
fn may_fall<const D: usize>(contact: &Contact<D>) -> bool {
    contact.normal.law.depends_on_displacement() || contact.friction.is_some()
}

/// The reason why Newton's method failed, as a message.
fn explain(reason: &str, counts: &SolveCounts) -> String {
    let reason = reason.to_owned();
    counts.period(true).map_or(reason.clone(), |period| format!("{reason}; {}", cycle_message(period)))
}

/// Writes the steepest descent of each contact's friction at the pressures in its bounds, over all ranks. Collective.
fn write_steepest_decreases<const D: usize>(session: &Session, contacts: &[Contact<D>], out: &mut Vec<f64>) {
    let steepest_decrease = |contact: &Contact<D>| match &contact.friction {
        Some(friction) if friction.decreases() => session.largest([friction.steepest_decrease()])[0],
        _ => 0.0,
    };
    out.clear();
    // That of an attempt that left all bounds is none.
    let known = |decrease: f64| if decrease.is_finite() { decrease } else { 0.0 };
    out.extend(contacts.iter().map(steepest_decrease).map(known));
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
