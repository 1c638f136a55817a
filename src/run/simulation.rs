//! A job that is set up and stepped without output files.

use super::{
    scene::split,
    setup::{Setup, setup},
    steps,
    validate::validate,
};
use crate::{
    error::Result,
    fem::{
        body::Body,
        effect::{Energy, Step},
        state::State,
    },
    io::output::history::Totals,
    job::{Loaded, Time},
    linear_algebra::tensor::larger,
    mesh::{GlobalMesh, Mesh},
    parallel::session::Session,
    solver::stepping::{Adaptive, Landings, Pace, StepOutcome, Stepper, next_step},
};

/// A body with its state and scheme, for programs that look at fields after each step.
pub struct Simulation<const D: usize, const S: usize> {
    /// The body and what acts on it.
    pub body: Body<D, S>,
    /// Its converged state.
    pub state: State,
    /// The scheme.
    pub scheme: Stepper,
    /// Sums and maxima over the steps.
    pub totals: Totals,
    time: Time,
    landings: Landings,
    adaptive: Option<Adaptive<D>>,
}

impl<const D: usize, const S: usize> Simulation<D, S> {
    /// Sets a job up on `mesh`, the whole mesh on rank 0 and nothing elsewhere; adds warnings about the mesh to those of the
    /// job. `S` is the number of stress components that go with the job's hypothesis. Collective.
    pub fn new(session: &Session, loaded: &mut Loaded, mesh: Option<GlobalMesh<D>>) -> Result<Self> {
        let mesh = split(session, mesh)?;
        validate(session, &mesh, loaded)?;
        Self::on(session, loaded, mesh)
    }

    /// The same on this rank's part of a mesh that was checked against the job. Collective.
    pub fn on(session: &Session, loaded: &Loaded, mesh: Mesh<D>) -> Result<Self> {
        let Setup { body, state, scheme, .. } = setup::<D, S>(session, loaded, mesh)?;
        let totals = totals_at_start(session, &body, &state)?;
        let (time, adaptive) = (loaded.job.time.clone(), steps::adaptive(&loaded.job));
        let landings = steps::landings(&loaded.job);
        Ok(Self { body, state, scheme, totals, time, landings, adaptive })
    }

    /// The state of the step size control, if steps are adaptive.
    pub fn pace(&self) -> Option<Pace> {
        self.adaptive.as_ref().map(|adaptive| adaptive.pace)
    }

    /// Takes the next step; `None` at the end time. Collective.
    pub fn advance(&mut self, session: &Session) -> Result<Option<StepOutcome>> {
        if self.state.time >= self.time.end {
            return Ok(None);
        }
        let (body, state) = (&mut self.body, &mut self.state);
        let target = self.landings.next(state.time);
        let outcome = match &mut self.adaptive {
            Some(adaptive) => adaptive.advance(session, &mut self.scheme, body, state, target)?,
            None => {
                let step = next_step(state, self.time.step, target.time);
                self.scheme.advance(session, body, state, step)?
            }
        };
        self.totals.add(&outcome);
        update_slip_pressure(session, &self.body, &self.state, &mut self.totals)?;
        Ok(Some(outcome))
    }
}

/// Updates the largest contact pressure under slip weakening, which the certificate bounds. Collective.
pub(super) fn update_slip_pressure<const D: usize, const S: usize>(
    session: &Session,
    body: &Body<D, S>,
    state: &State,
    totals: &mut Totals,
) -> Result<()> {
    if let Some(mine) = session.agree(body.slip_pressure(state))? {
        let [largest] = session.largest([mine]);
        totals.max_slip_pressure =
            Some(totals.max_slip_pressure.map_or(largest, |most| larger(most, largest)));
    }
    Ok(())
}

/// The totals of a run that has taken no step. Collective.
pub(super) fn totals_at_start<const D: usize, const S: usize>(
    session: &Session,
    body: &Body<D, S>,
    state: &State,
) -> Result<Totals> {
    let rest = Step { time: state.time, length: 0.0, previous_length: 0.0 };
    let (mine, _) = session.agree(body.energy(state, rest))?;
    Ok(Totals::at_start(Energy::from_array(session.sum(mine.to_array()))))
}
