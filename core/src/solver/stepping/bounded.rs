//! A step whose contacts are bounds on velocity components, solved by PETSc's own solver for variational inequalities.
//!
//! `K v - b = 0`, except where a velocity is at its bound, which exerts the remaining force. The solver does not use the contact
//! graphs and serves as an independent check of Newton's method on them.

use super::{
    linear_solver::SolverSettings,
    problem::{REMEDY, StepProblem, System},
};
use crate::{
    error::{Error, Result},
    fem::{body::Body, effect::Contact},
    linear_algebra::petsc::{BoundedSnes, DistributedVector, Limits, NonlinearOutcome, UNBOUNDED},
};

/// PETSc's solver with its bounds.
pub(super) struct Bounded {
    snes: BoundedSnes,
    settings: SolverSettings,
    lower: DistributedVector,
    upper: DistributedVector,
    residual: DistributedVector,
}

impl Bounded {
    /// A solver for velocities with the layout of `like`.
    pub(super) fn new(like: &DistributedVector, settings: &SolverSettings) -> Result<Self> {
        let (lower, upper, residual) = (like.like()?, like.like()?, like.like()?);
        let snes = BoundedSnes::new("bounds_", like)?;
        Ok(Self { snes, settings: settings.clone(), lower, upper, residual })
    }

    /// Solves for the velocity `trial`, starting from its values, and sets the pressures of the contacts. Collective.
    pub(super) fn solve<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        system: System<'_>,
        trial: &mut DistributedVector,
    ) -> Result<()> {
        let solved = self.solve_on_rank(&mut problem.body.contacts, system, trial);
        let outcome = problem.session.agree(solved)?;
        problem.work.newton += outcome.iterations;
        if !outcome.converged() {
            return Err(problem.failed(outcome.description(), REMEDY));
        }
        Ok(())
    }

    fn solve_on_rank<const D: usize>(
        &mut self,
        contacts: &mut [Contact<D>],
        system: System<'_>,
        trial: &mut DistributedVector,
    ) -> Result<NonlinearOutcome> {
        self.lower.fill(-UNBOUNDED)?;
        self.upper.fill(UNBOUNDED)?;
        {
            let (mut lower, mut upper) = (self.lower.owned_mut()?, self.upper.owned_mut()?);
            contacts.iter().for_each(|contact| contact.normal.add_bounds(&mut lower, &mut upper));
        }
        let bounds = [&self.lower, &self.upper];
        let Some(matrix) = system.matrix.assembled() else {
            return Err(Error::Internal(
                "the solver of variational inequalities requires an assembled matrix".into(),
            ));
        };
        let limits = Limits {
            absolute: system.tolerance,
            relative: self.settings.tolerance,
            iterations: self.settings.max_newton_iterations as usize,
        };
        let outcome = self.snes.solve(matrix, system.right_hand_side, bounds, trial, limits)?;
        self.residual.copy_from(self.snes.residual())?;
        let (velocity, mut residual) = (trial.owned()?, self.residual.owned_mut()?);
        for contact in contacts.iter_mut() {
            contact.normal.set_reactions(&velocity, &residual);
        }
        contacts.iter().for_each(|contact| contact.add_forces(&velocity, &mut residual));
        Ok(outcome)
    }

    /// The residual of the equations of motion at the end of the last solve, in N.
    pub(super) fn residual(&self) -> &DistributedVector {
        &self.residual
    }
}

/// Refuses contacts on this rank that are not velocity bounds, and obstacles that forces move.
pub(super) fn refuse_other_contacts<const D: usize, const S: usize>(body: &Body<D, S>) -> Result<()> {
    if body.contacts.iter().any(|contact| contact.obstacle.is_driven()) {
        return Err(Error::Refused(
            "[solver] method = \"vinewtonrsls\" does not support obstacles that forces move; use method = \"newton\", or delete \
             [contact.obstacle_load]"
                .into(),
        ));
    }
    match body.contacts.iter().find_map(|contact| contact.normal.oblique_normal()) {
        None => Ok(()),
        Some(place) => Err(Error::Refused(format!(
            "[solver] method = \"vinewtonrsls\" limits components of the velocity, but the normal at {place:?} m is not parallel to \
             an axis; use method = \"newton\""
        ))),
    }
}
