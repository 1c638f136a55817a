//! The results of an undisturbed run, and their comparison with those of a disturbed one.

use crate::{case::Case, hdf5_file::NumberFile, results::Results};

/// Number of ranks of disturbed runs.
pub const RANKS: usize = 2;

/// Number of steps of a case.
const STEPS: u64 = 16;

/// A job that saves a checkpoint after each of its 16 steps and writes fields after every fourth; writing files takes most of its
/// time.
pub fn saving() -> Case {
    Case::square(16).set("checkpoint.every", "1").set("output.fields", "{every = 4}")
}

/// The same job without disturbance.
pub fn undisturbed() -> (Results, Case) {
    let case = saving();
    (case.run(RANKS), case)
}

/// Continues the run, or starts it again if there is no checkpoint; the results must then be bitwise equal to those of the
/// undisturbed run. Returns whether the field file had to be replaced.
#[track_caller]
pub fn finish(case: &Case, straight: &Results, what: &str) -> bool {
    let left = case.folder().join("out");
    let saved = left.exists() && !Results::of(left).checkpoints().is_empty();
    let options: &[&str] = if saved { &["--restart"] } else { &[] };
    case.run_with(RANKS, options).expect(0);
    assert_same(straight, &case.results(), what)
}

#[track_caller]
fn assert_same(straight: &Results, results: &Results, what: &str) -> bool {
    for name in ["history.csv", "resultants.csv", "probes.csv", "profiles.csv"] {
        assert_eq!(straight.text(name), results.text(name), "{what}: {name}");
    }
    let [one, other] = [straight, results].map(|r| {
        assert_eq!(r.checkpoints(), [STEPS, STEPS - 1], "{what}");
        NumberFile::open(&r.path(&format!("checkpoint-{STEPS}.h5"))).checkpoint_tables()
    });
    assert!(one.len() >= 4 && one == other, "{what}: the last checkpoint differs");
    assert_eq!(results.summary()["status"], "completed", "{what}");
    assert!(!results.files().iter().any(|name| name.ends_with(".part")), "{what}: {:?}", results.files());
    assert_same_fields(straight, results, what)
}

/// All steps in the field file must be equal to those of the undisturbed run, and the last one must be among them. Returns whether
/// the field file had to be put aside.
#[track_caller]
pub fn assert_same_fields(straight: &Results, results: &Results, what: &str) -> bool {
    let put_aside = results.path("fields.damaged.vtkhdf").exists();
    let [one, other] = [straight, results].map(|r| NumberFile::open(&r.path("fields.vtkhdf")));
    let (all, there) = (one.times(), other.times());
    assert!(put_aside || all == there, "{what}: times {there:?}");
    assert_eq!(all.last(), there.last(), "{what}");
    for (position, time) in there.iter().enumerate() {
        let step = all.iter().position(|t| t == time).expect("a time of the undisturbed run");
        for name in one.names("Fields") {
            assert!(one.field(&name, step) == other.field(&name, position), "{what}: {name} at {time} s");
        }
    }
    put_aside
}
