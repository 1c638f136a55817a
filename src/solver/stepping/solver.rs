//! The solver for the steps of a body.

use super::{
    bounded::{self, Bounded},
    condensed::Condensed,
    flow::Flow,
    linear_solver::{Method, Preconditioner, ProblemSize, SolverSettings},
    newton::Newton,
};
use crate::{
    error::{Error, Result},
    fem::body::Body,
    linear_algebra::petsc::{DistributedVector, Ksp, ProjectedKsp, has_option},
    mesh::Mesh,
    parallel::session::Session,
};

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
    /// The solver for the steps of a body of this problem size, with the preconditioner of the settings. Vectors have the layout
    /// of `like`. Collective.
    pub(super) fn new<const D: usize, const S: usize>(
        session: &Session,
        body: &mut Body<D, S>,
        like: &DistributedVector,
        settings: &SolverSettings,
        problem: ProblemSize,
    ) -> Result<Self> {
        if body.contacts.is_empty() && !body.flows() {
            return Ok(Self::Linear(linear(session, settings.preconditioner, &body.mesh)?));
        }
        if can_condense(settings, problem)? {
            let precision = problem.factor_precision();
            return Ok(Self::Condensed(Box::new(Condensed::new(session, body, like, settings, precision)?)));
        }
        Self::whole(session, body, like, settings)
    }

    /// Newton's method on the whole body, for velocities with the layout of `like`. Collective.
    pub(super) fn whole<const D: usize, const S: usize>(
        session: &Session,
        body: &mut Body<D, S>,
        like: &DistributedVector,
        settings: &SolverSettings,
    ) -> Result<Self> {
        body.contacts.iter_mut().for_each(|contact| contact.number_unknowns(|node| node));
        let linear_solver = projected(session, settings.preconditioner, &body.mesh, like)?;
        let mut newton = Newton::new(like, &body.contacts, linear_solver, settings)?;
        if body.flows() {
            newton.flow = Some(Flow::new(like)?);
        }
        if settings.method == Method::Vinewtonrsls {
            session.agree(bounded::refuse_oblique_normals(body))?;
            if body.flows() {
                return Err(Error::Refused(
                    "[solver] method = \"vinewtonrsls\" does not support viscoplastic flow, damage, adhesion or contact memory at the end of a step; use method = \"newton\" or \
                     [time] scheme = \"lagged_euler\""
                        .into(),
                ));
            }
            newton.bounded = Some(Bounded::new(like, settings)?);
        }
        Ok(Self::Newton(Box::new(newton)))
    }
}

/// Whether all unknowns except the motions of contact nodes are eliminated.
fn can_condense(settings: &SolverSettings, problem: ProblemSize) -> Result<bool> {
    Ok(settings.preconditioner == Preconditioner::Cholesky
        && settings.method == Method::Newton
        && problem.is_condensed()
        && !has_option("pc_type")?
        && !has_option("ksp_type")?)
}

/// A solver of linear steps on a mesh. Collective.
pub(super) fn linear<const D: usize>(
    session: &Session,
    chosen: Preconditioner,
    mesh: &Mesh<D>,
) -> Result<Ksp> {
    let mut ksp = Ksp::new("")?;
    chosen.configure(session, mesh, &mut ksp)?;
    ksp.start_from_solution()?;
    ksp.apply_options()?;
    Ok(ksp)
}

/// A solver for Newton's method on a mesh, for vectors with the layout of `like`. Collective.
pub(super) fn projected<const D: usize>(
    session: &Session,
    chosen: Preconditioner,
    mesh: &Mesh<D>,
    like: &DistributedVector,
) -> Result<ProjectedKsp> {
    let mut solver = ProjectedKsp::new("", like, D)?;
    chosen.configure(session, mesh, solver.linear_solver())?;
    solver.linear_solver().apply_options()?;
    solver.set_refresh_threshold(chosen.refresh_threshold(D));
    Ok(solver)
}
