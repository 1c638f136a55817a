//! Viscosity that is written in the job as a formula of the strain rate: a nonlinear operator `A`.
//!
//! ```text
//! A(e) = bulk tr(e) I + f(g) dev e,   g = sqrt(2 dev e : dev e)
//! ```
//!
//! In simple shear `g` is the shear rate, and the shear stress is `f(g) g / 2`. `A` is the gradient of `bulk tr(e)^2 / 2 + F(g)` with
//! `F'(g) = f(g) g / 2`, so that its derivative is symmetric, with the eigenvalues `n bulk`, `f(g)` and `d(f g)/dg`. It is strongly
//! monotone with the least of them, assumption H(A)(iv) of Wang and Cheng (2022). Traces and deviators are those of the `n` stored normal
//! components: in plane stress of the two in the plane, as those of a viscosity without a formula.
//!
//! The matrix of a step contains the linear viscosity `bulk tr(e) I + m dev e` with the infimum `m` of `d(f g)/dg` up to the reference
//! rate, from an enclosure. What remains is monotone, so that certificates of the linear viscosity hold for `A`.

use super::{growth::Growth, isotropic::Isotropic, viscoplasticity::Tangent};
use crate::{
    laws::{
        expression::{Formula, OfRate, Variable},
        law::{Derived, LawFault},
    },
    linear_algebra::tensor::{Mandel, dot, normal_components, trace},
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A viscosity that is a formula of the strain rate, in place of `volumetric` and `shear`: the viscous stress is
/// `bulk tr(e) I + shear dev e` for the strain rate e. In plane stress, trace and deviator are those of the plane.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ViscosityFormula {
    /// Factor of the deviator of the strain rate, twice the dynamic viscosity, as a formula of the equivalent strain rate
    /// g = sqrt(2 dev e : dev e) in 1/s, which is the shear rate in simple shear. shear*g must grow with g, and must not jump.
    #[schemars(extend("unit" = "Pa s"), example = &"2e3*(1e-3 + g)^(-0.4)")]
    pub shear: Formula<OfRate>,
    /// Factor of the trace of the strain rate. A constant `shear` is the viscosity with `volumetric = bulk - shear/3`, in plane stress
    /// `bulk - shear/2`.
    #[schemars(extend("unit" = "Pa s", "exclusiveMinimum" = 0), example = 1e4)]
    pub bulk: f64,
    /// Equivalent strain rate up to which the certificates hold from the start: the matrix of a step has the least viscosity that resists a
    /// change of strain rates up to this one. Where a step is faster, the run extends the range and computes the certificates anew.
    #[schemars(extend("unit" = "1/s", "exclusiveMinimum" = 0), example = 10.0)]
    pub reference_rate: f64,
    #[serde(skip)]
    least: Arc<Derived<Result<f64, [String; 2]>>>,
}

impl ViscosityFormula {
    /// With this formula.
    pub fn new(shear: Formula<OfRate>, bulk: f64, reference_rate: f64) -> Self {
        Self { shear, bulk, reference_rate, least: Arc::default() }
    }

    /// The fault of the formula: it must be strongly monotone up to the reference rate, and monotone for all rates.
    pub fn fault(&self) -> Option<LawFault> {
        self.growth().fault(self.least())
    }

    /// The same formula with bounds up to this multiple of its reference rate; `None` if its stress may not grow there.
    pub fn covering(&self, multiple: f64) -> Option<Self> {
        let wide = Self::new(self.shear.clone(), self.bulk, multiple * self.reference_rate);
        wide.least().is_ok().then_some(wide)
    }

    /// The linear viscosity in Pa s that the matrix of a step contains, in a body with this many normal components.
    pub fn tensor(&self, normal_components: usize) -> Isotropic {
        let least = self.least_shear();
        Isotropic { volumetric: self.bulk - least / normal_components as f64, shear: least }
    }

    /// Whether the viscosity is linear.
    pub fn is_constant(&self) -> bool {
        self.shear.is_constant_along(Variable::G)
    }

    /// What the viscous stress adds to that of the linear viscosity.
    pub fn rest(&self) -> RateViscosity {
        RateViscosity {
            shear: self.shear.clone(),
            least: self.least_shear(),
            reference_rate: self.reference_rate,
        }
    }

    /// The infimum in Pa s of `d(f g)/dg` up to the reference rate, from below; 0 if the formula has a fault.
    fn least_shear(&self) -> f64 {
        *self.least().as_ref().unwrap_or(&0.0)
    }

    fn least(&self) -> &Result<f64, [String; 2]> {
        self.least.get(|| self.find_least())
    }

    fn find_least(&self) -> Result<f64, [String; 2]> {
        self.growth().least(self.reference_rate)
    }

    fn growth(&self) -> Growth<'_, OfRate> {
        Growth {
            formula: &self.shear,
            by: Variable::G,
            key: "shear",
            what: "viscosity",
            product: "viscous stress",
            variable: "strain rate",
            reference: "reference_rate",
            unit: " Pa s",
            remedy: ": write (1e-3 + g)^(-0.4) in place of g^(-0.4)",
        }
    }
}

/// What a viscous stress of the strain rate adds to that of a linear viscosity: `(f(g) - m) dev e`.
#[derive(Debug, Clone, PartialEq)]
pub struct RateViscosity {
    shear: Formula<OfRate>,
    /// `m` in Pa s.
    least: f64,
    reference_rate: f64,
}

impl RateViscosity {
    /// `g` in 1/s of a strain rate, and its deviator.
    fn equivalent<const S: usize>(rate: &Mandel<S>) -> (f64, Mandel<S>) {
        let normal = normal_components::<S>();
        let mean = trace(rate) / normal as f64;
        let deviator: Mandel<S> = std::array::from_fn(|c| if c < normal { rate[c] - mean } else { rate[c] });
        ((2.0 * dot(&deviator, &deviator)).sqrt(), deviator)
    }

    /// The same law with the reference rate of this formula.
    pub fn within_reference(self, formula: &ViscosityFormula) -> Self {
        Self { reference_rate: formula.reference_rate, ..self }
    }

    /// The equivalent strain rate in 1/s as a share of the reference rate.
    pub fn share_of_reference<const S: usize>(&self, rate: &Mandel<S>) -> f64 {
        Self::equivalent(rate).0 / self.reference_rate
    }

    /// The stress in Pa that it adds at a strain rate in 1/s.
    pub fn stress<const S: usize>(&self, rate: &Mandel<S>) -> Mandel<S> {
        let (g, deviator) = Self::equivalent(rate);
        let factor = self.shear.value(&[(Variable::G, g)]) - self.least;
        deviator.map(|component| factor * component)
    }

    /// The derivative in Pa s of this stress by the strain rate.
    pub fn tangent<const S: usize>(&self, rate: &Mandel<S>) -> Tangent<S> {
        let (g, deviator) = Self::equivalent(rate);
        let [shear, slope] = self.shear.differentiate(&[(Variable::G, g)], Variable::G);
        let across = shear - self.least;
        let share = across / normal_components::<S>() as f64;
        let isotropic = Isotropic { volumetric: -share, shear: across };
        // The slope may be infinite at rest, where the deviator is zero.
        let along = if g > 0.0 { 2.0 * slope / g } else { 0.0 };
        std::array::from_fn(|i| {
            let mut unit = [0.0; S];
            unit[i] = 1.0;
            let row = isotropic.apply(&unit);
            std::array::from_fn(|j| row[j] + along * deviator[i] * deviator[j])
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn written(shear: &str, reference_rate: f64) -> ViscosityFormula {
        ViscosityFormula::new(Formula::parse(shear).expect("a formula"), 40.0, reference_rate)
    }

    fn rest(shear: &str) -> RateViscosity {
        written(shear, 10.0).rest()
    }

    /// The whole stress of a law.
    fn stress<const S: usize>(law: &ViscosityFormula, rate: &Mandel<S>) -> Mandel<S> {
        let linear = law.tensor(normal_components::<S>()).apply(rate);
        let rest = law.rest().stress(rate);
        std::array::from_fn(|c| linear[c] + rest[c])
    }

    #[test]
    fn stresses_by_hand() {
        // In simple shear at 3/s the stress is (5 + 2 x 3) 3 / 2; uniform growth at 0.1/s along each axis gives 3 x 40 x 0.1.
        let law = written("5 + 2*g", 10.0);
        let root = std::f64::consts::SQRT_2;
        let sheared = stress::<6>(&law, &[0.1, 0.1, 0.1, 0.0, 0.0, 1.5 * root]);
        let expected = [12.0, 12.0, 12.0, 0.0, 0.0, 16.5 * root];
        assert!((0..6).all(|c| (sheared[c] - expected[c]).abs() < 1e-13), "{sheared:?}");
        // In the plane, e = (1, -1, 0) has g = 2; along one axis (1, 0, 0) it is 1.
        assert_eq!(stress::<3>(&law, &[1.0, -1.0, 0.0]), [9.0, -9.0, 0.0]);
        let along = stress::<3>(&law, &[1.0, 0.0, 0.0]);
        assert!((along[0] - 43.5).abs() < 1e-13 && (along[1] - 36.5).abs() < 1e-13, "{along:?}");
        // Plane strain: dev = (2, -1, -1)/3, g = sqrt(4/3).
        let g = (4.0_f64 / 3.0).sqrt();
        let along = stress::<4>(&law, &[1.0, 0.0, 0.0, 0.0]);
        assert!((along[0] - (40.0 + (5.0 + 2.0 * g) * 2.0 / 3.0)).abs() < 1e-13, "{along:?}");
        assert!((along[2] - (40.0 - (5.0 + 2.0 * g) / 3.0)).abs() < 1e-13, "{along:?}");
    }

    #[test]
    fn a_constant_is_the_viscosity_without_a_formula() {
        let law = written("50", 1.0);
        assert_eq!((law.is_constant(), law.fault()), (true, None));
        let hidden = written("50 + 0*g", 1.0);
        assert_eq!((hidden.is_constant(), hidden.fault()), (true, None));
        assert!(!written("50 + 1e-9*g", 1.0).is_constant());
        assert_eq!(law.tensor(2), Isotropic { volumetric: 15.0, shear: 50.0 });
        assert_eq!(law.tensor(3).smallest_modulus::<6>(), 50.0);
        assert!(
            (ViscosityFormula { bulk: 10.0, ..law }.tensor(3).smallest_modulus::<6>() - 30.0).abs() < 1e-13
        );
    }

    #[test]
    fn the_least_growth_of_the_stress_is_enclosed() {
        // d/dg of g (1e-3 + g)^(-0.4) is least at the reference rate.
        let slope = |g: f64| (1e-3 + g).powf(-1.4) * (1e-3 + 0.6 * g);
        for (text, wanted) in [
            ("2e3*(1e-3 + g)^(-0.4)", 2e3 * slope(10.0)),
            ("5 + 2*g", 5.0),
            // Carreau's law.
            (
                "3 + 7*(1 + (2*g)^2)^(-0.35)",
                3.0 + 7.0 * (401.0_f64.powf(-0.35) - 0.7 * 400.0 * 401.0_f64.powf(-1.35)),
            ),
            ("max(3, 5 - g)", 1.0),
            ("if(g < 2, 5 - g, 3)", 1.0),
            ("if(g < 0.3, 5, 4.7 + g)", 5.0),
        ] {
            let law = written(text, 10.0);
            assert_eq!(law.fault(), None, "{text}");
            let found = law.least_shear();
            assert!(found <= wanted * (1.0 + 1e-12) && found >= 0.985 * wanted, "{text}: {found} {wanted}");
        }
    }

    #[test]
    fn viscosities_that_are_not_monotone_are_refused_with_place_and_remedy() {
        for (text, message, help) in [
            ("5 - g", "near g = ", "more slowly than 1/g"),
            ("3*exp(-g/20)", "fall with the strain rate near g = ", "min(g, 10)"),
            ("-2", "grows by -2 Pa s", "more slowly"),
            ("g", "may not grow with the strain rate near g = 0", "add a constant"),
            ("0", "may not grow", "add a constant"),
            // Bingham's law: the stress tends to a limit that it has already.
            ("min(5, 5/max(g, 1e-3))", "may not grow with the strain rate near g = ", "add a constant"),
            ("g^(-0.4)", "no value near g = 0", "1e-3 + g"),
            ("if(g < 1, 2, 3)", "may jump with g", "interpolate"),
            ("if(g < 1, 2, 2 + 1e-9*g)", "may jump with g", "interpolate"),
            ("ln(g)", "no value near g = 0", "every g"),
        ] {
            let fault = written(text, 10.0).fault().expect(text);
            assert_eq!(fault.key, "shear");
            assert!(fault.message.contains(message) && fault.help.contains(help), "{text}: {fault:?}");
            assert_eq!(written(text, 10.0).least_shear(), 0.0);
        }
        assert_eq!(written("0.01 + min(5, 5/max(g, 1e-3))", 10.0).fault(), None, "it grows");
    }

    fn check<const S: usize>(law: &RateViscosity, rate: Mandel<S>, other: Mandel<S>) {
        let tangent = law.tangent(&rate);
        let small = 1e-6;
        for j in 0..S {
            let moved = |step: f64| {
                let mut moved = rate;
                moved[j] += step;
                law.stress(&moved)
            };
            let [above, below] = [moved(small), moved(-small)];
            for i in 0..S {
                let slope = (above[i] - below[i]) / (2.0 * small);
                assert!(
                    (tangent[i][j] - slope).abs() < 1e-6 * (1.0 + slope.abs()),
                    "{i} {j}: {} {slope}",
                    tangent[i][j]
                );
                assert!((tangent[i][j] - tangent[j][i]).abs() < 1e-12 * (1.0 + tangent[i][j].abs()));
            }
        }
        // What remains beside the linear viscosity is monotone.
        let [one, two] = [law.stress(&rate), law.stress(&other)];
        let work: f64 = (0..S).map(|c| (one[c] - two[c]) * (rate[c] - other[c])).sum();
        assert!(work >= -1e-12, "{work}");
    }

    proptest! {
        #[test]
        fn tangents_are_derivatives_and_stresses_monotone(
            rate in prop::array::uniform6(-1.0f64..1.0), other in prop::array::uniform6(-1.0f64..1.0), number in 0_usize..4
        ) {
            let law = rest(["2*(0.1 + g)^(-0.4)", "5 + 2*g", "1 + 3/cosh(g)^0.2", "1 + sqrt(g)"][number]);
            prop_assume!(rate.iter().any(|e| e.abs() > 0.1));
            check::<6>(&law, rate, other);
            let first = |all: [f64; 6]| std::array::from_fn(|c| all[c]);
            check::<4>(&law, first(rate), std::array::from_fn(|c| other[c]));
            prop_assume!((rate[0] - rate[1]).abs() + rate[2].abs() > 0.1);
            check::<3>(&law, std::array::from_fn(|c| rate[c]), std::array::from_fn(|c| other[c]));
        }
    }

    #[test]
    fn at_rest_the_tangent_is_isotropic_also_where_the_formula_has_no_derivative() {
        let tangent = rest("1 + sqrt(g)").tangent::<3>(&[0.0; 3]);
        assert!(tangent.as_flattened().iter().all(|value| value.abs() < 0.02), "{tangent:?}");
        assert_eq!(rest("1 + sqrt(g)").stress::<6>(&[0.0; 6]), [0.0; 6]);
    }
}
