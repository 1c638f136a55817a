//! Random jobs over every feature, as a user would run them: from files, at default settings.
//!
//! A scene is drawn in a frame: a rotation, units of length, mass and time, and a number of steps. Every job must be completed, or end
//! with a message that names the reason and a remedy. Completed ones must have balanced energies, forces and moments in every step, and
//! the same results on 1, 2 and 3 ranks, after a restart, in a rotated frame and in other units; shorter steps must converge.

mod drawn;
mod invariants;

use super::{World, test_of};
use crate::mpirun;
use std::ops::Range;

/// Jobs of `make test`; `CLARKE_RANDOM_SCENES=5000`, or `=17..18`, tries others.
const JOBS: u64 = 60;
/// Others that have found faults.
const KEPT: [u64; 2] = [1574, 2852];
/// Jobs for each start of the launcher.
const BATCH: u64 = 20;

fn chosen() -> Vec<Range<u64>> {
    let Some(words) = std::env::var("CLARKE_RANDOM_SCENES").ok() else {
        return std::iter::once(0..JOBS).chain(KEPT.map(|kept| kept..kept + 1)).collect();
    };
    let number = |text: &str| text.parse().unwrap_or_else(|_| panic!("CLARKE_RANDOM_SCENES={words}"));
    let range = match words.split_once("..") {
        Some((first, end)) => number(first)..number(end),
        None => 0..number(&words),
    };
    std::iter::once(range).collect()
}

/// The scenario of the jobs whose numbers follow the name of the test.
fn scenario(world: &World) {
    let words = mpirun::words();
    let numbers: Vec<u64> = words.split(' ').map(|text| text.parse().expect("a number")).collect();
    invariants::hold(&world.session, numbers[0]..numbers[1], &world.folder);
}

#[test]
fn random_scenes_are_completed_or_end_with_a_reason_and_keep_their_invariants() {
    let Some(test) = test_of(|world| scenario(&world)) else { return };
    let batches = chosen().into_iter().flat_map(|jobs| {
        let end = jobs.end;
        jobs.step_by(BATCH as usize).map(move |first| (first, end.min(first + BATCH)))
    });
    for (first, end) in batches {
        let folder = tempfile::tempdir().expect("folder");
        // The results on one rank come first: the others are compared with them.
        for ranks in [1, 2, 3] {
            mpirun::run(ranks, &format!("{test} {first} {end}"), folder.path());
        }
    }
}
