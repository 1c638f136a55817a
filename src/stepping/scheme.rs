//! The choice of the time scheme.

use super::lagged_euler::LaggedEuler;
use crate::{
    body::Body,
    effect::{Energy, Step},
    error::Result,
    petsc::DistributedVector,
    session::Session,
    state::State,
};

/// How a step is taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scheme {
    /// Elastic and viscoplastic stress lag by a step, as in Wang and Cheng (2022).
    LaggedEuler,
}

impl Scheme {
    /// Its name in job files.
    pub fn name(self) -> &'static str {
        match self {
            Self::LaggedEuler => "lagged_euler",
        }
    }
}

/// A scheme with what it keeps from one part of a step to the next.
pub(super) enum Method {
    LaggedEuler(LaggedEuler),
}

impl Method {
    pub fn new(scheme: Scheme) -> Self {
        match scheme {
            Scheme::LaggedEuler => Self::LaggedEuler(LaggedEuler::default()),
        }
    }

    pub fn scheme(&self) -> Scheme {
        match self {
            Self::LaggedEuler(_) => Scheme::LaggedEuler,
        }
    }

    /// The length for which the matrix of a step is assembled.
    pub fn matrix_length(&self, step: Step) -> f64 {
        match self {
            Self::LaggedEuler(_) => step.length,
        }
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
        }
    }

    /// Takes the solved velocity over into the state. Collective.
    pub fn commit(&mut self, state: &mut State, solved: &DistributedVector, step: Step) -> Result<()> {
        match self {
            Self::LaggedEuler(_) => state.commit(solved, step.time, step.length),
        }
    }

    /// Energies of the step just committed, over all ranks, without the work of the loads. Collective.
    pub fn energy<const D: usize, const S: usize>(
        &self,
        session: &Session,
        body: &Body<D, S>,
        state: &State,
        step: Step,
    ) -> Result<Energy> {
        match self {
            Self::LaggedEuler(scheme) => scheme.energy(session, body, state, step),
        }
    }
}
