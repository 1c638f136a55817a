//! What a run starts from and a check describes: nothing of it touches the output folder.

use super::{Scene, build, scene::refuse_empty_matrix};
use crate::{
    body::Body,
    error::{Error, Result},
    job::{Job, Loaded},
    mesh::{Mesh, distribute},
    output::probes::Probes,
    petsc::set_option,
    session::Session,
    state::State,
    stepping::LaggedEuler,
    tensor::Vector,
};

/// All that is needed for the first step.
pub(super) struct Setup<const D: usize, const S: usize> {
    pub body: Body<D, S>,
    pub state: State,
    pub scheme: LaggedEuler,
    pub probes: Probes<D>,
}

/// Sets the problem of a job up, whose whole mesh is on rank 0. Collective.
pub(super) fn setup<const D: usize, const S: usize>(
    session: &Session,
    loaded: &Loaded,
    scene: Option<Scene<D>>,
) -> Result<Setup<D, S>> {
    let job = &loaded.job;
    session.agree(refuse_empty_matrix(loaded))?;
    for (name, value) in &job.solver.petsc {
        session.agree(set_option(name, value))?;
    }
    let mesh = distribute(session, scene.map(|s| (s.mesh, s.partition)))?;
    let probes = session.agree(probes(session, &mesh, job))?;
    let (body, state) = build::body::<D, S>(session, job, mesh)?;
    let scheme =
        LaggedEuler::new(session, &body, &state, build::settings(job)).map_err(|error| match error {
            Error::Internal(words) if !job.solver.petsc.is_empty() => loaded.fault(
                "solver.petsc",
                words,
                "PETSc can't use these options: correct them or leave them out",
            ),
            other => other,
        });
    let scheme = session.agree(scheme)?;
    Ok(Setup { body, state, scheme, probes })
}

fn probes<const D: usize>(session: &Session, mesh: &Mesh<D>, job: &Job) -> Result<Probes<D>> {
    let points: Vec<(String, Vector<D>)> = job
        .output
        .probe
        .iter()
        .map(|p| (p.name.clone(), std::array::from_fn(|i| p.point.get(i).copied().unwrap_or(0.0))))
        .collect();
    Probes::locate(session, mesh, &points)
}
