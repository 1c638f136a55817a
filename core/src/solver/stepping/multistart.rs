//! Repeated solution of a step from other start velocities, to search for further solutions.

use super::{StepOutcome, contacts::restore_pressures, problem::StepProblem, step_solver::StepSolver};
use crate::{
    error::{Error, Result},
    linear_algebra::petsc::DistributedVector,
};

/// Velocities that differ by more than this share of the larger one are different.
const RELATIVE_DIFFERENCE: f64 = 1e-6;
/// The same for velocities of which one is certainly not an inaccurate solution of the step of the other.
const CERTAIN_DIFFERENCE: f64 = 1e-3;
/// The same for changes of the displacement in a step: a body at rest has velocities of rounding errors.
const SMALL_CHANGE: f64 = 1e-3;
/// Uniform normal velocity of all contact points, relative to the largest velocity at which a law has a kink; every second
/// start has random velocities instead.
const UNIFORM_VELOCITIES: [f64; 6] = [1.5, 0.25, 0.75, 4.0, -0.5, -2.0];
/// Range of the random velocities.
const RANDOM_VELOCITIES: [f64; 2] = [-1.0, 2.0];

/// Solves a step from the velocity in `trial` after solving it from this number of others; writes the new velocity there and counts
/// the solutions that differ. Collective.
pub(super) fn solve_and_search<const D: usize, const S: usize>(
    solver: &mut StepSolver,
    problem: &mut StepProblem<'_, D, S>,
    trial: &mut DistributedVector,
    starts: usize,
) -> Result<StepOutcome> {
    let session = problem.session;
    let mut others = Vec::new();
    let mut velocity = trial.like()?;
    let mut fastest = SMALL_CHANGE * problem.state.displacement.norm()? / problem.step.length;
    for number in 0..starts {
        velocity.copy_from(trial)?;
        write_start(problem, number, &mut velocity)?;
        fastest = f64::max(fastest, velocity.norm()?);
        match session.agree(solver.solve(problem, &mut velocity)) {
            Ok(_) if is_new(&others, &velocity, [RELATIVE_DIFFERENCE, fastest])? => {
                let mut solution = velocity.like()?;
                solution.copy_from(&velocity)?;
                others.push(solution);
            }
            Err(error) if !error.is_failure() => return Err(error.into()),
            _ => {}
        }
    }
    session.agree(restore_pressures(problem.body, problem.state))?;
    match session.agree(solver.solve(problem, trial)) {
        Ok(outcome) => {
            let solutions =
                others.len() + usize::from(is_new(&others, trial, [RELATIVE_DIFFERENCE, fastest])?);
            let mut solutions_differ = false;
            for other in &others {
                let alone = std::slice::from_ref(other);
                solutions_differ |= is_new(alone, trial, [CERTAIN_DIFFERENCE, fastest])?;
            }
            Ok(StepOutcome { solutions, solutions_differ, ..outcome })
        }
        Err(error) if error.is_failure() => {
            Err(Error::Failed(format!("{error}; solutions from other start velocities: {}", others.len())))
        }
        Err(other) => Err(other.into()),
    }
}

/// Sets the velocities of contact nodes to those of the start with this number.
fn write_start<const D: usize, const S: usize>(
    problem: &StepProblem<'_, D, S>,
    number: usize,
    velocity: &mut DistributedVector,
) -> Result<()> {
    let mut nodal = velocity.owned_mut()?;
    let ids = &problem.body.mesh.node_ids;
    for contact in &problem.body.contacts {
        let scale = contact.largest_kink_velocity();
        contact.set_start_velocities(|node| scale * start_velocity(number, ids[node]), &mut nodal);
    }
    problem.body.held.clear(&mut nodal);
    Ok(())
}

/// Whether a velocity differs from all of these by more than this share of the larger one and of the fastest start: a solution at rest is
/// found up to rounding errors of the start. Collective.
fn is_new(
    found: &[DistributedVector],
    velocity: &DistributedVector,
    [share, fastest]: [f64; 2],
) -> Result<bool> {
    for other in found {
        let mut difference = velocity.like()?;
        difference.copy_from(velocity)?;
        difference.add_scaled(-1.0, other)?;
        if difference.norm()? <= share * f64::max(velocity.norm()?, other.norm()?).max(fastest) {
            return Ok(false);
        }
    }
    Ok(true)
}

/// The velocity of a node in the start with this number, the same on any number of ranks.
fn start_velocity(number: usize, node: u32) -> f64 {
    if number.is_multiple_of(2) {
        return UNIFORM_VELOCITIES[number / 2 % UNIFORM_VELOCITIES.len()];
    }
    let key = [(number as u32).to_le_bytes(), node.to_le_bytes()].concat();
    let unit = (xxhash_rust::xxh3::xxh3_64(&key) >> 11) as f64 / (1u64 << 53) as f64;
    RANDOM_VELOCITIES[0] + (RANDOM_VELOCITIES[1] - RANDOM_VELOCITIES[0]) * unit
}
