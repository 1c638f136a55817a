//! The root of an increasing function whose evaluation is expensive.

/// Largest ratio of successive secant steps while no interval with a change of sign is known.
const SECANT_GROWTH: f64 = 10.0;
/// Ratio of successive steps where the function is constant.
const GROWTH: f64 = 3.0;

/// Secant steps, inside an interval with a change of sign as soon as one is known.
#[derive(Debug, Default)]
pub(super) struct IncreasingRoot {
    /// The nearest known points below and above the root, with their values.
    low: Option<[f64; 2]>,
    high: Option<[f64; 2]>,
    last: Option<[f64; 2]>,
    /// Width of the interval at the last bisection, or when it was found.
    width: f64,
    /// Secant steps since then.
    count: u32,
}

impl IncreasingRoot {
    /// The next point, after the function has this value at a point; `slope`, which is positive, is an estimate for the first step.
    /// `None` if no number lies between the points around the root.
    pub(super) fn next(&mut self, at: f64, value: f64, slope: f64) -> Option<f64> {
        let side = if value < 0.0 { &mut self.low } else { &mut self.high };
        *side = Some([at, value]);
        let before = self.last.replace([at, value]);
        let secant = before.and_then(|[before, earlier]| {
            let step = -value * (at - before) / (value - earlier);
            (step.is_finite() && step * value <= 0.0).then_some(step)
        });
        let (Some([low, _]), Some([high, _])) = (self.low, self.high) else {
            let last = before.map(|[before, _]| (at - before).abs());
            let step = match (secant, last) {
                (Some(step), Some(last)) => step.abs().min(SECANT_GROWTH * last),
                (None, Some(last)) => GROWTH * last,
                _ => (value / slope).abs(),
            };
            return Some(at - value.signum() * step);
        };
        let (middle, width) = (0.5 * (low + high), high - low);
        if !(low < middle && middle < high) {
            return None;
        }
        if self.width == 0.0 {
            self.width = width;
        }
        // The interval must halve in three steps.
        self.count += 1;
        let is_slow = self.count > 3 && width > 0.5 * self.width;
        if width <= 0.5 * self.width || is_slow {
            (self.width, self.count) = (width, 0);
        }
        let next = secant.map_or(middle, |step| at + step);
        Some(if !is_slow && low < next && next < high { next } else { middle })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Evaluations until the value is small, from 0.
    fn solve(function: impl Fn(f64) -> f64, slope: f64) -> (f64, u32) {
        let mut root = IncreasingRoot::default();
        let mut at = 0.0;
        for count in 1..200 {
            let value = function(at);
            if value.abs() < 1e-10 {
                return (at, count);
            }
            match root.next(at, value, slope) {
                Some(next) => at = next,
                None => return (at, count),
            }
        }
        panic!("no root")
    }

    #[test]
    fn roots_of_smooth_kinked_and_jumping_functions_are_found() {
        let (linear, count) = solve(|x| 3.0 * x - 6.0, 3.0);
        assert!((linear - 2.0).abs() < 1e-12 && count <= 3);
        // An obstacle comes into contact after a way of its own: Hertz, with slopes far from the estimate.
        for slope in [1e-4, 1.0, 1e4] {
            let (hertz, count) = solve(|x: f64| (x - 2.0).max(0.0).powf(1.5) - 8.0, slope);
            assert!((hertz - 6.0).abs() < 1e-9 && count < 40, "{hertz} after {count}, {slope}");
        }
        let (kink, count) =
            solve(|x| if x < 1.0 { 1e-3 * (x - 1.0) - 1.0 } else { 1e6 * (x - 1.0) - 1.0 }, 1.0);
        assert!((kink - 1.0).abs() < 1e-5 && count < 60, "{kink} after {count}");
        let (back, _) = solve(|x| x.powi(3) + 27.0, 1.0);
        assert!((back + 3.0).abs() < 1e-9);
        let (jump, count) = solve(|x| if x < 0.7 { -1.0 } else { 2.0 }, 1.0);
        assert!((jump - 0.7).abs() < 1e-15 && count < 80, "{jump} after {count}");
    }
}
