//! The scheme of Wang and Cheng (2022), (24)-(25): backward difference for inertia, implicit viscosity and contact,
//! elastic and viscoplastic stress from the previous step.
//!
//! ```text
//! H_n = H_{n-1} + k G(s_{n-1}),   s_n = E e(u_{n-1}) + H_n
//! (1/k) M (v_n - v_{n-1}) + A v_n + C(v_n) + B^T s_n = f_n
//! u_n = u_{n-1} + k v_n,          sigma_n = A e(v_n) + s_n
//! ```

use crate::{
    error::{Error, Result},
    fem::{
        body::Body,
        effect::{Energy, Step},
        state::State,
    },
    parallel::session::Session,
};

/// Energies that are computed at the start of a step.
#[derive(Debug, Default)]
pub(super) struct LaggedEuler {
    pub explicit: Energy,
}

/// Refuses a step longer than the stability bound of explicit flow at the stresses for which forces were just added, if the bound
/// depends on them. Collective.
pub(super) fn refuse_fast_flow<const D: usize, const S: usize>(
    session: &Session,
    body: &mut Body<D, S>,
    step: Step,
) -> Result<()> {
    let Some(mine) = body.take_flow_step_bound() else { return Ok(()) };
    let [bound] = session.largest([-mine]).map(|largest| -largest);
    if step.length <= bound {
        return Ok(());
    }
    Err(Error::Failed(format!(
        "the step of {} s to t = {} s is longer than {bound:.4e} s, the stability bound of explicit viscoplastic flow at the largest \
         overstress in the body (for power laws the bound decreases with the overstress); use a shorter [time] step, \
         scheme = \"implicit_euler\", or accept it with [solver] accept = [\"explicit_stability\"]",
        step.length, step.time
    )))
}

impl LaggedEuler {
    /// Adds `M v_{n-1} / k - B^T s_n`.
    pub(super) fn start<const D: usize, const S: usize>(
        &mut self,
        body: &mut Body<D, S>,
        state: &State,
        step: Step,
        forces: &mut [f64],
    ) -> Result<()> {
        self.explicit = body.add_explicit_forces(state, step, forces)?;
        Ok(())
    }
}
