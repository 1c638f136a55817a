//! Corrections of steps that are solved with a factor in single precision.

use super::{
    StepOutcome,
    newton::Newton,
    problem::{StepProblem, System},
    solver::LinearSolver,
};
use crate::{
    error::{Error, Result},
    linear_algebra::petsc::DistributedVector,
};

/// Number of corrections after which they have failed.
pub(super) const MAX_CORRECTIONS: usize = 12;
/// A correction that reduces the residual by less than this factor counts as divergence.
const LARGEST_REDUCTION: f64 = 0.5;

/// Solves a step from the velocity in `trial`, and writes the new one there. A solver in double precision needs one pass, one in single
/// precision corrections until the residual in double precision is small. Collective.
pub(super) fn correct<const D: usize, const S: usize>(
    newton: &mut Newton,
    solver: &mut dyn LinearSolver,
    problem: &mut StepProblem<'_, D, S>,
    system: System<'_>,
    trial: &mut DistributedVector,
) -> Result<StepOutcome> {
    solver.start(system, trial)?;
    let (mut sum, mut last) = (StepOutcome::default(), f64::INFINITY);
    for _ in 0..MAX_CORRECTIONS {
        let outcome = newton.solve(problem, solver.condense(system, trial)?)?;
        sum = sum.followed_by(outcome);
        let Some(left) = solver.expand(system, trial)? else {
            trial.update_ghosts()?;
            return Ok(sum);
        };
        if left <= system.tolerance {
            trial.update_ghosts()?;
            return Ok(StepOutcome { residual: left, ..sum });
        }
        if left.is_nan() || left > LARGEST_REDUCTION * last {
            break;
        }
        last = left;
    }
    Err(Error::Failed("corrections with a factor in single precision do not converge".into()))
}
