//! Verification on small meshes in memory, from simple to composite problems: PETSc handles, assembly, the Jacobian, calls to
//! effects, uniform fields, energy and closed forms, manufactured solutions.
//!
//! A test has a scenario: it starts this program again under `mpirun`, once for each number of ranks, where the same test runs it.

mod adaptive;
mod adhesion;
mod allocations;
mod assembly;
mod belts;
mod branches;
mod callbacks;
mod closed_forms;
mod corners;
mod creep;
mod damage;
mod damping;
mod effects;
mod energy;
mod fast_flow;
mod flow_matrices;
mod flowing_contact;
mod free_bodies;
mod half_models;
mod heat;
mod held_by_contact;
mod inclusion;
mod indefinite;
mod indicator;
mod jacobian;
mod ledgers;
mod limit_loads;
mod manufactured;
mod manufactured_contact;
mod manufactured_flow;
mod memory;
mod midsides;
mod obstacles;
mod one_cell;
mod orders;
mod orthotropic;
mod patch;
mod petsc_boundary;
mod profiles;
mod pulses;
mod quadratic;
mod random_laws;
mod random_scenes;
mod rejected_steps;
mod resultants;
mod scenes;
mod schemes;
mod softening;
mod subspace;
mod supports;
mod tolerance;
mod uniqueness;
mod units;
mod unloading;
mod wave;

use crate::mpirun;
use clarke::parallel::session::{Mpi, Session};
use std::path::PathBuf;

/// What a scenario runs with under `mpirun`.
pub struct World {
    pub session: Session,
    /// The folder of the test.
    pub folder: PathBuf,
    // Dropped after the session.
    mpi: Mpi,
}

/// The name of the test that calls this with a closure. Under `mpirun`, where this test was started again, it runs the closure instead.
fn test_of<F: FnOnce(World)>(scenario: F) -> Option<&'static str> {
    let Some(folder) = mpirun::folder() else {
        let closure = std::any::type_name::<F>();
        let test = closure.split_once("::").and_then(|(_, path)| path.split_once("::{{closure}}"));
        return Some(test.expect("a closure of a test").0);
    };
    let mpi = Mpi::start().expect("MPI");
    let session = mpi.session().expect("PETSc");
    scenario(World { session, folder, mpi });
    None
}

/// Runs the scenario of a test on one rank with the kernels of OpenBLAS for each of these processors, whose rounding errors differ; with
/// those that it chooses where this is empty.
pub fn run_with_kernels(kernels: &[&str], scenario: impl FnOnce(World)) {
    let Some(test) = test_of(scenario) else { return };
    let folder = tempfile::tempdir().expect("folder");
    kernels.iter().for_each(|kernels| mpirun::run_with_kernels(kernels, test, folder.path()));
}

/// Runs the scenario of a test on each of these numbers of ranks, with one folder for all of them.
pub fn run_on(ranks: &[usize], scenario: impl FnOnce(World)) {
    let Some(test) = test_of(scenario) else { return };
    let folder = tempfile::tempdir().expect("folder");
    for &ranks in ranks {
        mpirun::run(ranks, test, folder.path());
    }
}
