//! Steps with a factor in single precision, whose solutions are corrected until the residual in double precision is small.
//!
//! With `K = L L^T + E`, the correction `d` of a velocity `v` solves `L L^T d + C(v + d) = r` with `r = b - K v`. The residual
//! `r_c` along the motions that laws see, where the forces of contact are large, is left as it is; `L y = r - r_c` takes the rest half
//! through, and the contact alone solves `S (v + d) + C(v + d) = L_c y_c + r_c + S v`. What is left is `-E d`: it is measured, and
//! corrected in the same way until it is small.

use super::{
    StepOutcome,
    condensed::{Condensed, Factored, factored},
    equations::StepMatrix,
    newton::{From, Task, restore_pressures},
};
use crate::{body::Body, error::Result, petsc::DistributedVector, session::Session};

/// Corrections after which single precision has failed.
const CORRECTIONS: usize = 12;
/// A correction that leaves more than this share of the residual leads nowhere.
const LEAST: f64 = 0.5;

/// Share of the tolerance to which the contact alone is solved: later corrections start so near to their solution that Newton's
/// method would stop just below it, and velocity and pressure stay as far off their graph.
const CONTACT_SHARE: f64 = 0.1;

/// Vectors of all nodes, and of contact nodes.
pub(super) struct Refinement {
    first: DistributedVector,
    residual: DistributedVector,
    correction: DistributedVector,
    start: DistributedVector,
    change: DistributedVector,
    product: DistributedVector,
}

impl Refinement {
    fn new(nodes: &DistributedVector, contact: &DistributedVector) -> Result<Self> {
        Ok(Self {
            first: nodes.like()?,
            residual: nodes.like()?,
            correction: nodes.like()?,
            start: contact.like()?,
            change: contact.like()?,
            product: contact.like()?,
        })
    }
}

impl Condensed {
    /// Solves a step from the velocity in `trial`, and leaves the new one there; `None`, and all as it was, where
    /// single precision is not enough. Collective.
    pub(super) fn refine<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        from: From<'_>,
        task: Task<'_>,
        trial: &mut DistributedVector,
    ) -> Result<Option<StepOutcome>> {
        let mut refinement = match self.refinement.take() {
            Some(refinement) => refinement,
            None => Box::new(Refinement::new(trial, &self.trial)?),
        };
        refinement.first.copy_from(trial)?;
        let refined = self.refine_with(session, body, from, task, trial, &mut refinement);
        let refined = match session.agree(refined) {
            Err(error) if error.is_failure() => None,
            other => other?,
        };
        if refined.is_none() {
            trial.copy_from(&refinement.first)?;
            restore_pressures(body, from)?;
        }
        self.refinement = Some(refinement);
        Ok(refined)
    }

    fn refine_with<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        from: From<'_>,
        task: Task<'_>,
        trial: &mut DistributedVector,
        refinement: &mut Refinement,
    ) -> Result<Option<StepOutcome>> {
        let mut outcome = StepOutcome::default();
        let mut before = f64::INFINITY;
        write_residual(task, trial, &mut refinement.residual)?;
        for _ in 0..CORRECTIONS {
            let pass = self.correct(session, body, from, task, trial, refinement)?;
            outcome = StepOutcome {
                newton_iterations: outcome.newton_iterations + pass.newton_iterations,
                linear_iterations: outcome.linear_iterations + pass.linear_iterations,
                indefinite_solves: outcome.indefinite_solves + pass.indefinite_solves,
                ..pass
            };
            let left = self.left::<D>(task, trial, refinement)?;
            if left <= task.tolerance {
                trial.update_ghosts()?;
                return Ok(Some(outcome));
            }
            if left.is_nan() || left > LEAST * before {
                break;
            }
            before = left;
        }
        Ok(None)
    }

    /// Corrects a velocity once for its residual. Collective.
    fn correct<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        from: From<'_>,
        task: Task<'_>,
        trial: &mut DistributedVector,
        refinement: &mut Refinement,
    ) -> Result<StepOutcome> {
        let Refinement { residual, correction, start, change, product, .. } = refinement;
        self.take_push::<D>(residual, change)?;
        self.forward(residual)?;
        self.restrict::<D>(from, trial)?;
        start.copy_from(&self.trial)?;
        let Factored { cholesky, condensed, .. } = factored(&mut self.factored)?;
        condensed.write_times_lower(cholesky.last_mut(), &mut self.right_hand_side)?;
        self.right_hand_side.add_scaled(1.0, change)?;
        condensed.multiply(start, product)?;
        self.right_hand_side.add_scaled(1.0, product)?;
        let contact = Task { tolerance: CONTACT_SHARE * task.tolerance, ..task };
        let outcome = self.solve_contact(session, body, from, contact)?;
        self.right_hand_side.add_scaled(-1.0, product)?;
        change.copy_from(&self.trial)?;
        change.add_scaled(-1.0, start)?;
        let Factored { cholesky, condensed, .. } = factored(&mut self.factored)?;
        condensed.multiply(change, product)?;
        condensed.read_times_upper(change, cholesky.last_mut())?;
        self.backward(correction)?;
        trial.add_scaled(1.0, correction)?;
        self.put_found::<D>(trial)?;
        Ok(outcome)
    }

    /// Writes `b - K v`, and gives the norm of `b - K v - C(v)` with the forces `C(v)` that Newton's method left. Collective.
    fn left<const D: usize>(
        &mut self,
        task: Task<'_>,
        trial: &DistributedVector,
        refinement: &mut Refinement,
    ) -> Result<f64> {
        let Refinement { residual, correction, change, product, .. } = refinement;
        write_residual(task, trial, residual)?;
        change.copy_from(&self.right_hand_side)?;
        change.add_scaled(-1.0, product)?;
        correction.copy_from(residual)?;
        {
            let (forces, mut left) = (change.owned()?, correction.owned_mut()?);
            for (&node, force) in self.nodes.iter().zip(forces.chunks_exact(D)) {
                left[node * D..][..D].iter_mut().zip(force).for_each(|(left, force)| *left -= force);
            }
        }
        correction.norm()
    }

    /// Takes the forces along the motions that laws see out of a residual.
    fn take_push<const D: usize>(
        &self,
        residual: &mut DistributedVector,
        push: &mut DistributedVector,
    ) -> Result<()> {
        let (mut residual, mut push) = (residual.owned_mut()?, push.owned_mut()?);
        push.fill(0.0);
        for motion in &self.motions {
            let value = &mut residual[self.nodes[motion.at / D] * D..][..D];
            let force: f64 = motion.direction.iter().zip(&*value).map(|(n, r)| n * r).sum();
            for ((value, push), n) in value.iter_mut().zip(&mut push[motion.at..]).zip(&motion.direction) {
                *value -= force * n;
                *push += force * n;
            }
        }
        Ok(())
    }
}

/// Writes `b - K v`. Collective.
fn write_residual(
    task: Task<'_>,
    velocity: &DistributedVector,
    residual: &mut DistributedVector,
) -> Result<()> {
    task.matrix.multiply(velocity, residual)?;
    residual.scale(-1.0)?;
    residual.add_scaled(1.0, task.right_hand_side)
}
