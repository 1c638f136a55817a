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

/// Solves a step from the velocity in `trial`, and writes the new one there: with all fallbacks, but where a body may be at rest with the
/// first from `trial` and from there before the others. Collective.
pub(super) fn correct<const D: usize, const S: usize>(
    newton: &mut Newton,
    solver: &mut dyn LinearSolver,
    problem: &mut StepProblem<'_, D, S>,
    system: System<'_>,
    trial: &mut DistributedVector,
) -> Result<StepOutcome> {
    let most = system.fallbacks[1];
    if most < 2 || !newton.properties(problem).may_be_solved_at_rest() {
        return correct_from(newton, solver, problem, system, trial);
    }
    let mut start = match newton.extrapolated.take() {
        Some(start) => start,
        None => trial.like()?,
    };
    start.copy_from(trial)?;
    let first = System { fallbacks: [0, 1], ..system };
    let mut solved = problem.session.agree(correct_from(newton, solver, problem, first, trial));
    for others in [first, System { fallbacks: [1, most - 1], ..system }] {
        if !matches!(&solved, Err(error) if error.is_failure()) {
            break;
        }
        restore_pressures(problem.body, problem.state)?;
        if others.fallbacks == first.fallbacks {
            trial.fill(0.0)?;
        } else {
            trial.copy_from(&start)?;
        }
        solved = problem.session.agree(correct_from(newton, solver, problem, others, trial));
    }
    newton.extrapolated = Some(start);
    Ok(solved?)
}

/// Solves a step from the velocity in `trial`, and writes the new one there. A solver in double precision needs one pass, one in single
/// precision corrections until the residual in double precision is small. Collective.
fn correct_from<const D: usize, const S: usize>(
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
