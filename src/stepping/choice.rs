//! What solves the steps of a body with contact or flow.

use super::{
    bounded::{self, Bounded},
    condensed::Condensed,
    factor_cache,
    flow::Flow,
    linear_solver::{Method, Preconditioner, SolverSettings},
    newton::Newton,
    step_solver::Solver,
};
use crate::{
    body::Body,
    effect::{Contact, contact_nodes},
    error::{Error, Result},
    petsc::{DistributedVector, Precision, has_option},
    session::Session,
    state::State,
};

/// Motions of contact nodes whose dense matrix costs no more than the factorisation.
const MOST_MOTIONS: usize = 4_000;

/// Newton's method on the contact alone, where all else can be eliminated, or on the whole body. Collective.
pub(super) fn newton<const D: usize, const S: usize>(
    session: &Session,
    body: &Body<D, S>,
    state: &State,
    settings: SolverSettings,
    (preconditioner, precision): (Preconditioner, Precision),
) -> Result<Solver> {
    let unknowns = body.mesh.total_nodes * D;
    let whole = session.ranks() == 1 || preconditioner.is_redundant(session.ranks(), unknowns);
    let chosen = has_option("pc_type")? || has_option("ksp_type")?;
    if preconditioner == Preconditioner::Cholesky
        && settings.method == Method::Newton
        && whole
        && !chosen
        && !body.flows()
        && !body.contacts.iter().any(Contact::needs_ghosts)
        && motions(session, body) <= MOST_MOTIONS
    {
        let condensed = Condensed::new(session, body, state.contact_traction.is_some(), precision)?;
        return Ok(Solver::Condensed(Box::new(condensed)));
    }
    whole_newton(session, body, &state.velocity, settings, preconditioner)
}

/// The motions that the contacts of a body see, over all ranks. Collective.
fn motions<const D: usize, const S: usize>(session: &Session, body: &Body<D, S>) -> usize {
    session.total(contact_nodes(&body.contacts, &body.fixed).iter().map(|contact| contact.seen).sum())
}

/// Newton's method on the whole body, for velocities laid out like `like`. Collective.
pub(super) fn whole_newton<const D: usize, const S: usize>(
    session: &Session,
    body: &Body<D, S>,
    like: &DistributedVector,
    settings: SolverSettings,
    preconditioner: Preconditioner,
) -> Result<Solver> {
    let unknowns = body.mesh.total_nodes * D;
    let linear_solver = factor_cache::projected::<D>(session, preconditioner, unknowns, like)?;
    let mut newton = Newton::new(like, &body.contacts, linear_solver)?;
    if body.flows() {
        newton.flow = Some(Flow::new(like)?);
    }
    if settings.method == Method::Vinewtonrsls {
        session.agree(bounded::refuse(body))?;
        if body.flows() {
            return Err(Error::Refused(
                "[solver] method = \"vinewtonrsls\" knows no flow, damage, bonds or memory at the end of a step: use method = \"newton\" or \
                 [time] scheme = \"lagged_euler\""
                    .into(),
            ));
        }
        newton.bounded = Some(Bounded::new(like)?);
    }
    Ok(Solver::Newton(Box::new(newton)))
}
