//! Hard cases that need more than one job: families over a parameter, units, refusals, very many steps.
//!
//! `make test` tries a sample of each family, `make hard` the whole (`CLARKE_HARD=1`); docs/stability.md has the numbers. The tests
//! print the measured numbers.

mod bounds;
mod flow;
mod impact;
mod incompressible;
mod jumps;
mod loads;
mod long;
mod meshes;
mod theta;
mod units;
mod vanishing;

/// A sample of a family, or the whole family in `make hard`.
fn family<T: Clone>(sample: &[T], others: &[T]) -> Vec<T> {
    let others = if thorough() { others } else { &[] };
    [sample, others].concat()
}

/// Whether this is `make hard`.
fn thorough() -> bool {
    std::env::var_os("CLARKE_HARD").is_some()
}

/// The numbers must agree within a fraction of the expected one.
#[track_caller]
fn assert_close(found: f64, expected: f64, share: f64, what: &str) {
    assert!((found - expected).abs() <= share * expected.abs(), "{what}: {found:e} instead of {expected:e}");
}
