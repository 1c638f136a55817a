//! A step whose contacts are bounds on velocity components, as PETSc's own solver for variational inequalities sees it.
//!
//! `K v - b = 0` but where a bound is reached, and the force there pushes back. It knows nothing of contact graphs and
//! serves as an independent check of Newton's method on them.

use super::newton::Task;
use crate::{
    body::Body,
    effect::Contact,
    error::{Error, Result},
    petsc::{BoundedSnes, DistributedVector, Limits, NonlinearOutcome, UNBOUNDED},
};

/// PETSc's solver with its bounds.
pub(super) struct Bounded {
    snes: BoundedSnes,
    lower: DistributedVector,
    upper: DistributedVector,
    residual: DistributedVector,
}

impl Bounded {
    /// A solver for velocities laid out like `like`.
    pub fn new(like: &DistributedVector) -> Result<Self> {
        let (lower, upper, residual) = (like.like()?, like.like()?, like.like()?);
        Ok(Self { snes: BoundedSnes::new("bounds_", like)?, lower, upper, residual })
    }

    /// Solves from and into the velocity `trial`, and leaves the pressures with the contacts. Collective.
    pub fn solve<const D: usize>(
        &mut self,
        contacts: &mut [Contact<D>],
        task: Task<'_>,
        trial: &mut DistributedVector,
    ) -> Result<NonlinearOutcome> {
        self.lower.fill(-UNBOUNDED)?;
        self.upper.fill(UNBOUNDED)?;
        {
            let (mut lower, mut upper) = (self.lower.owned_mut()?, self.upper.owned_mut()?);
            contacts.iter().for_each(|contact| contact.add_bounds(&mut lower, &mut upper));
        }
        let bounds = [&self.lower, &self.upper];
        let (absolute, relative) = task.tolerances();
        let limits = Limits { absolute, relative, iterations: task.settings.newton_iterations };
        let Some(matrix) = task.matrix.assembled() else {
            return Err(Error::Internal("bounds need the entries of the matrix".into()));
        };
        let outcome = self.snes.solve(matrix, task.right_hand_side, bounds, trial, limits)?;
        self.residual.copy_from(self.snes.residual())?;
        let (velocity, mut residual) = (trial.owned()?, self.residual.owned_mut()?);
        for contact in contacts.iter_mut() {
            contact.bear(&velocity, &residual);
        }
        contacts.iter().for_each(|contact| contact.add_forces(&velocity, &mut residual));
        Ok(outcome)
    }

    /// What is left of the equations of motion at the end of the last solve, in N.
    pub fn residual(&self) -> &DistributedVector {
        &self.residual
    }
}

/// Why these contacts on this rank can't be solved this way, if they can't.
pub(super) fn refuse<const D: usize, const S: usize>(body: &Body<D, S>) -> Result<()> {
    match body.contacts.iter().find_map(Contact::more_than_bounds) {
        None => Ok(()),
        Some(place) => Err(Error::Refused(format!(
            "[solver] method = \"vinewtonrsls\" bounds components of the velocity, but the normal at {place:?} m is not along \
             an axis; use method = \"newton\""
        ))),
    }
}
