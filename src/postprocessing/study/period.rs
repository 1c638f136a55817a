//! The period of an oscillation.

/// Swings below this share of the amplitude around the mean are noise.
const NOISE: f64 = 0.05;
/// Values that differ by less than this share of the largest are constant.
const ROUNDING: f64 = 1e-12;

/// The mean period in s of values at ascending times, from the times at which they cross a level, their mean; `None` if they cross it
/// less than twice in the same direction, are constant, or are not all numbers.
///
/// Crossings in the same direction are a period apart whatever the level is. One counts if the values then swing beyond the level by a
/// twentieth of the amplitude; its time is that at which the line between two values crosses the level.
pub(super) fn period(times: &[f64], values: &[f64], level: f64) -> Option<f64> {
    let extremes = values
        .iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(*value), high.max(*value)]);
    let amplitude = 0.5 * (extremes[1] - extremes[0]);
    let largest = extremes[0].abs().max(extremes[1].abs());
    let are_numbers = level.is_finite() && values.iter().chain(times).all(|value| value.is_finite());
    if !are_numbers || amplitude <= ROUNDING * largest {
        return None;
    }
    let (mut side, mut last_change) = (None, f64::NAN);
    // Time of the first and of the last crossing in each direction, and their number.
    let mut found = [[0.0; 2]; 2];
    let mut counts = [0_u32; 2];
    for (at, value) in values.iter().enumerate() {
        let off = value - level;
        if let Some(before) = at.checked_sub(1).map(|before| values[before] - level)
            && (before > 0.0) != (off > 0.0)
        {
            let share = before / (before - off);
            last_change = times[at - 1] + share * (times[at] - times[at - 1]);
        }
        if off.abs() <= NOISE * amplitude {
            continue;
        }
        let is_above = off > 0.0;
        if side.is_some_and(|side| side != is_above) {
            let direction = usize::from(is_above);
            counts[direction] += 1;
            if counts[direction] == 1 {
                found[direction][0] = last_change;
            }
            found[direction][1] = last_change;
        }
        side = Some(is_above);
    }
    let periods = counts.iter().map(|count| count.saturating_sub(1)).sum::<u32>();
    let spans: f64 = found.iter().map(|[first, last]| last - first).sum();
    (periods > 0).then(|| spans / f64::from(periods))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// Values of a function of time at 201 times up to `end`.
    fn sampled(end: f64, value: impl Fn(f64) -> f64) -> (Vec<f64>, Vec<f64>) {
        (0..=200).map(|n| f64::from(n) * end / 200.0).map(|t| (t, value(t))).unzip()
    }

    fn of(end: f64, level: f64, value: impl Fn(f64) -> f64) -> Option<f64> {
        let (times, values) = sampled(end, value);
        period(&times, &values, level)
    }

    #[test]
    fn the_period_is_that_of_the_oscillation_whatever_the_level_and_the_window() {
        for (end, level) in [(1.0, 0.0), (0.83, 0.0), (0.71, 0.3), (1.0, -0.5)] {
            let found = of(end, level, |t| (TAU * t / 0.2 + 0.4).sin()).expect("a period");
            assert!((found - 0.2).abs() < 1e-4, "{found} up to {end} s across {level}");
        }
        // With zeros on the samples.
        let (times, values): (Vec<f64>, Vec<f64>) = [0.0, 1.0, 0.0, -1.0, 0.0, 1.0, 0.0, -1.0, 0.0]
            .iter()
            .enumerate()
            .map(|(n, value)| (0.25 * n as f64, *value))
            .unzip();
        assert_eq!(period(&times, &values, 0.0), Some(1.0));
    }

    #[test]
    fn decay_unequal_halves_and_noise_do_not_change_it() {
        let decaying = of(2.0, 0.0, |t| (-t).exp() * (TAU * t / 0.25).cos()).expect("a period");
        assert!((decaying - 0.25).abs() < 1e-4, "{decaying}");
        // A third of the period up, two thirds down.
        let unequal =
            of(3.0, 0.2, |t| if (t / 0.6).fract() < 1.0 / 3.0 { 1.0 } else { 0.0 }).expect("a period");
        assert!((unequal - 0.6).abs() < 0.02, "{unequal}");
        let mut turn = 1.0;
        let (times, mut values) = sampled(1.0, |t| (TAU * t / 0.5).sin());
        values.iter_mut().for_each(|value| {
            turn = -turn;
            *value += 0.03 * turn;
        });
        let noisy = period(&times, &values, 0.0).expect("a period");
        assert!((noisy - 0.5).abs() < 0.02, "{noisy}");
    }

    #[test]
    fn what_crosses_less_than_twice_in_a_direction_has_no_period() {
        assert_eq!(of(1.0, 0.5, |t| t), None, "one crossing");
        assert_eq!(of(1.0, 0.0, |t| (TAU * t + 0.1).sin()), None, "one crossing in each direction");
        assert!(of(1.0, 0.0, |t| (1.2 * TAU * t + 0.1).sin()).is_none());
        assert!(of(1.0, 0.0, |t| (1.6 * TAU * t + 0.1).sin()).is_some(), "two downward");
        assert_eq!(of(1.0, 3.0, |_| 3.0), None, "constant");
        assert_eq!(of(1.0, 1.0, |t| 1.0 + 1e-16 * (90.0 * t).sin()), None, "rounding");
        assert_eq!(period(&[], &[], f64::NAN), None);
        assert_eq!(period(&[1.0], &[2.0], 2.0), None);
        for wrong in [f64::NAN, f64::INFINITY] {
            let (times, mut values) = sampled(1.0, |t| (TAU * t / 0.2).sin());
            values[77] = wrong;
            assert_eq!(period(&times, &values, 0.0), None, "{wrong}");
        }
    }
}
