//! Newton's method for the contact equations of one step.

use super::{
    StepOutcome,
    bounded::Bounded,
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

/// Newton's method with what it needs.
pub(super) struct Newton {
    pub snes: Snes,
    /// PETSc's solver for variational inequalities, if that solves the steps.
    pub bounded: Option<Bounded>,
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
        body.contacts.iter_mut().zip(&self.scales).for_each(|(contact, scale)| contact.scale = *scale);
        branches(body, &state.velocity, &mut self.before)?;
        // Where nothing acts but an obstacle that moves, its first push is what residuals are small against.
        let tolerances = (tolerance, settings.tolerance);
        if let Some(bounded) = &mut self.bounded {
            let contacts = &mut body.contacts;
            let most = settings.newton_iterations;
            let solved = bounded.solve(contacts, matrix, right_hand_side, trial, tolerances, most);
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
        {
            let mut trial = trial.owned_mut()?;
            body.contacts.iter().for_each(|contact| contact.unmap(&mut trial));
        }
        self.start.copy_from(trial)?;
        let (mut effort, mut newton_iterations) = (Effort::default(), 0);
        for last in if self.chosen_search { &[true][..] } else { &[false, true] } {
            if !self.chosen_search {
                self.snes.search_along_steps(*last)?;
            }
            trial.copy_from(&self.start)?;
            effort.sets.clear();
            let mut equations = ContactEquations {
                matrix,
                contacts: &mut body.contacts,
                right_hand_side,
                scratch: &mut self.scratch,
                linear_solver: &mut self.linear_solver,
                session,
                stop_at_cycles: !last,
                effort,
            };
            let solved = self.snes.solve(&mut equations, trial, tolerances, settings.newton_iterations);
            effort = equations.effort;
            newton_iterations += effort.sets.len();
            match session.agree(solved) {
                Ok(outcome) if outcome.converged() => break,
                Ok(_) | Err(Error::Failed(_)) if !last => {}
                Ok(outcome) => return Err(failed(step, &why(&outcome, &effort), REMEDY)),
                Err(Error::Failed(words)) => return Err(failed(step, &words, REMEDY)),
                Err(other) => return Err(other),
            }
        }
        {
            let mut trial = trial.owned_mut()?;
            body.contacts.iter_mut().for_each(|contact| contact.map(&mut trial));
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
