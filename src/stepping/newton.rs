//! Newton's method for the contact equations of one step.

use super::{
    StepOutcome,
    equations::{ContactEquations, Effort, Scratch},
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
    pub linear_solver: ProjectedKsp,
    pub scratch: Scratch,
    pub before: Vec<u8>,
    pub after: Vec<u8>,
    /// The parameters of each contact's graphs for the matrix in use: along the normal, of friction.
    pub scales: Vec<[f64; 2]>,
}

/// Fixed-point iterations after which a step has failed.
const FIXED_POINTS: usize = 200;
/// What is tried with friction where the first attempt fails, each time from the state before the step: other parameters of
/// the graphs, by these factors, along which the residual may fall where it did not; then a fixed point, which
/// does not cycle between pressure and friction.
const RETRIES: [(f64, FrictionIteration); 4] = [
    (30.0, FrictionIteration::Newton),
    (1.0 / 30.0, FrictionIteration::Newton),
    (1.0, FrictionIteration::FixedPoint),
    (30.0, FrictionIteration::FixedPoint),
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
        let follows = settings.friction == FrictionIteration::Newton;
        let mut falls = largest_falls(session, &body.contacts);
        self.parametrise(body, &falls, 1.0, follows);
        branches(body, &state.velocity, &mut self.before)?;
        let mut effort = Effort::default();
        let mut newton_iterations = 0;
        loop {
            let mut solved = self.attempt(session, body, task, trial, &mut effort)?;
            let has_friction = body.contacts.iter().any(|contact| contact.friction().is_some());
            for (factor, iteration) in RETRIES {
                if solved.is_ok() || !has_friction {
                    break;
                }
                self.start_again(body, state, trial)?;
                self.parametrise(body, &falls, factor, iteration == FrictionIteration::Newton && follows);
                solved = if iteration == FrictionIteration::Newton && follows {
                    self.newton(session, body, task, trial, &mut effort)?
                } else {
                    self.fixed_point(session, body, task, trial, &mut effort)?
                };
            }
            newton_iterations += match solved {
                Ok(iterations) => iterations,
                Err(words) => return Err(failed(step, &words, REMEDY)),
            };
            let now = largest_falls(session, &body.contacts);
            if body
                .contacts
                .iter()
                .zip(&now)
                .all(|(contact, fall)| *fall <= STEEPEST * contact.friction_scale())
            {
                break;
            }
            // The pressure rose so much that the friction graph folded over its parameter: the same with a larger one.
            falls = now;
            self.parametrise(body, &falls, 1.0, follows);
        }
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
        factor: f64,
        follows: bool,
    ) {
        for ((contact, scales), fall) in body.contacts.iter_mut().zip(&self.scales).zip(falls) {
            contact.scale = (factor * scales[0]).max(2.0 * contact.law.monotonicity_constant());
            contact.set_friction((factor * scales[1]).max(fall / STEEP), follows);
        }
    }

    /// The iteration that the job asks for. Collective.
    fn attempt<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        task: Task<'_>,
        trial: &mut DistributedVector,
        effort: &mut Effort,
    ) -> Result<std::result::Result<usize, String>> {
        match task.settings.friction {
            FrictionIteration::Newton => self.newton(session, body, task, trial, effort),
            FrictionIteration::FixedPoint => self.fixed_point(session, body, task, trial, effort),
        }
    }

    /// Goes back to the state before the step.
    fn start_again<const D: usize, const S: usize>(
        &self,
        body: &mut Body<D, S>,
        state: &State,
        trial: &mut DistributedVector,
    ) -> Result<()> {
        trial.copy_from(&state.velocity)?;
        if let Some(traction) = &state.contact_traction {
            let traction = traction.owned()?;
            body.contacts.iter_mut().for_each(|contact| contact.recall(&traction));
        }
        Ok(())
    }

    /// Newton's method on the equations with friction bounds held at pressures that are brought up to date until these
    /// solve them, too. Gives the iterations, or why it failed. Collective.
    fn fixed_point<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        task: Task<'_>,
        trial: &mut DistributedVector,
        effort: &mut Effort,
    ) -> Result<std::result::Result<usize, String>> {
        let mut sum = 0;
        for _ in 0..FIXED_POINTS {
            body.contacts.iter_mut().for_each(Contact::take_pressures);
            match self.newton(session, body, task, trial, effort)? {
                // What solves the equations of the last bounds solves those of its own.
                Ok(0) if sum > 0 => return Ok(Ok(sum)),
                Ok(iterations) => sum += iterations.max(1),
                Err(words) => return Ok(Err(words)),
            }
        }
        Ok(Err(format!("friction bounds still change after {FIXED_POINTS} fixed-point iterations")))
    }

    /// Newton's method from the velocity in `trial`, and the solution there. Gives the iterations, or why it failed.
    /// Collective.
    fn newton<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        task: Task<'_>,
        trial: &mut DistributedVector,
        effort: &mut Effort,
    ) -> Result<std::result::Result<usize, String>> {
        {
            let mut trial = trial.owned_mut()?;
            body.contacts.iter().for_each(|contact| contact.unmap(&mut trial));
        }
        let first_set = effort.sets.len();
        let mut equations = ContactEquations {
            matrix: task.matrix,
            contacts: &mut body.contacts,
            right_hand_side: task.right_hand_side,
            scratch: &mut self.scratch,
            linear_solver: &mut self.linear_solver,
            session,
            effort: std::mem::take(effort),
        };
        let solved = self.snes.solve(&mut equations, trial, task.tolerance, task.settings.newton_iterations);
        *effort = equations.effort;
        let outcome = session.agree(match solved {
            Err(Error::Failed(words)) => Err(failed(task.step, &words, REMEDY)),
            other => other,
        })?;
        {
            let mut trial = trial.owned_mut()?;
            body.contacts.iter_mut().for_each(|contact| contact.map(&mut trial));
        }
        if outcome.converged() {
            return Ok(Ok(outcome.iterations));
        }
        Ok(Err(why(session, &outcome, &effort.sets[first_set..])))
    }

    /// The largest of all contacts over all ranks. Collective.
    fn inclusion_residual<const D: usize, const S: usize>(
        &self,
        session: &Session,
        body: &Body<D, S>,
        velocity: &DistributedVector,
    ) -> Result<f64> {
        let (velocity, residual) = (velocity.local()?, self.snes.residual().owned()?);
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

/// Why Newton's method failed, in words. Collective.
fn why(session: &Session, outcome: &NonlinearOutcome, sets: &[u64]) -> String {
    let words = outcome.words().to_owned();
    let Some(last) = sets.len().checked_sub(1) else { return words };
    // Half the bits suffice to tell sets apart, and add up over ranks without a carry beyond them.
    let of = |at: usize| (sets[at] >> 32) as f64;
    let seen = (0..last).rev().find(|&at| session.sum([f64::from(u8::from(of(at) != of(last)))])[0] == 0.0);
    match seen {
        Some(first) => format!(
            "{words}; Newton's method came back to the branches of the contact graph that it had {} iterations before",
            last - first
        ),
        None => words,
    }
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
