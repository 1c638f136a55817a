//! The solver for the steps of a body.

use super::{
    bounded::{self, Bounded},
    condensed::Condensed,
    flow::Flow,
    linear_solver::{Method, Preconditioner, SolverSettings},
    newton::Newton,
};
use crate::{
    error::{Error, Result},
    fem::{
        body::Body,
        effect::{Contact, contact_nodes},
    },
    linear_algebra::petsc::{DistributedVector, Ksp, Precision, ProjectedKsp, has_option},
    parallel::session::Session,
};

/// Number of motions of contact nodes whose dense matrix costs no more than the factorisation.
const MOST_MOTIONS: usize = 4_000;

/// The solver of linear or of nonlinear steps; only the required one exists.
pub(super) enum Solver {
    /// Steps without contact and flow.
    Linear(Ksp),
    /// Newton's method on the whole body.
    Newton(Box<Newton>),
    /// Newton's method on the contact unknowns alone.
    Condensed(Box<Condensed>),
}

impl Solver {
    /// The solver for the steps of a body, with the preconditioner of the settings and factors of this precision. Vectors have the
    /// layout of `like`. Collective.
    pub(super) fn new<const D: usize, const S: usize>(
        session: &Session,
        body: &mut Body<D, S>,
        like: &DistributedVector,
        settings: SolverSettings,
        precision: Precision,
    ) -> Result<Self> {
        if body.contacts.is_empty() && !body.flows() {
            return Ok(Self::Linear(linear(session, settings.preconditioner, components(body))?));
        }
        if can_condense(session, body, settings)? {
            return Ok(Self::Condensed(Box::new(Condensed::new(session, body, settings, precision)?)));
        }
        Self::whole(session, body, like, settings)
    }

    /// Newton's method on the whole body, for velocities with the layout of `like`. Collective.
    pub(super) fn whole<const D: usize, const S: usize>(
        session: &Session,
        body: &mut Body<D, S>,
        like: &DistributedVector,
        settings: SolverSettings,
    ) -> Result<Self> {
        body.contacts.iter_mut().for_each(|contact| contact.number_unknowns(|node| node));
        let linear_solver = projected::<D>(session, settings.preconditioner, components(body), like)?;
        let mut newton = Newton::new(like, &body.contacts, linear_solver, settings)?;
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
            newton.bounded = Some(Bounded::new(like, settings)?);
        }
        Ok(Self::Newton(Box::new(newton)))
    }
}

/// Whether all unknowns except the motions of contact nodes can be eliminated. Collective.
fn can_condense<const D: usize, const S: usize>(
    session: &Session,
    body: &Body<D, S>,
    settings: SolverSettings,
) -> Result<bool> {
    let preconditioner = settings.preconditioner;
    let whole = session.ranks() == 1 || preconditioner.is_redundant(session.ranks(), components(body));
    let chosen = has_option("pc_type")? || has_option("ksp_type")?;
    Ok(preconditioner == Preconditioner::Cholesky
        && settings.method == Method::Newton
        && whole
        && !chosen
        && !body.flows()
        && !body.contacts.iter().any(Contact::needs_ghosts)
        && motions(session, body) <= MOST_MOTIONS)
}

/// Velocity components over all ranks.
fn components<const D: usize, const S: usize>(body: &Body<D, S>) -> usize {
    body.mesh.total_nodes * D
}

/// The number of motions on which the contacts of a body act, over all ranks. Collective.
fn motions<const D: usize, const S: usize>(session: &Session, body: &Body<D, S>) -> usize {
    session.total(contact_nodes(&body.contacts, &body.fixed).iter().map(|contact| contact.seen).sum())
}

/// A solver of linear steps, for this many unknowns. Collective.
pub(super) fn linear(session: &Session, chosen: Preconditioner, unknowns: usize) -> Result<Ksp> {
    let mut ksp = Ksp::new("")?;
    chosen.configure(&mut ksp, session.ranks(), unknowns)?;
    ksp.start_from_solution()?;
    ksp.apply_options()?;
    Ok(ksp)
}

/// A solver for Newton's method, for vectors with the layout of `like` and `D` components for each node. Collective.
pub(super) fn projected<const D: usize>(
    session: &Session,
    chosen: Preconditioner,
    unknowns: usize,
    like: &DistributedVector,
) -> Result<ProjectedKsp> {
    let mut solver = ProjectedKsp::new("", like, D)?;
    chosen.configure(solver.linear_solver(), session.ranks(), unknowns)?;
    solver.linear_solver().apply_options()?;
    solver.set_refresh_threshold(chosen.refresh_threshold(D));
    Ok(solver)
}
