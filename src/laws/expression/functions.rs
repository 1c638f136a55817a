//! The names that an expression may use.

use std::collections::BTreeMap;

use super::program::{Binary, Instruction, Ternary, Unary, Variable};

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

const NAMES: &[(&str, Meaning)] = &[
    ("t", Meaning::Value(Instruction::Variable(Variable::T))),
    ("x", Meaning::Value(Instruction::Variable(Variable::X))),
    ("y", Meaning::Value(Instruction::Variable(Variable::Y))),
    ("z", Meaning::Value(Instruction::Variable(Variable::Z))),
    ("pi", Meaning::Value(Instruction::Number(std::f64::consts::PI))),
    ("e", Meaning::Value(Instruction::Number(std::f64::consts::E))),
    ("inf", Meaning::Value(Instruction::Number(f64::INFINITY))),
    ("min", Meaning::Many(Binary::of_pieces(f64::min, below))),
    ("max", Meaning::Many(Binary::of_pieces(f64::max, below))),
    ("atan2", Meaning::Two(Binary::smooth(f64::atan2))),
    ("hypot", Meaning::Two(Binary::smooth(f64::hypot))),
    ("abs", Meaning::One(Unary::of_pieces(f64::abs, negative))),
    ("sign", Meaning::One(Unary::of_pieces(sign, sign))),
    ("floor", Meaning::One(Unary::of_pieces(f64::floor, f64::floor))),
    ("ceil", Meaning::One(Unary::of_pieces(f64::ceil, f64::ceil))),
    ("round", Meaning::One(Unary::of_pieces(f64::round, f64::round))),
    ("step", Meaning::One(Unary::switch(step))),
    ("if", Meaning::Three(Ternary::of_pieces(choose, |[condition, ..]| nonzero(condition)))),
    ("pulse", Meaning::Three(Ternary::switch(pulse))),
    ("interpolate", Meaning::Points),
    ("sqrt", Meaning::One(Unary::smooth(f64::sqrt))),
    ("cbrt", Meaning::One(Unary::smooth(f64::cbrt))),
    ("exp", Meaning::One(Unary::smooth(f64::exp))),
    ("ln", Meaning::One(Unary::smooth(f64::ln))),
    ("log10", Meaning::One(Unary::smooth(f64::log10))),
    ("sin", Meaning::One(Unary::smooth(f64::sin))),
    ("cos", Meaning::One(Unary::smooth(f64::cos))),
    ("tan", Meaning::One(Unary::smooth(f64::tan))),
    ("asin", Meaning::One(Unary::smooth(f64::asin))),
    ("acos", Meaning::One(Unary::smooth(f64::acos))),
    ("atan", Meaning::One(Unary::smooth(f64::atan))),
    ("sinh", Meaning::One(Unary::smooth(f64::sinh))),
    ("cosh", Meaning::One(Unary::smooth(f64::cosh))),
    ("tanh", Meaning::One(Unary::smooth(f64::tanh))),
];

/// Whether expressions know a name of their own: a function, a variable or a constant.
pub fn is_known(name: &str) -> bool {
    meaning(name).is_some()
}

/// The meaning of `name`.
pub(super) fn meaning(name: &str) -> Option<Meaning> {
    NAMES.iter().find(|(known, _)| *known == name).map(|(_, meaning)| *meaning)
}

/// Every name, variables first.
pub(super) fn names() -> impl Iterator<Item = &'static str> {
    NAMES.iter().map(|(name, _)| *name)
}

/// -1, 0 or 1.
fn sign(number: f64) -> f64 {
    if number == 0.0 { 0.0 } else { number.signum() }
}

/// 0 for negative numbers, else 1.
fn step(number: f64) -> f64 {
    if number.is_nan() { number } else { f64::from(u8::from(number >= 0.0)) }
}

fn nonzero(number: f64) -> f64 {
    if number.is_nan() { number } else { f64::from(u8::from(number != 0.0)) }
}

/// The second value where the first is not 0, else the third.
fn choose([condition, then, otherwise]: [f64; 3]) -> f64 {
    if condition.is_nan() {
        condition
    } else if condition != 0.0 {
        then
    } else {
        otherwise
    }
}

/// 1 from the second number on, until the third is reached; else 0.
fn pulse([number, start, end]: [f64; 3]) -> f64 {
    if number.is_nan() || start.is_nan() || end.is_nan() {
        f64::NAN
    } else {
        f64::from(u8::from(start <= number && number < end))
    }
}

/// Whether a number is below zero.
fn negative(number: f64) -> f64 {
    f64::from(u8::from(number < 0.0))
}

/// Whether the left number is less than the right one.
fn below(left: f64, right: f64) -> f64 {
    f64::from(u8::from(left < right))
}
