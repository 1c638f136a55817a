//! Newton's method for the contact equations of one step.

use super::{
    StepOutcome,
    bounded::Bounded,
    equations::{Effort, Scratch, StepMatrix},
    fallbacks::{FALLBACKS, Search},
    flow::{Flow, FlowStart},
    linear_solver::{FrictionIteration, LINEAR_ITERATIONS, SolverSettings},
};
use crate::{
    body::Body,
    effect::{COUNTS, Contact, Energy, Peaks, PointCount, Step},
    error::{Error, Result},
    petsc::{DistributedVector, ProjectedKsp, Snes, has_option},
    session::Session,
    tensor::larger,
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
    /// The steepest fall of each contact's friction at the pressures of the last attempt.
    pub falls: Vec<f64>,
    /// What was done for the step.
    effort: Effort,
    /// Where the step started.
    pub start: DistributedVector,
    /// Whether the user chose how to search along steps.
    pub chosen_search: bool,
    /// What cells that flow need, if there are any.
    pub flow: Option<Flow>,
}

/// Share of the friction graph's parameter that its fall may reach while a step is solved, and that it is given at first.
const STEEPEST: f64 = 0.8;
pub(super) const STEEP: f64 = 0.5;

/// Linear solves stop at this share of what the step needs.
const LINEAR_SHARE: f64 = 0.3;
/// First linear solves of a step reduce their residual by this factor only, while branches may still change.
const LINEAR_REDUCTION: f64 = 1e-3;

/// The equations of a step and what counts as their solution.
#[derive(Clone, Copy)]
pub(super) struct Task<'a> {
    pub step: Step,
    pub matrix: &'a dyn StepMatrix,
    pub right_hand_side: &'a DistributedVector,
    pub tolerance: f64,
    pub settings: SolverSettings,
    /// Where the displacement starts, if stresses are those at the end of the step.
    pub flow: Option<FlowStart<'a>>,
}

/// The converged state that a step starts from.
#[derive(Clone, Copy)]
pub(super) struct From<'a> {
    pub velocity: &'a DistributedVector,
    pub traction: Option<&'a DistributedVector>,
}

impl Task<'_> {
    /// The residual norm in N at which a step is solved, and the share of the first one that is small enough in any case:
    /// where next to nothing acts but an obstacle that moves, its first push is what residuals are small against.
    pub fn tolerances(&self) -> (f64, f64) {
        (self.tolerance, self.settings.tolerance)
    }
}

impl Newton {
    /// Newton's method for unknowns laid out like `like`.
    pub fn new<const D: usize>(
        like: &DistributedVector,
        contacts: &[Contact<D>],
        linear_solver: ProjectedKsp,
    ) -> Result<Self> {
        let mut snes = Snes::new("", like, D)?;
        snes.apply_options()?;
        Ok(Self {
            snes,
            bounded: None,
            linear_solver,
            scratch: Scratch::new(like, contacts)?,
            before: Vec::new(),
            after: Vec::new(),
            scales: Vec::new(),
            falls: Vec::new(),
            effort: Effort::default(),
            start: like.like()?,
            chosen_search: has_option("snes_linesearch_type")?,
            flow: None,
        })
    }

    /// Chooses the parameters `c` of each contact's graphs: as stiff as the body is against motions of its surface alone, along
    /// the normal and in sliding, and along the normal above twice the steepest fall. With softer ones the residual is so
    /// steep where points change their branch that line searches fail. Collective.
    pub fn choose_scales<const D: usize>(
        &mut self,
        session: &Session,
        contacts: &[Contact<D>],
        like: &DistributedVector,
        matrix: &dyn StepMatrix,
    ) -> Result<()> {
        self.scales.clear();
        let mut room = [like.like()?, like.like()?];
        for contact in contacts {
            self.scales.push(resistance(session, contact, matrix, &mut room)?);
        }
        Ok(())
    }

    /// Solves a step from the velocity in `trial`, and leaves the new one there. Collective.
    pub fn solve<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        from: From<'_>,
        task: Task<'_>,
        trial: &mut DistributedVector,
    ) -> Result<StepOutcome> {
        let (step, settings) = (task.step, task.settings);
        branches(body, from.velocity, &mut self.before)?;
        if let Some(bounded) = &mut self.bounded {
            let contacts = &mut body.contacts;
            let solved = bounded.solve(contacts, task, trial);
            let outcome = session.agree(solved)?;
            if !outcome.converged() {
                return Err(failed(step, outcome.words(), REMEDY));
            }
            return self.check_inclusion(
                session,
                body,
                step,
                trial,
                settings,
                (outcome.iterations, &Effort::default()),
            );
        }
        self.linear_solver.set_tolerances(
            LINEAR_REDUCTION,
            LINEAR_SHARE * task.tolerance,
            LINEAR_ITERATIONS,
        )?;
        self.start.copy_from(trial)?;
        let follows = |contact: &Contact<D>| contact.friction().is_some_and(|f| f.follows_pressure());
        let (follows, chosen) = (body.contacts.iter().any(follows), self.chosen_search);
        let mut attempts = FALLBACKS.iter().filter(|a| match a.iteration {
            FrictionIteration::Newton => !follows || settings.friction == FrictionIteration::Newton,
            FrictionIteration::FixedPoint => follows,
        });
        // Elsewhere what is inside is no linear problem.
        let inside = self.flow.is_none() && !body.contacts.iter().any(Contact::needs_ghosts);
        let mut attempts = attempts.by_ref().filter(|a| match a.search {
            Search::FullSteps => !chosen,
            Search::Equilibrated => inside,
            Search::Backtracking => true,
        });
        largest_falls(session, &body.contacts, &mut self.falls);
        let mut effort = std::mem::take(&mut self.effort);
        effort.restart();
        let mut newton_iterations = 0;
        let mut attempt = attempts.next().copied();
        let mut why = String::new();
        while let Some(now) = attempt {
            self.parametrise(body, now);
            match self.attempt(session, body, task, now, trial, &mut effort)? {
                Ok(iterations) => newton_iterations += iterations,
                Err((iterations, words)) => {
                    (newton_iterations, why) = (newton_iterations + iterations, words);
                    attempt = attempts.next().copied();
                    self.start_again(body, from, trial)?;
                    continue;
                }
            }
            // Where the pressure rose so much that the friction graph folded over its parameter: the same with a larger one.
            largest_falls(session, &body.contacts, &mut self.falls);
            let mut pairs = body.contacts.iter().zip(&self.falls);
            if pairs.all(|(contact, fall)| *fall <= STEEPEST * contact.friction_scale()) {
                break;
            }
        }
        if attempt.is_none() {
            return Err(failed(step, &why, REMEDY));
        }
        let checked =
            self.check_inclusion(session, body, step, trial, settings, (newton_iterations, &effort));
        self.effort = effort;
        checked
    }

    /// Holds the velocity in `trial` and the pressures of the contacts against the graphs. Collective.
    fn check_inclusion<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &Body<D, S>,
        step: Step,
        trial: &mut DistributedVector,
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
            solutions: 0,
            landed_on: None,
            energy: Energy::default(),
            peaks: Peaks::default(),
        })
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
            largest = larger(largest, distance);
        }
        Ok(session.largest([largest])[0])
    }
}

/// What resists a motion of a contact's boundary alone, along the normal and in sliding, in Pa s/m; along the normal no less than
/// twice the law's steepest fall. Collective.
fn resistance<const D: usize>(
    session: &Session,
    contact: &Contact<D>,
    matrix: &dyn StepMatrix,
    [motion, answer]: &mut [DistributedVector; 2],
) -> Result<[f64; 2]> {
    let mut against = |motion: &DistributedVector, square: f64| -> Result<f64> {
        matrix.multiply(motion, answer)?;
        let [square] = session.sum([square]);
        Ok(positive_or_one(motion.dot(answer)? / square))
    };
    motion.fill(0.0)?;
    contact.add_normals(&mut motion.owned_mut()?);
    let square = contact.normal_square(&motion.owned()?);
    let normal = against(motion, square)?.max(2.0 * contact.law.monotonicity_constant());
    if contact.friction().is_none() {
        return Ok([normal; 2]);
    }
    motion.fill(0.0)?;
    contact.add_unit_sliding(&mut motion.owned_mut()?);
    let square = contact.tangential_square(&motion.owned()?);
    Ok([normal, against(motion, square)?])
}

/// Sets the reference values of the contacts from the matrix of the whole body, however steps are solved. Collective.
pub(super) fn set_reference_values<const D: usize>(
    session: &Session,
    contacts: &mut [Contact<D>],
    like: &DistributedVector,
    matrix: &dyn StepMatrix,
) -> Result<()> {
    if contacts.is_empty() {
        return Ok(());
    }
    let mut room = [like.like()?, like.like()?];
    for contact in contacts {
        contact.reference.resistance = resistance(session, contact, matrix, &mut room)?;
        [contact.reference.area] = session.sum([contact.area()]);
    }
    Ok(())
}

/// Takes the pressures of all contacts back to those of the converged state.
pub(super) fn restore_pressures<const D: usize, const S: usize>(
    body: &mut Body<D, S>,
    from: From<'_>,
) -> Result<()> {
    if let Some(traction) = from.traction {
        let traction = traction.owned()?;
        body.contacts.iter_mut().for_each(|contact| contact.restore_pressures(&traction));
    }
    Ok(())
}

/// Writes the steepest fall of each contact's friction at the pressures of now, over all ranks. Collective.
fn largest_falls<const D: usize>(session: &Session, contacts: &[Contact<D>], out: &mut Vec<f64>) {
    let falls = |contact: &Contact<D>| match contact.friction() {
        Some(law) if law.steepest_fall() > 0.0 => session.largest([contact.steepest_friction_fall()])[0],
        _ => 0.0,
    };
    out.clear();
    out.extend(contacts.iter().map(falls));
}

fn positive_or_one(stiffness: f64) -> f64 {
    if stiffness.is_finite() && stiffness > 0.0 { stiffness } else { 1.0 }
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
