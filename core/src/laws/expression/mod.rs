//! Numbers that may be expressions in t, x, y, z, and laws that are formulas in variables of their own.
//!
//! An expression is compiled once to a short program for a stack machine, so that it can be evaluated at every
//! node and step, by any thread. The same program runs on several machines: for values, the pieces that determine them, derivatives,
//! enclosures over ranges of the variables, from which bounds of a law are proven, and times at which it switches.

mod analysis;
mod breakpoints;
mod compile;
mod enclosure;
mod evaluate;
mod formula;
mod functions;
mod interval;
mod program;

use std::borrow::Cow;
use std::fmt;
use std::sync::Arc;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{self, Deserializer, Visitor};
use serde::{Deserialize, Serialize, Serializer};

pub use analysis::{Border, Place, REACH, Supremum, Unproven};
pub use breakpoints::{Breakpoints, Span};
pub use compile::Fault;
pub use enclosure::Enclosure;
use evaluate::Arguments;
pub use formula::{Formula, OfCreep, OfMotion, OfRate, OfSliding, OfStrain, Scope, short};
pub use functions::Names;
pub use interval::Interval;
pub use program::Variable;
use program::{COUNT, Program};

/// A number, or an expression in t, x, y, z.
#[derive(Debug, Clone, PartialEq)]
pub enum Scalar {
    /// A number.
    Number(f64),
    /// An expression.
    Expression(Expression),
}

impl Scalar {
    /// Value at `time` and `point` (one coordinate for each axis; missing ones are zero).
    pub fn evaluate(&self, time: f64, point: &[f64]) -> f64 {
        match self {
            Self::Number(number) => *number,
            Self::Expression(expression) => expression.evaluate(time, point),
        }
    }

    /// Contains its value at `time` and `point` without rounding, and what rounding in the evaluation makes of it.
    pub fn enclose(&self, time: f64, point: &[f64]) -> Interval {
        match self {
            Self::Number(number) => Interval::from(*number),
            Self::Expression(expression) => {
                let ranges = arguments(time, point).map(Interval::from);
                expression.program.enclose(&ranges, Variable::T).value
            }
        }
    }

    /// Contains its values at `point` between two times.
    pub fn enclose_during(&self, [start, end]: [f64; 2], point: &[f64]) -> Interval {
        match self {
            Self::Number(number) => Interval::from(*number),
            Self::Expression(expression) => {
                let mut ranges = arguments(start, point).map(Interval::from);
                ranges[Variable::T as usize] = Interval::new(start, end);
                expression.program.enclose(&ranges, Variable::T).value
            }
        }
    }

    /// Whether it contains t.
    pub fn depends_on_time(&self) -> bool {
        self.uses(Variable::T)
    }

    /// Whether it contains x, y or z.
    pub fn depends_on_position(&self) -> bool {
        [Variable::X, Variable::Y, Variable::Z].into_iter().any(|variable| self.uses(variable))
    }

    /// Whether it is piecewise, for example because of min or abs.
    pub fn has_pieces(&self) -> bool {
        matches!(self, Self::Expression(expression) if expression.program.has_pieces())
    }

    /// A digest of the pieces that determine its value at `time` and `point`; it differs where another piece is active.
    pub fn pieces(&self, time: f64, point: &[f64]) -> u64 {
        match self {
            Self::Number(_) => 0,
            Self::Expression(expression) => expression.program.pieces(&arguments(time, point)),
        }
    }

    /// Times at which it switches or a table has a kink or ends, found from arguments that are linear functions of time.
    pub fn breakpoints(&self) -> Breakpoints {
        match self {
            Self::Number(_) => Breakpoints::default(),
            Self::Expression(expression) => expression.program.breakpoints(),
        }
    }

    /// Whether it contains `variable`.
    pub fn uses(&self, variable: Variable) -> bool {
        matches!(self, Self::Expression(expression) if expression.uses(variable))
    }
}

impl Default for Scalar {
    fn default() -> Self {
        Self::Number(0.0)
    }
}

/// An expression whose text had names of numbers.
#[derive(Debug, Clone)]
pub struct Resolved {
    /// The expression, whose text contains the numbers in place of the names.
    pub expression: Expression,
    /// The names, in the order of the text.
    pub names: Vec<String>,
}

/// A compiled expression; clones share the program.
#[derive(Debug, Clone)]
pub struct Expression {
    text: Arc<str>,
    program: Program,
}

impl Expression {
    /// Compiles `text`, an expression in t, x, y, z; an error contains its position in the text.
    pub fn parse(text: &str) -> Result<Self, Fault> {
        Self::parse_in(text, Variable::OF_TIME_AND_PLACE)
    }

    /// Compiles `text`, an expression in these variables.
    pub fn parse_in(text: &str, variables: &[Variable]) -> Result<Self, Fault> {
        Ok(Self { text: text.into(), program: compile::compile(text, variables, &Names::new())?.program })
    }

    /// Compiles `text`, an expression in these variables, in which these names stand for finite numbers; an error contains its position in
    /// the text.
    pub fn resolve(text: &str, variables: &[Variable], names: &Names) -> Result<Resolved, Fault> {
        let compile::Compiled { program, named } = compile::compile(text, variables, names)?;
        let mut with_numbers = String::with_capacity(text.len());
        let mut end = 0;
        for (at, number) in &named {
            // The shortest digits that are read back as the same number.
            with_numbers.push_str(&format!("{}({number:?})", &text[end..at.start]));
            end = at.end;
        }
        with_numbers.push_str(&text[end..]);
        let too_long = |fault| Fault { at: 0..text.len(), ..fault };
        compile::refuse_long(&with_numbers).map_err(too_long)?;
        let names = named.into_iter().map(|(at, _)| text[at].to_owned()).collect();
        Ok(Resolved { expression: Self { text: with_numbers.into(), program }, names })
    }

    /// The expression as written.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Whether it contains `variable`.
    pub fn uses(&self, variable: Variable) -> bool {
        self.program.uses(variable)
    }

    /// The first variable that it contains.
    pub fn variable(&self) -> Option<Variable> {
        Variable::ALL.iter().copied().find(|variable| self.uses(*variable))
    }

    /// Value at `time` and `point`; not finite where the expression is undefined, as in sqrt(-1).
    pub fn evaluate(&self, time: f64, point: &[f64]) -> f64 {
        self.program.evaluate(&arguments(time, point))
    }
}

/// Time and place as arguments of a program.
fn arguments(time: f64, point: &[f64]) -> Arguments {
    let mut arguments = [0.0; COUNT];
    arguments[0] = time;
    arguments[1..].iter_mut().zip(point.iter().take(3)).for_each(|(argument, x)| *argument = *x);
    arguments
}

impl PartialEq for Expression {
    fn eq(&self, other: &Self) -> bool {
        self.text == other.text
    }
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
        json_schema!({
            "type": ["number", "string", "object"],
            "format": "expression",
            "properties": {
                "table": { "type": "string", "description": "A file with times and values." },
                "column": { "type": "integer", "minimum": 2, "description": "The column of the values; 2 if absent." }
            },
            "required": ["table"],
            "additionalProperties": false
        })
    }
}

#[cfg(test)]
mod tests;
