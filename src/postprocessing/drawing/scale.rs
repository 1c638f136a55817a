//! Scales and number formats: axis scales with round ticks, powers of ten, digits.

/// The range of values of a picture, and its ticks.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Scale {
    /// Smallest value shown, in shown units.
    pub low: f64,
    /// Largest value shown, in shown units.
    pub high: f64,
    /// Values and labels of the ticks.
    pub ticks: Vec<(f64, String)>,
    /// The factor from values to shown values, a power of 1000.
    pub factor: f64,
    /// Whether the scale is logarithmic; values are then shown as their logarithms.
    pub logarithmic: bool,
    /// The power of ten before the unit, such as "10⁻³".
    pub power: Option<String>,
}

impl Scale {
    /// A linear scale for these values; its ends are round numbers if `round`, otherwise the extreme values, further apart if numbers show these
    /// as the same.
    pub(super) fn linear(values: impl Iterator<Item = f64>, round: bool) -> Self {
        let (mut low, mut high) = extent(values).unwrap_or((0.0, 1.0));
        let largest = low.abs().max(high.abs());
        let is_one = |shown: f64| {
            if round { high - low <= 1e-12 * largest } else { number(low * shown) == number(high * shown) }
        };
        if is_one(10f64.powi(-thousands(largest))) {
            let room = if high == 0.0 { 1.0 } else { 0.1 * high.abs() };
            (low, high) = (low - room, high + room);
        }
        let exponent = thousands(low.abs().max(high.abs()));
        let factor = 10f64.powi(-exponent);
        let (mut low, mut high) = (low * factor, high * factor);
        let step = round_step((high - low) / 5.0);
        if round {
            (low, high) = ((low / step + 1e-9).floor() * step, (high / step - 1e-9).ceil() * step);
        }
        let decimals = (-step.log10().floor()).max(0.0) as usize;
        let first = (low / step - 1e-9).ceil() as i64;
        let last = (high / step + 1e-9).floor() as i64;
        let tick = |n: i64| (n as f64 * step, with_minus_sign(format!("{:.decimals$}", n as f64 * step)));
        let power = (exponent != 0).then(|| power_of_ten(exponent));
        Self { low, high, ticks: (first..=last).map(tick).collect(), factor, logarithmic: false, power }
    }

    /// A logarithmic scale for these values; values that are not positive are ignored.
    pub(super) fn logarithmic(values: impl Iterator<Item = f64>) -> Self {
        let (low, high) = extent(values.filter(|v| *v > 0.0)).unwrap_or((1e-16, 1.0));
        let low = (low.log10() + 1e-9).floor();
        let high = (high.log10() - 1e-9).ceil().max(low + 1.0);
        let step = ((high - low) / 6.0).ceil().max(1.0) as usize;
        let ticks = (low as i32..=high as i32).step_by(step);
        let ticks = ticks.map(|n| (f64::from(n), power_of_ten(n))).collect();
        Self { low, high, ticks, factor: 1.0, logarithmic: true, power: None }
    }

    /// Position of a value, in shown units; none for values that the scale cannot show.
    pub(super) fn place(&self, value: f64) -> Option<f64> {
        let shown = if self.logarithmic { value.log10() } else { value * self.factor };
        shown.is_finite().then_some(shown)
    }

    /// A range of values in words, with the power of ten of this scale, if it has one.
    pub(super) fn range(&self, ends: [f64; 2], unit: &str) -> String {
        let [low, high] = ends.map(|end| end * self.factor);
        let words = match &self.power {
            None if number(low) == number(high) => format!("{} {unit}", number(low)),
            None => format!("from {} to {} {unit}", number(low), number(high)),
            Some(power) => {
                let largest = low.abs().max(high.abs()).max(1e-300);
                let decimals = 3.0 - largest.log10().floor();
                let [low, high] = [low, high].map(|end| {
                    // A small end keeps a digit, so that only zero is shown as zero.
                    let first = -end.abs().max(1e-12).log10().floor();
                    let decimals = if end == 0.0 { decimals } else { decimals.max(first) };
                    let decimals = decimals.clamp(0.0, 12.0) as usize;
                    let digits = format!("{end:.decimals$}");
                    with_minus_sign(without_trailing_zeros(&digits).to_owned())
                });
                if low == high {
                    format!("{low} × {power} {unit}")
                } else {
                    format!("({low} to {high}) × {power} {unit}")
                }
            }
        };
        words.trim_end().to_owned()
    }

    /// The label of a quantity with its unit in this scale.
    pub(super) fn words(&self, quantity: &str, unit: &str) -> String {
        match (&self.power, unit) {
            (None, "") => quantity.to_owned(),
            (None, unit) if unit.contains('/') && !unit.starts_with('√') => {
                format!("{quantity} / ({unit})")
            }
            (None, unit) => format!("{quantity} / {unit}"),
            (Some(power), "") => format!("{quantity} / {power}"),
            (Some(power), unit) => format!("{quantity} / ({power} {unit})"),
        }
    }
}

/// Smallest and largest finite value.
pub fn extent(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values.filter(|v| v.is_finite()).fold(None, |range, v| {
        let (low, high) = range.unwrap_or((v, v));
        Some((f64::min(low, v), f64::max(high, v)))
    })
}

/// The 1st and the 99th percentile of the finite values.
pub(super) fn percentiles(values: &[f64]) -> Option<(f64, f64)> {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let left_out = sorted.len() / 100;
    let low = *sorted.get(left_out)?;
    Some((low, sorted[sorted.len() - 1 - left_out]))
}

/// The largest of 1, 2 and 5 times a power of ten that is at most `size`, which is positive.
fn round_below(size: f64) -> f64 {
    let power = 10f64.powf(size.log10().floor());
    let leading = size / power;
    power * [5.0, 2.0].into_iter().find(|digit| leading >= *digit - 1e-9).unwrap_or(1.0)
}

fn round_step(about: f64) -> f64 {
    let below = round_below(about);
    if about <= below * (1.0 + 1e-9) { below } else { round_below(below * 2.6) }
}

/// The power of ten, a multiple of 3, that scales a size to about 1; 0 for sizes that need no scaling.
fn thousands(size: f64) -> i32 {
    if size == 0.0 || (0.02..2e4).contains(&size) { 0 } else { ((size.log10() / 3.0).floor() * 3.0) as i32 }
}

/// `10ⁿ` as text.
pub fn power_of_ten(exponent: i32) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let digits = exponent.unsigned_abs().to_string();
    let raised = digits.bytes().filter_map(|digit| DIGITS.get(usize::from(digit.wrapping_sub(b'0'))));
    format!("10{}{}", if exponent < 0 { "⁻" } else { "" }, raised.collect::<String>())
}

/// A number as text: five significant digits, a power of ten if it is very small or large.
pub fn number(value: f64) -> String {
    if !value.is_finite() {
        return value.to_string();
    }
    let size = value.abs();
    if size == 0.0 || (1e-3..1e6).contains(&size) {
        let decimals = if size == 0.0 { 0 } else { (4 - size.log10().floor() as i32).max(0) as usize };
        return with_minus_sign(without_trailing_zeros(&format!("{value:.decimals$}")).to_owned());
    }
    let text = format!("{value:.3e}");
    let (digits, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let power = power_of_ten(exponent.parse().unwrap_or(0));
    with_minus_sign(format!("{} × {power}", without_trailing_zeros(digits)))
}

/// A rounded number as text: three significant digits.
pub fn size(value: f64) -> String {
    let digits = format!("{value:.2e}").parse::<f64>();
    number(digits.unwrap_or(value))
}

/// Without trailing zeros.
fn without_trailing_zeros(digits: &str) -> &str {
    if digits.contains('.') { digits.trim_end_matches('0').trim_end_matches('.') } else { digits }
}

fn with_minus_sign(digits: String) -> String {
    if digits.starts_with('-') && digits.contains(|c: char| ('1'..='9').contains(&c)) {
        digits.replacen('-', "−", 1)
    } else {
        digits.trim_start_matches('-').to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn captions_have_the_power_of_ten_of_the_bar() {
        let range = |low: f64, high: f64, unit: &str| {
            Scale::linear([low, high].into_iter(), false).range([low, high], unit)
        };
        assert_eq!(range(4554.7, 5.5678e7, "Pa"), "(0.005 to 55.68) × 10⁶ Pa");
        assert_eq!(range(-0.25, 0.5, "m"), "from −0.25 to 0.5 m");
        assert_eq!(range(-3e-6, 1.25e-6, ""), "(−3 to 1.25) × 10⁻⁶");
        assert_eq!(range(2.0732e-3, 2.07321e-3, "m/s"), "2.073 × 10⁻³ m/s");
        assert_eq!([range(293.0, 293.001, "K"), range(0.0, 0.0, "Pa")], ["293 K", "0 Pa"]);
    }

    fn words(scale: &Scale) -> Vec<&str> {
        scale.ticks.iter().map(|(_, word)| word.as_str()).collect()
    }

    #[test]
    fn ticks_are_round_and_small_values_carry_their_power_in_the_unit() {
        let scale = Scale::linear([0.0, 0.0075].into_iter(), true);
        assert_eq!(words(&scale), ["0", "2", "4", "6", "8"]);
        assert_eq!(scale.words("velocity", "m/s"), "velocity / (10⁻³ m/s)");
        assert_eq!(scale.place(0.004), Some(4.0));
        assert_eq!(
            words(&Scale::linear([-0.25, 0.31].into_iter(), true)),
            ["−0.4", "−0.2", "0.0", "0.2", "0.4"]
        );
        assert_eq!(
            words(&Scale::linear([0.0, 1.0].into_iter(), false)),
            ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]
        );
    }

    #[test]
    fn a_constant_still_has_a_range() {
        for value in [0.0, 3.0, -1e-9] {
            let scale = Scale::linear([value, value].into_iter(), true);
            assert!(scale.low < scale.high && !scale.ticks.is_empty(), "{scale:?}");
        }
        assert!(!Scale::linear(std::iter::empty(), true).ticks.is_empty());
        for value in [1.0, 100.0, 3e-5] {
            let scale = Scale::logarithmic([value, value].into_iter());
            assert!(scale.low < scale.high && scale.ticks.len() > 1, "{scale:?}");
        }
    }

    #[test]
    fn powers_of_ten_enclose_the_values_and_zero_has_no_place() {
        let scale = Scale::logarithmic([0.0, 3e-14, 2e-9].into_iter());
        assert_eq!((scale.low, scale.high), (-14.0, -8.0));
        assert_eq!(words(&scale)[0], "10⁻¹⁴");
        assert_eq!(scale.place(0.0), None);
    }

    #[test]
    fn numbers_have_five_digits() {
        let cases =
            [(40.54326475, "40.543"), (1e-9, "1 × 10⁻⁹"), (-0.5, "−0.5"), (2048.0, "2048"), (0.0, "0")];
        for (value, text) in cases {
            assert_eq!(number(value), text);
        }
        assert_eq!(number(-2.7003e-8), "−2.7 × 10⁻⁸");
        assert_eq!([7.0702, 0.012345, 123456.0].map(size), ["7.07", "0.0123", "123000"]);
    }

    #[test]
    fn a_hundredth_of_the_values_is_left_out_at_either_end() {
        let mut values: Vec<f64> = (0..200).map(f64::from).collect();
        (values[7], values[100]) = (-1e9, f64::NAN);
        assert_eq!(percentiles(&values), Some((0.0, 198.0)));
        assert_eq!(percentiles(&[3.0, 1.0, 2.0]), Some((1.0, 3.0)));
        assert_eq!(percentiles(&[f64::NAN]), None);
    }

    #[test]
    fn round_numbers_below() {
        assert_eq!([7.0, 5.0, 4.9, 1.0, 0.21].map(round_below), [5.0, 5.0, 2.0, 1.0, 0.2]);
    }
}
