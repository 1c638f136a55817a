//! Files that several ranks write and read together. A test starts this program again under `mpirun`, once for each scenario and
//! number of ranks, and checks the outcome and the files of the scenario.

mod checkpoints;
mod fields;
mod rows;

use crate::mpirun;
use mpi::Threading;
use mpi::traits::Communicator;
use std::path::Path;

/// The test that others start under `mpirun`.
const SCENARIO: &str = "parallel_files::scenario";

/// Runs a scenario on some ranks.
fn run(ranks: usize, scenario: &str, folder: &Path) {
    mpirun::run(ranks, &format!("{SCENARIO} {scenario}"), folder);
}

/// The part of the tests that runs under `mpirun`.
#[test]
#[ignore = "started by the other tests, under mpirun"]
fn scenario() {
    let (name, folder) = (mpirun::words(), mpirun::folder().expect("a folder"));
    let (universe, _) = mpi::initialize_with_threading(Threading::Funneled).expect("MPI");
    let world = universe.world();
    std::panic::set_hook(Box::new({
        let rank = world.rank();
        move |panic| {
            eprintln!("rank {rank}: {panic}");
            mpi::topology::SimpleCommunicator::world().abort(1)
        }
    }));
    match name.as_str() {
        "rows" => rows::write_and_read(&world, &folder),
        "rows_fault" => rows::fail_on_one_rank(&world, &folder),
        "checkpoint_write" => checkpoints::write(&world, &folder),
        "checkpoint_read" => checkpoints::read(&world, &folder),
        "checkpoint_refusals" => checkpoints::refuse_misfits(&world, &folder),
        "checkpoint_damage" => checkpoints::damage(&world, &folder),
        "fields_write" => fields::write(&world, &folder, 0),
        "fields_write_packed" => fields::write(&world, &folder, 9),
        "fields_many" => fields::write_many(&world, &folder),
        "fields_die" => fields::die(&world, &folder),
        "fields_solid" => fields::write_solid(&world, &folder),
        "fields_resume" => fields::resume(&world, &folder),
        other => panic!("no scenario {other}"),
    }
}

/// The rank that owns a row, as if assigned by a partitioner; if there are more than two ranks, one of them owns nothing.
pub fn owner(id: u64, size: usize) -> usize {
    let working = if size > 2 { size - 1 } else { size };
    (mpirun::scramble(id) % working as u64) as usize
}
