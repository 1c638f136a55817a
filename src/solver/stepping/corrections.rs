//! Corrections of steps that are solved with a factor in single precision.

use super::{
    StepOutcome,
    contacts::restore_pressures,
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
const DIVERGENCE: &str = "corrections with a factor in single precision do not converge";

/// Solves a step from the velocity in `trial`, and writes the new one there: with all fallbacks, but where a body may be at rest with the
/// first from `trial` and from there before the others. A solver in double precision needs one pass, one in single precision corrections
/// until the residual in double precision is small. Collective.
pub(super) fn correct<const D: usize, const S: usize>(
    newton: &mut Newton,
    solver: &mut dyn LinearSolver,
    problem: &mut StepProblem<'_, D, S>,
    system: System<'_>,
    trial: &mut DistributedVector,
) -> Result<StepOutcome> {
    let all = system.fallbacks;
    let tries_rest = all[1] > 1 && newton.properties(problem).may_be_solved_at_rest();
    if tries_rest {
        newton.keep_extrapolated(trial)?;
    }
    let in_turn = [[0, 1], [0, 1], [1, all[1].saturating_sub(1)]];
    let at_once = [all];
    let mut failure = None;
    for (number, fallbacks) in (if tries_rest { &in_turn[..] } else { &at_once }).iter().enumerate() {
        if number > 0 {
            restore_pressures(problem.body, problem.state)?;
        }
        match (number, &newton.extrapolated) {
            (1, _) => trial.fill(0.0)?,
            (2, Some(extrapolated)) => trial.copy_from(extrapolated)?,
            _ => {}
        }
        let system = System { fallbacks: *fallbacks, ..system };
        solver.start(system, trial)?;
        let (mut sum, mut last) = (StepOutcome::default(), f64::INFINITY);
        failure = None;
        for _ in 0..MAX_CORRECTIONS {
            match problem.session.agree(newton.solve(problem, solver.condense(system, trial)?)) {
                Ok(outcome) => sum = sum.followed_by(outcome),
                Err(error) if error.is_failure() => {
                    failure = Some(error.into());
                    break;
                }
                Err(error) => return Err(error.into()),
            }
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
    }
    Err(failure.unwrap_or_else(|| Error::Failed(DIVERGENCE.into())))
}
