//! The period of an oscillation.

/// Swings below this share of the amplitude around the mean are noise.
const NOISE: f64 = 0.05;
/// Values that differ by less than this share of the largest are constant but for errors of the solver.
const CONSTANT: f64 = 1e-8;
/// Steps in a period below which an oscillation is told from noise by its regularity.
const FEW: f64 = 8.0;
/// Largest deviation of the periods of a regular oscillation from their mean, relative to it.
const REGULAR: f64 = 0.25;

/// The mean period in s of values at ascending times, from the times at which they cross a level, their mean; `None` if they cross it
/// less than twice in the same direction, are constant beside the `largest` magnitude of the run, are irregular from step to step, or are
/// not all numbers.
///
/// Crossings in the same direction are a period apart whatever the level is. One counts if the values then swing beyond the level by a
/// twentieth of the amplitude; its time is that at which the line between two values crosses the level.
pub(super) fn period(times: &[f64], values: &[f64], [level, largest]: [f64; 2]) -> Option<f64> {
    let extremes = values
        .iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(*value), high.max(*value)]);
    let amplitude = 0.5 * (extremes[1] - extremes[0]);
    let are_numbers = level.is_finite() && values.iter().chain(times).all(|value| value.is_finite());
    if !are_numbers || amplitude <= CONSTANT * largest {
        return None;
    }
    let (mut side, mut last_change) = (None, f64::NAN);
    // Times of the last crossing in each direction, and the periods.
    let mut last = [f64::NAN; 2];
    let mut periods: Vec<f64> = Vec::new();
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
            let since = last_change - last[direction];
            periods.extend((!since.is_nan()).then_some(since));
            last[direction] = last_change;
        }
        side = Some(is_above);
    }
    let (count, step) = (periods.len() as f64, (times.last()? - times.first()?) / (times.len() as f64 - 1.0));
    let mean = periods.iter().sum::<f64>() / count;
    let deviation = (periods.iter().map(|period| (period - mean).powi(2)).sum::<f64>() / count).sqrt();
    (mean >= FEW * step || deviation <= REGULAR * mean).then_some(mean)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// Values of a function of time at 201 times up to `end`.
    fn sampled(end: f64, value: impl Fn(f64) -> f64) -> (Vec<f64>, Vec<f64>) {
        (0..=200).map(|n| f64::from(n) * end / 200.0).map(|t| (t, value(t))).unzip()
    }

    fn largest(values: &[f64]) -> f64 {
        values.iter().fold(0.0, |most: f64, value| most.max(value.abs()))
    }

    fn of(end: f64, level: f64, value: impl Fn(f64) -> f64) -> Option<f64> {
        let (times, values) = sampled(end, value);
        period(&times, &values, [level, largest(&values)])
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
        assert_eq!(period(&times, &values, [0.0, largest(&values)]), Some(1.0));
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
        let noisy = period(&times, &values, [0.0, largest(&values)]).expect("a period");
        assert!((noisy - 0.5).abs() < 0.02, "{noisy}");
    }

    #[test]
    fn what_crosses_less_than_twice_in_a_direction_has_no_period() {
        assert_eq!(of(1.0, 0.5, |t| t), None, "one crossing");
        assert_eq!(of(1.0, 0.0, |t| (TAU * t + 0.1).sin()), None, "one crossing in each direction");
        assert!(of(1.0, 0.0, |t| (1.2 * TAU * t + 0.1).sin()).is_none());
        assert!(of(1.0, 0.0, |t| (1.6 * TAU * t + 0.1).sin()).is_some(), "two downward");
        assert_eq!(of(1.0, 3.0, |_| 3.0), None, "constant");
        assert_eq!(of(1.0, 1.0, |t| 1.0 + 1e-9 * (90.0 * t).sin()), None, "errors of the solver");
        let (times, still) = sampled(1.0, |t| 1e-9 * (90.0 * t).sin());
        assert!(period(&times, &still, [0.0, 1e-9]).is_some());
        assert_eq!(period(&times, &still, [0.0, 1.0]), None, "at rest after a motion");
        // A linear congruential generator.
        let mut state = 12345_u64;
        let mut random = |_| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        let noise: Vec<f64> = times.iter().map(&mut random).collect();
        assert_eq!(period(&times, &noise, [0.0, 0.5]), None, "noise");
        assert_eq!(period(&[], &[], [f64::NAN, 0.0]), None);
        assert_eq!(period(&[1.0], &[2.0], [2.0, 2.0]), None);
        for wrong in [f64::NAN, f64::INFINITY] {
            let (times, mut values) = sampled(1.0, |t| (TAU * t / 0.2).sin());
            values[77] = wrong;
            assert_eq!(period(&times, &values, [0.0, largest(&values)]), None, "{wrong}");
        }
    }
}
