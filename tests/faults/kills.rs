//! SIGKILL to a rank or to `mpirun` at random moments, most of them while files are written.

use crate::{
    Random,
    case::Case,
    launch::{Running, Target},
    trials,
    undisturbed::{RANKS, finish, saving, undisturbed},
};
use std::{
    collections::BTreeMap,
    path::Path,
    time::{Duration, Instant},
};

/// What a kill is to hit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Moment {
    /// Anything from the launch to the end.
    Any,
    /// A checkpoint that is being written: its unfinished file is there.
    Saving,
}

/// Kills a process of the run at the moment, after some more random microseconds; whether it was still there.
fn kill(case: &Case, running: &mut Running, moment: Moment, whole: Duration, random: &mut Random) -> bool {
    let target = if random.below(3) == 0 { Target::Launcher } else { Target::OneRank };
    let began = Instant::now();
    match moment {
        Moment::Any => std::thread::sleep(whole.mul_f64(random.below(1000) as f64 / 1000.0)),
        Moment::Saving => {
            let step = 1 + random.below(16);
            let part = case.folder().join(format!("out/checkpoint-{step}.h5.part"));
            while !part.exists() && began.elapsed() < 3 * whole && running.goes_on() {}
            std::thread::sleep(Duration::from_micros(random.below(4000)));
        }
    }
    running.try_signal("KILL", target)
}

fn half_written(folder: &Path) -> bool {
    let names = folder.exists().then(|| crate::results::names(folder)).unwrap_or_default();
    names.iter().any(|name| name.ends_with(".h5.part"))
}

#[test]
fn a_run_killed_at_any_moment_goes_on_to_the_same_result() {
    let began = Instant::now();
    let (straight, _kept) = undisturbed();
    let whole = began.elapsed();
    let mut random = Random(2026);
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    let mut count = |what: &'static str, so: bool| *counts.entry(what).or_default() += usize::from(so);
    let wanted = trials(6, 200);
    let mut kills = 0;
    while kills < wanted {
        let case = saving();
        // Up to three kills in a row: the first run, then runs that go on.
        for _ in 0..=random.below(3) {
            let moment = if random.below(3) == 0 { Moment::Any } else { Moment::Saving };
            let out = case.folder().join("out");
            let saved = out.exists() && !case.results().checkpoints().is_empty();
            let mut running = case.start_with(RANKS, if saved { &["--restart"] } else { &[] });
            let killed = kill(&case, &mut running, moment, whole, &mut random);
            let outcome = running.wait();
            if !killed {
                count("came too late", true);
                continue;
            }
            kills += 1;
            assert!(outcome.code != 0 || case.results().summary()["status"] == "completed");
            count("kills", true);
            count("while a checkpoint was written", half_written(&out));
            count("before the first checkpoint", !out.exists() || case.results().checkpoints().is_empty());
        }
        let put_aside = finish(&case, &straight, &format!("after {kills} kills"));
        count("runs that went on", true);
        count("field files put aside", put_aside);
    }
    println!("{counts:?}");
}
