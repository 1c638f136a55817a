//! Newton's method for the contact equations of one step.

use super::{
    StepOutcome,
    equations::{CellForces, ContactEquations, Effort, Scratch},
    flow::{Flow, FlowStart},
    linear_solver::SolverSettings,
};
use crate::{
    body::Body,
    effect::{Contact, Energy, PointCount, Step},
    error::{Error, Result},
    petsc::{DistributedVector, LineSearch, Matrix, NonlinearOutcome, ProjectedKsp, Snes},
    session::Session,
    state::State,
};

/// Iterations with full steps before backtracking starts anew. A new set of branches raises the residual at first, so that
/// backtracking would creep where full steps arrive; where the sets repeat, only backtracking arrives.
const FULL_STEPS: usize = 12;

/// Newton's method with what it needs.
pub(super) struct Newton {
    pub snes: Snes,
    pub linear_solver: ProjectedKsp,
    pub scratch: Scratch,
    pub before: Vec<u8>,
    pub after: Vec<u8>,
    /// The parameter of each contact's graphs for the matrix in use.
    pub scales: Vec<f64>,
    /// What cells that flow need, if there are any.
    pub flow: Option<Flow>,
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
        start: Option<FlowStart<'_>>,
    ) -> Result<StepOutcome> {
        body.contacts.iter_mut().zip(&self.scales).for_each(|(contact, scale)| contact.scale = *scale);
        branches(body, &state.velocity, &mut self.before)?;
        {
            let mut trial = trial.owned_mut()?;
            body.contacts.iter().for_each(|contact| contact.unmap(&mut trial));
        }
        let (cells, contacts) = body.cells_and_contacts();
        let mut cells = match (&mut self.flow, start) {
            (Some(flow), Some(start)) => Some(flow.of(cells, start)),
            _ => None,
        };
        let cells = cells.as_mut().map(|cells| cells as &mut dyn CellForces);
        let mut equations = ContactEquations {
            matrix,
            cells,
            contacts,
            right_hand_side,
            scratch: &mut self.scratch,
            linear_solver: &mut self.linear_solver,
            effort: Effort::default(),
        };
        let words = |error| match error {
            Error::Failed(words) => failed(step, &words, REMEDY),
            other => other,
        };
        let iterations = settings.newton_iterations;
        self.snes.set_line_search(LineSearch::FullSteps)?;
        let full = self.snes.solve(&mut equations, trial, tolerance, iterations.min(FULL_STEPS));
        let mut outcome = session.agree(full.map_err(words))?;
        if !outcome.converged() && outcome.iterations < iterations {
            let tried = outcome.iterations;
            trial.copy_from(&state.velocity)?;
            equations.start_again(state, trial)?;
            self.snes.set_line_search(LineSearch::Backtracking)?;
            let solved = self.snes.solve(&mut equations, trial, tolerance, iterations - tried);
            outcome = session.agree(solved.map_err(words))?;
            outcome.iterations += tried;
        }
        let effort = equations.effort;
        if !outcome.converged() {
            return Err(failed(step, &why(session, &outcome, &effort), REMEDY));
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
            newton_iterations: outcome.iterations,
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

/// Why Newton's method failed, in words. Collective.
fn why(session: &Session, outcome: &NonlinearOutcome, effort: &Effort) -> String {
    let words = outcome.words().to_owned();
    let Some(last) = effort.sets.len().checked_sub(1) else { return words };
    // Half the bits suffice to tell sets apart, and add up over ranks without a carry beyond them.
    let of = |at: usize| (effort.sets[at] >> 32) as f64;
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
