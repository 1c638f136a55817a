//! How far a function of time is from the straight line between two of its values.

/// The share of a value that may be an error of rounding.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

/// A function between two times.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Course {
    /// The largest distance from the straight line between its values at these times, without what may be rounding errors.
    pub bend: f64,
    /// Its least and its largest value.
    pub range: [f64; 2],
}

/// A function between two times, by its values at the ends of this many equal parts. Values that are not finite are left out.
pub fn course(function: impl Fn(f64) -> f64, [start, end]: [f64; 2], parts: u32) -> Course {
    let [first, last] = [start, end].map(&function);
    let mut found = Course { bend: 0.0, range: [first.min(last), first.max(last)] };
    for part in 1..parts {
        let share = f64::from(part) / f64::from(parts);
        let value = function((1.0 - share) * start + share * end);
        let distance = (value - ((1.0 - share) * first + share * last)).abs();
        if distance.is_finite() && distance > ROUNDING * value.abs().max(first.abs()) {
            found.bend = found.bend.max(distance);
        }
        found.range = [found.range[0].min(value), found.range[1].max(value)];
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_is_a_quarter_of_its_length_squared_off_its_chord() {
        let Course { bend, range } = course(|t| t * t, [0.5, 1.0], 64);
        assert!((bend - 0.0625).abs() < 1e-15 && range == [0.25, 1.0], "{bend} {range:?}");
        let Course { bend, range } = course(|t| (4.0 * t).sin(), [0.0, std::f64::consts::PI], 16);
        assert!((bend - 1.0).abs() < 1e-12 && range.map(f64::round) == [-1.0, 1.0], "{bend} {range:?}");
    }

    #[test]
    fn rounding_errors_and_values_that_are_not_finite_are_no_bend() {
        assert_eq!(course(|t| 3.0 * t, [0.25, 0.5], 64).bend, 0.0);
        assert_eq!(course(|t| 1e-20 * (20.0 * t).sin() - 1e-4, [0.3, 0.7], 64).bend, 0.0);
        assert_eq!(course(|t| (t - 9.0).sqrt(), [0.3, 0.7], 64).bend, 0.0);
    }
}
