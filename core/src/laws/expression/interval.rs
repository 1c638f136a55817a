//! Intervals with outward rounding: enclosures of all values that a function takes.
//!
//! Sums, products, quotients and roots are rounded outward by one unit in the last place, other functions by four, which is more
//! than the errors of the mathematical library. An empty or partial domain, as of `ln` of a negative number, is remembered.

use std::f64::consts::{PI, TAU};
use std::ops::{Add, Div, Mul, Neg, Sub};

macro_rules! of_numbers {
    ($($function:ident)*) => {
        $(fn $function(self) -> Self {
            f64::$function(self)
        })*
    };
}

/// Numbers from which the rules of differentiation are written once: numbers and intervals.
pub(super) trait Real:
    Copy
    + From<f64>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    fn abs(self) -> Self;
    fn square(self) -> Self;
    fn power(self, exponent: Self) -> Self;
    fn arc(self, abscissa: Self) -> Self;
    fn length(self, other: Self) -> Self;
    fn sqrt(self) -> Self;
    fn cbrt(self) -> Self;
    fn exp(self) -> Self;
    fn ln(self) -> Self;
    fn log10(self) -> Self;
    fn sin(self) -> Self;
    fn cos(self) -> Self;
    fn tan(self) -> Self;
    fn asin(self) -> Self;
    fn acos(self) -> Self;
    fn atan(self) -> Self;
    fn sinh(self) -> Self;
    fn cosh(self) -> Self;
    fn tanh(self) -> Self;
}

/// All numbers from `low` to `high`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    /// Lower end; minus infinity if there is none.
    pub low: f64,
    /// Upper end; infinite if there is none.
    pub high: f64,
    /// Whether the function has a value everywhere.
    pub is_defined: bool,
}

impl Interval {
    /// All numbers, perhaps with places where a function has no value.
    const NOTHING_KNOWN: Self = Self { low: f64::NEG_INFINITY, high: f64::INFINITY, is_defined: false };

    /// From `low` to `high`.
    pub fn new(low: f64, high: f64) -> Self {
        if low <= high { Self { low, high, is_defined: true } } else { Self::NOTHING_KNOWN }
    }

    /// Whether it contains a number.
    pub fn contains(self, number: f64) -> bool {
        self.low <= number && number <= self.high
    }

    /// The absolute values of its numbers.
    pub fn size(self) -> Self {
        Real::abs(self)
    }

    /// Whether it is this number alone.
    pub(super) fn is(self, number: f64) -> bool {
        self.low == number && self.high == number
    }

    /// The smallest interval that contains both.
    pub(super) fn hull(self, other: Self) -> Self {
        let is_defined = self.is_defined && other.is_defined;
        Self { low: self.low.min(other.low), high: self.high.max(other.high), is_defined }
    }

    /// The numbers that are in both of two intervals that enclose the same ones.
    pub(super) fn meet(self, other: Self) -> Self {
        Self { low: self.low.max(other.low), high: self.high.min(other.high), ..self }
    }

    /// The same numbers, defined where both are.
    fn defined_with(self, other: Self) -> Self {
        Self { is_defined: self.is_defined && other.is_defined, ..self }
    }

    /// These ends, rounded outward by `units` in the last place.
    fn outward(self, low: f64, high: f64, units: usize) -> Self {
        if low.is_nan() || high.is_nan() {
            return Self::NOTHING_KNOWN;
        }
        let low = (0..units).fold(low, |low, _| low.next_down());
        let high = (0..units).fold(high, |high, _| high.next_up());
        Self { low, high, ..self }
    }

    /// As [`outward`](Self::outward), for products and quotients: rounding does not change their sign.
    fn outward_with_sign(self, low: f64, high: f64) -> Self {
        let wide = self.outward(low, high, 1);
        let wide = if low >= 0.0 { Self { low: wide.low.max(0.0), ..wide } } else { wide };
        if high <= 0.0 { Self { high: wide.high.min(0.0), ..wide } } else { wide }
    }

    /// The values of an increasing function of the mathematical library, which lie between `least` and `most`; its value at 0 is exact.
    fn increasing(self, function: fn(f64) -> f64, [least, most]: [f64; 2]) -> Self {
        let (low, high, at_zero) = (function(self.low), function(self.high), function(0.0));
        let wide = self.outward(low, high, 4);
        // Rounding passes neither the value at 0 nor the limits.
        let least = if self.low >= 0.0 { least.max(at_zero) } else { least };
        let most = if self.high <= 0.0 { most.min(at_zero) } else { most };
        Self { low: wide.low.max(least), high: wide.high.min(most), ..wide }
    }

    /// The part of it on which a function with this domain has values.
    fn within(self, least: f64, most: f64) -> Option<Self> {
        let is_defined = self.is_defined && least <= self.low && self.high <= most;
        let (low, high) = (self.low.max(least), self.high.min(most));
        (low <= high).then_some(Self { low, high, is_defined })
    }

    /// Whether it contains a number `first + k period` with an integer `k`, or may do so.
    fn meets(self, first: f64, period: f64) -> bool {
        let slack = 1e-9 * (1.0 + self.low.abs().max(self.high.abs()));
        ((self.high + slack - first) / period).floor() != ((self.low - slack - first) / period).floor()
    }

    /// Sine (`shift` 0) or cosine (a quarter of the period).
    fn wave(self, function: fn(f64) -> f64, top: f64) -> Self {
        let is_wide = self.high - self.low >= TAU || self.low.abs().max(self.high.abs()) > 1e6;
        let [a, b] = [self.low, self.high].map(function);
        let (at_top, at_bottom) = (is_wide || self.meets(top, TAU), is_wide || self.meets(top + PI, TAU));
        let low = if at_bottom { -1.0 } else { a.min(b) };
        let high = if at_top { 1.0 } else { a.max(b) };
        let wide = self.outward(low, high, 4);
        Self { low: wide.low.max(-1.0), high: wide.high.min(1.0), ..wide }
    }

    /// Its power with a whole exponent that is not negative.
    fn whole_power(self, exponent: f64) -> Self {
        if exponent == 0.0 {
            return Self { low: 1.0, high: 1.0, ..self };
        }
        let [a, b] = [self.low, self.high].map(|end| end.powf(exponent));
        if exponent % 2.0 != 0.0 {
            let wide = self.outward(a, b, 4);
            let low = if self.low >= 0.0 { wide.low.max(0.0) } else { wide.low };
            let high = if self.high <= 0.0 { wide.high.min(0.0) } else { wide.high };
            return Self { low, high, ..wide };
        }
        let least = if self.contains(0.0) { 0.0 } else { a.min(b) };
        let wide = self.outward(least, a.max(b), 4);
        Self { low: wide.low.max(0.0), ..wide }
    }
}

/// Whether the sum of two numbers is not rounded (Knuth's error term).
fn is_exact_sum(a: f64, b: f64) -> bool {
    let sum = a + b;
    let part = sum - a;
    (a - (sum - part)) + (b - part) == 0.0
}

impl From<f64> for Interval {
    fn from(number: f64) -> Self {
        Self::new(number, number)
    }
}

impl Add for Interval {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        let sum = self.defined_with(other);
        if self.is(0.0) {
            return other.defined_with(self);
        }
        if other.is(0.0) {
            return sum;
        }
        let (low, high) = (self.low + other.low, self.high + other.high);
        let wide = sum.outward(low, high, 1);
        Self {
            low: if is_exact_sum(self.low, other.low) { low } else { wide.low },
            high: if is_exact_sum(self.high, other.high) { high } else { wide.high },
            ..wide
        }
    }
}

impl Sub for Interval {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Interval {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        let product = self.defined_with(other);
        for (unit, factor) in [(self, other), (other, self)] {
            if unit.is(0.0) || unit.is(1.0) {
                let of_unit = if unit.is(0.0) { unit } else { factor };
                return of_unit.defined_with(product);
            }
        }
        // Zero times a number that is finite, however large.
        let times = |a: f64, b: f64| if a == 0.0 || b == 0.0 { 0.0 } else { a * b };
        let ends = [
            times(self.low, other.low),
            times(self.low, other.high),
            times(self.high, other.low),
            times(self.high, other.high),
        ];
        let low = ends.iter().fold(f64::INFINITY, |low, end| low.min(*end));
        let high = ends.iter().fold(f64::NEG_INFINITY, |high, end| high.max(*end));
        product.outward_with_sign(low, high)
    }
}

impl Div for Interval {
    type Output = Self;

    fn div(self, other: Self) -> Self {
        let quotient = self.defined_with(other);
        if other.contains(0.0) {
            if other.is(0.0) {
                return Self::NOTHING_KNOWN;
            }
            // On one side of zero: the quotient has one sign, if the numerator has.
            let inverse = if other.low == 0.0 {
                Self { low: (1.0 / other.high).next_down().max(0.0), high: f64::INFINITY, is_defined: false }
            } else if other.high == 0.0 {
                Self { low: f64::NEG_INFINITY, high: (1.0 / other.low).next_up().min(0.0), is_defined: false }
            } else {
                return Self::NOTHING_KNOWN;
            };
            return self * inverse;
        }
        if other.is(1.0) || self.is(0.0) {
            return quotient;
        }
        self * quotient.outward_with_sign(1.0 / other.high, 1.0 / other.low)
    }
}

impl Neg for Interval {
    type Output = Self;

    fn neg(self) -> Self {
        Self { low: -self.high, high: -self.low, ..self }
    }
}

impl Real for Interval {
    fn abs(self) -> Self {
        let [a, b] = [self.low.abs(), self.high.abs()];
        Self { low: if self.contains(0.0) { 0.0 } else { a.min(b) }, high: a.max(b), ..self }
    }

    fn square(self) -> Self {
        self.whole_power(2.0)
    }

    fn power(self, exponent: Self) -> Self {
        let is_whole = exponent.low == exponent.high && exponent.low.fract() == 0.0;
        if is_whole && exponent.low.abs() < 1e3 {
            let power = self.whole_power(exponent.low.abs()).defined_with(exponent);
            return if exponent.low < 0.0 { Self::from(1.0) / power } else { power };
        }
        let Some(base) = self.within(0.0, f64::INFINITY) else { return Self::NOTHING_KNOWN };
        // Monotone in the base and in the exponent, so that the extremes are at corners.
        let ends = [(base.low, exponent.low), (base.low, exponent.high), (base.high, exponent.low)];
        let last = base.high.powf(exponent.high);
        let all = ends.map(|(base, exponent)| base.powf(exponent));
        let low = all.iter().fold(last, |low, end| low.min(*end));
        let high = all.iter().fold(last, |high, end| high.max(*end));
        let is_singular = base.low == 0.0 && exponent.low <= 0.0;
        let wide = base.defined_with(exponent).outward(low, high, 4);
        Self { low: wide.low.max(0.0), is_defined: wide.is_defined && !is_singular, ..wide }
    }

    fn arc(self, abscissa: Self) -> Self {
        if abscissa.low > 0.0 {
            return (self / abscissa).atan();
        }
        Self::new(-PI.next_up(), PI.next_up()).defined_with(self).defined_with(abscissa)
    }

    fn length(self, other: Self) -> Self {
        (self.square() + other.square()).sqrt()
    }

    fn sqrt(self) -> Self {
        self.within(0.0, f64::INFINITY)
            .map_or(Self::NOTHING_KNOWN, |part| part.increasing(f64::sqrt, [0.0, f64::INFINITY]))
    }

    fn cbrt(self) -> Self {
        self.increasing(f64::cbrt, [f64::NEG_INFINITY, f64::INFINITY])
    }

    fn exp(self) -> Self {
        self.increasing(f64::exp, [0.0, f64::INFINITY])
    }

    fn ln(self) -> Self {
        let all = [f64::NEG_INFINITY, f64::INFINITY];
        let part =
            self.within(0.0, f64::INFINITY).map_or(Self::NOTHING_KNOWN, |part| part.increasing(f64::ln, all));
        Self { is_defined: part.is_defined && self.low > 0.0, ..part }
    }

    fn log10(self) -> Self {
        let all = [f64::NEG_INFINITY, f64::INFINITY];
        let part = self
            .within(0.0, f64::INFINITY)
            .map_or(Self::NOTHING_KNOWN, |part| part.increasing(f64::log10, all));
        Self { is_defined: part.is_defined && self.low > 0.0, ..part }
    }

    fn sin(self) -> Self {
        self.wave(f64::sin, 0.5 * PI)
    }

    fn cos(self) -> Self {
        self.wave(f64::cos, 0.0)
    }

    fn tan(self) -> Self {
        if self.high - self.low >= PI || self.low.abs().max(self.high.abs()) > 1e6 || self.meets(0.5 * PI, PI)
        {
            return Self::NOTHING_KNOWN;
        }
        self.increasing(f64::tan, [f64::NEG_INFINITY, f64::INFINITY])
    }

    fn asin(self) -> Self {
        self.within(-1.0, 1.0).map_or(Self::NOTHING_KNOWN, |part| part.increasing(f64::asin, [-2.0, 2.0]))
    }

    fn acos(self) -> Self {
        self.within(-1.0, 1.0)
            .map_or(Self::NOTHING_KNOWN, |part| part.outward(part.high.acos(), part.low.acos(), 4))
    }

    fn atan(self) -> Self {
        self.increasing(f64::atan, [-2.0, 2.0])
    }

    fn sinh(self) -> Self {
        self.increasing(f64::sinh, [f64::NEG_INFINITY, f64::INFINITY])
    }

    fn cosh(self) -> Self {
        self.abs().increasing(f64::cosh, [1.0, f64::INFINITY])
    }

    fn tanh(self) -> Self {
        self.increasing(f64::tanh, [-1.0, 1.0])
    }
}

impl Real for f64 {
    fn abs(self) -> Self {
        f64::abs(self)
    }

    fn square(self) -> Self {
        self * self
    }

    fn power(self, exponent: Self) -> Self {
        self.powf(exponent)
    }

    fn arc(self, abscissa: Self) -> Self {
        self.atan2(abscissa)
    }

    fn length(self, other: Self) -> Self {
        self.hypot(other)
    }

    of_numbers!(sqrt cbrt exp ln log10 sin cos tan asin acos atan sinh cosh tanh);
}
