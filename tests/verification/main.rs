//! Verification on small meshes in memory, from simple to composite problems: PETSc handles, assembly, the Jacobian, calls to
//! effects, uniform fields, energy and closed forms, manufactured solutions.
//!
//! A test starts this program again under `mpirun`, once for each scenario and number of ranks.

mod adaptive;
mod adhesion;
mod allocations;
mod assembly;
mod belts;
mod branches;
mod callbacks;
mod closed_forms;
mod creep;
mod damage;
mod effects;
mod energy;
mod fast_flow;
mod flowing_contact;
mod free_bodies;
mod half_models;
mod held_by_contact;
mod inclusion;
mod indefinite;
mod indicator;
mod jacobian;
mod ledgers;
mod limit_loads;
mod manufactured_contact;
mod manufactured;
mod manufactured_flow;
mod memory;
mod midsides;
#[path = "../mpirun/mod.rs"]
mod mpirun;
mod obstacles;
mod one_cell;
mod orders;
mod patch;
mod petsc_boundary;
mod profiles;
mod pulses;
mod quadratic;
mod random_laws;
mod random_scenes;
mod scenes;
mod schemes;
mod softening;
mod subspace;
mod supports;
mod rejected_steps;
mod resultants;
mod tolerance;
mod unloading;
mod uniqueness;
mod wave;

use clarke::parallel::session::Mpi;
use std::path::PathBuf;

/// The part of the tests that runs under `mpirun`.
#[test]
#[ignore = "started by the other tests, under mpirun"]
fn scenario() {
    let name = std::env::var(mpirun::SCENARIO).expect("a scenario");
    let folder = PathBuf::from(std::env::var(mpirun::FOLDER).expect("a folder"));
    let mpi = Mpi::start().expect("MPI");
    let session = mpi.session().expect("PETSc");
    match name.as_str() {
        "adaptive_errors" => adaptive::errors(&session),
        "tolerance" => tolerance::all(&session),
        "pulses" => pulses::all(&session),
        "vectors" => petsc_boundary::exchange_vectors(&session),
        "matrices" => petsc_boundary::multiply_matrices(&session),
        "linear" => petsc_boundary::solve_linear(&session),
        "petsc_fails_alone" => petsc_boundary::fail_alone(&session),
        "options" => petsc_boundary::set_options(&session),
        "outlive" => petsc_boundary::outlive(mpi, session),
        "newton" => callbacks::solve_nonlinear(&session),
        "callback_error" => callbacks::fail_on_the_last_rank(&session),
        "callback_panic" => callbacks::panic_on_the_last_rank(&session, &folder),
        "allocations" => allocations::count(&session),
        "assembly" => assembly::compare(&session),
        "jacobian" => jacobian::compare(&session),
        "indicator" => indicator::sums(&session),
        "effectivity" => indicator::effectivity_tends_to_one(&session),
        "effects" => effects::count(&session),
        "profiles" => profiles::all(&session, &folder),
        "patch" => patch::uniform_fields(&session),
        "energy" => energy::random_jobs(&session),
        "carried_energy" => energy::carried(&session),
        "resultants" => resultants::all(&session),
        "ledger_orders" => ledgers::orders(&session),
        "bounces" => ledgers::bounces(&session),
        "thrown_balls" => ledgers::obstacles(&session),
        "falling_weight" => ledgers::closed_forms(&session),
        "closed_forms" => closed_forms::all(&session),
        "creep" => creep::all(&session),
        "damage" => damage::all(&session),
        "memory" => memory::all(&session),
        "midsides" => midsides::all(&session, &folder),
        "adhesion" => adhesion::all(&session),
        "one_cell" => one_cell::all(&session),
        "held_by_contact" => held_by_contact::blocks(&session),
        "soft_springs" => held_by_contact::on_soft_springs(&session),
        "nearly_free" => held_by_contact::nearly_free(&session),
        "at_rest" => inclusion::at_rest(&session),
        "judged" => inclusion::judged(&session),
        "indefinite" => indefinite::solve(&session),
        "belts" => belts::all(&session),
        "moving_obstacles" => obstacles::moving(&session),
        "impacts" => obstacles::impacts(&session),
        "bounds" => obstacles::bounds(&session),
        "several_laws" => obstacles::several(&session, &folder),
        "random_laws" => random_laws::solve(&session),
        "supports" => supports::all(&session),
        "half_models" => half_models::all(&session),
        "contact_edges" => half_models::edges(&session),
        "subspace" => subspace::solve(&session),
        "carried" => resultants::carried(&session),
        "orders_plane" => orders::plane(&session),
        "rejected_steps" => rejected_steps::in_the_plane(&session),
        "failed_set_up" => rejected_steps::after_failures(&session),
        "softening" => softening::all(&session),
        "limit_loads" => limit_loads::all(&session),
        "branches" => branches::passed(&session),
        "unloading" => unloading::all(&session),
        "orders_space" => orders::space(&session),
        "manufactured_contact_plane" => manufactured_contact::plane(&session),
        "manufactured_contact_space" => manufactured_contact::space(&session),
        "manufactured_plane" => manufactured::plane(&session),
        "manufactured_space" => manufactured::space(&session),
        "scheme_adapted" => schemes::adapted(&session),
        "scheme_orders" => schemes::orders(&session),
        "scheme_closed_forms" => schemes::closed_forms(&session),
        "manufactured_time" => manufactured::time(&session),
        "quadratic_plane" => quadratic::plane(&session),
        "quadratic_space" => quadratic::space(&session),
        "quadratic_bars" => quadratic::bars(&session),
        "power_laws" => fast_flow::power_laws(&session),
        "flowing_contact" => flowing_contact::all(&session),
        "free_bodies" => free_bodies::all(&session),
        "flow_together" => fast_flow::together(&session),
        "flowing_plane" => manufactured_flow::plane(&session),
        "flowing_space" => manufactured_flow::space(&session),
        "unique_plane" => uniqueness::plane(&session),
        "unique_space" => uniqueness::space(&session),
        scenes if scenes.starts_with(random_scenes::SCENARIO) => {
            random_scenes::scenario(&session, scenes, &folder);
        }
        other => panic!("no scenario {other}"),
    }
}

fn run_on(ranks: &[usize], scenario: &str) {
    let folder = tempfile::tempdir().expect("folder");
    for &ranks in ranks {
        mpirun::run(ranks, scenario, folder.path());
    }
}
