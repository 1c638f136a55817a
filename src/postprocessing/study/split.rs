//! Splits errors into those of the steps and those of the mesh.

use super::{
    Ran,
    compare::Compared,
    measure::{Measured, Target},
    plan::{Plan, Planned, PlannedReference},
    results::Results,
};
use crate::{error::Result, parallel::session::Session};

/// Adds both parts of the errors for all runs on whose mesh the steps of the reference were computed. Collective.
pub(super) fn add_parts(
    session: &Session,
    plan: &Plan,
    ran: &[Ran],
    on_meshes: &[Ran],
    results: &mut Results,
) -> Result<()> {
    let Some(PlannedReference::Run(reference)) = &plan.reference else { return Ok(()) };
    let distance = |from: &Planned, to: &Planned, dimension: usize| -> Result<Vec<Measured>> {
        let between = from.adaptive.or(to.adaptive).is_some();
        let target = Target::Run(to.loaded.job.output_folder(), between);
        let compared = Compared { dimension, folder: from.loaded.job.output_folder(), target };
        Ok(compared.errors(session, &plan.study.norm)?.measured)
    };
    for (at, run) in plan.runs.iter().enumerate().filter(|(_, run)| run.cells == reference.cells) {
        if plan.study.compare.split && keeps_physics(run) {
            for error in results.runs[at].errors.iter_mut().take(plan.study.norm.len()).flatten() {
                (error.of_steps, error.of_mesh) = (Some(error.error), Some(0.0));
            }
        }
    }
    for (planned, made) in plan.split.iter().zip(on_meshes).filter(|(_, made)| made.record.is_complete()) {
        let of_mesh = distance(planned, reference, made.record.dimension)?;
        for (at, run) in plan.runs.iter().enumerate() {
            if run.cells != planned.cells || results.runs[at].error.is_some() || !keeps_physics(run) {
                continue;
            }
            let of_steps = distance(run, planned, ran[at].record.dimension)?;
            let parts = of_steps.iter().zip(&of_mesh);
            for (error, (steps, mesh)) in results.runs[at].errors.iter_mut().zip(parts) {
                let Some(error) = error else { continue };
                (error.of_steps, error.of_mesh) = (Some(steps.error), Some(mesh.error));
            }
        }
    }
    Ok(())
}

/// Whether a run differs from the base job in mesh, steps and solver only.
fn keeps_physics(run: &Planned) -> bool {
    let concerns = |set: &String, table: &str| set.trim_start().starts_with(table);
    run.set.iter().all(|set| ["time.", "solver."].iter().any(|table| concerns(set, table)))
}
