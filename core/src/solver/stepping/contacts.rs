//! Operations on contacts before and after a step.

use crate::{
    error::{Error, Result},
    fem::{
        body::Body,
        effect::{Blend, CONTACT, Energy, NUMERICAL, Step, WORK},
        pairs::exchanged,
        state::State,
    },
    linear_algebra::petsc::DistributedVector,
    parallel::session::Session,
};

/// The largest multiple of a rigid motion at which it is looked for what bears it, and the share of it that is rounding.
const FARTHEST: f64 = 1e12;
const ROUNDING: f64 = 1e-14;

/// Adds the energy that contact dissipated in a committed step, the numerical part, and the work on obstacles; adds the powers of friction
/// and of laws of the velocity to `powers`.
pub(super) fn add_contact_energy<const D: usize, const S: usize>(
    body: &Body<D, S>,
    state: &State,
    step: Step,
    energy: &mut Energy,
    powers: &mut Energy,
) -> Result<()> {
    let velocity = state.velocity.local()?;
    let velocity = body.seen_by_contacts(&velocity);
    for contact in &body.contacts {
        let own = contact.energy_of_step(&velocity, step.length);
        energy[CONTACT] += own.dissipated + step.length * own.dissipated_power;
        energy[NUMERICAL] += own.numerical;
        energy[WORK] += own.work + step.length * own.driving_power;
        powers[CONTACT] += own.dissipated_power;
        powers[WORK] += own.driving_power;
    }
    Ok(())
}

/// The energy in J that contacts which follow their obstacles store on this rank after a step.
pub(super) fn stored_where_following<const D: usize, const S: usize>(
    body: &Body<D, S>,
    state: &State,
) -> Result<f64> {
    let displacement = state.displacement.local()?;
    let following = body.contacts.iter().filter(|contact| contact.follows_surface);
    following.map(|contact| contact.stored_energy(state.time, &displacement)).sum()
}

/// Prepares the points of all contacts for a step from this blend, whose displacement has ghosts, with the pressures of the converged
/// state.
pub(super) fn prepare_contacts<const D: usize, const S: usize>(
    body: &mut Body<D, S>,
    state: &State,
    step: Step,
    (blend, start): (Blend, &DistributedVector),
) -> Result<()> {
    if body.contacts.is_empty() {
        return Ok(());
    }
    let (converged, start, velocity) = (state.displacement.local()?, start.local()?, state.velocity.local()?);
    let (converged, start) = (body.seen_by_contacts(&converged), body.seen_by_contacts(&start));
    for (number, contact) in body.contacts.iter_mut().enumerate() {
        let friction = contact.friction.as_mut().filter(|friction| friction.law.sees_temperature());
        if let Some((friction, heat)) = friction.zip(body.heat.as_ref()) {
            let seen = |node: usize| heat.seen()[node];
            match exchanged(&body.pairs, number) {
                Some(pair) => friction.set_temperatures(|node| pair.across(&body.mesh, node, seen)),
                None => friction.set_temperatures(seen),
            }
        }
        contact.prepare(step, blend, [&converged, &start, &velocity])?;
    }
    restore_pressures(body, state)
}

/// Fails where an obstacle passes a boundary in the step with this solution, which has ghosts.
pub(super) fn refuse_passage<const D: usize, const S: usize>(
    body: &Body<D, S>,
    state: &State,
    step: Step,
    solved: &DistributedVector,
) -> Result<()> {
    let (displacement, velocity) = (state.displacement.local()?, solved.local()?);
    let (displacement, velocity) = (body.seen_by_contacts(&displacement), body.seen_by_contacts(&velocity));
    for (number, contact) in body.contacts.iter().enumerate() {
        let passage = contact.refuse_passage(step, &displacement, &velocity);
        passage.map_err(|error| Error::Failed(format!("contact.{number}: {error}")))?;
    }
    Ok(())
}

/// Keeps how near obstacles have come in the step just committed. Collective.
pub(super) fn keep_closeness<const D: usize, const S: usize>(
    session: &Session,
    body: &mut Body<D, S>,
    state: &State,
    step: Step,
) -> Result<()> {
    let [velocity, displacement] = [&state.velocity, &state.displacement].map(DistributedVector::local);
    let (velocity, displacement) = (velocity?, displacement?);
    let [velocity, displacement] = [&velocity, &displacement].map(|values| body.seen_by_contacts(values));
    for contact in &mut body.contacts {
        contact.keep_closeness(step, &velocity)?;
        contact.keep_slip([&displacement, &velocity]);
        contact.keep_shift(session, [&displacement, &velocity])?;
    }
    Ok(())
}

/// The multiple of a motion at which it has closed a gap of each contact whose gaps it closes, and goes on as far again; 1 where that is less.
/// Collective.
pub(super) fn multiple_to_touch<const D: usize, const S: usize>(
    session: &Session,
    body: &Body<D, S>,
    motion: &mut DistributedVector,
) -> Result<f64> {
    motion.update_ghosts()?;
    let motion = motion.local()?;
    let mut most = 1.0_f64;
    for contact in &body.contacts {
        let [negative] = session.largest([-contact.normal.approach().multiple_to_touch(&motion)]);
        most = if negative.is_finite() { most.max(-2.0 * negative) } else { most };
    }
    Ok(most)
}

/// Adds the multiple of a rigid motion to a motion at which the pressures balance the forces that have this power in it, and sets pressures
/// to those there; returns whether there is such a multiple. Collective.
pub(super) fn rest_on_contacts<const D: usize, const S: usize>(
    session: &Session,
    body: &mut Body<D, S>,
    (motion, rigid): (&mut DistributedVector, &mut DistributedVector),
    power: f64,
) -> Result<bool> {
    motion.update_ghosts()?;
    rigid.update_ghosts()?;
    let found = {
        let motions = [&*motion.local()?, &*rigid.local()?];
        let open = |multiple: f64| {
            let powers =
                body.contacts.iter().map(|contact| contact.normal.power_of_pressures(motions, multiple));
            session.sum([powers.sum()])[0] - power
        };
        let (mut low, mut high) = (-1.0, 1.0);
        let mut ends = [open(low), open(high)];
        while ends[1] < 0.0 && high < FARTHEST {
            (low, high) = (high, 2.0 * high);
            ends = [ends[1], open(high)];
        }
        while ends[0] >= 0.0 && -low < FARTHEST {
            (high, low) = (low, 2.0 * low);
            ends = [open(low), ends[0]];
        }
        if !(ends[0] < 0.0 && ends[1] >= 0.0) {
            return Ok(false);
        }
        while high - low > ROUNDING * low.abs().max(high.abs()) {
            let middle = 0.5 * (low + high);
            // Next to zero there may be no number between.
            if middle <= low || middle >= high {
                break;
            }
            match open(middle) {
                below if below < 0.0 => (low, ends[0]) = (middle, below),
                above => (high, ends[1]) = (middle, above),
            }
        }
        let share = -ends[0] / (ends[1] - ends[0]);
        for contact in &mut body.contacts {
            contact.normal.set_pressures_between(motions, [low, high], share);
        }
        low + share * (high - low)
    };
    motion.add_scaled(found, rigid)?;
    Ok(true)
}

/// Sets the pressures of all contacts to those of the converged state, and obstacles that forces move to the start of the step.
pub(super) fn restore_pressures<const D: usize, const S: usize>(
    body: &mut Body<D, S>,
    state: &State,
) -> Result<()> {
    for contact in &mut body.contacts {
        contact.obstacle.restart();
        contact.place_obstacle()?;
    }
    if let Some(traction) = &state.contact_traction {
        let traction = traction.owned()?;
        body.contacts.iter_mut().for_each(|contact| contact.restore_pressures(&traction));
    }
    Ok(())
}

/// Copies the pressures of the step just taken into the state, and advances the histories of friction. Collective.
pub(super) fn commit_tractions<const D: usize, const S: usize>(
    body: &mut Body<D, S>,
    state: &mut State,
) -> Result<()> {
    let Some(traction) = &mut state.contact_traction else { return Ok(()) };
    let velocity = state.velocity.local()?;
    let velocity = body.seen_by_contacts(&velocity);
    body.contacts.iter_mut().for_each(|contact| contact.advance_histories(&velocity));
    traction.owned_mut()?.fill(0.0);
    for contact in &body.contacts {
        contact.add_tractions(&velocity, &mut traction.owned_mut()?);
    }
    Ok(())
}
