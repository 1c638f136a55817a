//! Newton's method for the contact equations of one step.

use super::{
    StepOutcome,
    equations::{ContactEquations, Effort, Scratch, cycle},
    linear_solver::SolverSettings,
};
use crate::{
    body::Body,
    effect::{Contact, Energy, PointCount, Step},
    error::{Error, Result},
    petsc::{DistributedVector, Matrix, NonlinearOutcome, ProjectedKsp, Snes},
    session::Session,
    state::State,
};

/// What is tried in turn until a step is solved: whether to search along steps for a decrease of the residual, and how
/// much stiffer than the body the parameter of the graphs is. Which branches come back depends on both.
const ATTEMPTS: [(bool, f64); 5] = [(false, 1.0), (false, 10.0), (false, 100.0), (true, 1.0), (true, 10.0)];

/// Newton's method with what it needs.
pub(super) struct Newton {
    pub snes: Snes,
    pub linear_solver: ProjectedKsp,
    pub scratch: Scratch,
    pub before: Vec<u8>,
    pub after: Vec<u8>,
    /// The parameter of each contact's graphs for the matrix in use.
    pub scales: Vec<f64>,
    /// Where the step started.
    pub start: DistributedVector,
    /// Whether the user chose how to search along steps.
    pub chosen_search: bool,
}

impl Newton {
    /// Chooses the parameter `c` of each contact's graphs: above twice the steepest fall, and as stiff as the body is
    /// against a unit pressure on the whole contact. Collective.
    pub fn choose_scales<const D: usize>(
        &mut self,
        session: &Session,
        contacts: &[Contact<D>],
        like: &DistributedVector,
    ) -> Result<()> {
        let (mut pressure, mut answer) = (like.like()?, like.like()?);
        self.scales.clear();
        for contact in contacts {
            pressure.fill(0.0)?;
            contact.add_unit_pressure(&mut pressure.owned_mut()?);
            self.linear_solver.linear_solver().precondition(&pressure, &mut answer)?;
            let [square] = session.sum([contact.normal_square(&answer.owned()?)]);
            let stiffness = answer.dot(&pressure)? / square;
            let stiffness = if stiffness.is_finite() && stiffness > 0.0 { stiffness } else { 1.0 };
            self.scales.push(stiffness.max(2.0 * contact.law.monotonicity_constant()));
        }
        Ok(())
    }

    /// Solves a step from the velocity in `trial`, and leaves the new one there. Collective.
    pub fn solve<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        state: &State,
        step: Step,
        matrix: &Matrix,
        right_hand_side: &DistributedVector,
        trial: &mut DistributedVector,
        (tolerance, settings): (f64, SolverSettings),
    ) -> Result<StepOutcome> {
        branches(body, &state.velocity, &mut self.before)?;
        self.start.copy_from(trial)?;
        let (mut effort, mut newton_iterations) = (Effort::default(), 0);
        let attempts = if self.chosen_search { &ATTEMPTS[..1] } else { &ATTEMPTS[..] };
        for (number, &(search, stiffer)) in attempts.iter().enumerate() {
            let last = number + 1 == attempts.len();
            if !self.chosen_search {
                self.snes.search_along_steps(search)?;
            }
            trial.copy_from(&self.start)?;
            self.unmap(body, state, stiffer, trial)?;
            effort.sets.clear();
            let mut equations = ContactEquations {
                matrix,
                contacts: &mut body.contacts,
                right_hand_side,
                scratch: &mut self.scratch,
                linear_solver: &mut self.linear_solver,
                session,
                stop_at_cycles: !last && !search,
                effort,
            };
            let solved = self.snes.solve(&mut equations, trial, tolerance, settings.newton_iterations);
            effort = equations.effort;
            newton_iterations += effort.sets.len();
            let missed = !matches!(&solved, Ok(outcome) if outcome.converged());
            let fatal = matches!(&solved, Err(error) if !matches!(error, Error::Failed(_)));
            // All ranks go the same way, whichever of them failed.
            let [missed, fatal] = session.largest([missed, fatal].map(|flag| f64::from(u8::from(flag))));
            if missed == 0.0 {
                break;
            }
            if last || fatal > 0.0 {
                let outcome = session.agree(solved.map_err(|error| match error {
                    Error::Failed(words) => failed(step, &words, REMEDY),
                    other => other,
                }))?;
                return Err(failed(step, &why(&outcome, &effort), REMEDY));
            }
        }
        {
            let mut trial = trial.owned_mut()?;
            body.contacts.iter_mut().for_each(|contact| contact.map(&mut trial));
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
        let counts = body.contacts.iter().map(|contact| contact.count(&velocity));
        let mine = counts.fold([changes, 0, 0], |[a, s, o], c| [a, s + c.sticking, o + c.open]);
        let [active_changes, sticking, open] = session.sum(mine.map(|n| n as f64)).map(|n| n as usize);
        Ok(StepOutcome {
            newton_iterations,
            linear_iterations: effort.linear_iterations,
            active_changes,
            points: PointCount { sticking, open },
            indefinite_solves: effort.indefinite,
            inclusion_residual: inclusion,
            energy: Energy::default(),
        })
    }

    /// Turns velocities into unknowns whose parameter is that much stiffer than the body, with the pressures of the
    /// converged state.
    fn unmap<const D: usize, const S: usize>(
        &self,
        body: &mut Body<D, S>,
        state: &State,
        stiffer: f64,
        trial: &mut DistributedVector,
    ) -> Result<()> {
        for (contact, scale) in body.contacts.iter_mut().zip(&self.scales) {
            contact.scale = stiffer * scale;
        }
        if let Some(traction) = &state.contact_traction {
            let traction = traction.owned()?;
            body.contacts.iter_mut().for_each(|contact| contact.recall(&traction));
        }
        let mut trial = trial.owned_mut()?;
        body.contacts.iter().for_each(|contact| contact.unmap(&mut trial));
        Ok(())
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

/// Why Newton's method failed, in words.
fn why(outcome: &NonlinearOutcome, effort: &Effort) -> String {
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
