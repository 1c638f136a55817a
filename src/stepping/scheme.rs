//! The choice of the time scheme.

use super::{bdf2, flow::FlowStart, implicit::Implicit, implicit_euler, lagged_euler::LaggedEuler};
use crate::{
    body::Body,
    effect::{Blend, Energy, Evaluation, Peaks, Step},
    error::Result,
    petsc::DistributedVector,
    session::Session,
    state::State,
};

pub use crate::job::Scheme;

/// The state at which laws are evaluated under a scheme, before the first step.
pub fn evaluation(scheme: Scheme) -> Evaluation {
    if scheme.is_implicit() { Evaluation::End(Blend::euler(0.0)) } else { Evaluation::Converged }
}

/// A scheme with what it keeps from one part of a step to the next.
pub(super) enum Method {
    LaggedEuler(LaggedEuler),
    Implicit(Box<Implicit>),
}

impl Method {
    pub fn new(scheme: Scheme, state: &State) -> Result<Self> {
        let implicit = |formula| Ok(Self::Implicit(Box::new(Implicit::new(state, formula)?)));
        match scheme {
            Scheme::LaggedEuler => Ok(Self::LaggedEuler(LaggedEuler::default())),
            Scheme::ImplicitEuler => implicit(implicit_euler::blend),
            Scheme::Bdf2 => implicit(bdf2::blend),
        }
    }

    /// The length for which the matrix of a step is assembled.
    pub fn matrix_length(&self, step: Step) -> f64 {
        match self {
            Self::LaggedEuler(_) => step.length,
            Self::Implicit(scheme) => scheme.matrix_length(step),
        }
    }

    /// The same for a step after others of its length.
    pub fn steady_length(&self, length: f64) -> f64 {
        self.matrix_length(Step { time: 0.0, length, previous_length: length })
    }

    /// Takes in what the step starts from, and adds what is known of its forces to `forces` (with ghosts).
    pub fn start<const D: usize, const S: usize>(
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

    /// Tells contacts that are prepared for the step where it starts.
    pub fn prepare_contacts<const D: usize, const S: usize>(
        &mut self,
        body: &mut Body<D, S>,
        state: &State,
        step: Step,
    ) -> Result<()> {
        match self {
            Self::LaggedEuler(_) => Ok(()),
            Self::Implicit(scheme) => scheme.prepare_contacts(body, state, step),
        }
    }

    /// Where the displacement starts, for cells that flow at the end of the step.
    pub fn flow_start(&self) -> Option<FlowStart<'_>> {
        match self {
            Self::LaggedEuler(_) => None,
            Self::Implicit(scheme) => Some(scheme.flow_start()),
        }
    }

    /// The least residual norm in N that means something. Collective.
    pub fn rounding(&self, session: &Session) -> f64 {
        match self {
            Self::LaggedEuler(_) => 0.0,
            Self::Implicit(scheme) => scheme.rounding(session),
        }
    }

    /// Does what is left to do for a solved step before it is committed. Collective.
    pub fn finish<const D: usize, const S: usize>(
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

    /// Takes the solved velocity over into the state. Collective.
    pub fn commit(&mut self, state: &mut State, solved: &DistributedVector, step: Step) -> Result<()> {
        match self {
            Self::LaggedEuler(_) => state.commit(solved, step.time, step.length),
            Self::Implicit(scheme) => scheme.commit(state, solved, step),
        }
    }

    /// Energies of the step just committed without the work of the loads, and its largest stress and strain, over all ranks.
    /// Collective.
    pub fn energy<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &Body<D, S>,
        state: &State,
        step: Step,
    ) -> Result<(Energy, Peaks)> {
        match self {
            Self::LaggedEuler(scheme) => scheme.energy(session, body, state, step),
            Self::Implicit(scheme) => scheme.energy(session, body, state, step),
        }
    }
}

/// Sums and largest values over all ranks. Collective.
pub(super) fn over_ranks(session: &Session, energy: Energy, peaks: Peaks) -> (Energy, Peaks) {
    let [von_mises, strain] = session.largest([peaks.von_mises, peaks.strain]);
    (Energy::from_array(session.sum(energy.to_array())), Peaks { von_mises, strain })
}
