//! Laws written in the job: formulas in variables of their own, with derivatives and proven bounds.

use super::analysis::{Border, Place, REACH, Supremum, Unproven};
use super::enclosure::{Enclosure, Ranges};
use super::evaluate::Arguments;
use super::interval::Interval;
use super::program::{COUNT, Variable};
use super::{Expression, Fault, Scalar};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{self, Deserializer, Visitor};
use serde::{Deserialize, Serialize, Serializer};
use std::borrow::Cow;
use std::fmt;
use std::marker::PhantomData;

/// Share of a value that is rounding where two pieces of a formula meet.
const ROUNDING: f64 = 1e-12;

/// The variables of a family of formulas.
pub trait Scope: fmt::Debug + Copy + PartialEq {
    /// The variables.
    const VARIABLES: &'static [Variable];
}

/// Declares scopes with their variables.
macro_rules! scopes {
    ($($(#[$about:meta])* $scope:ident: $($variable:ident)*;)*) => {
        $(
            $(#[$about])*
            #[derive(Debug, Clone, Copy, PartialEq)]
            pub struct $scope;

            impl Scope for $scope {
                const VARIABLES: &'static [Variable] = &[$(Variable::$variable),*];
            }
        )*
    };
}

scopes! {
    /// Formulas of a normal velocity or a penetration.
    OfMotion: V D;
    /// Formulas of a sliding velocity, a slip distance, a pressure, time, place and temperature.
    OfSliding: V L P T X Y Z Temperature;
    /// Formulas of the von Mises stress, the mean stress, the accumulated viscoplastic strain and the temperature.
    OfCreep: Q P E Temperature;
    /// Formulas of the equivalent strain rate.
    OfRate: G;
    /// Formulas of the equivalent strain.
    OfStrain: E;
}

/// A formula of a law, in the variables of its scope.
#[derive(Debug, Clone, PartialEq)]
pub struct Formula<S> {
    pub(super) expression: Expression,
    scope: PhantomData<S>,
}

impl<S: Scope> Formula<S> {
    /// Compiles `text`.
    pub fn parse(text: &str) -> Result<Self, Fault> {
        Ok(Self { expression: Expression::parse_in(text, S::VARIABLES)?, scope: PhantomData })
    }

    /// This formula times a variable of its scope.
    pub fn times(&self, variable: Variable) -> Result<Self, Fault> {
        Self::parse(&format!("({})*{}", self.text(), variable.name()))
    }

    /// The formula as written.
    pub fn text(&self) -> &str {
        self.expression.text()
    }

    /// The formula of time and place where its other variables are 0.
    pub fn as_scalar(&self) -> Scalar {
        Scalar::Expression(self.expression.clone())
    }

    /// Whether it contains `variable`.
    pub fn uses(&self, variable: Variable) -> bool {
        self.expression.uses(variable)
    }

    /// Whether it is piecewise, for example because of min or abs.
    pub fn has_pieces(&self) -> bool {
        self.expression.program.has_pieces()
    }

    /// Whether its derivative by a variable of its scope is known to be zero for all values from 0 on, and all values of the others.
    pub fn is_constant_along(&self, variable: Variable) -> bool {
        let from_zero = Interval::new(0.0, REACH);
        let known = self.expression.program.enclose(&[from_zero; COUNT], variable);
        !self.uses(variable) || (known.slope.is(0.0) && known.value.is_defined && known.is_one_piece)
    }

    /// Its value where the variables have these values, and all others are 0.
    pub fn value(&self, at: &[(Variable, f64)]) -> f64 {
        self.expression.program.evaluate(&arguments(at))
    }

    /// Its value there, and its derivative by one variable.
    pub fn differentiate(&self, at: &[(Variable, f64)], by: Variable) -> [f64; 2] {
        let (value, [slope]) = self.slopes(at, [by]);
        [value, slope]
    }

    /// Its value there, and its derivatives by some variables.
    pub fn slopes<const N: usize>(&self, at: &[(Variable, f64)], by: [Variable; N]) -> (f64, [f64; N]) {
        self.expression.program.differentiate(&arguments(at), by)
    }

    /// What is known of its values, and of its derivatives by one variable, in these ranges.
    pub fn enclose(&self, ranges: &[(Variable, Interval)], by: Variable) -> Enclosure {
        self.expression.program.enclose(&whole(ranges), by)
    }

    /// The borders between its pieces along one variable, for all values of the others in these ranges.
    pub fn borders(&self, ranges: &[(Variable, Interval)], along: Variable) -> Result<Vec<Border>, Unproven> {
        self.expression.program.borders(&whole(ranges), along)
    }

    /// Whether it may jump with this variable: a function that jumps depends on it, unless this is the only variable and the formula has
    /// the same value on both sides of each border.
    pub fn jumps_along(&self, variable: Variable) -> bool {
        let all = Interval::new(f64::NEG_INFINITY, f64::INFINITY);
        let may_jump = self.expression.program.enclose(&[all; COUNT], variable).may_jump;
        let others = || S::VARIABLES.iter().any(|other| *other != variable && self.uses(*other));
        may_jump && (others() || !self.meets_at_borders(variable))
    }

    /// Whether its values on both sides of each border along this variable are equal but for rounding, where all others are 0.
    fn meets_at_borders(&self, variable: Variable) -> bool {
        let meets = |ends: Border| {
            let [[below, rise], [above, slope]] =
                ends.map(|end| self.differentiate(&[(variable, end)], variable));
            let size = below.abs() + above.abs() + ends[1].abs() * (rise.abs() + slope.abs());
            (above - below).abs() <= ROUNDING * size
        };
        let borders = self.borders(&[(variable, Interval::new(-REACH, REACH))], variable);
        borders.is_ok_and(|borders| borders.into_iter().all(meets))
    }

    /// The largest value of a part of its enclosures, such as its values or its derivatives by one variable, in any of these ranges, from
    /// above, and about where it is taken.
    pub fn supremum<'a>(
        &self,
        ranges: impl IntoIterator<Item = &'a [(Variable, Interval)]>,
        by: Variable,
        of: impl Fn(&Enclosure) -> Interval,
    ) -> Result<Supremum, Unproven> {
        let ranges: Vec<Ranges> = ranges.into_iter().map(whole).collect();
        self.expression.program.supremum(&ranges, by, of)
    }

    /// A place in words: the values of the variables that the formula contains.
    pub fn at(&self, place: &Place) -> String {
        let used = S::VARIABLES.iter().filter(|variable| self.uses(**variable));
        let named =
            used.map(|variable| format!("{} = {}", variable.name(), short(place[*variable as usize])));
        let named: Vec<_> = named.collect();
        if named.is_empty() { format!("any {}", S::VARIABLES[0].name()) } else { named.join(", ") }
    }
}

/// A number in a few digits.
pub fn short(number: f64) -> String {
    let plain = number == 0.0 || (1e-3..1e6).contains(&number.abs());
    if plain { format!("{}", (number * 1e6).round() / 1e6) } else { format!("{number:.3e}") }
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

impl<S: Scope> Serialize for Formula<S> {
    fn serialize<T: Serializer>(&self, serializer: T) -> Result<T::Ok, T::Error> {
        match self.text().parse::<f64>() {
            Ok(number) => serializer.serialize_f64(number),
            Err(_) => serializer.serialize_str(self.text()),
        }
    }
}

impl<'de, S: Scope> Deserialize<'de> for Formula<S> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(FormulaVisitor(PhantomData))
    }
}

struct FormulaVisitor<S>(PhantomData<S>);

impl<S: Scope> Visitor<'_> for FormulaVisitor<S> {
    type Value = Formula<S>;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("a number or a formula")
    }

    fn visit_f64<E: de::Error>(self, number: f64) -> Result<Formula<S>, E> {
        self.visit_str(&format!("{number:?}"))
    }

    fn visit_i64<E: de::Error>(self, number: i64) -> Result<Formula<S>, E> {
        self.visit_f64(number as f64)
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<Formula<S>, E> {
        Formula::parse(text).map_err(|fault| E::custom(fault.message))
    }
}

impl<S: Scope> JsonSchema for Formula<S> {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "Formula".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let names: Vec<&str> = S::VARIABLES.iter().map(|variable| variable.name()).collect();
        json_schema!({ "type": ["number", "string"], "format": "expression", "variables": names.join(", ") })
    }
}
