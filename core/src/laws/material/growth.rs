//! Stresses that grow with a measure of the strain or of its rate: `x f(x)` with a formula `f`, proven by enclosures.

use crate::laws::{
    expression::{Formula, Interval, REACH, Scope, Supremum, Unproven, Variable, short},
    law::LawFault,
};

/// Share of a value that is rounding.
const ROUNDING: f64 = 1e-12;

/// A formula whose product with its variable must grow, and its words in messages.
pub(super) struct Growth<'a, S> {
    pub formula: &'a Formula<S>,
    pub by: Variable,
    /// The key of the formula.
    pub key: &'static str,
    /// What the formula is, such as a viscosity.
    pub what: &'static str,
    /// What its product with the variable is.
    pub product: &'static str,
    /// What the variable is.
    pub variable: &'static str,
    /// The key of the value up to which the product must grow by more than rounding.
    pub reference: &'static str,
    /// The unit of the formula, after a blank, if it has one.
    pub unit: &'static str,
    /// Words that complete the message about a formula without a value somewhere.
    pub remedy: &'static str,
}

impl<S: Scope> Growth<'_, S> {
    /// The infimum of `d(x f)/dx` up to this value, from below, which is positive; `x f` must not fall anywhere. Otherwise the message and
    /// the remedy.
    pub(super) fn least(&self, most: f64) -> Result<f64, [String; 2]> {
        let Self { formula, by, key, what, product, variable, reference, unit, remedy } = *self;
        let name = by.name();
        let of_product = formula.times(by).map_err(|fault| [fault.message, fault.help])?;
        if of_product.jumps_along(by) {
            return Err([
                format!(
                    "the {what} may jump with {name}: a comparison, if, step, sign or a rounded number contains {name}"
                ),
                "write it with min, max, abs or interpolate, which are continuous".into(),
            ]);
        }
        let fall = |most: f64| {
            let ranges = [(by, Interval::new(0.0, most))];
            formula.supremum([&ranges[..]], by, |known| -known.growth).map_err(|unproven| {
                let (Unproven::Undefined(place) | Unproven::Pieces(place)) = unproven;
                [
                    format!("the {what} has no value near {}", formula.at(&place)),
                    format!("it must have one for every {name} from 0 on{remedy}"),
                ]
            })
        };
        let scale = formula.value(&[(by, most)]).abs();
        let Supremum { bound, place } = fall(REACH)?;
        if bound > ROUNDING * scale {
            return Err([
                format!(
                    "the {product} may fall with the {variable} near {}: {key}*{name} grows by {}{unit} there",
                    formula.at(&place),
                    short(-bound)
                ),
                format!(
                    "let {key} fall more slowly than 1/{name}, add a small constant to it, or bound its argument, as in min({name}, 10)"
                ),
            ]);
        }
        let Supremum { bound, place } = fall(most)?;
        if -bound > ROUNDING * scale {
            return Ok(-bound);
        }
        Err([
            format!(
                "the {product} may not grow with the {variable} near {}: {key}*{name} must grow up to {name} = {reference}",
                formula.at(&place)
            ),
            format!("add a constant to {key}, or choose a smaller {reference}"),
        ])
    }

    /// The supremum of `d(x f)/dx` up to this value, from above; infinite where nothing bounds it.
    pub(super) fn most(&self, most: f64) -> f64 {
        let ranges = [(self.by, Interval::new(0.0, most))];
        let found = self.formula.supremum([&ranges[..]], self.by, |known| known.growth);
        found.map_or(f64::INFINITY, |supremum| supremum.bound)
    }

    /// The fault of the formula that this outcome shows.
    pub(super) fn fault(&self, least: &Result<f64, [String; 2]>) -> Option<LawFault> {
        let [message, help] = least.as_ref().err()?.clone();
        Some(LawFault::at_value(self.key, message, help))
    }
}
