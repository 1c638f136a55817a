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
        effect::{Form, OBSTACLE_KINETIC, Step},
        state::State,
        turning::Turning,
    },
    io::output::history::Totals,
    job::{Job, Loaded, Scheme},
    linear_algebra::{petsc::DistributedVector, sparse::Precision, tensor::larger},
    mesh::{GlobalMesh, Mesh},
    parallel::{agreement::Agreed, session::Session},
    solver::stepping::{Adaptive, Landing, Landings, StepOutcome, Stepper, TIME_TOLERANCE},
};

/// Imbalances of energy below this share of the energy turned over are not looked into.
const BALANCED: f64 = 1e-9;
/// The shortest part of a fixed step that is divided, as a share of it.
const SHORTEST_PART: f64 = 1.0 / 256.0;
/// Rounding errors of energies as a share of those that cancel.
const ROUNDING: f64 = 1e-14;

/// A body with its state and scheme, for programs that look at fields after each step.
pub struct Simulation<const D: usize, const S: usize> {
    /// The body with its loads and contacts.
    pub body: Body<D, S>,
    /// Its converged state.
    pub state: State,
    /// The scheme.
    pub scheme: Stepper,
    /// Sums and maxima over the steps.
    pub totals: Totals,
    /// Times at which steps must end.
    pub(super) landings: Landings,
    /// The step size control, if steps are adaptive.
    pub(super) adaptive: Option<Adaptive<D>>,
    /// How far its bodies turn, if they have contacts.
    turning: Option<Turning<D>>,
}

/// A body with its state and the solver of its steps.
pub(super) struct Prepared<const D: usize, const S: usize> {
    pub body: Body<D, S>,
    pub state: State,
    pub scheme: Stepper,
}

impl<const D: usize, const S: usize> Simulation<D, S> {
    /// Sets a job up on `mesh`, the whole mesh on rank 0 and nothing elsewhere; adds warnings about the mesh to those of the
    /// job. `S` is the number of stress components that go with the job's hypothesis. Collective.
    pub fn new(session: &Session, loaded: &mut Loaded, mesh: Option<GlobalMesh<D>>) -> Result<Self> {
        let mesh = split(session, mesh, &loaded.job)?;
        validate(session, &mesh, loaded)?;
        Self::on(session, loaded, mesh)
    }

    /// The same on this rank's part of a mesh that was checked against the job. Collective.
    pub fn on(session: &Session, loaded: &Loaded, mesh: Mesh<D>) -> Result<Self> {
        let Setup { body, state, scheme, .. } = setup::<D, S>(session, loaded, mesh, &[])?;
        Ok(Self::start(session, &loaded.job, Prepared { body, state, scheme }, None)?)
    }

    /// A job that was set up, with the totals of the run that it continues, if there is one. Collective.
    pub(super) fn start(
        session: &Session,
        job: &Job,
        Prepared { body, state, mut scheme }: Prepared<D, S>,
        totals: Option<Totals>,
    ) -> Result<Self, Agreed> {
        let totals = match totals {
            Some(totals) => totals,
            None => totals_at_start(session, &body, &state)?,
        };
        let turning = Turning::new(session, &body, &state)?;
        let mut adaptive = steps::adaptive(job);
        if let (Some(adaptive), Some(level)) = (&mut adaptive, totals.step_level) {
            adaptive.step_level = level;
        }
        (scheme.powers, scheme.attempted) = (totals.powers, totals.attempted);
        if totals.single_precision_failed {
            scheme.solver.use_double_precision();
        }
        Ok(Self { body, state, scheme, totals, landings: steps::landings(job), adaptive, turning })
    }

    /// Takes the next step, shortened to land on required times, and adds it to the totals; `None` at the end time. Collective.
    pub fn advance(&mut self, session: &Session) -> Result<Option<StepOutcome>, Agreed> {
        let Self { body, state, scheme, totals, landings, adaptive, turning } = self;
        if state.time >= landings.end {
            return Ok(None);
        }
        let target = landings.next([state.time, state.step_length]);
        scheme.turnover = totals.turnover;
        let was_single = scheme.solver.factor_precision() == Some(Precision::Single);
        let outcome = if let Some(adaptive) = adaptive {
            let outcome = adaptive.advance(session, scheme, body, state, target);
            totals.step_level = Some(adaptive.step_level);
            outcome
        } else {
            let parts = Parts { landings, target, divided_until: &mut totals.divided_until };
            let outcome = parts.advance(session, scheme, body, state);
            totals.parts += u64::from(totals.divided_until.is_some());
            outcome
        };
        let mut outcome = outcome.inspect_err(|_| totals.add_work(scheme.take_work()))?;
        let before = *totals;
        // Newton's method may jump over unstable states without having met them.
        outcome.fell |= !body.has_form(Form::Mass) && totals.is_jump(&outcome.energy);
        totals.add(&outcome);
        // The kinetic energy of a body with mass is far above rounding errors.
        if totals.energy_imbalance > BALANCED && !body.has_form(Form::Mass) {
            totals.allow_rounding(rounding(session, body, state, outcome.residual)?, &before);
        }
        if totals.heat_imbalance > BALANCED {
            totals.allow_rounding_of_heat(scheme.rounding_of_heat(session, body)?, &before);
        }
        totals.single_precision_failed |=
            was_single && scheme.solver.factor_precision() == Some(Precision::Double);
        // The largest contact pressure under velocity weakening, which the certificate bounds.
        if let Some(mine) = session.agree(body.slip_pressure(state))? {
            let [most] = session.largest([mine]);
            totals.max_slip_pressure = Some(totals.max_slip_pressure.map_or(most, |max| larger(max, most)));
        }
        if scheme.scheme == Scheme::LaggedEuler
            && let Some(mine) = session.agree(body.fall_of_friction(state))?
        {
            let [most] = session.largest([mine]);
            totals.max_friction_fall = Some(totals.max_friction_fall.map_or(most, |max| larger(max, most)));
        }
        if let Some(mine) = session.agree(body.range_share(state))? {
            let [most] = session.largest([mine]);
            totals.max_rate_share = Some(totals.max_rate_share.map_or(most, |max| larger(max, most)));
        }
        if let Some(turning) = turning
            && let Some(turn) = turning.after_step(session, body, state)?
        {
            totals.turn = Some(turn.or(totals.turn));
        }
        Ok(Some(outcome))
    }
}

/// A fixed step, or what is left of one that was divided.
struct Parts<'a> {
    landings: &'a Landings,
    /// Where the whole step ends at the latest.
    target: Landing,
    /// The end of a divided step in s, from its first part to its last one.
    divided_until: &'a mut Option<f64>,
}

impl Parts<'_> {
    /// Takes the step, or its next part, and commits it. A step that generates the energy of failing bonds or damage is halved, as are its
    /// parts that have no solution; after a part that was taken the next one is at most twice as long. Collective.
    fn advance<const D: usize, const S: usize>(
        self,
        session: &Session,
        scheme: &mut Stepper,
        body: &mut Body<D, S>,
        state: &mut State,
    ) -> Result<StepOutcome, Agreed> {
        let Self { landings, mut target, divided_until } = self;
        let shortest = SHORTEST_PART * landings.length;
        let times = [state.time, state.step_length];
        if let Some(end) = *divided_until {
            let part = (state.time + 2.0 * state.step_length).min(end);
            if part < target.time - shortest * TIME_TOLERANCE {
                target = Landing { time: part, name: None, ..target };
            }
        }
        loop {
            let step = landings.fixed_step(times, target);
            let attempt = session.agree(scheme.attempt(session, body, state, step));
            let may_halve = 0.5 * step.length >= shortest;
            let is_halved = match &attempt {
                Ok(_) => may_halve && session.agree(scheme.generates_failure(session, body, state, step))?,
                Err(error) => may_halve && divided_until.is_some() && error.is_failure(),
            };
            if is_halved {
                divided_until.get_or_insert(step.time);
                target = Landing { time: state.time + 0.5 * step.length, name: None, ..target };
                continue;
            }
            let mut outcome = attempt?;
            session.agree(scheme.accept(session, body, state, step, &mut outcome))?;
            *divided_until = divided_until.filter(|end| state.time < *end);
            outcome.landed_on = target.name.filter(|_| step.time == target.time);
            return Ok(outcome);
        }
    }
}

/// The energy in J that rounding errors, and the residual of its equations as a share of their forces, may generate in the step just
/// committed of a body without mass. Collective.
fn rounding<const D: usize, const S: usize>(
    session: &Session,
    body: &Body<D, S>,
    state: &State,
    residual: f64,
) -> Result<f64, Agreed> {
    // Of opposite signs at every other node, these motions strain each cell as if nothing cancelled.
    let strained = |field: &DistributedVector, factor: f64| -> Result<Vec<f64>> {
        let sign = |at: usize| if (at / D).is_multiple_of(2) { factor } else { -factor };
        Ok(field.local()?.iter().enumerate().map(|(at, x)| sign(at) * x.abs()).collect())
    };
    let energy = |form: Form, of: &[f64], motion: &[f64]| {
        let mut forces = vec![0.0; of.len()];
        if body.has_form(form) {
            body.add_form(form, of, &mut forces);
        }
        forces.iter().zip(motion).map(|(force, x)| force * x).sum::<f64>().abs()
    };
    let mine = || -> Result<f64> {
        let motion = strained(&state.velocity, state.step_length)?;
        let before = energy(Form::Elasticity, &strained(&state.displacement, 1.0)?, &motion);
        let viscous = energy(Form::Viscosity, &strained(&state.velocity, 1.0)?, &motion);
        let elastic = energy(Form::Elasticity, &motion, &motion);
        Ok(ROUNDING * before + larger(residual, ROUNDING) * (viscous + elastic))
    };
    Ok(session.sum([session.agree(mine())?])[0])
}

/// The totals of a run that has taken no step. Collective.
fn totals_at_start<const D: usize, const S: usize>(
    session: &Session,
    body: &Body<D, S>,
    state: &State,
) -> Result<Totals, Agreed> {
    let rest = Step { time: state.time, length: 0.0, previous_length: 0.0 };
    let (mine, _) = session.agree(body.energy(state, rest))?;
    let mut energy = mine.map_values(|values| session.sum(values));
    for motion in body.obstacle_motions() {
        energy[OBSTACLE_KINETIC] += motion.kinetic_energy();
    }
    Ok(Totals::at_start(energy))
}
