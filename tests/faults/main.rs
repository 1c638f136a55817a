//! Faults cause no loss of results: killed processes, full disks, damaged files, time limits, foreign folders, hostile input.
//!
//! `make test` tries a sample of each, `make hard` many more (`CLARKE_HARD=1`); docs/stability.md has the counts.

mod agreements;
#[path = "../runs/case.rs"]
#[allow(dead_code)]
mod case;
mod damage;
mod disks;
mod enormous;
mod folders;
#[path = "../runs/hdf5_file.rs"]
#[allow(dead_code)]
mod hdf5_file;
mod kills;
#[path = "../runs/launch.rs"]
#[allow(dead_code)]
mod launch;
mod limits;
mod matrix;
#[path = "../mpirun/mod.rs"]
#[allow(dead_code)]
mod mpirun;
mod one_rank;
#[path = "../runs/results.rs"]
#[allow(dead_code)]
mod results;
mod undisturbed;

/// The part of the tests that runs under `mpirun`.
#[test]
#[ignore = "started by the other tests, under mpirun"]
fn scenario() {
    let name = std::env::var(mpirun::SCENARIO).expect("a scenario");
    if name.starts_with("restart_") {
        let folder = std::env::var(mpirun::FOLDER).expect("a folder");
        return matrix::scenario(&name, folder.as_ref());
    }
    if let Some(words) = name.strip_prefix(agreements::SCENARIO) {
        let folder = std::env::var(mpirun::FOLDER).expect("a folder");
        return agreements::scenario(words, folder.as_ref());
    }
    let exit = one_rank::fail(name.trim_start_matches("one_rank "));
    std::process::exit(i32::from(exit as u8));
}

/// Number of cases: a sample, or many in `make hard`.
fn trials(sample: usize, many: usize) -> usize {
    if std::env::var_os("CLARKE_HARD").is_some() { many } else { sample }
}

/// Pseudorandom numbers, the same in every run of the tests.
struct Random(u64);

impl Random {
    fn below(&mut self, limit: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (mixed ^ (mixed >> 31)) % limit
    }
}
