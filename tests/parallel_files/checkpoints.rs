//! Checkpoints, intact and damaged.

use super::{owner, run};
use crate::mpirun::scramble;
use clarke::error::Result;
use clarke::io::output::checkpoint_file::{self, Checkpoint, IdTable, RowSet};
use clarke::io::output::inspect::inspect;
use clarke::io::output::seal;
use mpi::traits::{Communicator, CommunicatorCollectives};
use std::path::Path;

const NODES: u64 = 143;
const CELLS: u64 = 240;
const HEADER: &[u8] = br#"{"step": 64, "time": 0.5}"#;

fn displacement(node: u64) -> [f64; 2] {
    [node as f64 / 7.0, -(node as f64).cos()]
}

fn velocity(node: u64) -> [f64; 2] {
    [f64::from_bits(scramble(node) >> 2), node as f64]
}

fn history(cell: u64) -> [f64; 3] {
    std::array::from_fn(|component| (cell * 3 + component as u64) as f64 / 3.0)
}

fn owned(total: u64, world: &impl Communicator) -> Vec<u64> {
    let (rank, size) = (world.rank() as usize, world.size() as usize);
    let mut ids: Vec<u64> = (0..total).filter(|id| owner(*id, size) == rank).collect();
    ids.sort_by_key(|id| scramble(*id + 5));
    ids
}

pub fn write(world: &impl Communicator, folder: &Path) {
    let (nodes, cells) = (owned(NODES, world), owned(CELLS, world));
    let displacements: Vec<f64> = nodes.iter().flat_map(|id| displacement(*id)).collect();
    let velocities: Vec<f64> = nodes.iter().flat_map(|id| velocity(*id)).collect();
    let histories: Vec<f64> = cells.iter().flat_map(|id| history(*id)).collect();
    let sets = [
        RowSet { name: "nodes", total: NODES, ids: &nodes },
        RowSet { name: "cells", total: CELLS, ids: &cells },
    ];
    let tables = [
        IdTable { name: "displacement", set: "nodes", width: 2, values: &displacements },
        IdTable { name: "velocity", set: "nodes", width: 2, values: &velocities },
        IdTable { name: "history", set: "cells", width: 3, values: &histories },
    ];
    checkpoint_file::write(&folder.join("checkpoint-64.h5"), world, HEADER, &sets, &tables).expect("write");
}

/// The contents of the checkpoint for these ids.
fn read_all(
    path: &Path,
    world: &impl Communicator,
    nodes: &[u64],
    cells: &[u64],
) -> Result<(Vec<u8>, Vec<Vec<f64>>)> {
    let checkpoint = Checkpoint::open(path, world)?;
    let (nodes, cells) = (checkpoint.rows("nodes", NODES, nodes)?, checkpoint.rows("cells", CELLS, cells)?);
    let tables = vec![nodes.read("velocity", 2)?, nodes.read("displacement", 2)?, cells.read("history", 3)?];
    Ok((checkpoint.header().to_vec(), tables))
}

fn expected(nodes: &[u64], cells: &[u64]) -> (Vec<u8>, Vec<Vec<f64>>) {
    let tables = vec![
        nodes.iter().flat_map(|id| velocity(*id)).collect(),
        nodes.iter().flat_map(|id| displacement(*id)).collect(),
        cells.iter().flat_map(|id| history(*id)).collect(),
    ];
    (HEADER.to_vec(), tables)
}

pub fn read(world: &impl Communicator, folder: &Path) {
    let path = folder.join("checkpoint-64.h5");
    let (mut nodes, cells) = (owned(NODES, world), owned(CELLS, world));
    nodes.extend((0..NODES).step_by(9)); // ghosts: wanted by every rank
    assert_eq!(read_all(&path, world, &nodes, &cells).expect("read"), expected(&nodes, &cells));
    let checkpoint = Checkpoint::open(&path, world).expect("open");
    assert_eq!(checkpoint.tables("nodes").expect("names"), ["displacement", "velocity"]);
    assert!(checkpoint.tables("facets").expect("names").is_empty());
}

pub fn refuse_misfits(world: &impl Communicator, folder: &Path) {
    let path = folder.join("checkpoint-64.h5");
    let checkpoint = Checkpoint::open(&path, world).expect("open");
    let refusal = |set: &'static str, total: u64, table: &str, width: usize, wanted: &[u64]| {
        let read = checkpoint.rows(set, total, wanted).and_then(|rows| rows.read(table, width));
        read.expect_err("refused").to_string()
    };
    let missing = refusal("nodes", NODES, "gap", 1, &[]);
    assert!(
        missing.contains("tables/nodes/gap is missing") && missing.contains("checkpoint-64.h5"),
        "{missing}"
    );
    let total = refusal("nodes", NODES + 1, "velocity", 2, &[]);
    assert!(total.contains("143") && total.contains("144"), "{total}");
    let width = refusal("nodes", NODES, "velocity", 3, &[]);
    assert!(width.contains("143 x 2") && width.contains("143 x 3"), "{width}");
    let last = world.rank() == world.size() - 1;
    let outside = refusal("nodes", NODES, "velocity", 2, if last { &[NODES] } else { &[0] });
    assert!(outside.contains("id 143"), "{outside}");

    let twice = [RowSet { name: "nodes", total: 2, ids: if last { &[1, 1] } else { &[] } }];
    let other = folder.join("other.h5");
    let error = checkpoint_file::write(&other, world, b"{}", &twice, &[]).expect_err("refused").to_string();
    assert!(error.contains("row 1 occurs twice") || error.contains("row 0 is missing"), "{error}");
    assert!(!other.exists());
    let sum = [RowSet { name: "nodes", total: 4, ids: if last { &[1, 1, 1, 3] } else { &[] } }];
    let error = checkpoint_file::write(&other, world, b"{}", &sum, &[]).expect_err("refused").to_string();
    assert!(error.contains("row 1 occurs twice") || error.contains("is missing"), "same sum: {error}");

    let foreign = folder.join("foreign.h5");
    if world.rank() == 0 {
        std::fs::write(&foreign, [b"\x89HDF\r\n\x1a\n".as_slice(), &[0; 600]].concat()).expect("file");
    }
    world.barrier();
    let error = Checkpoint::open(&foreign, world).err().expect("refused").to_string();
    assert!(error.contains("not a checkpoint") && error.contains("--restart"), "{error}");
    let error = Checkpoint::open(&folder.join("nowhere.h5"), world).err().expect("refused").to_string();
    assert!(error.contains("nowhere.h5"), "{error}");
}

pub fn damage(world: &impl Communicator, folder: &Path) {
    let path = folder.join("checkpoint-64.h5");
    let good = std::fs::read(&path).expect("read");
    let (nodes, cells): (Vec<u64>, Vec<u64>) = ((0..NODES).collect(), (0..CELLS).collect());
    let right = expected(&nodes, &cells);
    let bad_path = folder.join("bad.h5");
    let outcome = |bytes: &[u8]| {
        std::fs::write(&bad_path, bytes).expect("write");
        read_all(&bad_path, world, &nodes, &cells)
    };
    let refused = |bytes: &[u8]| {
        let error = outcome(bytes).expect_err("refused").to_string();
        assert!(error.contains("bad.h5") && error.contains("--restart"), "{error}");
    };
    assert_eq!(outcome(&good).expect("undamaged"), right);
    for trial in 0..1000 {
        let bit = scramble(trial) % (good.len() as u64 * 8);
        let mut bad = good.clone();
        bad[(bit / 8) as usize] ^= 1 << (bit % 8);
        refused(&bad);
    }
    for length in (0..good.len()).step_by(good.len() / 200 + 1).chain([511, 512, good.len() - 1]) {
        refused(&good[..length]);
    }
    refused(&[good.as_slice(), &[0]].concat());
    refused(&vec![0; good.len()]);

    // Damage before sealing, which the checksums of the tables detect.
    let number = history(117)[1].to_le_bytes();
    let place = good.windows(8).position(|bytes| bytes == number).expect("a number of the table");
    let mut bad = good.clone();
    bad[place] ^= 1;
    std::fs::write(&bad_path, &bad).expect("write");
    seal::seal(&bad_path, seal::CHECKPOINT, world).expect("seal");
    let error = read_all(&bad_path, world, &nodes, &cells).expect_err("refused").to_string();
    assert!(error.contains("tables/cells/history") && error.contains("checksum"), "{error}");
}

#[test]
fn a_checkpoint_of_any_number_of_ranks_is_read_on_any_number_of_ranks() {
    for writers in 1..=4 {
        let folder = tempfile::tempdir().expect("folder");
        run(writers, "checkpoint_write", folder.path());
        let names: Vec<_> = std::fs::read_dir(folder.path()).expect("folder").collect();
        assert_eq!(names.len(), 1, "nothing but the checkpoint is left: {names:?}");
        let words = inspect(&folder.path().join("checkpoint-64.h5")).expect("inspect");
        for part in ["intact", "\"step\": 64", "nodes: 143 rows", "history", "3 x f64"] {
            assert!(words.contains(part), "{words}");
        }
        for readers in 1..=4 {
            run(readers, "checkpoint_read", folder.path());
        }
    }
}

#[test]
fn checkpoints_that_do_not_fit_the_job_are_refused_with_the_reason() {
    let folder = tempfile::tempdir().expect("folder");
    run(2, "checkpoint_write", folder.path());
    run(1, "checkpoint_refusals", folder.path());
    run(3, "checkpoint_refusals", folder.path());
}

#[test]
fn no_flipped_bit_and_no_cut_gives_a_wrong_restart() {
    let folder = tempfile::tempdir().expect("folder");
    run(2, "checkpoint_write", folder.path());
    run(1, "checkpoint_damage", folder.path());
}
