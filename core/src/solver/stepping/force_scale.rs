//! The size of the forces of a step, by which its accuracy is measured.
//!
//! The right-hand side `b` of a step contains `M v_{n-1} / k'`, and with moving supports `-K g`. Where a body is carried along, both are
//! much larger than the forces that act on it, and cancel in the residual. The size is therefore the norm of `b - M V / k'` with the mean
//! velocity `V` of the body, and with moving supports that of `b + K g - M V / k'` or of `b - K v` at the start velocity `v`, whichever is
//! larger; but at most that of `b`.

use crate::{
    error::Result,
    fem::{body::Body, effect::Form, state::State},
    linear_algebra::petsc::DistributedVector,
    parallel::session::Session,
};

/// The least size as a share of the norm of `b`: below a smaller one rounding errors of `K v` often make steps be solved twice.
const LEAST_SHARE: f64 = 0.1;

/// The masses that belong to the velocity components.
#[derive(Debug)]
pub(super) struct ForceScale {
    /// Sums of the rows of the mass matrix in kg at the owned components; empty without inertia.
    masses: Vec<f64>,
}

impl ForceScale {
    /// For a body, with vectors like `layout`. Collective.
    pub(super) fn new<const D: usize, const S: usize>(
        body: &Body<D, S>,
        layout: &DistributedVector,
    ) -> Result<Self> {
        if !body.has_form(Form::Mass) {
            return Ok(Self { masses: Vec::new() });
        }
        let mut masses = layout.like()?;
        {
            let mut masses = masses.local_mut()?;
            masses.fill(0.0);
            let ones = vec![1.0; masses.len()];
            body.add_form(Form::Mass, &ones, &mut masses);
        }
        masses.add_ghosts_to_owners()?;
        let masses = masses.owned()?.to_vec();
        Ok(Self { masses })
    }

    /// The norm in N of `forces - M V / length` at free components, with the mean velocity `V` of the state. Collective.
    pub(super) fn without_translation<const D: usize, const S: usize>(
        &self,
        session: &Session,
        body: &Body<D, S>,
        state: &State,
        (forces, length): (&DistributedVector, f64),
    ) -> Result<f64> {
        let (forces, velocity) = (forces.owned()?, state.velocity.owned()?);
        // Momentum along each axis, and the mass.
        let mut sums = [0.0; 4];
        for (masses, velocities) in self.masses.chunks_exact(D).zip(velocity.chunks_exact(D)) {
            sums[3] += masses[0];
            (0..D).for_each(|i| sums[i] += masses[i] * velocities[i]);
        }
        let [momentum @ .., mass] = session.sum(sums);
        let rate = momentum.map(|momentum| if mass > 0.0 { momentum / (mass * length) } else { 0.0 });
        let carried = |at: usize| self.masses.get(at).map_or(0.0, |mass| mass * rate[at % D]);
        let free = forces.iter().zip(body.held.flags()).enumerate().filter(|(_, (_, held))| !**held);
        let squares = free.map(|(at, (force, _))| (force - carried(at)).powi(2)).sum();
        Ok(session.sum([squares])[0].sqrt())
    }
}

/// The size of forces whose norm is `norm`, given that without what only carries the body along.
pub(super) fn size_of(norm: f64, without: f64) -> f64 {
    without.min(norm).max(LEAST_SHARE * norm)
}
