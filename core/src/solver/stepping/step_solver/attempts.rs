//! The attempts at a step: how it is solved at first, and what is changed after each failure.

use super::{StepSolver, unassembled};
use crate::{
    error::Result,
    fem::effect::{Contact, Friction},
    linear_algebra::{
        petsc::{DistributedVector, Ksp, Precision},
        tensor::larger,
    },
    solver::stepping::{
        StepOutcome,
        contacts::{multiple_to_touch, rest_on_contacts, restore_pressures},
        corrections::correct,
        equations::{Floor, StepMatrix},
        factor_cache::Prepared,
        flow_corrections::{Corrected, FlowCorrections, StepFactor},
        force_scale::size_of,
        linear_solver::LINEAR_ITERATIONS,
        newton::Newton,
        problem::{REMEDY, StepProblem, System},
        solver::LinearSolver,
        step_clock::CountedMatrix,
    },
};

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
/// The same where contact alone holds a body: moved as a rigid one, it has those of its stiffness.
const LARGEST_FLOOR_OF_FREE: f64 = 1e-2;
/// The share of the forces that a stiffness is to leave of rounding errors where they hide the solution.
const WANTED_FLOOR: f64 = 1e-6;
/// The largest residual at which Newton's method stagnates by rounding errors, as a multiple of those of `K v`.
const STAGNANT: f64 = 4.0;

/// Rounding errors may hide that nothing holds a body in residuals below this multiple of them.
const HIDING: f64 = 10.0;

/// Fallbacks of Newton's method that are tried before a body that contact alone holds starts from elsewhere.
const FIRST_FALLBACKS: usize = 2;
/// Number of factors with derivatives at velocities of a step after which Newton's method solves it.
const MOST_FACTORS: usize = 15;

/// A body that only contact holds flies away if it moves by more than this multiple of its size in a step.
const FAR: f64 = 1e3;
/// The same for one that comes to rest on its contacts.
const LARGEST_REST: f64 = 0.1;
const FLIGHT: &str =
    "a body moves by more than a thousand times its size, so that rounding errors hide the forces on it";
const NO_FLIGHT: &str = "check the loads and the gap";

/// What is changed before a step is tried again.
#[derive(Clone, Copy)]
enum Change {
    /// The step is solved as it is.
    Nothing,
    /// Where full steps have failed and the body may rest, the step starts from there.
    AtRest,
    /// After that, the step starts as it did at first, with more fallbacks of Newton's method.
    NotAtRest,
    /// The factor is one in double precision.
    DoublePrecision,
    /// Where contact alone holds a body, the step starts from what soft springs bear.
    FromSprings,
    /// The same, but moved as a rigid body to where the contacts bear the loads.
    OnContacts,
    /// Where contact alone holds a body, the step starts as it did at first, with all fallbacks of Newton's method.
    AllFallbacks,
    /// The tolerance is the residual that rounding errors of the solution leave.
    Relaxed,
}

impl Change {
    /// All changes in their order. Each attempt keeps those before.
    const ALL: [Self; 8] = [
        Self::Nothing,
        Self::AtRest,
        Self::NotAtRest,
        Self::DoublePrecision,
        Self::FromSprings,
        Self::OnContacts,
        Self::AllFallbacks,
        Self::Relaxed,
    ];
}

/// How accurately a step is solved, in N.
#[derive(Debug, Clone, Copy)]
struct Accuracy {
    /// The residual norm at which it counts as solved.
    tolerance: f64,
    /// The size of the forces, of those that drive obstacles, too.
    size: f64,
    /// The residual that rounding errors leave.
    floor: Floor,
    /// The largest that counts as such before something is pressed on: rounding errors of a body that has moved farther might hide its loads.
    near_floor: f64,
    /// Whether that holds only after something is pressed on: where contact alone holds a body, a direction may be any rigid motion, whose
    /// rounding errors hide that nothing holds it.
    awaits_pressure: bool,
    /// The number of fallbacks of Newton's method that are tried.
    fallbacks: usize,
    /// Whether a body at rest is tried after the first of them.
    tries_rest: bool,
    /// The forces to which its residual is compared: not below those of which rounding errors are the tolerance.
    reference: f64,
}

/// What an attempt uses: the solvers, the matrix of the step and the one that is factored.
struct Parts<'a> {
    newton: Option<&'a mut Newton>,
    flowing: Option<&'a mut FlowCorrections>,
    solver: &'a mut dyn LinearSolver,
    matrix: CountedMatrix<'a>,
    factored: FactorOf<'a>,
    scales: &'a [[f64; 2]],
}

/// What is factored.
enum FactorOf<'a> {
    /// The matrix of the step.
    Step,
    /// That of a step of another length.
    AnotherLength,
    /// That of a step with the derivatives of what its cells add.
    Tangents(CountedMatrix<'a>),
}

impl StepSolver {
    /// Solves a step from the velocity in `trial`, and writes the new one there. Collective.
    pub(in crate::solver::stepping) fn solve<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        trial: &mut DistributedVector,
    ) -> Result<StepOutcome> {
        let mut accuracy = self.accuracy(problem, trial)?;
        if self.springs.are_needed() || accuracy.tries_rest {
            keep(&mut self.first_start, trial)?;
        }
        let (mut failure, mut hidden) = (None, None);
        for change in Change::ALL {
            if !self.apply(change, problem, trial, &mut accuracy)? {
                continue;
            }
            let solved = match self.flowing {
                Some(_) => self.solve_with_flow(problem, trial, accuracy),
                None => self.solve_without_flow(problem, trial, accuracy),
            };
            let solved = problem.session.agree(solved);
            let solved =
                solved.and_then(|solved| problem.session.agree(self.refuse_flight(problem, trial, solved)));
            match solved {
                Ok(solved) => {
                    // Where only an obstacle moves the body, its forces are those with which the step begins.
                    let first = self.newton.as_ref().map_or(0.0, |newton| newton.counts.first);
                    let reference = accuracy.reference.max(first);
                    let residual = if reference > 0.0 { solved.residual / reference } else { 0.0 };
                    return Ok(StepOutcome { residual, ..solved });
                }
                Err(error) if error.is_failure() => {
                    failure = Some(error);
                    hidden = hidden.or(self.rounding_that_hides(problem, accuracy)?);
                }
                Err(error) => return Err(self.springs.explain(error)),
            }
        }
        if let Some(share) = hidden {
            let [why, remedy] = words_of_rounding(share);
            return Err(problem.failed(&why, &remedy));
        }
        Err(failure.map_or_else(unassembled, |failure| self.springs.explain(failure)))
    }

    /// The residual of the last search that failed as a share of the forces, where contact alone holds a body and it consists of rounding
    /// errors of the forces within the body. Collective.
    fn rounding_that_hides<const D: usize, const S: usize>(
        &self,
        problem: &StepProblem<'_, D, S>,
        accuracy: Accuracy,
    ) -> Result<Option<f64>> {
        let Some(newton) = self.newton.as_ref().filter(|_| self.springs.are_needed()) else {
            return Ok(None);
        };
        let (residual, speed) = newton.ended_at()?;
        // The motion of a body that nothing holds has rounding errors of any size.
        let is_near = speed <= LARGEST_REST * farthest(problem) / FAR;
        let is_rounding =
            is_near && residual > accuracy.floor.largest && residual <= accuracy.floor.slope * speed;
        Ok((is_rounding && accuracy.size > 0.0).then(|| residual / accuracy.size))
    }

    /// Changes how a step is solved; returns whether the change is one. Collective.
    fn apply<const D: usize, const S: usize>(
        &mut self,
        change: Change,
        problem: &mut StepProblem<'_, D, S>,
        trial: &mut DistributedVector,
        accuracy: &mut Accuracy,
    ) -> Result<bool> {
        match change {
            Change::Nothing => Ok(true),
            Change::AtRest => {
                if !accuracy.tries_rest {
                    return Ok(false);
                }
                trial.fill(0.0)?;
                restore_pressures(problem.body, problem.state)?;
                Ok(true)
            }
            Change::NotAtRest => {
                if !accuracy.tries_rest {
                    return Ok(false);
                }
                accuracy.fallbacks = self.first_fallbacks();
                go_to(&self.first_start, problem, trial)?;
                Ok(true)
            }
            Change::DoublePrecision => {
                if self.parts()?.solver.precision() != Some(Precision::Single) {
                    return Ok(false);
                }
                problem.session.agree(self.refactor_in_double(problem, trial))?;
                Ok(true)
            }
            Change::FromSprings => {
                if !self.springs.are_needed() {
                    return Ok(false);
                }
                self.start_from_springs(problem, trial)?;
                (accuracy.awaits_pressure, accuracy.fallbacks) = (false, usize::MAX);
                Ok(true)
            }
            Change::OnContacts => Ok(self.springs.are_needed() && self.start_on_contacts(problem, trial)?),
            Change::AllFallbacks => {
                if !self.springs.are_needed() {
                    return Ok(false);
                }
                accuracy.awaits_pressure = true;
                go_to(&self.first_start, problem, trial)?;
                Ok(true)
            }
            Change::Relaxed => {
                // The start value may be much smaller than the solution, especially at rest.
                let mut solution = trial.like()?;
                self.precondition(problem.forces, &mut solution)?;
                let rounding = f64::EPSILON * self.matrix_norm * solution.norm()?;
                if !(rounding > accuracy.tolerance && rounding <= LARGEST_FLOOR * accuracy.size) {
                    return Ok(false);
                }
                accuracy.tolerance = rounding;
                if !self.is_nonlinear() {
                    trial.copy_from(&solution)?;
                }
                Ok(true)
            }
        }
    }

    /// Starts a step anew from the velocity at which soft springs bear the loads. Foundations that nothing presses on yet do not resist: the
    /// start lies farther on in the same direction, where the gaps are closed. Dashpots, which bear less and less of a faster motion,
    /// resist most at rest. Collective.
    fn start_from_springs<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        trial: &mut DistributedVector,
    ) -> Result<()> {
        if problem.body.contacts.iter().all(|contact| !contact.normal.law.depends_on_displacement()) {
            trial.fill(0.0)?;
        } else {
            let forces = loads(problem, trial)?;
            self.precondition(&forces, trial)?;
            let multiple = multiple_to_touch(problem.session, problem.body, trial)?;
            trial.scale(multiple)?;
        }
        restore_pressures(problem.body, problem.state)
    }

    /// Starts a step anew from the same velocity, to which a rigid motion is added that takes the body to where its contacts bear what the
    /// springs bear: a law may have no pressure until far beyond the gap, and none that grows. Returns whether there is such a place.
    /// Collective.
    fn start_on_contacts<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        trial: &mut DistributedVector,
    ) -> Result<bool> {
        let mut borne = loads(problem, trial)?;
        self.precondition(&borne, trial)?;
        let (mut inner, mut rigid) = (trial.like()?, trial.like()?);
        self.multiply(trial, &mut inner)?;
        borne.add_scaled(-1.0, &inner)?;
        self.precondition(&borne, &mut rigid)?;
        restore_pressures(problem.body, problem.state)?;
        let power = borne.dot(&rigid)?;
        rest_on_contacts(problem.session, problem.body, (trial, &mut rigid), power)
    }

    /// Solves a step in which no cells flow, or the whole body by Newton's method. Collective.
    fn solve_without_flow<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        trial: &mut DistributedVector,
        accuracy: Accuracy,
    ) -> Result<StepOutcome> {
        self.keep_start(trial)?;
        let Parts { newton, solver, matrix, scales, .. } = self.parts()?;
        let system = accuracy.system(problem, &matrix, scales);
        match newton {
            None => solve_linear(solver.krylov().linear_solver(), problem, system, trial),
            Some(newton) => correct(newton, solver, problem, system, trial),
        }
    }

    /// Solves a condensed step in which cells flow: by corrections, where these are slow with factors that have derivatives at the
    /// velocities reached, and where that does not help by Newton's method for the whole body. Collective.
    fn solve_with_flow<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        trial: &mut DistributedVector,
        accuracy: Accuracy,
    ) -> Result<StepOutcome> {
        let session = problem.session;
        if problem.body.flows_beside_viscosity() {
            // Those of the last step help no more than those without, and a rejected step leaves no trace.
            self.forget_tangents();
        }
        self.flowing.iter_mut().for_each(|flowing| flowing.begin());
        let softens = problem.body.softens();
        if softens {
            keep(&mut self.start, trial)?;
        }
        let (mut factors, mut earlier, mut is_stable) = (0, StepOutcome::default(), true);
        loop {
            let Parts { newton: Some(newton), flowing: Some(flowing), solver, matrix, factored, scales } =
                self.parts()?
            else {
                return Err(unassembled());
            };
            let system = accuracy.system(problem, &matrix, scales);
            let is_replaceable = factors < MOST_FACTORS;
            let other: Option<&dyn StepMatrix> = match &factored {
                FactorOf::Tangents(other) => Some(other),
                FactorOf::Step | FactorOf::AnotherLength => None,
            };
            let corrected = match factored {
                FactorOf::Step | FactorOf::Tangents(_) if is_stable => {
                    let factor = StepFactor { solver: &mut *solver, other };
                    flowing.correct(newton, factor, problem, system, trial)?
                }
                _ => Corrected::Unfinished(StepOutcome::default(), false),
            };
            match corrected {
                Corrected::Solved(outcome) => return Ok(earlier.followed_by(outcome)),
                Corrected::Unfinished(work, has_progressed)
                    if is_replaceable && (has_progressed || factors == 0) =>
                {
                    (factors, earlier) = (factors + 1, earlier.followed_by(work));
                }
                Corrected::Unfinished(work, _) => {
                    let outcome = flowing.solve_whole(solver, problem, system, trial)?;
                    return Ok(earlier.followed_by(work).followed_by(outcome));
                }
            }
            if !session.agree(self.refactor_with_tangents(problem, trial))? {
                factors = MOST_FACTORS;
                if softens {
                    // Newton's method tells where a body goes that softens, from the start of the step.
                    is_stable = false;
                    go_to(&self.start, problem, trial)?;
                }
            }
        }
    }

    /// Refuses the solution of a step in which a body that only contact holds flies away. Collective.
    fn refuse_flight<const D: usize, const S: usize>(
        &self,
        problem: &StepProblem<'_, D, S>,
        trial: &DistributedVector,
        solved: StepOutcome,
    ) -> Result<StepOutcome> {
        match self.springs.are_needed() && trial.norm()? > farthest(problem) {
            true => Err(problem.failed(FLIGHT, NO_FLIGHT)),
            false => Ok(solved),
        }
    }

    /// Keeps the velocity from which a step with a factor in single precision starts.
    fn keep_start(&mut self, trial: &DistributedVector) -> Result<()> {
        if self.parts()?.solver.precision() == Some(Precision::Single) {
            keep(&mut self.start, trial)?;
        }
        Ok(())
    }

    fn parts(&mut self) -> Result<Parts<'_>> {
        let Self { active, with_tangents, step_matrix, newton, flowing, products, .. } = self;
        let Prepared { matrix, solver, scales, .. } = active.as_mut().ok_or_else(unassembled)?;
        let of_step = CountedMatrix { matrix: step_matrix.as_ref().unwrap_or(matrix), products };
        let (factored, solver, scales) = match (with_tangents, &*step_matrix) {
            (Some(Prepared { matrix, solver, scales, .. }), _) => {
                (FactorOf::Tangents(CountedMatrix { matrix, products }), solver, scales)
            }
            (None, Some(_)) => (FactorOf::AnotherLength, solver, scales),
            (None, None) => (FactorOf::Step, solver, scales),
        };
        Ok(Parts {
            newton: newton.as_deref_mut(),
            flowing: flowing.as_deref_mut(),
            solver: &mut **solver,
            matrix: of_step,
            factored,
            scales,
        })
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
            let square = body
                .contacts
                .iter()
                .map(|contact| {
                    contact.normal.approach().square_of_closing_forces(contact.reference.resistance[0])
                })
                .sum();
            norm = session.sum([square])[0].sqrt();
            *scale = norm;
        }
        // The tolerance is never below the rounding error of `K v`, even if the remaining forces are small; friction on a moving
        // obstacle rounds `v` as a difference from the obstacle's velocity.
        let mut motion = start.norm()?;
        let rubs_moving = |c: &Contact<D>| c.friction.is_some() && c.obstacle.surface_may_move();
        if body.contacts.iter().any(rubs_moving) {
            let frictions = body.contacts.iter().flat_map(|contact| &contact.friction);
            let mine = frictions.map(Friction::obstacle_velocity_square).sum();
            motion += session.sum([mine])[0].sqrt();
        }
        let product = f64::EPSILON * self.matrix_norm * motion;
        // An estimate of the forces as if they were equal in all unknowns. At rest under steady loads the forces cancel, and a body that
        // its obstacle has released has none: the accuracy of pressures is then limited by rounding errors.
        let accuracy = self.settings.inclusion_tolerance;
        let size = norm.max(rounding.max(product) / accuracy).max(LEAST_REFERENCE);
        let total = size * ((body.mesh.total_nodes * D) as f64).sqrt();
        // The forces that drive obstacles are among those of the step.
        let mut driving = 0.0;
        for contact in &mut body.contacts {
            let [along, _] = &contact.obstacle.motions;
            let own = along.as_ref().map_or(0.0, |motion| motion.driving.abs());
            contact.reference.forces = total.max(own);
            driving = larger(driving, own);
        }
        let size = size_of(norm, *scale);
        let all = size.max(driving);
        let tolerance =
            (self.settings.tolerance * size).max(LEAST_FORCE).max(ROUNDING_SHARE * *rounding).max(product);
        let rounded = rounding.max(product).max(LEAST_FORCE);
        let reference = all.max(rounded / self.settings.tolerance);
        let slope = STAGNANT * f64::EPSILON * self.matrix_norm;
        // No rounding errors of a flight.
        let far = if self.springs.are_needed() { farthest(problem) } else { f64::INFINITY };
        let share = if self.springs.are_needed() { LARGEST_FLOOR_OF_FREE } else { LARGEST_FLOOR };
        let floor = Floor { slope, largest: (share * all).max(STAGNANT * product).min(slope * far) };
        let near_floor = floor.largest.min(WANTED_FLOOR * all).min(slope * LARGEST_REST / FAR * far);
        let tries_rest = self.flowing.is_none()
            && self.newton.as_ref().is_some_and(|newton| newton.properties(problem).may_be_solved_at_rest());
        Ok(Accuracy {
            tolerance,
            size: all,
            floor,
            near_floor,
            awaits_pressure: self.springs.are_needed(),
            fallbacks: if tries_rest { 1 } else { self.first_fallbacks() },
            tries_rest,
            reference,
        })
    }

    /// The number of fallbacks that are tried from the first start; where contact alone holds a body, others start from elsewhere: without
    /// any pressure, the equations are singular.
    fn first_fallbacks(&self) -> usize {
        if self.springs.are_needed() { FIRST_FALLBACKS } else { usize::MAX }
    }

    /// Replaces a factor whose single precision was insufficient, and resets the step to its start. Collective.
    fn refactor_in_double<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        trial: &mut DistributedVector,
    ) -> Result<()> {
        go_to(&self.start, problem, trial)?;
        self.precision = Precision::Double;
        self.refactor(problem)
    }
}

impl Accuracy {
    /// The equations of a step that is solved so accurately, with this matrix and these parameters of the graphs.
    fn system<'a, const D: usize, const S: usize>(
        self,
        problem: &StepProblem<'a, D, S>,
        matrix: &'a dyn StepMatrix,
        scales: &'a [[f64; 2]],
    ) -> System<'a> {
        let Self { tolerance, floor, near_floor, awaits_pressure, fallbacks, .. } = self;
        let [floor, hiding_floor] = if awaits_pressure {
            [Floor { largest: near_floor, ..floor }, hiding(floor)]
        } else {
            [floor, Floor::default()]
        };
        let StepProblem { forces: right_hand_side, converged, .. } = *problem;
        System {
            matrix,
            right_hand_side,
            tolerance,
            floor,
            hiding_floor,
            awaits_pressure,
            fallbacks,
            converged,
            scales,
        }
    }
}

/// The residual below which these rounding errors may hide that nothing holds a body.
fn hiding(Floor { slope, largest }: Floor) -> Floor {
    Floor { slope: HIDING * slope, largest: HIDING * largest }
}

/// The reason and the remedy where rounding errors of the forces within a body that contact alone holds are this share of the loads.
fn words_of_rounding(share: f64) -> [String; 2] {
    let why = format!(
        "the body is so much stiffer than the contact that holds it that rounding errors of the forces within it are about {:.0} % of \
         its loads, which hides where it comes to rest",
        100.0 * share
    );
    let factor = share / WANTED_FLOOR;
    [why, format!("divide its elastic moduli by {factor:.0e}, with which it moves as a rigid body, too")]
}

/// Resets a step to a start that was kept. Collective.
fn go_to<const D: usize, const S: usize>(
    start: &Option<DistributedVector>,
    problem: &mut StepProblem<'_, D, S>,
    trial: &mut DistributedVector,
) -> Result<()> {
    if let Some(start) = start {
        trial.copy_from(start)?;
    }
    restore_pressures(problem.body, problem.state)
}

/// Keeps a copy of a vector.
fn keep(place: &mut Option<DistributedVector>, vector: &DistributedVector) -> Result<()> {
    match place {
        Some(kept) => kept.copy_from(vector),
        none => none.insert(vector.like()?).copy_from(vector),
    }
}

/// The forces of a step in N, with those that drive obstacles as they act on bodies, in a vector with the layout of `like`. Collective.
fn loads<const D: usize, const S: usize>(
    problem: &StepProblem<'_, D, S>,
    like: &DistributedVector,
) -> Result<DistributedVector> {
    let mut forces = like.like()?;
    {
        let mut nodal = forces.local_mut()?;
        nodal.fill(0.0);
        let contacts = &problem.body.contacts;
        contacts.iter().for_each(|contact| contact.add_driving_force(problem.session, &mut nodal));
    }
    forces.add_ghosts_to_owners()?;
    problem.body.held.clear(&mut forces.owned_mut()?);
    forces.add_scaled(1.0, problem.forces)?;
    Ok(forces)
}

/// The norm of the velocities in m/s above which a body that only contact holds flies away.
fn farthest<const D: usize, const S: usize>(problem: &StepProblem<'_, D, S>) -> f64 {
    let Some(contact) = problem.body.contacts.first() else { return f64::INFINITY };
    FAR * contact.normal.body_size / problem.step.length * (problem.body.mesh.total_nodes as f64).sqrt()
}

/// Solves a step without contact and flow. Collective.
fn solve_linear<const D: usize, const S: usize>(
    ksp: &mut Ksp,
    problem: &mut StepProblem<'_, D, S>,
    system: System<'_>,
    trial: &mut DistributedVector,
) -> Result<StepOutcome> {
    ksp.set_tolerances(0.0, system.tolerance, LINEAR_ITERATIONS)?;
    let outcome = problem.session.agree(ksp.solve(problem.forces, trial))?;
    problem.work.linear += outcome.iterations;
    let mut residual = outcome.residual;
    if !outcome.converged() {
        let mut left = trial.like()?;
        system.write_residual(trial, &mut left)?;
        residual = left.norm()?;
        if !system.floor.is_reached(residual, trial.norm()?) {
            return Err(problem.failed(outcome.description(), REMEDY));
        }
    }
    Ok(StepOutcome { residual, ..StepOutcome::default() })
}
