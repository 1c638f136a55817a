//! Creep whose rate is written in the job as a formula of the von Mises norm of the stress, the mean stress and the accumulated creep
//! strain.
//!
//! ```text
//! X(s) = 3/2 p' dev s / q,   p' = f(q, m, p)
//! ```
//!
//! with an `f` that is zero without stress, does not decrease with `q` and does not increase with `p`: dissipative, and with a unique end of
//! every step. A step of length `k` ends in `s = s* / (1 + x E W)` with `x = dp / q` and `W` as in [`norton`](super::norton); `x` is the
//! root of `x q(x) - k f(q(x), m, p + x q(x))`, which increases: creep keeps the volume, and with it the mean stress `m`. In plane stress
//! `X` is the in-plane part of that of the plane's stress in space; it changes `m`, and an `f` of it is refused.
//! All conditions on `f`, and the fastest rate, which bounds explicit steps, follow from enclosures of the formula.

use super::{
    flow::{Flow, InPlaces, Parameters, Room},
    release::{Release, WEIGHT, rate_along_deviator},
    tangent::{Tangent, add_product, write_isotropic},
};
use crate::{
    laws::{
        expression::{Enclosure, Formula, Interval, OfCreep, REACH, Supremum, Unproven, Variable},
        law::{Derived, LawFault},
        material::{Elastic, Elasticity, Hypothesis, Isotropic},
    },
    linear_algebra::tensor::{Mandel, add_scaled, dot, larger, normal_components, trace, von_mises},
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Creep at a rate that is a formula: the equivalent creep strain e grows at this rate, in the direction of the stress deviator.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CreepFormula {
    /// Rate of the equivalent creep strain as a formula of the von Mises norm q of the stress in Pa, the mean stress p in Pa, positive in
    /// tension, the equivalent creep strain e and, with [material.heat], the temperature in K that a step is expected to end with (under
    /// lagged_euler that at its start, under midpoint the mean). It is zero at q = 0, must not decrease with q nor increase with e, and must
    /// not jump with them, at any temperature from 0 on. In plane stress it must not depend on p.
    #[schemars(extend("unit" = "1/s"), example = &"1e-3*sinh(q/20e6)^4", example = &"1e9*(q/20e6)^4*exp(-24e3/max(temperature, 1))")]
    pub rate: Formula<OfCreep>,
    /// Von Mises norm of the stress, and size of a mean stress that the rate contains, up to which explicit_step_bound holds with scheme
    /// lagged_euler; implicit schemes do not use it.
    #[schemars(extend("unit" = "Pa", "exclusiveMinimum" = 0), example = 5e7)]
    pub reference_stress: f64,
    /// The temperature in K at which the law is evaluated.
    #[serde(skip)]
    temperature: f64,
    #[serde(skip)]
    bounds: Derived<Vec<Derived<[f64; 3]>>>,
}

impl<N> InPlaces<N> for CreepFormula {
    type AtPlace = Self;

    fn with_yield_stress(&self, _: f64) -> Self {
        self.clone()
    }
}

impl Parameters for CreepFormula {
    type Flow = Elastic<Self>;

    fn prepare(&self, elasticity: &Elasticity, hypothesis: Hypothesis) -> Elastic<Self> {
        Elastic { parameters: self.clone(), elasticity: elasticity.tensor(hypothesis) }
    }

    fn fault(&self) -> Option<LawFault> {
        let [message, help] = self.first_fault()?;
        Some(LawFault::at_value("rate", message, help))
    }

    fn fault_in_plane_stress(&self) -> Option<LawFault> {
        self.rate.uses(Variable::P).then(|| {
            let message = "the rate contains the mean stress p, which creep changes in plane stress: a step might have several ends";
            LawFault::at_value("rate", message, "use plane strain or 3D, or delete p")
        })
    }

    fn keeps_volume(&self) -> bool {
        true
    }
}

impl CreepFormula {
    /// The largest derivatives of the rate by the stress, of its decrease by the strain, and by the mean stress in either direction, up to
    /// the stress of this level; found once, when the stresses of a step reach it.
    fn bounds(&self, level: i32) -> [f64; 3] {
        let all = self.bounds.get(|| LEVELS.map(|_| Derived::default()).collect());
        let at = usize::try_from(level - LEVELS.start).ok().and_then(|at| all.get(at));
        at.map_or([f64::INFINITY, 0.0, 0.0], |bounds| *bounds.get(|| self.find_bounds(level)))
    }

    fn find_bounds(&self, level: i32) -> [f64; 3] {
        let high = self.reference_stress * (f64::from(level) / PARTS).exp2();
        let part = [
            (Variable::Q, Interval::new(0.0, high)),
            (Variable::P, Interval::new(-high, high)),
            (Variable::E, Interval::new(0.0, REACH)),
            (Variable::Temperature, Interval::new(0.0, REACH)),
        ];
        let sup = |by, sign: f64| {
            let of = move |known: &Enclosure| if sign > 0.0 { known.slope } else { -known.slope };
            self.rate.supremum([&part[..]], by, of).map_or(f64::INFINITY, |found| found.bound.max(0.0))
        };
        let [by_strain, by_mean] = [Variable::E, Variable::P].map(|by| self.rate.uses(by));
        [
            sup(Variable::Q, 1.0),
            if by_strain { sup(Variable::E, -1.0) } else { 0.0 },
            if by_mean { sup(Variable::P, 1.0).max(sup(Variable::P, -1.0)) } else { 0.0 },
        ]
    }

    fn first_fault(&self) -> Option<[String; 2]> {
        let from_zero = Interval::new(0.0, REACH);
        let mean = (Variable::P, Interval::new(-REACH, REACH));
        let [strain, temperature] =
            [Variable::E, Variable::Temperature].map(|variable| (variable, from_zero));
        let (all, unloaded) =
            ([(Variable::Q, from_zero), mean, strain, temperature], [mean, strain, temperature]);
        for variable in [Variable::Q, Variable::P, Variable::E] {
            let name = variable.name();
            if self.rate.jumps_along(variable) {
                return Some([
                    format!(
                        "the rate may jump with {name}: a comparison, if, step, sign or a rounded number contains {name}"
                    ),
                    "write it with min, max, abs or interpolate, which are continuous".into(),
                ]);
            }
        }
        let sup = |ranges: &[(Variable, Interval)], by, of: fn(&Enclosure) -> Interval| {
            self.rate.supremum([ranges], by, of)
        };
        let conditions = [
            (
                sup(&unloaded, Variable::E, |known| known.value.size()),
                "is not zero without stress",
                "let it vanish at q = 0",
            ),
            (
                sup(&all, Variable::Q, |known| -known.slope),
                "may decrease with the stress",
                "let it grow with q, and write 1 - a/(q + a) in place of q/(q + a)",
            ),
            (
                sup(&all, Variable::E, |known| known.slope),
                "may increase with the creep strain",
                "let it fall with e, or use [material.damage]",
            ),
        ];
        // Beyond the rounding of a rate, and of its derivatives by stress and strain, of the size at the reference stress.
        let rate = self.value(self.reference_stress, [0.0; 2]).abs();
        let scales = [rate, rate / self.reference_stress, rate];
        for ((found, wrong, help), scale) in conditions.into_iter().zip(scales) {
            match found {
                Ok(Supremum { bound, place }) if bound > ROUNDING * scale => {
                    let place = self.rate.at(&place);
                    let near = if place.is_empty() { String::new() } else { format!(" near {place}") };
                    return Some([format!("the rate {wrong}{near}"), help.into()]);
                }
                Ok(_) => {}
                Err(Unproven::Undefined(place) | Unproven::Pieces(place)) => {
                    let help = "it must have one for every p, and every q, e and temperature from 0 on; e is the creep strain, Euler's number is exp(1)";
                    return Some([
                        format!("the rate has no value near {}", self.rate.at(&place)),
                        help.into(),
                    ]);
                }
            }
        }
        None
    }

    /// Rate in 1/s at a von Mises norm, a mean stress and an accumulated strain.
    fn value(&self, norm: f64, others: [f64; 2]) -> f64 {
        self.rate.value(&self.arguments(norm, others))
    }

    /// The rate, and its derivatives by the von Mises norm and the accumulated strain.
    fn at(&self, norm: f64, others: [f64; 2]) -> Rate {
        let arguments = self.arguments(norm, others);
        if self.rate.uses(Variable::E) {
            let (rate, [by_norm, by_strain]) = self.rate.slopes(&arguments, [Variable::Q, Variable::E]);
            return Rate { rate, by_norm, by_strain };
        }
        let [rate, by_norm] = self.rate.differentiate(&arguments, Variable::Q);
        Rate { rate, by_norm, by_strain: 0.0 }
    }

    /// The derivative of the rate by the mean stress.
    fn by_mean(&self, norm: f64, others: [f64; 2]) -> f64 {
        if !self.rate.uses(Variable::P) {
            return 0.0;
        }
        self.rate.differentiate(&self.arguments(norm, others), Variable::P)[1]
    }

    /// The arguments of a rate: von Mises norm, mean stress and accumulated strain, and the temperature.
    fn arguments(&self, norm: f64, [mean, accumulated]: [f64; 2]) -> [(Variable, f64); 4] {
        [
            (Variable::Q, norm),
            (Variable::P, mean),
            (Variable::E, accumulated),
            (Variable::Temperature, self.temperature),
        ]
    }

    /// Whether the rate depends on the temperature.
    pub fn sees_temperature(&self) -> bool {
        self.rate.uses(Variable::Temperature)
    }
}

impl Elastic<CreepFormula> {
    /// Sets the temperature in K at which the law is evaluated.
    pub fn set_temperature(&mut self, temperature: f64) {
        self.parameters.temperature = temperature;
    }
}

/// A rate in 1/s, and its derivatives by the von Mises norm and the accumulated strain.
#[derive(Debug, Clone, Copy)]
struct Rate {
    rate: f64,
    by_norm: f64,
    by_strain: f64,
}

/// The mean of the three normal stresses.
fn mean_of<const S: usize>(s: &Mandel<S>) -> f64 {
    trace(s) / 3.0
}

fn identity<const S: usize>() -> Mandel<S> {
    std::array::from_fn(|c| f64::from(u8::from(c < normal_components::<S>())))
}

/// Share of a rate that is rounding.
const ROUNDING: f64 = 1e-12;
/// Share of a stress at which a rate that is zero has a threshold.
const SMALL: f64 = 1e-6;
/// Change of a logarithm below which the next correction of Newton's method is a rounding error.
const LAST: f64 = 1e-11;
/// The same where the rate has no pieces: the next correction is about its square.
const LAST_IF_SMOOTH: f64 = 1e-7;
/// Largest size of a logarithm, and less than its number.
const LARGEST: f64 = 690.0;
const MOST: f64 = 1e299;

/// Where a step from a stress of this von Mises norm, and this mean and accumulated strain, ends in flow.
struct End {
    /// `x`.
    x: f64,
    /// `q(x)`.
    norm: f64,
    /// The derivative of `x q(x) - k f(q(x), m, p + x q(x))` by `x`, and by `q` at this `x`.
    by_x: f64,
    by_norm: f64,
    /// The derivative of `k f` by `p`.
    by_strain: f64,
}

impl End {
    /// At this `x`, with `q(x)` and its `fall`, and the rate there.
    fn new(x: f64, [norm, fall]: [f64; 2], length: f64, last: Rate) -> Self {
        let by_norm = x - length * (last.by_norm + x * last.by_strain);
        let by_x = norm * (1.0 - length * last.by_strain) - by_norm * norm * fall / x;
        Self { x, norm, by_x, by_norm, by_strain: length * last.by_strain }
    }
}

impl Elastic<CreepFormula> {
    /// The end of a step that flows at this rate at its start: the root `x`, whose logarithm is that of an increasing equation,
    /// `ln(x q(x)) - ln(k f(q(x), m, p + x q(x)))`, given `m` and `p`. Newton's method starts where the tangent of `f` has the end, which
    /// is the end for a rate that is linear beyond a threshold, and ends with a step of at most `last_step`.
    fn solve(
        &self,
        release: &Release,
        start: Rate,
        length: f64,
        [mean, accumulated]: [f64; 2],
        last_step: f64,
    ) -> End {
        let mut last = start;
        // The size of q(x) / (k f), and the derivative of the logarithm of x times it by that of x.
        let mut evaluate = |x: f64| {
            let (norm, fall) = release.at(x);
            last = self.parameters.at(norm, [mean, accumulated + x * norm]);
            let Rate { rate, by_norm, by_strain } = last;
            // Where nothing is left of the stress, all of it has flowed.
            let open = if norm > 0.0 { norm / (length * rate) } else { f64::INFINITY };
            let relaxed = (by_norm * norm * fall - by_strain * x * norm * (1.0 - fall)) / rate;
            [open, 1.0 - fall + if relaxed.is_finite() { relaxed } else { 0.0 }]
        };
        let (norm, _) = release.at(0.0);
        let Rate { rate, by_norm, by_strain } = start;
        let stiffness = release.stiffness_at_start();
        let growth = length * rate / (1.0 + length * (by_norm * stiffness - by_strain));
        let left = norm - stiffness * growth;
        let tangent = (growth / if left > 0.0 { left } else { norm }).clamp(1.0 / MOST, MOST);
        let [open, slope] = evaluate(tangent);
        let excess = tangent * open - 1.0;
        let x = if excess.abs() <= last_step {
            tangent * (1.0 - excess / slope)
        } else {
            let first = tangent.ln();
            root_from([first, first + open.ln(), slope], last_step, |logarithm: f64| {
                let [open, slope] = evaluate(logarithm.exp());
                [logarithm + open.ln(), slope]
            })
            .exp()
        };
        End::new(x, release.at(x).into(), length, last)
    }
}

/// The root of an increasing function between two [`LARGEST`], which `function` returns with its derivative, given a start with both:
/// Newton's method up to a step of `last_step`, with bisection once its steps leave a bracket or do not become half as long.
fn root_from(
    [start, mut value, mut slope]: [f64; 3],
    last_step: f64,
    mut function: impl FnMut(f64) -> [f64; 2],
) -> f64 {
    let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
    let (mut at, mut last, mut stride) = (start, f64::INFINITY, 1.0);
    for _ in 0..200 {
        let newton = at - value / slope;
        if (newton - at).abs() <= last_step {
            return newton;
        }
        if value > 0.0 {
            high = at
        } else {
            low = at
        }
        let is_open = low.is_infinite() || high.is_infinite();
        let next = if low < newton && newton < high && (is_open || (newton - at).abs() <= 0.5 * last) {
            newton
        } else if is_open {
            stride *= 2.0;
            if value > 0.0 { at - stride } else { at + stride }
        } else {
            0.5 * (low + high)
        };
        let next = next.clamp(-LARGEST, LARGEST);
        last = (next - at).abs();
        at = next;
        if last <= 2.0 * f64::EPSILON * (1.0 + at.abs()) {
            break;
        }
        [value, slope] = function(at);
    }
    at
}

/// Bounds of derivatives are found for stresses up to `2^(k / PARTS)` times the reference stress, for `k` in this range.
const PARTS: f64 = 64.0;
const LEVELS: std::ops::Range<i32> = -640..1920;

impl Flow for Elastic<CreepFormula> {
    #[inline(always)]
    fn elasticity(&self) -> &Isotropic {
        &self.elasticity
    }

    fn rate<const S: usize>(&self, s: &Mandel<S>, accumulated: f64) -> (Mandel<S>, f64) {
        let mean = mean_of(s);
        rate_along_deviator(s, |norm| self.parameters.value(norm, [mean, accumulated]))
    }

    fn flow_to_end<const S: usize>(
        &self,
        trial: &Mandel<S>,
        length: f64,
        accumulated: f64,
        tangent: Option<&mut Tangent<S>>,
    ) -> Option<(Mandel<S>, f64)> {
        let norm = von_mises(trial);
        let mean = mean_of(trial);
        let fastest = self.parameters.at(norm, [mean, accumulated]);
        if norm == 0.0 || fastest.rate == 0.0 {
            return None;
        }
        let release = Release::new(trial, norm, &self.elasticity);
        // The derivatives are those before the last step.
        let is_rough = tangent.is_some() || self.parameters.rate.has_pieces();
        let last_step = if is_rough { LAST } else { LAST_IF_SMOOTH };
        let end = self.solve(&release, fastest, length, [mean, accumulated], last_step);
        let growth = end.x * end.norm;
        let (left, [a, b]) = release.map::<S>(end.x);
        let weighted = WEIGHT.apply(&left.apply(trial));
        if let Some(tangent) = tangent {
            // The derivative of q(x) by s* at this x is R W s / q, that of R s* by x is -E W R s.
            let gradient = left.apply(&weighted);
            write_isotropic(tangent, a, b);
            let release = self.elasticity.apply(&gradient);
            add_product(tangent, end.by_norm / (end.by_x * end.norm), &release, &gradient);
            let by_mean = length * self.parameters.by_mean(end.norm, [mean, accumulated + growth]);
            if by_mean != 0.0 {
                add_product(tangent, -by_mean / (3.0 * end.by_x), &release, &identity());
            }
        }
        Some((weighted.map(|w| end.x * w), growth))
    }

    /// The end is known: `E W s` is what each unit of `x` released.
    fn by_accumulated<const S: usize>(
        &self,
        trial: &Mandel<S>,
        stress: &Mandel<S>,
        length: f64,
        accumulated: f64,
        _: &Tangent<S>,
    ) -> Mandel<S> {
        let released = self.elasticity.apply(&WEIGHT.apply(stress));
        let x = dot(&add_scaled(trial, -1.0, stress), &released) / dot(&released, &released);
        if x.is_nan() || x <= 0.0 {
            return [0.0; S];
        }
        let release = Release::new(trial, von_mises(trial), &self.elasticity);
        let (norm, fall) = release.at(x);
        let last = self.parameters.at(norm, [mean_of(trial), accumulated + x * norm]);
        let end = End::new(x, [norm, fall], length, last);
        let gradient = release.map::<S>(x).0.apply(&WEIGHT.apply(stress));
        self.elasticity.apply(&gradient).map(|component| -end.by_strain / end.by_x * component)
    }

    /// The yield surface of a rate that is zero up to a threshold, `g(s) = q` and `Y + h p` the threshold; nothing is linear in `p`.
    fn room<const S: usize>(
        &self,
        elastic: &Mandel<S>,
        release: &Mandel<S>,
        growth: f64,
        accumulated: f64,
    ) -> Room<S> {
        let law = &self.parameters;
        let (norm, mean) = (von_mises(elastic), mean_of(elastic));
        // A rate without pieces has no threshold.
        if !law.rate.has_pieces() {
            return Room::Everywhere;
        }
        let nearly_none = SMALL * if norm > 0.0 { norm } else { law.reference_stress };
        if law.value(nearly_none, [mean, accumulated]) != 0.0 {
            return Room::Everywhere;
        }
        if law.value(norm, [mean, accumulated]) == 0.0 {
            return Room::Nowhere;
        }
        let relief = 2.0 * von_mises(release);
        let at = |share: f64| ((norm - share * relief).max(0.0), [mean, accumulated + 2.0 * share * growth]);
        let yields = |share: f64| {
            let (norm, others) = at(share);
            law.value(norm, others) != 0.0
        };
        let [mut low, mut high] = [0.0, 1.0];
        if yields(high) {
            return Room::UpTo(f64::INFINITY, [0.0; S]);
        }
        loop {
            let middle = 0.5 * (low + high);
            if middle <= low || middle >= high {
                break;
            }
            if yields(middle) { low = middle } else { high = middle }
        }
        let (least, others) = at(low);
        let Rate { by_norm, by_strain, .. } = law.at(least, others);
        let falls = by_norm * relief - 2.0 * by_strain * growth;
        if falls <= 0.0 {
            return Room::UpTo(low, [0.0; S]);
        }
        let [along, by_mean] = [by_norm / norm, law.by_mean(least, others) / 3.0].map(|slope| slope / falls);
        let weighted = WEIGHT.apply(elastic);
        let identity = identity::<S>();
        Room::UpTo(low, std::array::from_fn(|c| along * weighted[c] + by_mean * identity[c]))
    }

    /// Along the deviator, stress relaxes at the rate `3 G df/dq`, also the largest rate in plane stress, and hardening at `-df/dp`; they
    /// add up. The derivatives are enclosed. A change of the mean stress changes the flow, in the norm of the elastic energy by
    /// `sqrt(G 3 K) df/dm`.
    fn fastest_rate<const S: usize>(&self, overstress: f64) -> f64 {
        let level = (overstress.log2() * PARTS).ceil().max(f64::from(LEVELS.start)) as i32;
        let [by_stress, by_strain, by_mean] = self.parameters.bounds(level);
        let Isotropic { volumetric, shear } = self.elasticity;
        let coupled = if by_mean == 0.0 { 0.0 } else { (0.5 * shear * (shear + 3.0 * volumetric)).sqrt() };
        1.5 * shear * by_stress + by_strain + coupled * by_mean
    }

    fn has_symmetric_tangent<const S: usize>(&self) -> bool {
        !self.parameters.rate.uses(Variable::P)
    }

    fn is_power_law(&self) -> bool {
        true
    }

    fn overstress<const S: usize>(&self, s: &Mandel<S>, _accumulated: f64) -> f64 {
        let mean = if self.parameters.rate.uses(Variable::P) { mean_of(s).abs() } else { 0.0 };
        larger(von_mises(s), mean) / self.parameters.reference_stress
    }

    fn hardens(&self) -> bool {
        self.parameters.rate.uses(Variable::E)
    }
}

#[cfg(test)]
mod tests {
    use super::super::Norton;
    use super::*;

    const BODY: Elasticity = Elasticity::linear(1000.0, 0.25);

    fn written(rate: &str) -> CreepFormula {
        let rate = Formula::parse(rate).expect("a formula");
        CreepFormula { rate, reference_stress: 10.0, temperature: 0.0, bounds: Derived::default() }
    }

    fn check<const S: usize>(hypothesis: Hypothesis) {
        for (exponent, hardening_strain) in [(1.0, None), (5.0, None), (3.0, Some(0.01))] {
            let norton = Norton {
                rate: 0.005,
                reference_stress: 10.0,
                exponent,
                hardening_strain,
                hardening_exponent: 1.5,
            };
            let hardening = if hardening_strain.is_some() { "/(1 + e/0.01)^1.5" } else { "" };
            let formula = written(&format!("0.005*(q/10)^{exponent}{hardening}"));
            assert_eq!(formula.fault(), None);
            let (one, other) = (norton.prepare(&BODY, hypothesis), formula.prepare(&BODY, hypothesis));
            assert_eq!(one.hardens(), other.hardens());
            for size in [1e-3, 1.0, 30.0, 1e3] {
                let trial: Mandel<S> = std::array::from_fn(|i| size * [1.0, -0.4, 0.3, 0.7, -0.2, 0.5][i]);
                let [mut first, mut second] = [[[0.0; S]; S]; 2];
                let (flow, growth) = one.flow_to_end(&trial, 0.7, 0.002, Some(&mut first)).expect("flow");
                let (found, other_growth) =
                    other.flow_to_end(&trial, 0.7, 0.002, Some(&mut second)).expect("flow");
                assert!(
                    (growth / other_growth - 1.0).abs() < 1e-12,
                    "{exponent} {size}: {growth} {other_growth}"
                );
                for i in 0..S {
                    assert!((flow[i] - found[i]).abs() < 1e-12 * growth, "{flow:?} {found:?}");
                    assert!(
                        (0..S).all(|j| (first[i][j] - second[i][j]).abs() < 1e-11),
                        "{exponent} {size}: {first:?} {second:?}"
                    );
                }
                let [(a, p), (b, r)] = [one.rate(&trial, 0.002), other.rate(&trial, 0.002)];
                assert!((p / r - 1.0).abs() < 1e-13 && (0..S).all(|i| (a[i] - b[i]).abs() < 1e-13 * p));
            }
            for overstress in [0.5, 1.0, 3.0] {
                let share = other.fastest_rate::<S>(overstress) / one.fastest_rate::<S>(overstress);
                assert!((1.0 - 1e-9..1.3).contains(&share), "{exponent} {overstress}: {share}");
            }
        }
    }

    #[test]
    fn nortons_law_written_as_a_formula_has_its_numbers() {
        check::<3>(Hypothesis::PlaneStress);
        check::<4>(Hypothesis::PlaneStrain);
        check::<6>(Hypothesis::Space);
    }

    #[test]
    fn steep_rates_flow_as_their_law_says_in_plane_stress_too() {
        let body = Elasticity::linear(20e9, 0.3);
        for text in [
            "1e-3*(q/30e6)^40",
            "1e-3*sinh(q/20e6)",
            "exp(q/5e6) - 1",
            "1e3*max(q/20e6 - 1, 0)",
            "1e-3*(q/30e6)^200",
        ] {
            for length in [1e-6, 0.1, 1e3] {
                let law = written(text).prepare(&body, Hypothesis::PlaneStress);
                let trial = [200e6, 0.0, 0.0];
                let (flow, growth) = law.flow_to_end(&trial, length, 0.0, None).expect("flow");
                let release = law.elasticity.apply(&flow);
                let stress: Mandel<3> = std::array::from_fn(|i| trial[i] - release[i]);
                let q = von_mises(&stress);
                // The stress whose rate is this growth, by the slope of the law.
                let Rate { rate, by_norm: slope, .. } = law.parameters.at(q, [0.0; 2]);
                let off = (growth / length - rate).abs() / slope.max(f64::MIN_POSITIVE);
                assert!(growth > 0.0 && q > 0.0 && off < 1e-6 * q, "{text} {length}: {growth} {q} {rate}");
            }
        }
    }

    #[test]
    fn creep_that_depends_on_the_mean_stress_by_hand() {
        // Uniaxial stress 60 has the mean 20, which creep keeps: 60 - q = 3 G growth = 1200 growth.
        let law = written("1e-3*(q/20)^2*exp(p/20)");
        assert_eq!(law.fault(), None);
        let body = law.prepare(&BODY, Hypothesis::Space);
        for (sign, factor) in [(1.0, 1.0_f64.exp()), (-1.0, (-1.0_f64).exp())] {
            let trial = [sign * 60.0, 0.0, 0.0, 0.0, 0.0, 0.0];
            let (flow, growth) = body.flow_to_end(&trial, 2.0, 0.0, None).expect("flow");
            let q = 60.0 - 1200.0 * growth;
            assert!((growth - 2e-3 * factor * (q / 20.0).powi(2)).abs() < 1e-13, "{growth}");
            assert!((flow[0] - sign * growth).abs() < 1e-15 && trace(&flow).abs() < 1e-15);
            let (_, rate) = body.rate(&trial, 0.0);
            assert!((rate - 9e-3 * factor).abs() < 1e-15, "{rate}");
        }
        let refused = law.fault_in_plane_stress().expect("refused");
        assert!(refused.message.contains("mean stress p") && refused.key == "rate");
        assert_eq!(written("1e-3*q").fault_in_plane_stress(), None);
        let up_to = |text: &str| written(text).prepare(&BODY, Hypothesis::Space).fastest_rate::<6>(1.0);
        // At most 3 G 2 q/400 e^(p/20) 1e-3, and sqrt(G 3 K) (q/20)^2/20 e^(p/20) 1e-3, with q and p of 10.
        let most = 0.5_f64.exp() * (1200.0 * 0.05 + (400.0_f64 * 2000.0).sqrt() * 0.25 / 20.0) * 1e-3;
        let found = up_to("1e-3*(q/20)^2*exp(p/20)");
        assert!(found >= most && found < 1.2 * most, "{found} {most}");
    }

    #[test]
    fn tangents_with_the_mean_stress_are_derivatives() {
        fn check<const S: usize>(hypothesis: Hypothesis, trial: Mandel<S>) {
            for text in ["1e-3*(q/20)^2*exp(p/20)", "2e-3*q*max(1 + 0.02*p, 0)/(1 + e/0.01)"] {
                let law = written(text).prepare(&BODY, hypothesis);
                assert!(!law.has_symmetric_tangent::<S>());
                let end = |trial: &Mandel<S>| {
                    let flow = law.flow_to_end(trial, 0.7, 0.002, None).map_or([0.0; S], |(flow, _)| flow);
                    let release = law.elasticity.apply(&flow);
                    std::array::from_fn::<f64, S, _>(|c| trial[c] - release[c])
                };
                let mut tangent = [[0.0; S]; S];
                law.flow_to_end(&trial, 0.7, 0.002, Some(&mut tangent)).expect("flow");
                for j in 0..S {
                    let moved = |step: f64| {
                        let mut moved = trial;
                        moved[j] += step;
                        end(&moved)
                    };
                    let [above, below] = [moved(1e-5), moved(-1e-5)];
                    for i in 0..S {
                        let slope = (above[i] - below[i]) / 2e-5;
                        assert!(
                            (tangent[i][j] - slope).abs() < 1e-6,
                            "{text} {i} {j}: {} {slope}",
                            tangent[i][j]
                        );
                    }
                }
            }
        }
        check::<4>(Hypothesis::PlaneStrain, [30.0, -12.0, 9.0, 21.0]);
        check::<6>(Hypothesis::Space, [30.0, -12.0, 9.0, 21.0, -6.0, 15.0]);
    }

    #[test]
    fn creep_is_as_fast_as_the_temperature_has_it() {
        let formula = written("1e-3*(q/20)^2*max(temperature - 300, 0)/100");
        assert!(formula.fault().is_none() && formula.sees_temperature() && !written("q").sees_temperature());
        let mut law = formula.prepare(&BODY, Hypothesis::Space);
        for (temperature, factor) in [(250.0, 0.0), (400.0, 1.0), (500.0, 2.0)] {
            law.set_temperature(temperature);
            let (_, rate) = law.rate(&[60.0, 0.0, 0.0, 0.0, 0.0, 0.0], 0.0);
            assert!((rate - 9e-3 * factor).abs() < 1e-15, "{rate}");
            let end = law.flow_to_end(&[60.0, 0.0, 0.0, 0.0, 0.0, 0.0], 2.0, 0.0, None);
            let growth = end.map_or(0.0, |(_, growth)| growth);
            let q = 60.0 - 1200.0 * growth;
            assert!((growth - 2e-3 * factor * (q / 20.0).powi(2)).abs() < 1e-13, "{growth}");
        }
        let fault = written("1e-3*q + 1e-9*temperature").fault().expect("refused");
        assert!(fault.message.contains("not zero without stress near q = 0, temperature = "), "{fault:?}");
    }

    #[test]
    fn below_a_threshold_nothing_creeps() {
        let law = written("1e-3*max(q/20 - 1, 0)^2").prepare(&BODY, Hypothesis::Space);
        assert_eq!(law.flow_to_end(&[19.0, 0.0, 0.0, 0.0, 0.0, 0.0], 1.0, 0.0, None), None);
        let (_, growth) = law.flow_to_end(&[60.0, 0.0, 0.0, 0.0, 0.0, 0.0], 1.0, 0.0, None).expect("flow");
        let q = 60.0 - 1200.0 * growth;
        assert!((growth - 1e-3 * (q / 20.0 - 1.0).powi(2)).abs() < 1e-16, "{growth}");
    }

    #[test]
    fn rates_that_make_no_law_are_refused_with_the_remedy() {
        for (text, message, help) in [
            ("1e-3", "not zero without stress", "q = 0"),
            ("1e-3*q*exp(-q/10)", "may decrease with the stress near q = ", "grow"),
            ("1e-3*q*(1 + e)", "may increase with the creep strain", "[material.damage]"),
            ("1e-3*if(q < 10, 0, q)", "may jump with q", "interpolate"),
            ("1e-3*q*sqrt(1 - e)", "no value near", "from 0 on"),
            ("1e-3*q*if(p < 0, 1, 2)", "may jump with p", "interpolate"),
            ("1e-3*q*(1 + p/10)", "may decrease with the stress near q = ", "grow"),
            ("1e-3*max(q + 2*p, 0)", "not zero without stress", "q = 0"),
        ] {
            let fault = written(text).fault().expect(text);
            assert!(fault.message.contains(message) && fault.help.contains(help), "{text}: {fault:?}");
        }
        for text in [
            "1e-3*sinh(q/20)^4*exp(-e/0.1)",
            "exp(q/5) - 1",
            "1e-3*sinh(q/2)",
            "8.5e-4*(q/1e-3)^2/(1 + e/0.1)",
            "q^1.5",
            "if(q < 0.3, 0, (q - 0.1*3)^2)",
            "if(q <= 20, 0, 1e-3*(q/20 - 1))",
        ] {
            assert_eq!(written(text).fault(), None, "{text}");
        }
    }
}
