//! A step solved from other start velocities, to see whether it has other solutions.

use super::step_solver::{Known, StepSolver};
use crate::{
    body::Body, effect::Step, error::Result, petsc::DistributedVector, session::Session, state::State,
};

/// Velocities differ when they do by more than this share of the larger one.
const DIFFERENT: f64 = 1e-6;
/// Normal velocities of all contact points alike, over the largest velocity at which a law turns a corner; every second
/// guess has them at random instead.
const ALIKE: [f64; 6] = [1.5, 0.25, 0.75, 4.0, -0.5, -2.0];
/// Between which random ones lie.
const RANDOM: [f64; 2] = [-1.0, 2.0];

/// Solves the step from `guesses` other starts than the one in `trial`, and gives the solutions that differ. Contacts must be
/// prepared anew afterwards. Collective.
pub(super) fn other_solutions<const D: usize, const S: usize>(
    session: &Session,
    (body, state): (&mut Body<D, S>, &State),
    step: Step,
    known: Known<'_>,
    solver: &mut StepSolver,
    trial: &DistributedVector,
    guesses: usize,
) -> Result<Vec<DistributedVector>> {
    let mut found = Vec::new();
    let mut velocity = trial.like()?;
    for guess in 0..guesses {
        velocity.copy_from(trial)?;
        {
            let mut nodal = velocity.owned_mut()?;
            let ids = &body.mesh.node_ids;
            for contact in &body.contacts {
                let corner = contact.corner_velocity();
                contact.start_at(|node| corner * share(guess, ids[node]), &mut nodal);
            }
            let fixed = nodal.iter_mut().zip(&body.fixed).filter(|(_, fixed)| **fixed);
            fixed.for_each(|(value, _)| *value = 0.0);
        }
        match session.agree(solver.solve(session, body, state, step, known, &mut velocity)) {
            Ok(_) if is_new(&found, &velocity)? => {
                let mut kept = velocity.like()?;
                kept.copy_from(&velocity)?;
                found.push(kept);
            }
            Err(error) if !error.is_failure() => return Err(error.into()),
            _ => {}
        }
    }
    Ok(found)
}

/// Whether a velocity differs from all of these. Collective.
pub(super) fn is_new(found: &[DistributedVector], velocity: &DistributedVector) -> Result<bool> {
    for other in found {
        let mut difference = velocity.like()?;
        difference.copy_from(velocity)?;
        difference.add_scaled(-1.0, other)?;
        if difference.norm()? <= DIFFERENT * f64::max(velocity.norm()?, other.norm()?) {
            return Ok(false);
        }
    }
    Ok(true)
}

/// The velocity of a node in a guess, the same on any number of ranks.
fn share(guess: usize, node: u32) -> f64 {
    if guess.is_multiple_of(2) {
        return ALIKE[guess / 2 % ALIKE.len()];
    }
    let key = [(guess as u32).to_le_bytes(), node.to_le_bytes()].concat();
    let unit = (xxhash_rust::xxh3::xxh3_64(&key) >> 11) as f64 / (1u64 << 53) as f64;
    RANDOM[0] + (RANDOM[1] - RANDOM[0]) * unit
}
