//! The names that an expression may use.

use super::interval::{Interval, Real};
use super::program::{Binary, Instruction, Piece, Ternary, Unary, Variable};
use std::collections::BTreeMap;

/// Numbers with names, which expressions may contain beside functions, variables and constants.
pub type Names = BTreeMap<String, f64>;

/// Meaning of a name.
#[derive(Clone, Copy)]
pub(super) enum Meaning {
    /// A variable or a constant.
    Value(Instruction),
    /// A function of one argument.
    One(Unary),
    /// A function of two arguments.
    Two(Binary),
    /// A function of two or more arguments, applied from left to right.
    Many(Binary),
    /// A function of three arguments.
    Three(Ternary),
    /// The first argument interpolated in the points that follow, as numbers.
    Points,
}

/// A smooth function of one argument, with its derivative.
macro_rules! smooth {
    ($function:ident, $argument:ident => $slope:expr) => {{
        fn value<R: Real>(argument: R) -> R {
            argument.$function()
        }
        fn slope<R: Real>($argument: R) -> R {
            $slope
        }
        Unary::smooth([value, slope], [value, slope])
    }};
}

/// A smooth function of two arguments, with its derivatives.
macro_rules! smooth_of_two {
    ($value:expr, ($left:ident, $right:ident) => $slopes:expr) => {{
        fn value<R: Real>($left: R, $right: R) -> R {
            $value
        }
        #[allow(unused_variables)]
        fn slopes<R: Real>($left: R, $right: R) -> [R; 2] {
            $slopes
        }
        Binary::smooth((value, slopes), (value, slopes))
    }};
}
pub(super) use smooth_of_two;

/// A nondecreasing function of steps.
macro_rules! steps {
    ($function:expr) => {{
        fn values(argument: Interval) -> Interval {
            Interval { low: $function(argument.low), high: $function(argument.high), ..argument }
        }
        Unary::of_steps($function, values)
    }};
}

/// A comparison of two numbers: 1 where it holds, else 0.
macro_rules! comparison {
    ($operator:tt) => {{
        fn at(a: f64, b: f64) -> f64 {
            if a.is_nan() || b.is_nan() { f64::NAN } else { f64::from(u8::from(a $operator b)) }
        }
        fn decide(a: Interval, b: Interval) -> Option<f64> {
            let corners = [at(a.low, b.low), at(a.low, b.high), at(a.high, b.low), at(a.high, b.high)];
            corners.iter().all(|corner| *corner == corners[0]).then_some(corners[0])
        }
        Binary::switch(at, decide)
    }};
}
pub(super) use comparison;

const ONE: f64 = 1.0;

const NAMES: &[(&str, Meaning)] = &[
    ("pi", Meaning::Value(Instruction::Number(std::f64::consts::PI))),
    ("e", Meaning::Value(Instruction::Number(std::f64::consts::E))),
    ("inf", Meaning::Value(Instruction::Number(f64::INFINITY))),
    ("min", Meaning::Many(MIN)),
    ("max", Meaning::Many(MAX)),
    ("atan2", Meaning::Two(ATAN2)),
    ("hypot", Meaning::Two(HYPOT)),
    ("abs", Meaning::One(Unary::abs())),
    ("sign", Meaning::One(steps!(sign))),
    ("floor", Meaning::One(steps!(f64::floor))),
    ("ceil", Meaning::One(steps!(f64::ceil))),
    ("round", Meaning::One(steps!(f64::round))),
    ("step", Meaning::One(steps!(step).switch())),
    ("if", Meaning::Three(CHOICE)),
    ("pulse", Meaning::Three(PULSE)),
    ("interpolate", Meaning::Points),
    ("sqrt", Meaning::One(smooth!(sqrt, a => R::from(0.5) / a.sqrt()).sharing(|_| Interval::from(0.5)))),
    ("cbrt", Meaning::One(smooth!(cbrt, a => R::from(1.0 / 3.0) / a.cbrt().square()))),
    ("exp", Meaning::One(smooth!(exp, a => a.exp()).sharing(|a| a))),
    ("ln", Meaning::One(smooth!(ln, a => R::from(ONE) / a))),
    ("log10", Meaning::One(smooth!(log10, a => R::from(std::f64::consts::LOG10_E) / a))),
    ("sin", Meaning::One(smooth!(sin, a => a.cos()))),
    ("cos", Meaning::One(smooth!(cos, a => -a.sin()))),
    ("tan", Meaning::One(smooth!(tan, a => R::from(ONE) + a.tan().square()))),
    ("asin", Meaning::One(smooth!(asin, a => R::from(ONE) / (R::from(ONE) - a.square()).sqrt()))),
    ("acos", Meaning::One(smooth!(acos, a => -R::from(ONE) / (R::from(ONE) - a.square()).sqrt()))),
    ("atan", Meaning::One(smooth!(atan, a => R::from(ONE) / (R::from(ONE) + a.square())))),
    ("sinh", Meaning::One(smooth!(sinh, a => a.cosh()))),
    ("cosh", Meaning::One(smooth!(cosh, a => a.sinh()))),
    ("tanh", Meaning::One(smooth!(tanh, a => R::from(ONE) / a.cosh().square()))),
];

/// Whether the left number is less than the right one.
const BELOW: Piece = Piece {
    at: |left, right| f64::from(u8::from(left < right)),
    decide: |left, right| {
        (left.high < right.low || left.low >= right.high).then(|| f64::from(u8::from(left.high < right.low)))
    },
};
const MIN: Binary = Binary::smooth(
    (f64::min, |left, right| if left < right { [1.0, 0.0] } else { [0.0, 1.0] }),
    (
        |left, right| Interval {
            low: left.low.min(right.low),
            high: left.high.min(right.high),
            ..left.hull(right)
        },
        |left, right| chosen(left, right),
    ),
)
.piecewise(BELOW);
const MAX: Binary = Binary::smooth(
    (f64::max, |left, right| if left < right { [0.0, 1.0] } else { [1.0, 0.0] }),
    (
        |left, right| Interval {
            low: left.low.max(right.low),
            high: left.high.max(right.high),
            ..left.hull(right)
        },
        |left, right| chosen(right, left),
    ),
)
.piecewise(BELOW);

/// The derivatives of the smaller one of two numbers, or of the larger one of the second and the first.
fn chosen(smaller: Interval, larger: Interval) -> [Interval; 2] {
    let either = Interval::new(0.0, 1.0);
    match (BELOW.decide)(smaller, larger) {
        Some(1.0) => [Interval::from(1.0), Interval::from(0.0)],
        Some(_) => [Interval::from(0.0), Interval::from(1.0)],
        None => [either; 2],
    }
}

/// The second value where the first is not 0, else the third.
const CHOICE: Ternary = Ternary {
    piece: |[condition, ..]| {
        if condition.is_nan() { condition } else { f64::from(u8::from(condition != 0.0)) }
    },
    decide: |[condition, ..]| match condition.contains(0.0) {
        false => Some(1.0),
        true => condition.is(0.0).then_some(0.0),
    },
    switches: false,
};
/// 1 from the second number on, until the third is reached; else 0.
const PULSE: Ternary = Ternary {
    piece: |[number, start, end]| match [number, start, end].iter().any(|x| x.is_nan()) {
        true => f64::NAN,
        false => f64::from(u8::from(start <= number && number < end)),
    },
    decide: |[number, start, end]| {
        if start.high <= number.low && number.high < end.low {
            return Some(1.0);
        }
        (number.high < start.low || end.high <= number.low).then_some(0.0)
    },
    switches: true,
};

const ATAN2: Binary = smooth_of_two!(left.arc(right), (left, right) => {
    let square = left.square() + right.square();
    [right / square, -left / square]
});
const HYPOT: Binary = smooth_of_two!(left.length(right), (left, right) => {
    let length = left.length(right);
    [left / length, right / length]
});

/// The meaning of `name`, if it is one of these variables, a constant or a function.
pub(super) fn meaning(name: &str, variables: &[Variable]) -> Option<Meaning> {
    let variable = variables.iter().find(|variable| variable.name() == name);
    let value = variable.map(|variable| Meaning::Value(Instruction::Variable(*variable)));
    value.or_else(|| NAMES.iter().find(|(known, _)| *known == name).map(|(_, meaning)| *meaning))
}

/// Every name, variables first.
pub(super) fn names(variables: &[Variable]) -> impl Iterator<Item = &'static str> {
    variables.iter().map(|variable| variable.name()).chain(NAMES.iter().map(|(name, _)| *name))
}

/// -1, 0 or 1.
fn sign(number: f64) -> f64 {
    if number == 0.0 { 0.0 } else { number.signum() }
}

/// 0 for negative numbers, else 1.
fn step(number: f64) -> f64 {
    if number.is_nan() { number } else { f64::from(u8::from(number >= 0.0)) }
}
