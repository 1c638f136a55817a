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
        self.parametrise(body, &falls, follows);
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
        let mut effort = Effort::default();
        let mut newton_iterations = 0;
        loop {
            let solved = if follows {
                match self.newton(session, body, task, trial, &mut effort) {
                    // The fixed point is slower, but it does not cycle between sticking and sliding.
                    Ok(Err(_))
                        if body
                            .contacts
                            .iter()
                            .any(|c| c.friction().is_some_and(|f| f.follows_pressure())) =>
                    {
                        self.start_again(body, state, &falls, trial)?;
                        self.fixed_point(session, body, task, trial, &mut effort)?
                    }
                    other => other?,
                }
            } else {
                self.fixed_point(session, body, task, trial, &mut effort)?
            };
            newton_iterations += match solved {
                Ok(iterations) => iterations,
                Err(words) => return Err(failed(step, &words, REMEDY)),
            };
            let now = largest_falls(session, &body.contacts);
            if now
                .iter()
                .zip(&falls)
                .zip(&self.scales)
                .all(|((n, f), s)| *n <= STEEPEST * friction_scale(*s, *f))
            {
                break;
            }
            // The pressure rose so much that the friction graph folded over its parameter: the same with a larger one.
            falls = now;
            self.parametrise(body, &falls, follows);
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
        follows: bool,
    ) {
        for ((contact, scales), fall) in body.contacts.iter_mut().zip(&self.scales).zip(falls) {
            contact.scale = scales[0];
            contact.set_friction(friction_scale(*scales, *fall), follows);
        }
    }

    /// Goes back to the state before the step, with friction bounds that stay.
    fn start_again<const D: usize, const S: usize>(
        &self,
        body: &mut Body<D, S>,
        state: &State,
        falls: &[f64],
        trial: &mut DistributedVector,
    ) -> Result<()> {
        trial.copy_from(&state.velocity)?;
        if let Some(traction) = &state.contact_traction {
            let traction = traction.owned()?;
            body.contacts.iter_mut().for_each(|contact| contact.recall(&traction));
        }
        self.parametrise(body, falls, false);
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
        self.start.copy_from(trial)?;
        let mut iterations = 0;
        let mut why = String::new();
        for last in if self.chosen_search { &[true][..] } else { &[false, true] } {
            if !self.chosen_search {
                self.snes.search_along_steps(*last)?;
            }
            trial.copy_from(&self.start)?;
            effort.sets.clear();
            let mut equations = ContactEquations {
                matrix: task.matrix,
                contacts: &mut body.contacts,
                right_hand_side: task.right_hand_side,
                scratch: &mut self.scratch,
                linear_solver: &mut self.linear_solver,
                session,
                stop_at_cycles: !last,
                effort: std::mem::take(effort),
            };
            let most = task.settings.newton_iterations;
            let solved = self.snes.solve(&mut equations, trial, task.tolerances(), most);
            *effort = equations.effort;
            iterations += effort.sets.len();
            why = match session.agree(solved) {
                Ok(outcome) if outcome.converged() => {
                    let mut trial = trial.owned_mut()?;
                    body.contacts.iter_mut().for_each(|contact| contact.map(&mut trial));
                    return Ok(Ok(iterations));
                }
                Ok(outcome) => words(&outcome, effort),
                Err(Error::Failed(words)) => words,
                Err(other) => return Err(other),
            };
        }
        let mut trial = trial.owned_mut()?;
        body.contacts.iter_mut().for_each(|contact| contact.map(&mut trial));
        Ok(Err(why))
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

/// The parameter of friction graphs that fall by so much at most.
fn friction_scale([_, stiffness]: [f64; 2], fall: f64) -> f64 {
    stiffness.max(fall / STEEP)
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
