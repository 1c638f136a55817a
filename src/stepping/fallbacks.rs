//! The ways in which a step is tried to be solved.

use super::{
    equations::{CellForces, ContactEquations, Effort, cycle},
    linear_solver::FrictionIteration,
    newton::{From, Newton, STEEP, Task, restore_pressures},
};
use crate::{
    body::Body,
    effect::Contact,
    error::Result,
    petsc::{DistributedVector, NonlinearOutcome},
    session::Session,
};

/// Fixed-point iterations after which a step has failed.
const FIXED_POINTS: usize = 200;
/// One way to solve a step.
#[derive(Clone, Copy)]
pub(super) struct Fallback {
    pub search: Search,
    /// How much stiffer than the body the parameters of the graphs are: which branches come back depends on it.
    pub stiffer: f64,
    pub iteration: FrictionIteration,
}

/// What keeps Newton's method on its way.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Search {
    /// Nothing: all steps in full.
    FullSteps,
    /// Every step as far as the residual falls enough.
    Backtracking,
    /// The same for the equations of the contact points alone: all other velocities are in equilibrium with theirs.
    Equilibrated,
}

const fn attempt(search: Search, stiffer: f64, iteration: FrictionIteration) -> Fallback {
    Fallback { search, stiffer, iteration }
}

/// What is tried in turn until a step is solved, each time from where the step started.
///
/// Full steps first: a new set of branches raises the residual of the whole body, so that a search would creep where full
/// steps arrive. In equilibrium it is that of the contact points alone, which tells how far off these are. A fixed point,
/// at last, does not cycle between pressure and friction; it serves friction that follows the pressure.
pub(super) const FALLBACKS: [Fallback; 12] = [
    attempt(Search::FullSteps, 1.0, FrictionIteration::Newton),
    attempt(Search::Equilibrated, 1.0, FrictionIteration::Newton),
    attempt(Search::Equilibrated, 10.0, FrictionIteration::Newton),
    attempt(Search::FullSteps, 10.0, FrictionIteration::Newton),
    attempt(Search::Backtracking, 1.0, FrictionIteration::Newton),
    attempt(Search::FullSteps, 100.0, FrictionIteration::Newton),
    attempt(Search::Backtracking, 1.0 / 30.0, FrictionIteration::Newton),
    attempt(Search::FullSteps, 1.0, FrictionIteration::FixedPoint),
    attempt(Search::Equilibrated, 1.0, FrictionIteration::FixedPoint),
    attempt(Search::FullSteps, 30.0, FrictionIteration::FixedPoint),
    attempt(Search::Equilibrated, 30.0, FrictionIteration::FixedPoint),
    attempt(Search::Backtracking, 30.0, FrictionIteration::FixedPoint),
];

/// Newton iterations; with why they led nowhere, if so.
pub(super) type Attempted = std::result::Result<usize, (usize, String)>;

impl Newton {
    /// Sets the parameters of all graphs, those of friction for its falls.
    pub(super) fn parametrise<const D: usize, const S: usize>(
        &self,
        body: &mut Body<D, S>,
        attempt: Fallback,
    ) {
        let follows = attempt.iteration == FrictionIteration::Newton;
        for ((contact, scales), fall) in body.contacts.iter_mut().zip(&self.scales).zip(&self.falls) {
            let [normal, tangential] = scales.map(|scale| attempt.stiffer * scale);
            contact.scale = normal.max(2.0 * contact.law.monotonicity_constant());
            contact.set_friction(tangential.max(fall / STEEP), follows);
        }
    }

    /// Goes back to where the step started.
    pub(super) fn start_again<const D: usize, const S: usize>(
        &self,
        body: &mut Body<D, S>,
        from: From<'_>,
        trial: &mut DistributedVector,
    ) -> Result<()> {
        trial.copy_from(&self.start)?;
        restore_pressures(body, from)
    }

    /// Solves once. A fixed point holds friction bounds at pressures that are brought up to date until these solve the
    /// equations, too. Collective.
    pub(super) fn attempt<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        task: Task<'_>,
        attempt: Fallback,
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
        search: Search,
        trial: &mut DistributedVector,
        effort: &mut Effort,
    ) -> Result<Attempted> {
        {
            let mut trial = trial.owned_mut()?;
            body.contacts.iter().for_each(|contact| contact.unmap(&mut trial));
        }
        let solved = self.iterate(session, body, task, search, trial, effort)?;
        if search == Search::Equilibrated {
            trial.copy_from(&self.scratch.velocity)?;
            return Ok(solved);
        }
        let mut trial = trial.owned_mut()?;
        body.contacts.iter_mut().for_each(|contact| contact.map(&mut trial));
        Ok(solved)
    }

    /// Newton's method from and into the unknowns in `trial`. Collective.
    fn iterate<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        task: Task<'_>,
        search: Search,
        trial: &mut DistributedVector,
        effort: &mut Effort,
    ) -> Result<Attempted> {
        if !self.chosen_search {
            self.snes.search_along_steps(search != Search::FullSteps)?;
        }
        effort.sets.clear();
        let (cells, contacts) = body.cells_and_contacts();
        let mut cells = match (&mut self.flow, task.flow) {
            (Some(flow), Some(start)) => Some(flow.of(cells, start)),
            _ => None,
        };
        let mut equations = ContactEquations {
            matrix: task.matrix,
            cells: cells.as_mut().map(|cells| cells as &mut dyn CellForces),
            contacts,
            right_hand_side: task.right_hand_side,
            scratch: &mut self.scratch,
            linear_solver: &mut self.linear_solver,
            session,
            stop_at_cycles: search == Search::FullSteps,
            equilibrated: search == Search::Equilibrated,
            effort: std::mem::take(effort),
        };
        let most = task.settings.newton_iterations;
        let solved = self.snes.solve(&mut equations, trial, task.tolerances(), most);
        *effort = equations.effort;
        let iterations = effort.sets.len();
        let missed = !matches!(&solved, Ok(outcome) if outcome.converged());
        // All ranks go the same way, whichever of them failed.
        let [missed] = session.largest([f64::from(u8::from(missed))]);
        if missed == 0.0 {
            return Ok(Ok(iterations));
        }
        match session.agree(solved) {
            Ok(outcome) => Ok(Err((iterations, words(&outcome, effort)))),
            Err(error) if error.is_failure() => Ok(Err((iterations, error.to_string()))),
            Err(error) => Err(error.into()),
        }
    }
}

/// Why Newton's method failed, in words.
fn words(outcome: &NonlinearOutcome, effort: &Effort) -> String {
    let words = outcome.words().to_owned();
    effort.period().map_or(words.clone(), |period| format!("{words}; {}", cycle(period)))
}
