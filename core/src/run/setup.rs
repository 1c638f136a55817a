//! Sets a job up for a run or for `solver check`, without touching the output folder.

use super::{
    bonds, build,
    estimate::MemoryEstimate,
    loads,
    materials::Materials,
    memory::require_for_run,
    obstacles, pairs, parts,
    restored::{StartState, sides_before, start_file, transfer},
    side_words, steps, touching,
    validate::refuse_free_bodies,
    within_cells,
};
use crate::{
    error::{Exit, Result},
    fem::{body::Body, state::State},
    io::output::{
        inventory::Inventory,
        probed,
        probes::{self, Probes},
    },
    job::Loaded,
    linear_algebra::petsc::set_option,
    mesh::Mesh,
    parallel::session::Session,
    solver::{
        certificate::{Certificates, Verdict},
        stepping::{ProblemSize, Stepper, StepperSettings},
    },
};
use std::path::PathBuf;

/// All that is needed for the first step.
pub(super) struct Setup<const D: usize, const S: usize> {
    pub body: Body<D, S>,
    pub state: State,
    pub scheme: Stepper,
    pub probes: Probes<D>,
    pub certificates: Certificates,
    pub verdict: Verdict,
    /// Warnings about the initial state.
    pub warnings: Vec<String>,
    /// The state of another run from which this one starts, if there is one.
    pub began_from: Option<StartState>,
}

/// Sets a job up on its mesh, which was checked against the job, given the run's own checkpoints from which it may go on. Collective.
pub(super) fn setup<const D: usize, const S: usize>(
    session: &Session,
    loaded: &Loaded,
    mut mesh: Mesh<D>,
    own: &[PathBuf],
) -> Result<Setup<D, S>> {
    let job = &loaded.job;
    for (name, value) in &job.solver.petsc {
        session.agree(set_option(name, value))?;
    }
    let from = start_file(session, loaded, own)?;
    let materials = Materials::new(session, job, &mesh)?;
    let earlier = sides_before(session, loaded, from.as_ref().map(|from| &*from.path))?;
    let paired = pairs::find(session, job, &mut mesh, (&materials, &earlier))?;
    let probes = session.agree(Probes::locate(session, &mesh, &job.output))?;
    let (mut body, mut state) = build::body::<D, S>(session, job, (mesh, &materials), paired)?;
    let fault = probed::fault(&job.output, &body);
    let fault = fault.map(|(key, [message, help])| loaded.fault(key, message, help));
    session.agree(fault.map_or(Ok(()), Err))?;
    let began_from = transfer(session, (loaded, from), &mut body, &mut state)?;
    refuse_free_bodies(session, &body, loaded)?;
    let mut warnings = obstacles::warnings(session, job, &body, &state)?;
    warnings.extend(materials.warning_of_mass());
    warnings.extend(bonds::warnings(session, job, &body));
    warnings.extend(parts::warnings(session, job, &body.mesh));
    warnings.extend(loads::warnings(session, job, &body));
    warnings.extend(within_cells::warnings(session, job, &body)?);
    warnings.extend(probes::warning(session, &body.mesh, &job.output)?);
    warnings.extend(touching::warning(session, job, &body.mesh)?);
    warnings.extend(parts::warnings_of_heat(session, job, &body)?);
    warnings.extend(side_words::warnings_of_changes(&earlier, &body.pairs));
    warnings.extend(side_words::warnings_of_edges(session, job, &mut body)?);
    warnings.extend(side_words::warnings_of_carriers(session, job, &body.pairs));
    warnings.extend(pairs::warnings_of_inclined_supports(session, job, &body));
    warnings.extend(pairs::warnings_of_held_faults(session, job, &body)?);
    warnings.extend(began_from.iter().filter_map(|from| from.warning.clone()));
    let shared = steps::steps_a_matrix(job);
    let settings = StepperSettings { scheme: job.time.scheme, solver: &job.solver, steps: shared };
    let scheme = Stepper::new(session, &mut body, &state, settings);
    let mut scheme = session.agree(scheme).map_err(|error| match error.exit() {
        Exit::Internal if !job.solver.petsc.is_empty() => loaded.fault(
            "solver.petsc",
            error.to_string(),
            "PETSc rejects these options: correct or delete them",
        ),
        _ => error.into(),
    })?;
    let longest = steps::longest_step(job);
    let steps = steps::landings(job).steps_after(0.0, longest);
    let problem = ProblemSize::of(session, &body, steps, job.solver.factor_precision)?;
    let inventory = Inventory::of(session, &body, &scheme);
    let estimate = MemoryEstimate::new(session, &body, &inventory, scheme.solver.preconditioner().0, problem);
    require_for_run(session, &estimate)?;
    let matrix = scheme.matrix(session, &mut body, longest);
    let mut matrix = session.agree(matrix).map_err(|error| match error.exit() {
        Exit::Internal => loaded.fault(
            "material",
            format!("the equations of a step can't be solved: {error}"),
            "check that density and viscosity, in SI units, have sensible values for this mesh and step",
        ),
        _ => error.into(),
    })?;
    let certificates =
        session.agree(Certificates::of(session, &body, &state, &mut matrix, steps::range(job)))?;
    let unique_step = if certificates.steps_are_unique() {
        None
    } else {
        session.agree(Certificates::unique_step(session, &body, &state, &mut matrix))?
    };
    let verdict = certificates.verdict(longest, unique_step, &job.solver.accept);
    session.agree(refuse(loaded, &verdict))?;
    Ok(Setup { body, state, scheme, probes, certificates, verdict, warnings, began_from })
}

fn refuse(loaded: &Loaded, verdict: &Verdict) -> Result<()> {
    if verdict.refusals.is_empty() {
        return Ok(());
    }
    let (found, remedies): (Vec<&str>, Vec<&str>) =
        verdict.refusals.iter().map(|(found, remedy)| (found.as_str(), remedy.as_str())).unzip();
    let adaptive = loaded.job.time.adaptive.as_ref();
    let key = match adaptive.is_some_and(|adaptive| adaptive.largest_step > loaded.job.time.step) {
        true => "time.adaptive.largest_step",
        false => "time.step",
    };
    Err(loaded.fault(key, found.join("; "), remedies.join("; ")))
}
