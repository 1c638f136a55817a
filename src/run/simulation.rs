//! A job in memory: set up and stepped without a file.

use super::{
    scene::scene,
    setup::{Setup, setup},
};
use crate::{
    body::Body,
    effect::{Energy, Step},
    error::Result,
    job::{Loaded, Time},
    mesh::GlobalMesh,
    output::history::Totals,
    session::Session,
    state::State,
    stepping::{LaggedEuler, StepOutcome},
};

/// A step that ends within this share of a step of the end ends there: the rounding of 100 000 steps adds up to more than
/// 1e-9 of one.
pub(super) const SNAP: f64 = 1e-6;

/// A body with its state and scheme, for programs that look at fields after each step.
pub struct Simulation<const D: usize, const S: usize> {
    /// The body and what acts on it.
    pub body: Body<D, S>,
    /// Its converged state.
    pub state: State,
    /// The scheme.
    pub scheme: LaggedEuler,
    /// What adds up over the steps.
    pub totals: Totals,
    time: Time,
}

impl<const D: usize, const S: usize> Simulation<D, S> {
    /// Sets a job up on `mesh`, the whole mesh on rank 0 and nothing elsewhere; the job's warnings grow by those of the
    /// mesh. `S` is the number of stress components that go with the job's hypothesis. Collective.
    pub fn new(session: &Session, loaded: &mut Loaded, mesh: Option<GlobalMesh<D>>) -> Result<Self> {
        let scene = mesh.map(|mesh| scene(mesh, loaded, session.ranks())).transpose();
        let scene = session.agree(scene)?;
        let Setup { body, state, scheme, .. } = setup::<D, S>(session, loaded, scene)?;
        let totals = totals_at_start(session, &body, &state)?;
        Ok(Self { body, state, scheme, totals, time: loaded.job.time.clone() })
    }

    /// Takes the next step; `None` at the end time. Collective.
    pub fn advance(&mut self, session: &Session) -> Result<Option<StepOutcome>> {
        if self.state.time >= self.time.end {
            return Ok(None);
        }
        let step = next_step(&self.state, self.time.step, self.time.end);
        let outcome = self.scheme.advance(session, &mut self.body, &mut self.state, step)?;
        self.totals.add(&outcome);
        Ok(Some(outcome))
    }
}

/// The totals of a run that has taken no step. Collective.
pub(super) fn totals_at_start<const D: usize, const S: usize>(
    session: &Session,
    body: &Body<D, S>,
    state: &State,
) -> Result<Totals> {
    let rest = Step { time: state.time, length: 0.0, previous_length: 0.0 };
    let mine = session.agree(body.energy(state, rest))?;
    Ok(Totals::at_start(Energy::from_array(session.sum(mine.to_array()))))
}

/// The step of `length` from here, cut or stretched to end at `end` where that is near.
pub(super) fn next_step(state: &State, length: f64, end: f64) -> Step {
    let previous_length = state.step_length;
    let time = state.time + length;
    if (end - time).abs() <= SNAP * length {
        Step { time: end, length, previous_length }
    } else if time > end {
        Step { time: end, length: end - state.time, previous_length }
    } else {
        Step { time, length, previous_length }
    }
}
