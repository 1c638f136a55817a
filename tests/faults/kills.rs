//! SIGKILL to a rank or to `mpirun` at random moments, most of them while files are written.

use super::{
    Random, trials,
    undisturbed::{RANKS, finish, saving, undisturbed},
};
use crate::{
    case::Case,
    launch::{Running, Target},
};
use std::{
    collections::BTreeMap,
    path::Path,
    time::{Duration, Instant},
};

/// The phase of a run in which it is killed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Moment {
    /// At any time from the launch to the end.
    Any,
    /// While a checkpoint is written: its incomplete file exists.
    Saving,
}

/// Kills a process of the run in this phase, after a random number of microseconds; returns whether the process still existed.
fn kill(case: &Case, running: &mut Running, moment: Moment, whole: Duration, random: &mut Random) -> bool {
    let target = if random.below(3) == 0 { Target::Launcher } else { Target::OneRank };
    let began = Instant::now();
    match moment {
        Moment::Any => std::thread::sleep(whole.mul_f64(random.below(1000) as f64 / 1000.0)),
        Moment::Saving => {
            let step = 1 + random.below(16);
            let part = case.folder().join(format!("out/checkpoint-{step}.h5.part"));
            while !part.exists() && began.elapsed() < 3 * whole && running.is_running() {
                std::thread::sleep(Duration::from_micros(200));
            }
            std::thread::sleep(Duration::from_micros(random.below(4000)));
        }
    }
    running.try_signal("KILL", target)
}

fn half_written(folder: &Path) -> bool {
    let names = if folder.exists() { crate::results::names(folder) } else { Vec::new() };
    names.iter().any(|name| name.ends_with(".h5.part"))
}

/// The outcomes of the kills.
type Counts = BTreeMap<&'static str, usize>;

/// Starts or continues a run and kills it; returns whether it was still running.
fn run_and_kill(case: &Case, whole: Duration, random: &mut Random, counts: &mut Counts) -> bool {
    let moment = if random.below(3) == 0 { Moment::Any } else { Moment::Saving };
    let out = case.folder().join("out");
    let saved = || out.exists() && !case.results().checkpoints().is_empty();
    let mut running = case.start_with(RANKS, if saved() { &["--restart"] } else { &[] });
    let killed = kill(case, &mut running, moment, whole, random);
    let launcher_hung = running.end_launcher_without_ranks();
    let outcome = running.wait();
    if killed {
        *counts.entry("launchers that hung").or_default() += usize::from(launcher_hung);
        assert!(outcome.code != 0 || case.results().summary()["status"] == "completed");
        *counts.entry("kills").or_default() += 1;
        *counts.entry("while a checkpoint was written").or_default() += usize::from(half_written(&out));
        *counts.entry("before the first checkpoint").or_default() += usize::from(!saved());
    }
    killed
}

#[test]
fn a_run_killed_at_any_moment_continues_to_the_same_result() {
    let began = Instant::now();
    let (straight, _kept) = undisturbed();
    let whole = began.elapsed();
    let (mut random, mut counts) = (Random(2026), Counts::new());
    let wanted = trials(4, 200);
    let mut kills = 0;
    while kills < wanted {
        let case = saving();
        // Successive kills: first of the initial run, then of runs that continue it.
        for _ in 0..=random.below(trials(3, 8) as u64) {
            kills += usize::from(run_and_kill(&case, whole, &mut random, &mut counts));
        }
        let put_aside = finish(&case, &straight, &format!("after {kills} kills"));
        *counts.entry("runs that went on").or_default() += 1;
        *counts.entry("field files put aside").or_default() += usize::from(put_aside);
        println!("{counts:?}");
    }
}
