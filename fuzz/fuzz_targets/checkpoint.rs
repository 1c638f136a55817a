//! Any bytes as a checkpoint, as they are and behind a seal that fits them: refused in words, or read with the
//! checksums they were written with.
#![no_main]

use clarke_core::{error::Result, io::output::{
        checkpoint::Header,
        checkpoint_file::Checkpoint,
        seal::{self, SEAL_BYTES},
    }};
use libfuzzer_sys::fuzz_target;
use mpi::{environment::Universe, topology::SimpleCommunicator};
use std::{
    path::{Path, PathBuf},
    sync::OnceLock,
};

/// MPI lives as long as the process.
struct Started(#[allow(dead_code)] Universe);
// SAFETY: the fuzzer has one thread.
unsafe impl Sync for Started {}
unsafe impl Send for Started {}

fn start() -> &'static PathBuf {
    static FILE: OnceLock<(Started, PathBuf)> = OnceLock::new();
    let (_, file) = FILE.get_or_init(|| {
        let universe = mpi::initialize().expect("MPI");
        let folder = if Path::new("/dev/shm").is_dir() { PathBuf::from("/dev/shm") } else { std::env::temp_dir() };
        (Started(universe), folder.join(format!("clarke-fuzz-{}.h5", std::process::id())))
    });
    file
}

fuzz_target!(|bytes: &[u8]| {
    let file = start();
    let world = SimpleCommunicator::world();
    std::fs::write(file, bytes).expect("a file");
    read(file, &world).err();
    if bytes.len() as u64 > SEAL_BYTES {
        seal::seal(file, seal::CHECKPOINT, &world).expect("sealed");
        read(file, &world).err();
    }
});

/// Reads the header and every table that the seeds have.
fn read(file: &Path, world: &SimpleCommunicator) -> Result<()> {
    let checkpoint = Checkpoint::open(file, world)?;
    let header = serde_json::from_slice::<Header>(checkpoint.header());
    let _ = header.map(|header| header.step);
    for (set, total, width) in [("nodes", 4, 2), ("cells", 2, 3)] {
        let wanted: Vec<u64> = (0..total).collect();
        let rows = checkpoint.rows(set, total, &wanted)?;
        for name in checkpoint.tables(set)? {
            rows.read(&name, width)?;
        }
    }
    Ok(())
}
