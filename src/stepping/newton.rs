//! Newton's method for the contact equations of one step.

use super::{
    StepOutcome,
    bounded::Bounded,
    equations::{ContactEquations, Effort, Scratch, cycle},
    linear_solver::{FrictionIteration, SolverSettings},
};
use crate::{
    body::Body,
    effect::{COUNTS, Contact, Energy, PointCount, Step},
    error::{Error, Result},
    petsc::{DistributedVector, Matrix, NonlinearOutcome, ProjectedKsp, Snes},
    session::Session,
    state::State,
};

/// Newton's method with what it needs.
pub(super) struct Newton {
    pub snes: Snes,
    /// PETSc's solver for variational inequalities, if that solves the steps.
    pub bounded: Option<Bounded>,
    pub linear_solver: ProjectedKsp,
    pub scratch: Scratch,
    pub before: Vec<u8>,
    pub after: Vec<u8>,
    /// The parameters of each contact's graphs for the matrix in use: along the normal, of friction.
    pub scales: Vec<[f64; 2]>,
    /// Where the step started.
    pub start: DistributedVector,
    /// Whether the user chose how to search along steps.
    pub chosen_search: bool,
}

/// Fixed-point iterations after which a step has failed.
const FIXED_POINTS: usize = 200;
/// One way to solve a step.
#[derive(Clone, Copy)]
struct Attempt {
    /// Whether to search along steps for a decrease of the residual, or to take them in full.
    search: bool,
    /// How much stiffer than the body the parameters of the graphs are: which branches come back depends on it.
    stiffer: f64,
    iteration: FrictionIteration,
}

const fn attempt(search: bool, stiffer: f64, iteration: FrictionIteration) -> Attempt {
    Attempt { search, stiffer, iteration }
}

/// What is tried in turn until a step is solved, each time from where the step started.
///
/// Full steps first: a new set of branches raises the residual, so that a search would creep where full steps arrive. A
/// fixed point, at last, does not cycle between pressure and friction; it serves friction that follows the pressure.
const ATTEMPTS: [Attempt; 10] = [
    attempt(false, 1.0, FrictionIteration::Newton),
    attempt(true, 1.0, FrictionIteration::Newton),
    attempt(false, 10.0, FrictionIteration::Newton),
    attempt(true, 30.0, FrictionIteration::Newton),
    attempt(false, 100.0, FrictionIteration::Newton),
    attempt(true, 1.0 / 30.0, FrictionIteration::Newton),
    attempt(false, 1.0, FrictionIteration::FixedPoint),
    attempt(true, 1.0, FrictionIteration::FixedPoint),
    attempt(false, 30.0, FrictionIteration::FixedPoint),
    attempt(true, 30.0, FrictionIteration::FixedPoint),
];
/// Share of the friction graph's parameter that its fall may reach while a step is solved, and that it is given at first.
const STEEPEST: f64 = 0.8;
const STEEP: f64 = 0.5;

/// The equations of a step and what counts as their solution.
#[derive(Clone, Copy)]
pub(super) struct Task<'a> {
    pub step: Step,
    pub matrix: &'a Matrix,
    pub right_hand_side: &'a DistributedVector,
    pub tolerance: f64,
    pub settings: SolverSettings,
}

impl Task<'_> {
    /// The residual norm in N at which a step is solved, and its share of the first one: where nothing acts but an obstacle
    /// that moves, its first push is what residuals are small against.
    pub fn tolerances(&self) -> (f64, f64) {
        (self.tolerance, self.settings.tolerance)
    }
}

/// Newton iterations; with why they led nowhere, if so.
type Attempted = std::result::Result<usize, (usize, String)>;

impl Newton {
    /// Chooses the parameters `c` of each contact's graphs. Along the normal: above twice the steepest fall, and as stiff as
    /// the body is against a unit pressure on the whole contact. For friction: as stiff as the body is against sliding of
    /// its surface alone; a softer one makes the residual so steep where points begin to slide that line searches fail.
    /// Collective.
    pub fn choose_scales<const D: usize>(
        &mut self,
        session: &Session,
        contacts: &[Contact<D>],
        like: &DistributedVector,
        matrix: &Matrix,
    ) -> Result<()> {
        let (mut pressure, mut answer) = (like.like()?, like.like()?);
        self.scales.clear();
        for contact in contacts {
            pressure.fill(0.0)?;
            contact.add_unit_pressure(&mut pressure.owned_mut()?);
            self.linear_solver.linear_solver().precondition(&pressure, &mut answer)?;
            let [square] = session.sum([contact.normal_square(&answer.owned()?)]);
            let normal = positive_or_one(answer.dot(&pressure)? / square);
            let tangential = if contact.friction().is_some() {
                let mut sliding = like.like()?;
                sliding.fill(0.0)?;
                contact.add_unit_sliding(&mut sliding.owned_mut()?);
                matrix.multiply(&sliding, &mut answer)?;
                let [square] = session.sum([contact.tangential_square(&sliding.owned()?)]);
                positive_or_one(sliding.dot(&answer)? / square)
            } else {
                normal
            };
            self.scales.push([normal.max(2.0 * contact.law.monotonicity_constant()), tangential]);
        }
        Ok(())
    }

    /// Solves a step from the velocity in `trial`, and leaves the new one there. Collective.
    pub fn solve<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        state: &State,
        task: Task<'_>,
        trial: &mut DistributedVector,
    ) -> Result<StepOutcome> {
        let (step, settings) = (task.step, task.settings);
        branches(body, &state.velocity, &mut self.before)?;
        if let Some(bounded) = &mut self.bounded {
            let contacts = &mut body.contacts;
            let solved = bounded.solve(contacts, task, trial);
            let outcome = session.agree(solved)?;
            if !outcome.converged() {
                return Err(failed(step, outcome.words(), REMEDY));
            }
            return self.judge(
                session,
                body,
                step,
                trial,
                settings,
                (outcome.iterations, &Effort::default()),
            );
        }
        self.start.copy_from(trial)?;
        let follows = |contact: &Contact<D>| contact.friction().is_some_and(|f| f.follows_pressure());
        let (follows, chosen) = (body.contacts.iter().any(follows), self.chosen_search);
        let mut attempts = ATTEMPTS.iter().filter(|a| match a.iteration {
            FrictionIteration::Newton => !follows || settings.friction == FrictionIteration::Newton,
            FrictionIteration::FixedPoint => follows,
        });
        let mut attempts = attempts.by_ref().filter(|a| !chosen || a.search);
        let mut falls = largest_falls(session, &body.contacts);
        let mut effort = Effort::default();
        let mut newton_iterations = 0;
        let mut attempt = attempts.next().copied();
        let mut why = String::new();
        while let Some(now) = attempt {
            self.parametrise(body, &falls, now);
            match self.attempt(session, body, task, now, trial, &mut effort)? {
                Ok(iterations) => newton_iterations += iterations,
                Err((iterations, words)) => {
                    (newton_iterations, why) = (newton_iterations + iterations, words);
                    attempt = attempts.next().copied();
                    self.start_again(body, state, trial)?;
                    continue;
                }
            }
            let steepest = largest_falls(session, &body.contacts);
            let mut pairs = body.contacts.iter().zip(&steepest);
            if pairs.all(|(contact, fall)| *fall <= STEEPEST * contact.friction_scale()) {
                break;
            }
            // The pressure rose so much that the friction graph folded over its parameter: the same with a larger one.
            falls = steepest;
        }
        if attempt.is_none() {
            return Err(failed(step, &why, REMEDY));
        }
        self.judge(session, body, step, trial, settings, (newton_iterations, &effort))
    }

    /// Holds the velocity in `trial` and the pressures of the contacts against the graphs. Collective.
    fn judge<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &Body<D, S>,
        step: Step,
        trial: &DistributedVector,
        settings: SolverSettings,
        (newton_iterations, effort): (usize, &Effort),
    ) -> Result<StepOutcome> {
        trial.update_ghosts()?;
        branches(body, trial, &mut self.after)?;
        let changes = self.before.iter().zip(&self.after).filter(|(a, b)| a != b).count();
        let inclusion = self.inclusion_residual(session, body, trial)?;
        if inclusion.is_nan() || inclusion > settings.inclusion_tolerance {
            let found = format!("velocity and pressure are {inclusion:.1e} off the contact graph");
            return Err(failed(step, &found, INCLUSION_REMEDY));
        }
        let velocity = trial.local()?;
        let mut points = [0.0; COUNTS];
        for contact in &body.contacts {
            let counts = contact.count(&velocity).to_array();
            points.iter_mut().zip(counts).for_each(|(sum, count)| *sum += count);
        }
        Ok(StepOutcome {
            newton_iterations,
            linear_iterations: effort.linear_iterations,
            active_changes: session.total(changes),
            points: PointCount::from_array(session.sum(points)),
            indefinite_solves: effort.indefinite,
            inclusion_residual: inclusion,
            energy: Energy::default(),
        })
    }

    /// Sets the parameters of all graphs, those of friction for these falls.
    fn parametrise<const D: usize, const S: usize>(
        &self,
        body: &mut Body<D, S>,
        falls: &[f64],
        attempt: Attempt,
    ) {
        let follows = attempt.iteration == FrictionIteration::Newton;
        for ((contact, scales), fall) in body.contacts.iter_mut().zip(&self.scales).zip(falls) {
            let [normal, tangential] = scales.map(|scale| attempt.stiffer * scale);
            contact.scale = normal.max(2.0 * contact.law.monotonicity_constant());
            contact.set_friction(tangential.max(fall / STEEP), follows);
        }
    }

    /// Goes back to where the step started.
    fn start_again<const D: usize, const S: usize>(
        &self,
        body: &mut Body<D, S>,
        state: &State,
        trial: &mut DistributedVector,
    ) -> Result<()> {
        trial.copy_from(&self.start)?;
        if let Some(traction) = &state.contact_traction {
            let traction = traction.owned()?;
            body.contacts.iter_mut().for_each(|contact| contact.recall(&traction));
        }
        Ok(())
    }

    /// Solves once. A fixed point holds friction bounds at pressures that are brought up to date until these solve the
    /// equations, too. Collective.
    fn attempt<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        task: Task<'_>,
        attempt: Attempt,
        trial: &mut DistributedVector,
        effort: &mut Effort,
    ) -> Result<Attempted> {
        if attempt.iteration == FrictionIteration::Newton {
            return self.newton(session, body, task, attempt.search, trial, effort);
        }
        let mut sum = 0;
        for _ in 0..FIXED_POINTS {
            body.contacts.iter_mut().for_each(Contact::take_pressures);
            match self.newton(session, body, task, attempt.search, trial, effort)? {
                // What solves the equations of the last bounds solves those of its own.
                Ok(0) if sum > 0 => return Ok(Ok(sum)),
                Ok(iterations) => sum += iterations.max(1),
                Err((iterations, words)) => return Ok(Err((sum + iterations, words))),
            }
        }
        let words = format!("friction bounds still change after {FIXED_POINTS} fixed-point iterations");
        Ok(Err((sum, words)))
    }

    /// Newton's method from the velocity in `trial`, and the solution there. Collective.
    fn newton<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        task: Task<'_>,
        search: bool,
        trial: &mut DistributedVector,
        effort: &mut Effort,
    ) -> Result<Attempted> {
        {
            let mut trial = trial.owned_mut()?;
            body.contacts.iter().for_each(|contact| contact.unmap(&mut trial));
        }
        if !self.chosen_search {
            self.snes.search_along_steps(search)?;
        }
        effort.sets.clear();
        let mut equations = ContactEquations {
            matrix: task.matrix,
            contacts: &mut body.contacts,
            right_hand_side: task.right_hand_side,
            scratch: &mut self.scratch,
            linear_solver: &mut self.linear_solver,
            session,
            stop_at_cycles: !search,
            effort: std::mem::take(effort),
        };
        let most = task.settings.newton_iterations;
        let solved = self.snes.solve(&mut equations, trial, task.tolerances(), most);
        *effort = equations.effort;
        let iterations = effort.sets.len();
        {
            let mut trial = trial.owned_mut()?;
            body.contacts.iter_mut().for_each(|contact| contact.map(&mut trial));
        }
        let missed = !matches!(&solved, Ok(outcome) if outcome.converged());
        let fatal = matches!(&solved, Err(error) if !matches!(error, Error::Failed(_)));
        // All ranks go the same way, whichever of them failed.
        let [missed, fatal] = session.largest([missed, fatal].map(|flag| f64::from(u8::from(flag))));
        if missed == 0.0 {
            return Ok(Ok(iterations));
        }
        match session.agree(solved) {
            Ok(outcome) => Ok(Err((iterations, words(&outcome, effort)))),
            Err(error) if fatal > 0.0 => Err(error),
            Err(Error::Failed(words) | Error::Elsewhere { message: words, .. }) => {
                Ok(Err((iterations, words)))
            }
            Err(other) => Err(other),
        }
    }

    /// The largest of all contacts over all ranks. Collective.
    fn inclusion_residual<const D: usize, const S: usize>(
        &self,
        session: &Session,
        body: &Body<D, S>,
        velocity: &DistributedVector,
    ) -> Result<f64> {
        let residual = self.bounded.as_ref().map_or(self.snes.residual(), Bounded::residual);
        let (velocity, residual) = (velocity.local()?, residual.owned()?);
        let mut largest = 0.0;
        for contact in &body.contacts {
            let range = session.largest(contact.range(&velocity));
            let distance = contact.inclusion_residual(&velocity, &residual, range);
            largest = if distance.is_nan() { f64::NAN } else { f64::max(largest, distance) };
        }
        Ok(session.largest([largest])[0])
    }
}

/// The steepest fall of each contact's friction at the pressures of now, over all ranks. Collective.
fn largest_falls<const D: usize>(session: &Session, contacts: &[Contact<D>]) -> Vec<f64> {
    let falls = |contact: &Contact<D>| match contact.friction() {
        Some(law) if law.steepest_fall() > 0.0 => session.largest([contact.steepest_friction_fall()])[0],
        _ => 0.0,
    };
    contacts.iter().map(falls).collect()
}

fn positive_or_one(stiffness: f64) -> f64 {
    if stiffness.is_finite() && stiffness > 0.0 { stiffness } else { 1.0 }
}

/// Why Newton's method failed, in words.
fn words(outcome: &NonlinearOutcome, effort: &Effort) -> String {
    let words = outcome.words().to_owned();
    effort.period().map_or(words.clone(), |period| format!("{words}; {}", cycle(period)))
}

pub(super) const REMEDY: &str =
    "try a smaller [time] step, a looser [solver] tolerance, or another [solver] preconditioner";

const INCLUSION_REMEDY: &str = "try a smaller [time] step or a tighter [solver] tolerance; [solver] inclusion_tolerance sets what is accepted";

pub(super) fn failed(step: Step, what: &str, remedy: &str) -> Error {
    Error::Failed(format!(
        "step to t = {:.6e} s (length {:.3e} s) failed: {what}; {remedy}",
        step.time, step.length
    ))
}

/// Branches of all contact points at owned or ghost velocities.
fn branches<const D: usize, const S: usize>(
    body: &Body<D, S>,
    velocity: &DistributedVector,
    out: &mut Vec<u8>,
) -> Result<()> {
    let velocity = velocity.local()?;
    out.clear();
    body.contacts.iter().for_each(|contact| contact.branches(&velocity, out));
    Ok(())
}
