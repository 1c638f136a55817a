//! Numbers that may be expressions in t, x, y, z.
//!
//! An expression is compiled once to a short program for a stack machine, so that it can be evaluated at every
//! node and step, by any thread.

mod compile;
mod functions;

use std::borrow::Cow;
use std::fmt;
use std::sync::Arc;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{self, Deserializer, Visitor};
use serde::{Deserialize, Serialize, Serializer};

pub use compile::Fault;

/// Values on the stack that need no allocation to evaluate.
const SMALL: usize = 32;

/// A number, or an expression in t, x, y, z.
#[derive(Debug, Clone, PartialEq)]
pub enum Scalar {
    /// A number.
    Number(f64),
    /// An expression.
    Expression(Expression),
}

impl Scalar {
    /// Value at `time` and `point` (one coordinate an axis; missing ones are zero).
    pub fn evaluate(&self, time: f64, point: &[f64]) -> f64 {
        match self {
            Self::Number(number) => *number,
            Self::Expression(expression) => expression.evaluate(time, point),
        }
    }

    /// Whether t occurs in it.
    pub fn depends_on_time(&self) -> bool {
        self.uses(Variable::T)
    }

    /// Whether x, y or z occurs in it.
    pub fn depends_on_position(&self) -> bool {
        [Variable::X, Variable::Y, Variable::Z].into_iter().any(|variable| self.uses(variable))
    }

    /// Whether it is made of pieces, as by min or abs.
    pub fn has_pieces(&self) -> bool {
        let Self::Expression(expression) = self else { return false };
        expression.program.iter().any(|instruction| match instruction {
            Instruction::Unary(function) => function.piece.is_some(),
            Instruction::Binary(function) => function.piece.is_some(),
            _ => false,
        })
    }

    /// A digest of the pieces that its value at `time` and `point` comes from: another one where another piece holds.
    pub fn pieces(&self, time: f64, point: &[f64]) -> u64 {
        match self {
            Self::Number(_) => 0,
            Self::Expression(expression) => expression.pieces(time, point),
        }
    }

    /// Whether `variable` occurs in it.
    pub fn uses(&self, variable: Variable) -> bool {
        matches!(self, Self::Expression(expression) if expression.program.contains(&Instruction::Variable(variable)))
    }
}

impl Default for Scalar {
    fn default() -> Self {
        Self::Number(0.0)
    }
}

/// What an expression may depend on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Variable {
    /// Time in seconds.
    T,
    /// First coordinate in metres.
    X,
    /// Second coordinate.
    Y,
    /// Third coordinate.
    Z,
}

/// A compiled expression; clones share the program.
#[derive(Debug, Clone)]
pub struct Expression {
    text: Arc<str>,
    program: Arc<[Instruction]>,
    depth: usize,
}

impl Expression {
    /// Compiles `text`; a fault says where in the text it is.
    pub fn parse(text: &str) -> Result<Self, Fault> {
        let program = compile::compile(text)?;
        let depth = stack_depth(&program);
        Ok(Self { text: text.into(), program: program.into(), depth })
    }

    /// The expression as it was written.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Value at `time` and `point`; not finite where the expression has no value, as in sqrt(-1).
    pub fn evaluate(&self, time: f64, point: &[f64]) -> f64 {
        self.with_stack(|stack| self.run::<false>(stack, time, point).0)
    }

    fn pieces(&self, time: f64, point: &[f64]) -> u64 {
        self.with_stack(|stack| self.run::<true>(stack, time, point).1)
    }

    fn with_stack<T>(&self, run: impl FnOnce(&mut [f64]) -> T) -> T {
        if self.depth <= SMALL { run(&mut [0.0; SMALL]) } else { run(&mut vec![0.0; self.depth]) }
    }

    /// The value, and the digest of its pieces if that is wanted.
    fn run<const PIECES: bool>(&self, stack: &mut [f64], time: f64, point: &[f64]) -> (f64, u64) {
        let (mut top, mut digest) = (0, 0);
        let mut note = |piece: f64| digest = mix(digest, piece);
        for instruction in self.program.iter() {
            match instruction {
                Instruction::Number(number) => {
                    stack[top] = *number;
                    top += 1;
                }
                Instruction::Variable(variable) => {
                    stack[top] = match variable {
                        Variable::T => time,
                        coordinate => point.get(*coordinate as usize - 1).copied().unwrap_or(0.0),
                    };
                    top += 1;
                }
                Instruction::Unary(function) => {
                    let argument = stack[top - 1];
                    if let (true, Some(piece)) = (PIECES, function.piece) {
                        note(piece(argument));
                    }
                    stack[top - 1] = (function.value)(argument);
                }
                Instruction::Binary(function) => {
                    top -= 1;
                    let (left, right) = (stack[top - 1], stack[top]);
                    if let (true, Some(piece)) = (PIECES, function.piece) {
                        note(piece(left, right));
                    }
                    stack[top - 1] = (function.value)(left, right);
                }
            }
        }
        (stack[0], digest)
    }
}

impl PartialEq for Expression {
    fn eq(&self, other: &Self) -> bool {
        self.text == other.text
    }
}

/// One step of the stack machine.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Instruction {
    Number(f64),
    Variable(Variable),
    Unary(Unary),
    Binary(Binary),
}

/// A function of the topmost value.
#[derive(Clone, Copy)]
struct Unary {
    value: fn(f64) -> f64,
    /// Tells which piece holds, if it has several.
    piece: Option<fn(f64) -> f64>,
}

impl Unary {
    const fn smooth(value: fn(f64) -> f64) -> Self {
        Self { value, piece: None }
    }

    const fn of_pieces(value: fn(f64) -> f64, piece: fn(f64) -> f64) -> Self {
        Self { value, piece: Some(piece) }
    }
}

/// A function of the two topmost values.
#[derive(Clone, Copy)]
struct Binary {
    value: fn(f64, f64) -> f64,
    /// Tells which piece holds, if it has several.
    piece: Option<fn(f64, f64) -> f64>,
}

impl Binary {
    const fn smooth(value: fn(f64, f64) -> f64) -> Self {
        Self { value, piece: None }
    }

    const fn of_pieces(value: fn(f64, f64) -> f64, piece: fn(f64, f64) -> f64) -> Self {
        Self { value, piece: Some(piece) }
    }
}

/// A digest with one more number in it.
fn mix(digest: u64, number: f64) -> u64 {
    (digest ^ number.to_bits()).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29)
}

impl fmt::Debug for Unary {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("Unary")
    }
}

impl fmt::Debug for Binary {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("Binary")
    }
}

impl PartialEq for Unary {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::fn_addr_eq(self.value, other.value)
    }
}

impl PartialEq for Binary {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::fn_addr_eq(self.value, other.value)
    }
}

fn stack_depth(program: &[Instruction]) -> usize {
    let (mut now, mut most) = (0_usize, 0);
    for instruction in program {
        match instruction {
            Instruction::Number(_) | Instruction::Variable(_) => now += 1,
            Instruction::Unary(_) => {}
            Instruction::Binary(_) => now -= 1,
        }
        most = most.max(now);
    }
    most
}

impl Serialize for Scalar {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Number(number) => serializer.serialize_f64(*number),
            Self::Expression(expression) => serializer.serialize_str(expression.text()),
        }
    }
}

impl<'de> Deserialize<'de> for Scalar {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(ScalarVisitor)
    }
}

struct ScalarVisitor;

impl Visitor<'_> for ScalarVisitor {
    type Value = Scalar;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("a number or an expression in t, x, y, z")
    }

    fn visit_f64<E: de::Error>(self, number: f64) -> Result<Scalar, E> {
        Ok(Scalar::Number(number))
    }

    fn visit_i64<E: de::Error>(self, number: i64) -> Result<Scalar, E> {
        Ok(Scalar::Number(number as f64))
    }

    fn visit_u64<E: de::Error>(self, number: u64) -> Result<Scalar, E> {
        Ok(Scalar::Number(number as f64))
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<Scalar, E> {
        Expression::parse(text).map(Scalar::Expression).map_err(|fault| E::custom(fault.message))
    }
}

impl JsonSchema for Scalar {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "Scalar".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": ["number", "string"], "format": "expression" })
    }
}

#[cfg(test)]
mod tests;
