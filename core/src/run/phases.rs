//! Time and memory traffic of each phase of a run, for `summary.json`.

use super::Clock;
use crate::{
    parallel::session::Session,
    solver::stepping::{StepClock, StepTraffic},
};
use serde_json::{Map, Value};
use std::time::Duration;

/// Seconds by phase of the slowest rank; `other` is what is left of its total. Collective.
pub(super) fn seconds(
    session: &Session,
    run: Clock,
    setup: Duration,
    clock: &StepClock,
    output: Duration,
) -> Map<String, Value> {
    let total = run.began.elapsed();
    let setup = setup.saturating_sub(clock.first_assembly);
    let steps = clock.assembly + clock.history + clock.solve + clock.balance;
    let phases = [
        ("total", total),
        ("launch", run.launched),
        ("setup", setup),
        ("assembly", clock.assembly),
        ("history", clock.history),
        ("solve", clock.solve),
        ("balance", clock.balance),
        ("output", output),
        ("other", total.saturating_sub(run.launched + setup + steps + output)),
    ];
    let seconds = session.largest(phases.map(|(_, spent)| spent.as_secs_f64()));
    phases.iter().zip(seconds).map(|((name, _), s)| ((*name).to_owned(), s.into())).collect()
}

/// Least memory traffic of each phase in bytes over all ranks, and bytes written to files; `null` where it is not counted. Collective.
pub(super) fn traffic(session: &Session, steps: &StepTraffic, written: u64) -> Map<String, Value> {
    let phases = [
        ("assembly", None),
        ("history", Some(steps.history)),
        ("solve", steps.solve),
        ("balance", Some(steps.balance)),
        ("output", Some(written)),
    ];
    let whole = |(name, mine): (&str, Option<u64>)| {
        let sum = session.total(usize::try_from(mine.unwrap_or(0)).unwrap_or(usize::MAX));
        let unknown = session.total(usize::from(mine.is_none())) > 0;
        (name.to_owned(), if unknown { Value::Null } else { sum.into() })
    };
    phases.into_iter().map(whole).collect()
}
