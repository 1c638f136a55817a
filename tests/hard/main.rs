//! Hard cases that one job can't show: families over a parameter, units, refusals, very many steps.
//!
//! `make test` tries a sample of each family, `make hard` the whole (`CLARKE_HARD=1`); docs/stability.md has the numbers.
//! The tests print what they measured.

mod bounds;
#[path = "../runs/case.rs"]
#[allow(dead_code)]
mod case;
mod flow;
mod impact;
mod incompressible;
mod jumps;
#[path = "../runs/launch.rs"]
#[allow(dead_code)]
mod launch;
mod loads;
mod long;
mod meshes;
#[path = "../runs/results.rs"]
#[allow(dead_code)]
mod results;
mod theta;
mod units;
mod vanishing;

/// A sample of a family, or all of it in `make hard`.
fn family<T: Clone>(sample: &[T], others: &[T]) -> Vec<T> {
    let others = if thorough() { others } else { &[] };
    [sample, others].concat()
}

/// Whether this is `make hard`.
fn thorough() -> bool {
    std::env::var_os("CLARKE_HARD").is_some()
}

/// These must agree within a share of the expected number.
#[track_caller]
fn assert_close(found: f64, expected: f64, share: f64, what: &str) {
    assert!((found - expected).abs() <= share * expected.abs(), "{what}: {found:e} instead of {expected:e}");
}
