//! Time schemes: the parts of a step that are specific to a scheme.

use super::{
    contacts::add_contact_energy, flow::FlowStart, implicit::Implicit, lagged_euler::LaggedEuler,
    outcome::over_ranks,
};
use crate::{
    error::Result,
    fem::{
        body::Body,
        effect::{Blend, CONTACT, Energy, Evaluation, NUMERICAL, Peaks, Step, VISCOUS},
        resultants::BalancedMotion,
        state::State,
    },
    job::Scheme,
    linear_algebra::petsc::DistributedVector,
    parallel::session::Session,
};

/// The state at which laws are evaluated under a scheme before the first step.
pub fn evaluation(scheme: Scheme) -> Evaluation {
    if scheme.is_implicit() { Evaluation::End(Blend::euler(0.0)) } else { Evaluation::Converged }
}

/// A scheme with the data that it stores during a step. Implicit schemes differ only in the blend of earlier states from which
/// a step starts.
pub(super) enum Integrator {
    LaggedEuler(LaggedEuler),
    Implicit(Box<Implicit>),
}

impl Integrator {
    /// The integrator of a scheme, for vectors with the layout of those of the state.
    pub(super) fn new(scheme: Scheme, state: &State) -> Result<Self> {
        Ok(match scheme.formula() {
            None => Self::LaggedEuler(LaggedEuler::default()),
            Some(blend) => Self::Implicit(Box::new(Implicit::new(state, blend)?)),
        })
    }

    /// The length for which the matrix of a step is assembled.
    pub(super) fn matrix_length(&self, step: Step) -> f64 {
        match self {
            Self::LaggedEuler(_) => step.length,
            Self::Implicit(scheme) => scheme.matrix_length(step),
        }
    }

    /// The same for a step that follows others of its length.
    pub(super) fn steady_length(&self, length: f64) -> f64 {
        self.matrix_length(Step { time: 0.0, length, previous_length: length })
    }

    /// Stores the start of the step, and adds its known forces to `forces` (with ghosts).
    pub(super) fn start<const D: usize, const S: usize>(
        &mut self,
        body: &mut Body<D, S>,
        state: &State,
        step: Step,
        forces: &mut [f64],
    ) -> Result<()> {
        match self {
            Self::LaggedEuler(scheme) => scheme.start(body, state, step, forces),
            Self::Implicit(scheme) => scheme.start(body, state, step, forces),
        }
    }

    /// The blend of states from which a started step of this length in s starts.
    pub(super) fn blend(&self, length: f64) -> Blend {
        match self {
            Self::LaggedEuler(_) => Blend::euler(length),
            Self::Implicit(scheme) => scheme.blend(),
        }
    }

    /// The displacement from which a started step of this length in s starts, given the converged state.
    pub(super) fn flow_start<'a>(&'a self, state: &'a State, length: f64) -> FlowStart<'a> {
        match self {
            Self::LaggedEuler(_) => FlowStart { displacement: &state.displacement, length },
            Self::Implicit(scheme) => scheme.flow_start(),
        }
    }

    /// The residual norm in N due to rounding errors of the forces. Collective.
    pub(super) fn rounding(&self, session: &Session) -> f64 {
        match self {
            Self::LaggedEuler(_) => 0.0,
            Self::Implicit(scheme) => scheme.rounding(session),
        }
    }

    /// Writes displacement, trial histories and energies of a solved step before it is committed. Collective.
    pub(super) fn finish<const D: usize, const S: usize>(
        &mut self,
        body: &mut Body<D, S>,
        state: &State,
        solved: &mut DistributedVector,
        step: Step,
    ) -> Result<()> {
        match self {
            Self::LaggedEuler(_) => Ok(()),
            Self::Implicit(scheme) => scheme.finish(body, state, solved, step),
        }
    }

    /// Commits the solved velocity to the state. Collective.
    pub(super) fn commit(&mut self, state: &mut State, solved: &DistributedVector, step: Step) -> Result<()> {
        match self {
            Self::LaggedEuler(_) => state.commit(solved, None, step),
            Self::Implicit(scheme) => scheme.commit(state, solved, step),
        }
    }

    /// The time in s at which the equations of a step hold.
    pub(super) fn balanced_time(&self, step: Step) -> f64 {
        match self {
            Self::LaggedEuler(_) => step.time,
            Self::Implicit(scheme) => scheme.balanced_time(step),
        }
    }

    /// The motion at which the forces of the step just committed are balanced, given the solved velocity.
    pub(super) fn balanced_motion<'a>(
        &'a self,
        state: &'a State,
        solved: &'a DistributedVector,
    ) -> BalancedMotion<'a> {
        match self {
            Self::LaggedEuler(_) => BalancedMotion {
                time: state.time,
                displacement: &state.displacement,
                velocity: &state.velocity,
                before: &state.previous_velocity,
                length: state.step_length,
            },
            Self::Implicit(scheme) => scheme.balanced_motion(state, solved),
        }
    }

    /// Whether a started step follows a formula of second order that needs the powers before it for energies of the same order.
    pub(super) fn averages_powers(&self) -> bool {
        match self {
            Self::LaggedEuler(_) => false,
            Self::Implicit(scheme) => scheme.blend().earlier != 0.0,
        }
    }

    /// Energies of the step just committed without the work of the loads, and its largest stress and strain, over all ranks; extrapolates
    /// a step that was solved at its midpoint to its end. Gives the powers in W at the end of the step, of the energies that are powers
    /// times its length. Collective.
    pub(super) fn complete<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        state: &mut State,
        step: Step,
    ) -> Result<(Energy, Peaks, Energy)> {
        let (mut energy, mut peaks) = body.energy(state, step)?;
        let mut powers = Energy::default();
        for kind in [VISCOUS, CONTACT] {
            powers[kind] = energy[kind] / step.length;
        }
        match self {
            Self::LaggedEuler(scheme) => energy += scheme.explicit,
            Self::Implicit(scheme) => scheme.add_solved(&mut energy),
        }
        add_contact_energy(body, state, step, &mut energy, &mut powers)?;
        if let Self::Implicit(scheme) = self {
            energy[NUMERICAL] += scheme.momentum_term(body, state, step)?;
            peaks = peaks.or(scheme.extrapolate(body, state, step, &mut energy)?);
        }
        let (energy, peaks) = over_ranks(session, energy, peaks);
        Ok((energy, peaks, powers.map_values(|values| session.sum(values))))
    }
}
