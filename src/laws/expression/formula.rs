//! Laws written in the job: formulas in variables of their own, with derivatives and proven bounds.

use super::analysis::{Border, Unproven};
use super::enclosure::{Enclosure, Ranges};
use super::evaluate::{Arguments, COUNT};
use super::interval::Interval;
use super::program::Variable;
use super::{Expression, Fault};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{self, Deserializer, Visitor};
use serde::{Deserialize, Serialize, Serializer};
use std::borrow::Cow;
use std::fmt;

/// A formula of a law. The schema of its key lists its variables.
#[derive(Debug, Clone, PartialEq)]
pub struct Formula(pub(super) Expression);

impl Formula {
    /// Compiles `text`, which may contain these variables.
    pub fn parse(text: &str, variables: &[Variable]) -> Result<Self, Fault> {
        Expression::parse_in(text, variables).map(Self)
    }

    /// The formula as written.
    pub fn text(&self) -> &str {
        self.0.text()
    }

    /// Whether it contains `variable`.
    pub fn uses(&self, variable: Variable) -> bool {
        self.0.uses(variable)
    }

    /// Its value where the variables have these values, and all others are 0.
    pub fn value(&self, at: &[(Variable, f64)]) -> f64 {
        self.0.program.evaluate(&arguments(at))
    }

    /// Its value there, and its derivative by one variable.
    pub fn differentiate(&self, at: &[(Variable, f64)], by: Variable) -> [f64; 2] {
        self.0.program.differentiate(&arguments(at), by)
    }

    /// What is known of its values, and of its derivatives by one variable, in these ranges.
    pub fn enclose(&self, ranges: &[(Variable, Interval)], by: Variable) -> Enclosure {
        self.0.program.enclose(&whole(ranges), by)
    }

    /// The borders between its pieces along one variable, for all values of the others in these ranges.
    pub fn borders(&self, ranges: &[(Variable, Interval)], along: Variable) -> Result<Vec<Border>, Unproven> {
        self.0.program.borders(&whole(ranges), along)
    }

    /// Whether a function that jumps depends on this variable: it may or may not jump with it.
    pub fn jumps_along(&self, variable: Variable) -> bool {
        let all = Interval::new(f64::NEG_INFINITY, f64::INFINITY);
        self.0.program.enclose(&[all; COUNT], variable).may_jump
    }

    /// The largest value of a part of its enclosures, such as its values or its derivatives by one variable, in any of these ranges, from
    /// above, and about where it is taken along the variable.
    pub fn supremum<'a>(
        &self,
        ranges: impl IntoIterator<Item = &'a [(Variable, Interval)]>,
        by: Variable,
        of: impl Fn(&Enclosure) -> Interval,
    ) -> Result<[f64; 2], Unproven> {
        let ranges: Vec<Ranges> = ranges.into_iter().map(whole).collect();
        self.0.program.supremum(&ranges, by, of)
    }
}

fn arguments(at: &[(Variable, f64)]) -> Arguments {
    let mut all = [0.0; COUNT];
    at.iter().for_each(|(variable, value)| all[*variable as usize] = *value);
    all
}

fn whole(ranges: &[(Variable, Interval)]) -> Ranges {
    let mut all = [Interval::from(0.0); COUNT];
    ranges.iter().for_each(|(variable, range)| all[*variable as usize] = *range);
    all
}

impl Serialize for Formula {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.text())
    }
}

impl<'de> Deserialize<'de> for Formula {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(FormulaVisitor)
    }
}

struct FormulaVisitor;

impl Visitor<'_> for FormulaVisitor {
    type Value = Formula;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("a number or a formula")
    }

    fn visit_f64<E: de::Error>(self, number: f64) -> Result<Formula, E> {
        self.visit_str(&format!("{number:?}"))
    }

    fn visit_i64<E: de::Error>(self, number: i64) -> Result<Formula, E> {
        self.visit_str(&number.to_string())
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<Formula, E> {
        Formula::parse(text, Variable::ALL).map_err(|fault| E::custom(fault.message))
    }
}

impl JsonSchema for Formula {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "Formula".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": ["number", "string"], "format": "expression" })
    }
}
