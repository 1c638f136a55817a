//! Faults cause no loss of results: killed processes, full disks, damaged files, time limits, foreign folders, hostile input.
//!
//! `make test` tries a sample of each, `make hard` many more (`CLARKE_HARD=1`); docs/stability.md has the counts.

mod agreements;
mod damage;
mod disks;
mod enormous;
mod folders;
mod kills;
mod limits;
mod matrix;
mod one_rank;
mod undisturbed;

use crate::mpirun;

/// The test that others start under `mpirun`.
const SCENARIO: &str = "faults::scenario";

/// The part of the tests that runs under `mpirun`.
#[test]
#[ignore = "started by the other tests, under mpirun"]
fn scenario() {
    let (words, folder) = (mpirun::words(), mpirun::folder().expect("a folder"));
    match words.split_once(' ').expect("a kind of scenario") {
        ("restart", what) => matrix::scenario(what, &folder),
        ("agreements", what) => agreements::scenario(what, &folder),
        (_, what) => std::process::exit(i32::from(one_rank::fail(what) as u8)),
    }
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
