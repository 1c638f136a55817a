//! A friction coefficient that is written in the job as a formula of sliding velocity, slip distance, pressure, time, place and
//! temperature.
//!
//! The bound is `mu(v, l, p, t, x, T) p` with the positive part `p` of the contact pressure. The slip distance `l` at the end of a step of
//! length `k` is `l0 + k v`, as in [`DistanceWeakening`](super::DistanceWeakening), so that within a step it is a law of the sliding
//! velocity. Its steepest decrease is bounded by enclosures of the derivatives of the formula for all values of its variables, and thus
//! proven.

use crate::laws::{
    contact::friction_law::{FrictionBound, FrictionHistory, SLIP, STICKS, SlidingContext, Slip, slip_after},
    expression::{Enclosure, Formula, Interval, OfSliding, REACH, Scalar, Supremum, Unproven, Variable},
    law::{Derived, LawFault, increasing_root},
    step::Blend,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Friction whose coefficient is a formula.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CoefficientFormula {
    /// Friction coefficient as a formula of the sliding velocity v in m/s, the slip distance l of a point since the start of the run in m,
    /// the contact pressure p in Pa, the time t in s, the undeformed coordinates x, y, z in m and, with [material.heat], the temperature of
    /// the body in K that a step is expected to end with (under lagged_euler that at its start, under midpoint the mean); between bodies, coordinates and temperature are those of the boundaries `on`. It must not be
    /// negative for any v, l, p, t and temperature from 0 on and any place, and not jump with v, l or p. A bound, the coefficient times p,
    /// that grows by much more than 1 Pa for each Pa from p = 0 on, such as 300/(p + 1e-3), makes steps fail where contact opens: for a
    /// constant bound use `tresca`. Where it contains l, field files and checkpoints contain the slip as `slip`.
    #[schemars(example = &"0.3 + 0.2*exp(-v/0.1)", example = &"0.4/(1 + max(temperature - 300, 0)/200)")]
    pub coefficient: Formula<OfSliding>,
    #[serde(skip)]
    facts: Derived<Facts>,
}

/// What is proven of a coefficient.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Facts {
    /// Steepest decrease with the velocity in s/m.
    fall_with_velocity: f64,
    /// Steepest decrease with the slip in 1/m.
    fall_with_slip: f64,
    /// Steepest change with the slip in 1/m.
    change_with_slip: f64,
}

/// A coefficient is negative beyond its rounding.
const ROUNDING: f64 = 1e-12;

/// The ranges of the variables.
fn ranges() -> [(Variable, Interval); 8] {
    let (from_zero, all) = (Interval::new(0.0, REACH), Interval::new(-REACH, REACH));
    [
        (Variable::V, from_zero),
        (Variable::L, from_zero),
        (Variable::P, from_zero),
        (Variable::T, from_zero),
        (Variable::X, all),
        (Variable::Y, all),
        (Variable::Z, all),
        (Variable::Temperature, from_zero),
    ]
}

impl CoefficientFormula {
    /// With this formula.
    pub fn new(coefficient: Formula<OfSliding>) -> Self {
        Self { coefficient, facts: Derived::default() }
    }

    fn facts(&self) -> Facts {
        *self.facts.get(|| {
            let steepest = |by: Variable, of: fn(&Enclosure) -> Interval| {
                if !self.coefficient.uses(by) {
                    return 0.0;
                }
                self.coefficient
                    .supremum([&ranges()[..]], by, of)
                    .map_or(f64::INFINITY, |found| found.bound.max(0.0))
            };
            Facts {
                fall_with_velocity: steepest(Variable::V, |known| -known.slope),
                fall_with_slip: steepest(Variable::L, |known| -known.slope),
                change_with_slip: steepest(Variable::L, |known| known.slope.size()),
            }
        })
    }

    fn arguments(&self, speed: f64, pressure: f64, at: SlidingContext) -> [(Variable, f64); 8] {
        let [x, y, z] = at.place;
        [
            (Variable::V, speed),
            (Variable::L, at.history + at.step_length * speed),
            (Variable::P, pressure.max(0.0)),
            (Variable::T, at.time),
            (Variable::X, x),
            (Variable::Y, y),
            (Variable::Z, z),
            (Variable::Temperature, at.temperature),
        ]
    }

    fn value(&self, speed: f64, pressure: f64, at: SlidingContext) -> f64 {
        self.coefficient.value(&self.arguments(speed, pressure, at))
    }

    /// The derivative of the coefficient by the sliding velocity at the end of the step.
    fn by_speed(&self, speed: f64, pressure: f64, at: SlidingContext) -> f64 {
        let arguments = self.arguments(speed, pressure, at);
        let (_, [own, by_slip]) = self.coefficient.slopes(&arguments, [Variable::V, Variable::L]);
        own + at.step_length * by_slip
    }

    fn fault(&self) -> Option<[String; 2]> {
        let formula = &self.coefficient;
        for variable in [Variable::V, Variable::L, Variable::P] {
            let name = variable.name();
            if formula.jumps_along(variable) {
                return Some([
                    format!(
                        "the coefficient may jump with {name}: a comparison, if, step, sign or a rounded number contains {name}"
                    ),
                    "write it with min, max, abs or interpolate, which are continuous".into(),
                ]);
            }
            let falls =
                |Supremum { bound, .. }: &Supremum| *bound == f64::INFINITY && variable != Variable::P;
            match formula.supremum([&ranges()[..]], variable, |known| -known.slope) {
                Ok(found) if falls(&found) => {
                    return Some([
                        format!(
                            "the coefficient falls without bound near {}, so that no step is short enough to have a unique solution",
                            formula.at(&found.place)
                        ),
                        format!("bound the decrease, for example by {name} + 1e-6 in place of {name}"),
                    ]);
                }
                Ok(_) => {}
                Err(unproven) => return Some(self.explain(unproven)),
            }
        }
        match formula.supremum([&ranges()[..]], Variable::V, |known| -known.value) {
            Ok(Supremum { bound, place }) if bound > ROUNDING => {
                let place = formula.at(&place);
                let near = if place.is_empty() { String::new() } else { format!(" near {place}") };
                Some([
                    format!("the coefficient may be negative{near}"),
                    "for every v, l, p, t and temperature from 0 on and every place, also outside of the body, it must not be: write max(..., 0) around it, \
                     and 1/(1 + v) in place of 1 - v/(1 + v)"
                        .into(),
                ])
            }
            Ok(_) => None,
            Err(unproven) => Some(self.explain(unproven)),
        }
    }

    fn explain(&self, unproven: Unproven) -> [String; 2] {
        let (Unproven::Undefined(place) | Unproven::Pieces(place)) = unproven;
        let help = "for every v, l, p, t and temperature from 0 on and every place, also outside of the body, it must have one: bound the arguments of \
                    roots, logarithms and powers, as in sqrt(max(x, 0)), and keep denominators away from 0";
        [format!("the coefficient has no value near {}", self.coefficient.at(&place)), help.into()]
    }
}

impl FrictionBound for CoefficientFormula {
    fn coefficient(&self, speed: f64, at: SlidingContext) -> f64 {
        self.value(speed, 0.0, at)
    }

    fn bound(&self, speed: f64, pressure: f64, at: SlidingContext) -> f64 {
        if pressure > 0.0 { self.value(speed, pressure, at) * pressure } else { 0.0 }
    }

    fn slope(&self, speed: f64, pressure: f64, at: SlidingContext) -> f64 {
        if pressure > 0.0 { self.by_speed(speed, pressure, at) * pressure } else { 0.0 }
    }

    fn by_pressure(&self, speed: f64, pressure: f64, at: SlidingContext) -> f64 {
        let arguments = self.arguments(speed, pressure, at);
        let [value, slope] = self.coefficient.differentiate(&arguments, Variable::P);
        value + slope * pressure.max(0.0)
    }

    fn jumps_at_rest(&self) -> bool {
        self.value(0.0, 1.0, SlidingContext::default()) > 0.0
    }

    fn steepest_decrease(&self, at: SlidingContext) -> f64 {
        let Facts { fall_with_velocity, fall_with_slip, .. } = self.facts();
        fall_with_velocity + at.step_length * fall_with_slip
    }

    fn corner_velocity(&self, at: SlidingContext) -> f64 {
        let fall = self.steepest_decrease(at);
        if fall > 0.0 { self.value(0.0, 1.0, at) / fall } else { 0.0 }
    }

    fn history(&self) -> Option<FrictionHistory> {
        self.coefficient.uses(Variable::L).then_some(FrictionHistory {
            quantity: SLIP,
            initial: 0.0,
            share: 1.0,
        })
    }

    fn in_time(&self) -> Option<Scalar> {
        Some(self.coefficient.as_scalar())
    }

    fn sees_temperature(&self) -> bool {
        self.coefficient.uses(Variable::Temperature)
    }

    fn is_same_everywhere(&self) -> bool {
        let other = [
            Variable::L,
            Variable::P,
            Variable::T,
            Variable::X,
            Variable::Y,
            Variable::Z,
            Variable::Temperature,
        ];
        !other.iter().any(|variable| self.coefficient.uses(*variable))
    }

    fn history_after(&self, histories: [f64; 2], blend: Blend, speed: f64) -> f64 {
        slip_after(histories, blend, speed)
    }

    fn history_measure(&self, slip: f64) -> f64 {
        let size = self.value(0.0, 1.0, SlidingContext::default());
        if size > 0.0 { slip * self.facts().change_with_slip / size } else { slip }
    }

    fn own_faults(&self) -> Vec<LawFault> {
        let fault = self.fault().map(|[message, help]| LawFault::at_value("coefficient", message, help));
        fault.into_iter().collect()
    }

    fn resolve(&self, s: f64, c: f64, pressure: f64, at: SlidingContext) -> Slip {
        let at_rest = self.bound(0.0, pressure, at);
        let sticks = |traction| Slip { speed: 0.0, traction, derivative: 0.0, slope: 0.0, coefficient: 0.0 };
        if at_rest > 0.0 && s <= at_rest {
            return sticks(s);
        }
        let open = |speed: f64| {
            let [bound, slope] = [self.bound(speed, pressure, at), self.slope(speed, pressure, at)];
            [c * speed + bound - s, c + slope]
        };
        let speed = match [Variable::V, Variable::L].iter().any(|variable| self.coefficient.uses(*variable)) {
            true if s > 0.0 => increasing_root(0.0, s / c, s / c, open),
            true => 0.0,
            false => (s - at_rest) / c,
        };
        let (traction, slope) = (self.bound(speed, pressure, at), self.slope(speed, pressure, at));
        let derivative = 1.0 / (c + slope);
        if c * derivative < STICKS {
            return Slip { speed, ..sticks(traction) };
        }
        let coefficient = if pressure > 0.0 { self.by_pressure(speed, pressure, at) } else { 0.0 };
        Slip { speed, traction, derivative, slope, coefficient }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::contact::{Coulomb, Decay, DistanceWeakening, FrictionLaw, VelocityWeakening};

    fn written(text: &str) -> FrictionLaw {
        FrictionLaw::CoefficientFormula(CoefficientFormula::new(Formula::parse(text).unwrap()))
    }

    #[test]
    fn built_in_laws_written_as_formulas_have_their_numbers() {
        let weakening = DistanceWeakening { at_rest: 0.6, dynamic: 0.2, distance: 0.5, decay: Decay::Linear };
        let pairs = [
            (FrictionLaw::Coulomb(Coulomb { coefficient: 0.3 }), "0.3"),
            (
                FrictionLaw::VelocityWeakening(VelocityWeakening {
                    at_rest: 0.5,
                    dynamic: 0.3,
                    decay_velocity: 0.1,
                }),
                "0.3 + 0.2*exp(-v/0.1)",
            ),
            (FrictionLaw::DistanceWeakening(weakening), "0.2 + 0.4*max(1 - l/0.5, 0)"),
            (
                FrictionLaw::DistanceWeakening(DistanceWeakening { decay: Decay::Exponential, ..weakening }),
                "0.2 + 0.4*exp(-l/0.5)",
            ),
        ];
        for (law, text) in pairs {
            let formula = written(text);
            assert!(formula.own_faults().is_empty(), "{text}");
            for history in [0.0, 0.2, 0.7] {
                let at = law.context([history; 2], Blend::euler(0.1));
                let [a, b] = [&law, &formula].map(|law| law.steepest_decrease(at));
                assert!(a <= b * (1.0 + 1e-12) && b <= 1.011 * a, "{text}: {a} {b}");
                assert_eq!(
                    law.history_after([0.1, 0.0], Blend::euler(0.1), 2.0),
                    0.1 + if law.history().is_some() { 0.2 } else { 0.0 }
                );
                for pressure in [-1.0, 0.0, 3.0] {
                    let c = 2.0 * b * f64::max(pressure, 0.0) + 0.7;
                    for step in 0..60 {
                        let s = 0.13 * f64::from(step);
                        for held in [0.0, 0.02] {
                            let [a, b] = [&law, &formula]
                                .map(|law| law.resolve_beside(s, c, pressure, at.beside(held)));
                            let off = (a.speed - b.speed).abs() * c + (a.traction - b.traction).abs();
                            assert!(off < 1e-12 * (1.0 + s), "{text} {s} {pressure} {held}: {a:?} {b:?}");
                            let off = (a.derivative - b.derivative).abs() * c
                                + (a.coefficient - b.coefficient).abs();
                            assert!(off < 1e-9, "{text} {s} {pressure} {held}: {a:?} {b:?}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn time_place_and_pressure_count() {
        let law = written("max(0.1 + 0.01*t + 0.02*x - 0.03*y + 0.04*z, 0) + 0.5*exp(-p/10)");
        assert!(law.own_faults().is_empty(), "{:?}", law.own_faults());
        let at = SlidingContext { time: 5.0, place: [1.0, 2.0, 3.0], ..SlidingContext::default() };
        let own = 0.1 + 0.05 + 0.02 - 0.06 + 0.12;
        let found = law.resolve(30.0, 2.0, 10.0, at);
        let bound = |p: f64| (own + 0.5 * (-p / 10.0).exp()) * p;
        assert!((found.traction - bound(10.0)).abs() < 1e-12, "{found:?}");
        let by_pressure = (bound(10.0 + 1e-5) - bound(10.0 - 1e-5)) / 2e-5;
        assert!((found.coefficient - by_pressure).abs() < 1e-9, "{found:?}");
    }

    #[test]
    fn a_coefficient_fades_with_the_temperature() {
        let law = written("0.4/(1 + max(temperature - 300, 0)/200)");
        assert!(law.own_faults().is_empty() && law.sees_temperature() && !law.is_same_everywhere());
        for (temperature, coefficient) in [(250.0, 0.4), (500.0, 0.2), (900.0, 0.1)] {
            let at = SlidingContext { temperature, ..SlidingContext::default() };
            assert!((law.bound(0.3, 10.0, at) - 10.0 * coefficient).abs() < 1e-14);
        }
        assert!(!written("0.3").sees_temperature());
        let negative = written("0.4 - temperature/1000").own_faults();
        assert!(negative[0].message.contains("may be negative near temperature = "), "{negative:?}");
    }

    #[test]
    fn regularised_friction_grows_from_zero() {
        let law = written("0.4*tanh(v/1e-3)");
        let at = SlidingContext::default();
        assert!(!law.jumps_at_rest() && law.steepest_decrease(at) == 0.0);
        let found = law.resolve(3.0, 100.0, 10.0, at);
        assert!((100.0 * found.speed + found.traction - 3.0).abs() < 1e-13);
        assert!((found.traction - 4.0 * (found.speed / 1e-3).tanh()).abs() < 1e-13);
        assert_eq!(law.resolve(0.0, 100.0, 10.0, at).speed, 0.0);
    }

    #[test]
    fn coefficients_without_a_certificate_are_refused_with_the_remedy() {
        for (text, message, help) in [
            ("0.3 - 0.1*v", "may be negative", "max("),
            ("0.3 + 0.01*x", "may be negative near x = -", "outside of the body"),
            ("if(v < 0.1, 0.3, 0.2)", "may jump with v", "interpolate"),
            ("0.3 + 0.1*floor(l)", "may jump with l", "interpolate"),
            ("max(0.5 - sqrt(v), 0.1)", "falls without bound near v", "v + 1e-6"),
            ("1/v", "no value near v = ", "denominators away from 0"),
            ("0.2 + sqrt(x)", "no value near x = -", "sqrt(max(x, 0))"),
        ] {
            let faults = written(text).own_faults();
            assert!(faults.len() == 1 && faults[0].key == "coefficient", "{text}: {faults:?}");
            assert!(
                faults[0].message.contains(message) && faults[0].help.contains(help),
                "{text}: {faults:?}"
            );
        }
        for text in [
            "if(t < 1, 0.3, 0.2 + 0.1*exp(-v))",
            "0.3*(1 - exp(-v/0.01))",
            "0.3*tanh(v/0.01)",
            "0.4*atan(v/1e-3)",
        ] {
            assert!(written(text).own_faults().is_empty(), "{text}: {:?}", written(text).own_faults());
        }
    }
}
