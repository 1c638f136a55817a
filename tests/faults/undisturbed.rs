//! What a run gives that nothing disturbed, and how a disturbed one is held against it.

use crate::{case::Case, hdf5_file::NumberFile, results::Results};

/// Ranks of the runs that are disturbed.
pub const RANKS: usize = 2;

/// Steps of a case.
const STEPS: u64 = 16;

/// A job that saves after each of its 16 steps and writes fields after each fourth; most of its time goes into files.
pub fn saving() -> Case {
    Case::square(16).set("checkpoint.every", "1").set("output.fields", "{every = 4}")
}

/// The same job where nothing happens.
pub fn undisturbed() -> (Results, Case) {
    let case = saving();
    (case.run(RANKS), case)
}

/// Goes on, or starts anew where no checkpoint was left; the results must then be those of the undisturbed run to the last
/// bit. Gives whether the field file had to be put aside.
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
    for name in ["history.csv", "probes.csv", "profiles.csv"] {
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

/// Every step of the fields that are there must be the undisturbed one, the last one among them.
fn assert_same_fields(straight: &Results, results: &Results, what: &str) -> bool {
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
