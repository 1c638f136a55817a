//! Quantities of a finished run by name, as in `[check]` of a job.

use super::period::period;
use crate::{
    io::output::{csv::records, quantity_name::TableQuantity},
    linear_algebra::tensor::larger,
};
use std::path::Path;

/// Relative distance of a time to the bounds of a window at which it is still inside, because ends of steps are rounded.
const ROUNDING: f64 = 1e-9;
/// Share of the largest magnitude of values at which they have arrived.
const ARRIVED: f64 = 0.01;

/// A window of simulated time in s; an absent bound is that of the run.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Window {
    /// The first time.
    pub from: Option<f64>,
    /// The last time.
    pub to: Option<f64>,
}

impl Window {
    /// Whether it is all of the run.
    pub(super) fn is_whole(self) -> bool {
        self == Self::default()
    }

    fn contains(self, time: f64) -> bool {
        let slack = ROUNDING * time.abs();
        self.from.is_none_or(|from| time >= from - slack) && self.to.is_none_or(|to| time <= to + slack)
    }
}

/// A quantity that a run has.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum RunQuantity {
    /// Its value.
    Number(f64),
    /// There is no such time: the values do not oscillate, or are all 0.
    NoTime,
}

/// The quantity in the output folder of a run, if it exists.
///
/// A quantity is a number of `summary.json` (`max_von_mises`, `certificates.viscosity_modulus`), or of a table: `history.COLUMN`,
/// `probe.NAME.COLUMN` and `resultant.SOURCE.COLUMN` at the last step, `profile.BOUNDARY.max.COLUMN`, `.min.` or `.first.` over the
/// boundary or at its first point, at the last output. With `.max.`, `.min.`, `.mean.`, `.amplitude.`, `.period.` or `.arrival.`
/// before the column, the others are over all steps.
pub fn quantity(folder: &Path, name: &str) -> Option<f64> {
    match quantity_in(folder, name, Window::default())? {
        RunQuantity::Number(number) => Some(number),
        RunQuantity::NoTime => None,
    }
}

/// As [`quantity`], of the steps in a window of time. Only histories, probes and resultants have values there.
pub(super) fn quantity_in(folder: &Path, name: &str, window: Window) -> Option<RunQuantity> {
    let Some(TableQuantity { table, of, side, column: field }) = TableQuantity::parse(name) else {
        let text = std::fs::read_to_string(folder.join("summary.json")).ok()?;
        let summary: serde_json::Value = serde_json::from_str(&text).ok()?;
        return summary.pointer(&format!("/{}", name.replace('.', "/")))?.as_f64().map(RunQuantity::Number);
    };
    let filter = table.keys.last().map(|key| key.name).zip(of);
    let numbers = |name: &str| column(folder, table.file, filter, name);
    if table.keys.first().is_some_and(|key| key.name == "time") {
        let times = numbers("time")?;
        let rows = times.iter().zip(numbers(field)?).filter(|(time, _)| Some(*time) == times.last());
        return extreme(side?, rows.map(|(_, value)| value)).map(RunQuantity::Number);
    }
    let is_over_time = matches!(side, Some("mean" | "period" | "arrival"));
    if window.is_whole() && !is_over_time {
        return over_steps(side, &numbers(field)?).map(RunQuantity::Number);
    }
    let all = numbers(field)?;
    let largest = all.iter().fold(0.0, |most, value| larger(most, value.abs()));
    let rows = numbers("time")?.into_iter().zip(all).filter(|(time, _)| window.contains(*time));
    let (times, values): (Vec<f64>, Vec<f64>) = rows.unzip();
    let level = mean(&times, &values)?;
    let time = match side {
        Some("period") => period(&times, &values, [level, largest]),
        Some("arrival") => arrival(&times, &values),
        Some("mean") => return Some(RunQuantity::Number(level)),
        _ => return over_steps(side, &values).map(RunQuantity::Number),
    };
    Some(time.map_or(RunQuantity::NoTime, RunQuantity::Number))
}

/// The last value, an extremum or the amplitude.
fn over_steps(side: Option<&str>, values: &[f64]) -> Option<f64> {
    let side_of = |side: &str| extreme(side, values.iter().copied());
    match side {
        None => values.last().copied(),
        Some("amplitude") => Some((side_of("max")? - side_of("min")?) / 2.0),
        Some(side) => side_of(side),
    }
}

/// The time at which values, linear between the times, first reach a hundredth of their largest magnitude; `None` if all are 0.
fn arrival(times: &[f64], values: &[f64]) -> Option<f64> {
    let level = ARRIVED * values.iter().map(|value| value.abs()).reduce(larger)?;
    let at = values.iter().position(|value| level > 0.0 && value.abs() >= level)?;
    let Some(before) = at.checked_sub(1) else {
        return times.first().copied();
    };
    let [low, high] = [before, at].map(|at| values[at].abs());
    Some(times[before] + (times[at] - times[before]) * (level - low) / (high - low))
}

/// The mean over time of values that are linear between the times.
fn mean(times: &[f64], values: &[f64]) -> Option<f64> {
    let (first, last) = (times.first()?, times.last()?);
    if first == last {
        return values.last().copied();
    }
    let pairs = times.windows(2).zip(values.windows(2));
    Some(pairs.map(|(t, v)| (t[1] - t[0]) * (v[0] + v[1]) / 2.0).sum::<f64>() / (last - first))
}

/// The numbers of a column in the rows in which another column contains this word (in all rows without a filter).
fn column(folder: &Path, table: &str, filter: Option<(&str, &str)>, name: &str) -> Option<Vec<f64>> {
    let bytes = std::fs::read(folder.join(table)).ok()?;
    let mut rows = records(&bytes).map(|record| record.entries);
    let header = rows.next()?;
    let place = |name: &str| header.iter().position(|column| *column == name);
    let (wanted, filter) = match filter {
        Some((column, word)) => (place(name)?, Some((place(column)?, word))),
        None => (place(name)?, None),
    };
    let kept = rows
        .filter(|row| filter.is_none_or(|(column, word)| row.get(column).is_some_and(|entry| entry == word)));
    kept.map(|row| row.get(wanted)?.parse().ok()).collect()
}

fn extreme(side: &str, mut values: impl Iterator<Item = f64>) -> Option<f64> {
    match side {
        "max" => values.reduce(larger),
        "min" => values.reduce(|a, b| -larger(-a, -b)),
        "first" => values.next(),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_where_the_quantity_says() {
        let folder = tempfile::tempdir().expect("folder");
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("written");
        write(
            "summary.json",
            r#"{"max_von_mises": 4.5, "status": "completed", "certificates": {"theta": 0.5}}"#,
        );
        write("history.csv", "step,work\n1,2.5\n2,3.5\n");
        write(
            "resultants.csv",
            "step,source,force_x\n1,contact low,7\n1,momentum,9\n2,contact low,-3\n1,contact pad.top,6\n2,contact pad.top,5\n",
        );
        write("probes.csv", "step,probe,velocity_y\n1,\"a, '\",1\n1,b,2\n2,\"a, '\",3\n2,b,4\n2,max,9\n");
        write(
            "profiles.csv",
            "time,profile,x,pressure\n1,low,0,9\n2,low,0,-1\n2,low,1,5\n2,top,0,7\n2,pad.top,0,8\n",
        );
        let cases = [
            ("max_von_mises", 4.5),
            ("certificates.theta", 0.5),
            ("history.work", 3.5),
            ("history.min.work", 2.5),
            ("resultant.contact low.force_x", -3.0),
            ("resultant.contact low.max.force_x", 7.0),
            ("probe.a, '.velocity_y", 3.0),
            ("probe.b.min.velocity_y", 2.0),
            ("probe.a, '.max.velocity_y", 3.0),
            ("profile.low.max.pressure", 5.0),
            ("profile.low.min.pressure", -1.0),
            ("profile.low.first.pressure", -1.0),
            ("resultant.contact pad.top.force_x", 5.0),
            ("resultant.contact pad.top.max.force_x", 6.0),
            ("profile.pad.top.max.pressure", 8.0),
            ("probe.max.velocity_y", 9.0),
        ];
        for (name, value) in cases {
            assert_eq!(quantity(folder.path(), name), Some(value), "{name}");
        }
    }

    #[test]
    fn a_window_contains_the_steps_between_its_times() {
        let folder = tempfile::tempdir().expect("folder");
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("written");
        write("history.csv", "step,time,work\n1,0.1,4\n2,0.3,8\n3,0.30000000000000004,6\n4,0.5,-2\n");
        write(
            "probes.csv",
            "step,time,probe,velocity_y\n1,1,a,1\n1,1,b,9\n2,2,a,3\n2,2,b,9\n3,4,a,7\n3,4,b,9\n",
        );
        let value = |name: &str, from: Option<f64>, to: Option<f64>| {
            quantity_in(folder.path(), name, Window { from, to })
        };
        for (name, from, to, expected) in [
            ("history.work", None, Some(0.3), Some(6.0)),
            ("history.max.work", Some(0.35), None, Some(-2.0)),
            ("history.min.work", None, Some(0.2), Some(4.0)),
            ("history.amplitude.work", None, None, Some(5.0)),
            ("history.amplitude.work", Some(0.3), None, Some(5.0)),
            ("history.amplitude.work", Some(0.1), Some(0.1), Some(0.0)),
            // (1 x 2 + 2 x 5) / 3, and of the last two steps alone.
            ("probe.a.mean.velocity_y", None, None, Some(4.0)),
            ("probe.a.mean.velocity_y", Some(1.5), Some(9.0), Some(5.0)),
            ("probe.a.mean.velocity_y", Some(4.0), None, Some(7.0)),
            ("probe.b.mean.velocity_y", None, None, Some(9.0)),
            ("probe.a.mean.velocity_y", Some(2.5), Some(3.5), None),
            ("probe.a.max.velocity_y", Some(5.0), None, None),
        ] {
            assert_eq!(
                value(name, from, to),
                expected.map(RunQuantity::Number),
                "{name} from {from:?} to {to:?}"
            );
        }
    }

    #[test]
    fn values_arrive_where_they_reach_a_hundredth_of_their_largest_magnitude() {
        let folder = tempfile::tempdir().expect("folder");
        let text = "step,time,work,rest\n1,1,0,0\n2,2,-0.005,0\n3,4,-0.105,0\n4,5,1,0\n5,6,-3,0\n";
        std::fs::write(folder.path().join("history.csv"), text).expect("written");
        let value = |name: &str, from: Option<f64>, to: Option<f64>| {
            quantity_in(folder.path(), name, Window { from, to })
        };
        for (from, to, expected) in
            [(None, None, 2.5), (None, Some(4.0), 1.21), (Some(4.0), None, 4.0), (Some(4.0), Some(5.0), 4.0)]
        {
            let Some(RunQuantity::Number(found)) = value("history.arrival.work", from, to) else {
                panic!("no arrival from {from:?} to {to:?}")
            };
            assert!((found - expected).abs() < 1e-12, "{found} from {from:?} to {to:?}");
        }
        assert_eq!(value("history.arrival.rest", None, None), Some(RunQuantity::NoTime));
        assert_eq!(value("history.arrival.work", Some(7.0), None), None, "no steps");
    }

    #[test]
    fn a_period_is_that_between_crossings_of_the_mean_in_a_window() {
        let folder = tempfile::tempdir().expect("folder");
        let rows = (0..40_i32).map(|n| {
            // A jump at 5 s, then a sawtooth about 10 with the period of 8 rows of 0.25 s.
            let (time, saw) = (0.25 * f64::from(n), f64::from((n % 8 - 4).abs()));
            format!("{n},{time},{}\n", if n < 20 { 0.0 } else { 8.0 + saw })
        });
        let text = format!("step,time,work\n{}", rows.collect::<String>());
        std::fs::write(folder.path().join("history.csv"), text).expect("written");
        let value = |from: Option<f64>, to: Option<f64>| {
            quantity_in(folder.path(), "history.period.work", Window { from, to })
        };
        assert_eq!(value(Some(5.0), None), Some(RunQuantity::Number(2.0)));
        assert_eq!(value(None, None), Some(RunQuantity::NoTime), "the jump crosses the mean of the run once");
        assert_eq!(value(None, Some(4.0)), Some(RunQuantity::NoTime), "nothing moves");
        assert_eq!(value(Some(20.0), None), None, "no steps");
        assert_eq!(quantity(folder.path(), "history.period.work"), None);
        assert_eq!(quantity(folder.path(), "history.period.nothing"), None);
    }
}
