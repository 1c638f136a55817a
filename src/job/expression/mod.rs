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

    /// Whether it has the same value everywhere and always.
    pub fn is_constant(&self) -> bool {
        !self.depends_on_time() && !self.depends_on_position()
    }

    /// Whether t occurs in it.
    pub fn depends_on_time(&self) -> bool {
        self.uses(Variable::T)
    }

    /// Whether x, y or z occurs in it.
    pub fn depends_on_position(&self) -> bool {
        [Variable::X, Variable::Y, Variable::Z].into_iter().any(|variable| self.uses(variable))
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
        if self.depth <= SMALL {
            self.run(&mut [0.0; SMALL], time, point)
        } else {
            self.run(&mut vec![0.0; self.depth], time, point)
        }
    }

    fn run(&self, stack: &mut [f64], time: f64, point: &[f64]) -> f64 {
        let mut top = 0;
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
                Instruction::Unary(function) => stack[top - 1] = (function.0)(stack[top - 1]),
                Instruction::Binary(function) => {
                    top -= 1;
                    stack[top - 1] = (function.0)(stack[top - 1], stack[top]);
                }
            }
        }
        stack[0]
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
struct Unary(fn(f64) -> f64);

/// A function of the two topmost values.
#[derive(Clone, Copy)]
struct Binary(fn(f64, f64) -> f64);

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
        std::ptr::fn_addr_eq(self.0, other.0)
    }
}

impl PartialEq for Binary {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::fn_addr_eq(self.0, other.0)
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
