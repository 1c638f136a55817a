//! Elasticity whose shear modulus is written in the job as a formula of the strain: a nonlinear operator `E`.
//!
//! ```text
//! E(e) = K tr(e) I + 2 G f(q) dev e,   q = sqrt(2 dev e : dev e)
//! ```
//!
//! with the bulk modulus `K` and the shear modulus `G` of the linear elasticity in whose table the formula is. In simple shear `q` is the
//! shear strain, and the shear stress is `G f(q) q`. `E` is the gradient of the stored energy `K tr(e)^2 / 2 + G F(q)` with
//! `F'(q) = f(q) q`. It is strongly monotone where `f(q) q` grows, by the same proof as for a
//! [viscosity](super::viscosity_formula). The matrix of an implicit step contains the linear elasticity with the infimum `m` of `d(f q)/dq`
//! up to the reference strain in place of `f`; what remains is monotone. The bound of explicit steps is that of the linear elasticity with
//! the supremum: the derivative of `E` has the eigenvalues `3 K`, `2 G f` and `2 G d(f q)/dq`, and `f` is a mean of `d(f q)/dq`.
//!
//! Under the midpoint rule the stress is a discrete gradient, so that its work in a step is the change of the stored energy: between the
//! strains `e_0` and `e_1`, `2 G f' dev (e_0 + e_1)/2` with the mean `f' = 2 (F(q_1) - F(q_0)) / (q_1^2 - q_0^2)` of `f` over `q^2`
//! (O. Gonzalez, Time integration and discrete Hamiltonian systems, Journal of Nonlinear Science 6 (1996), 449-467).

mod plane_stress;

use super::{growth::Growth, isotropic::Isotropic, stored::Stored};
use crate::{
    laws::{
        expression::{Formula, OfStrain, Variable},
        law::{Derived, LawFault},
    },
    linear_algebra::tensor::{Mandel, add_scaled, dot, normal_components, trace},
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A shear modulus that is a formula of the strain; linear in the change of volume.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ElasticityFormula {
    /// The shear modulus over that of `youngs_modulus` and `poisson_ratio`, as a formula of the equivalent strain e = sqrt(2 dev eps : dev
    /// eps), which is the shear strain in simple shear; Euler's number is exp(1). The bulk modulus is constant. shear_factor*e must grow with
    /// e, and must not jump.
    #[schemars(extend("unit" = "1"), example = &"1/(1 + e/1e-3)")]
    pub shear_factor: Formula<OfStrain>,
    /// Equivalent strain up to which the certificates hold from the start: the matrix of a step has the least stiffness that resists a change
    /// of strains up to this one. Where a step strains the body more, the run extends the range and computes the certificates anew.
    #[schemars(extend("unit" = "1", "exclusiveMinimum" = 0), example = 1e-2)]
    pub reference_strain: f64,
    #[serde(skip)]
    least: Arc<Derived<Result<f64, [String; 2]>>>,
    #[serde(skip)]
    most: Arc<Derived<f64>>,
    #[serde(skip)]
    stored: Arc<Derived<Arc<Stored>>>,
}

impl ElasticityFormula {
    /// With this formula.
    pub fn new(shear_factor: Formula<OfStrain>, reference_strain: f64) -> Self {
        let (least, most, stored) = Default::default();
        Self { shear_factor, reference_strain, least, most, stored }
    }

    /// The fault of the formula: its stress must be strongly monotone up to the reference strain, and monotone for all strains.
    pub fn fault(&self) -> Option<LawFault> {
        self.growth().fault(self.least())
    }

    /// The shear modulus without strain over that of the linear elasticity.
    pub fn at_rest(&self) -> f64 {
        self.shear_factor.value(&[(Variable::E, 0.0)])
    }

    /// Whether the stress is linear.
    pub fn is_constant(&self) -> bool {
        self.shear_factor.is_constant_along(Variable::E)
    }

    /// The law of a material whose linear elasticity has these moduli in three dimensions.
    pub fn law(&self, elasticity: Isotropic, comparison: Comparison) -> StrainElasticity {
        let stored = self.stored.get(|| Arc::new(Stored::new(&self.shear_factor, self.reference_strain)));
        let compared = match comparison {
            Comparison::Softer => *self.least().as_ref().unwrap_or(&0.0),
            Comparison::Stiffer => self.most(),
        };
        StrainElasticity { formula: self.clone(), elasticity, comparison, compared, stored: stored.clone() }
    }

    /// The fault of the formula where stresses are those at the start of a step: the stress must not rise too steeply for any step.
    pub fn fault_of_explicit_steps(&self) -> Option<LawFault> {
        (self.most() == f64::INFINITY).then(|| {
            LawFault::at_value(
                "shear_factor",
                "the elastic stress has no bound of its slope up to reference_strain, so that no explicit step is stable",
                "bound the argument of the formula, as in max(e, 1e-9), or use an implicit [time] scheme",
            )
        })
    }

    fn least(&self) -> &Result<f64, [String; 2]> {
        self.least.get(|| self.growth().least(self.reference_strain))
    }

    fn most(&self) -> f64 {
        *self.most.get(|| self.growth().most(self.reference_strain))
    }

    fn growth(&self) -> Growth<'_, OfStrain> {
        Growth {
            formula: &self.shear_factor,
            by: Variable::E,
            key: "shear_factor",
            what: "shear modulus",
            product: "elastic stress",
            variable: "strain",
            reference: "reference_strain",
            unit: "",
            remedy: "; e is the strain, Euler's number is exp(1)",
        }
    }
}

/// The linear elasticity that stands for such a law in the matrices of a body.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Comparison {
    /// The stiffest one that every change of strain up to the reference strain exceeds, which implicit steps contain.
    Softer,
    /// The softest one that no change of strain up to the reference strain exceeds, which bounds explicit steps.
    Stiffer,
}

/// The elastic stress of a material whose shear modulus is a formula of the strain.
#[derive(Debug, Clone, PartialEq)]
pub struct StrainElasticity {
    formula: ElasticityFormula,
    /// With the moduli where the formula is 1, in Pa.
    elasticity: Isotropic,
    comparison: Comparison,
    /// The infimum or supremum of `d(f q)/dq`.
    compared: f64,
    stored: Arc<Stored>,
}

/// A strain with its equivalent strain.
struct Point<const S: usize> {
    size: f64,
    deviator: Mandel<S>,
}

impl<const S: usize> Point<S> {
    fn of(strain: &Mandel<S>) -> Self {
        let normal = normal_components::<S>();
        let mean = trace(strain) / normal as f64;
        let deviator: Mandel<S> =
            std::array::from_fn(|c| if c < normal { strain[c] - mean } else { strain[c] });
        Self { size: (2.0 * dot(&deviator, &deviator)).sqrt(), deviator }
    }
}

impl StrainElasticity {
    /// The linear elasticity in Pa to which the law is compared, of strains with this number of components.
    pub fn linear<const S: usize>(&self) -> Isotropic {
        let compared = self.elasticity.with_shear_times(self.compared);
        if is_plane_stress::<S>() { compared.in_plane_stress() } else { compared }
    }

    /// The same law with bounds up to this multiple of the reference strain; `None` if its stress may not grow there.
    pub fn covering(&self, multiple: f64) -> Option<Self> {
        let (growth, most) = (self.formula.growth(), multiple * self.formula.reference_strain);
        let compared = match self.comparison {
            Comparison::Softer => growth.least(most).ok()?,
            Comparison::Stiffer => Some(growth.most(most)).filter(|most| most.is_finite())?,
        };
        Some(Self { compared, ..self.clone() })
    }

    /// The equivalent strain as a share of the reference strain.
    pub fn share_of_reference<const S: usize>(&self, strain: &Mandel<S>) -> f64 {
        let size = match is_plane_stress::<S>() {
            true => Point::of(&self.with_thickness(strain)).size,
            false => Point::of(strain).size,
        };
        size / self.formula.reference_strain
    }

    /// The stress in Pa.
    pub fn whole_stress<const S: usize>(&self, strain: &Mandel<S>) -> Mandel<S> {
        add_scaled(&self.linear::<S>().apply(strain), 1.0, &self.stress(strain))
    }

    /// The stress in Pa beyond that of the linear elasticity.
    pub fn stress<const S: usize>(&self, strain: &Mandel<S>) -> Mandel<S> {
        if is_plane_stress::<S>() {
            return self.plane_stress(strain);
        }
        let Point { size, deviator } = Point::of(strain);
        let factor = self.elasticity.shear * (self.factor(size) - self.compared);
        deviator.map(|component| factor * component)
    }

    /// The derivative in Pa of this stress by the strain.
    pub fn tangent<const S: usize>(&self, strain: &Mandel<S>) -> [Mandel<S>; S] {
        if is_plane_stress::<S>() {
            return self.plane_tangent(strain);
        }
        let Point { size, deviator } = Point::of(strain);
        let [factor, slope] = self.formula.shear_factor.differentiate(&[(Variable::E, size)], Variable::E);
        // The slope may be infinite at rest, where the deviator is zero.
        let along = if size > 0.0 { 2.0 * slope / size } else { 0.0 };
        self.combine(factor, along, &[deviator; 2])
    }

    /// The energy in J/m^3 that this stress stores.
    pub fn energy<const S: usize>(&self, strain: &Mandel<S>) -> f64 {
        self.energy_change([&[0.0; S], strain])
    }

    /// How much more energy in J/m^3 this stress stores at the second strain than at the first.
    pub fn energy_change<const S: usize>(&self, strains: [&Mandel<S>; 2]) -> f64 {
        if is_plane_stress::<S>() {
            return self.plane_energy_change(strains);
        }
        self.energy_between(strains.map(|strain| Point::of(strain).size))
    }

    fn energy_between(&self, [from, to]: [f64; 2]) -> f64 {
        let whole = self.stored.between(&self.formula.shear_factor, [from, to]);
        0.5 * self.elasticity.shear * (whole - 0.5 * self.compared * (to - from) * (to + from))
    }

    /// The mean stress in Pa beyond that of the linear elasticity between two strains, whose work is the change of the energy, given their
    /// mean and the second one.
    pub fn mean_stress<const S: usize>(&self, [before, mean, end]: [&Mandel<S>; 3]) -> Mandel<S> {
        if is_plane_stress::<S>() {
            return self.plane_mean_stress([before, end]);
        }
        let [start, end] = [before, end].map(|strain| Point::of(strain).size);
        let factor = self.stored.mean(&self.formula.shear_factor, [start, end]);
        let factor = self.elasticity.shear * (factor - self.compared);
        Point::of(mean).deviator.map(|component| factor * component)
    }

    /// The symmetric part of the derivative in Pa of this mean stress by the mean strain, for a given first strain.
    pub fn mean_tangent<const S: usize>(&self, [before, mean, end]: [&Mandel<S>; 3]) -> [Mandel<S>; S] {
        if is_plane_stress::<S>() {
            return self.plane_mean_tangent([before, end]);
        }
        let [start, end] = [before, end].map(Point::of);
        let formula = &self.formula.shear_factor;
        let factor = self.stored.mean(formula, [start.size, end.size]);
        let (sum, change) = (start.size + end.size, end.size - start.size);
        let [value, slope] = formula.differentiate(&[(Variable::E, end.size)], Variable::E);
        let along = if sum == 0.0 {
            0.0
        } else if change.abs() < CLOSE * sum {
            4.0 * slope / sum
        } else {
            8.0 * (value - factor) / (sum * change)
        };
        self.combine(factor, along, &[Point::of(mean).deviator, end.deviator])
    }

    /// `2 G ((factor - m) P + along sym(a b^T))` with the projection `P` on deviators.
    fn combine<const S: usize>(&self, factor: f64, along: f64, [a, b]: &[Mandel<S>; 2]) -> [Mandel<S>; S] {
        let shear = self.elasticity.shear;
        let across = shear * (factor - self.compared);
        let isotropic = Isotropic { volumetric: -across / 3.0, shear: across };
        let half = 0.5 * shear * along;
        std::array::from_fn(|i| {
            let mut unit = [0.0; S];
            unit[i] = 1.0;
            let row = isotropic.apply(&unit);
            std::array::from_fn(|j| row[j] + half * (a[i] * b[j] + b[i] * a[j]))
        })
    }

    fn factor(&self, size: f64) -> f64 {
        self.formula.shear_factor.value(&[(Variable::E, size)])
    }
}

/// Whether strains with this number of components are those of plane stress, whose strain across the plane follows.
const fn is_plane_stress<const S: usize>() -> bool {
    S == 3
}

/// Equivalent strains that differ by less than this share count as equal in a derivative.
const CLOSE: f64 = 1e-6;

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The bulk modulus is 40 Pa, the shear modulus 15 Pa.
    const BODY: Isotropic = Isotropic { volumetric: 30.0, shear: 30.0 };

    fn written(text: &str) -> ElasticityFormula {
        ElasticityFormula::new(Formula::parse(text).expect("a formula"), 0.1)
    }

    fn whole<const S: usize>(law: &StrainElasticity, strain: &Mandel<S>) -> Mandel<S> {
        add(&law.linear::<S>().apply(strain), &law.stress(strain))
    }

    fn add<const S: usize>(one: &Mandel<S>, other: &Mandel<S>) -> Mandel<S> {
        std::array::from_fn(|c| one[c] + other[c])
    }

    fn stored<const S: usize>(law: &StrainElasticity, strain: &Mandel<S>) -> f64 {
        0.5 * dot(&law.linear::<S>().apply(strain), strain) + law.energy(strain)
    }

    #[test]
    fn stresses_and_energies_by_hand() {
        // A shear of 0.3 has the stress 15 x 0.3 / (1 + 3) and the energy 15 x 0.1 (0.3 - 0.1 ln 4); a growth of volume of 0.3 the pressure 40
        // x 0.3.
        let law = written("1/(1 + e/0.1)").law(BODY, Comparison::Softer);
        let root = std::f64::consts::SQRT_2;
        let shear = [0.0, 0.0, 0.0, 0.0, 0.0, 0.15 * root];
        let sheared = whole::<6>(&law, &add(&shear, &[0.1, 0.1, 0.1, 0.0, 0.0, 0.0]));
        let expected = [12.0, 12.0, 12.0, 0.0, 0.0, 1.125 * root];
        assert!((0..6).all(|c| (sheared[c] - expected[c]).abs() < 1e-13), "{sheared:?}");
        let energy = stored(&law, &shear);
        assert!((energy - 1.5 * (0.3 - 0.1 * 4.0_f64.ln())).abs() < 1e-14, "{energy}");
        assert!((law.share_of_reference(&shear) - 3.0).abs() < 1e-14);
        // In plane strain along one axis dev = (2, -1, -1)/3, and e = sqrt(4/3).
        let strain = [0.3, 0.0, 0.0, 0.0];
        let factor = 1.0 / (1.0 + 0.3 * (4.0_f64 / 3.0).sqrt() / 0.1);
        let stress = whole::<4>(&law, &strain);
        assert!((stress[0] - (12.0 + 30.0 * factor * 0.2)).abs() < 1e-13, "{stress:?}");
        assert!((stress[2] - (12.0 - 30.0 * factor * 0.1)).abs() < 1e-13, "{stress:?}");
    }

    #[test]
    fn a_constant_is_linear_elasticity() {
        assert!(written("1").is_constant() && !written("1 + 1e-9*e").is_constant());
        let law = written("1").law(BODY, Comparison::Softer);
        let strain = [0.1, -0.3, 0.2, 0.05, 0.02, -0.07];
        let (found, wanted) = (whole::<6>(&law, &strain), BODY.apply(&strain));
        assert!((0..6).all(|c| (found[c] - wanted[c]).abs() < 1e-14), "{found:?}");
        assert!((stored(&law, &strain) - 0.5 * dot(&wanted, &strain)).abs() < 1e-14);
    }

    #[test]
    fn the_matrix_is_a_bound_up_to_the_reference_strain_and_beyond_once_it_is_covered() {
        // d/de of e/(1 + e/0.1) is 1/(1 + e/0.1)^2.
        let law = written("1/(1 + e/0.1)").law(BODY, Comparison::Softer);
        let wide = law.covering(8.0).expect("it grows");
        for (law, least) in [(&law, 0.25), (&wide, 1.0 / 81.0)] {
            let Isotropic { volumetric, shear } = law.linear::<6>();
            assert!(shear <= 30.0 * least && shear > 0.985 * 30.0 * least, "{shear}");
            assert!((3.0 * volumetric + shear - 120.0).abs() < 1e-12, "the bulk modulus stays");
        }
        let strain = [0.1, -0.3, 0.2, 0.05, 0.02, -0.07];
        let (one, other) = (whole::<6>(&law, &strain), whole::<6>(&wide, &strain));
        assert!((0..6).all(|c| (one[c] - other[c]).abs() < 1e-13));
        assert!((stored(&law, &strain) - stored(&wide, &strain)).abs() < 1e-13);
        // Beyond a strain of 0.4 the stress stays.
        assert_eq!(
            written("min(1, 0.4/max(e, 0.01)) + 1e-14").law(BODY, Comparison::Softer).covering(8.0),
            None
        );
    }

    #[test]
    fn moduli_whose_stress_may_fall_are_refused_with_place_and_remedy() {
        for (text, message, help) in [
            (
                "1 - e",
                "the elastic stress may fall with the strain near e = ",
                "shear_factor fall more slowly than 1/e",
            ),
            ("exp(-e/0.01)", "near e = ", "more slowly"),
            ("e", "may not grow with the strain near e = 0", "smaller reference_strain"),
            ("e^(-0.5)", "the shear modulus has no value near e = 0", "exp(1)"),
            ("if(e < 0.01, 1, 0.5)", "the shear modulus may jump with e", "interpolate"),
        ] {
            let fault = written(text).fault().expect(text);
            assert_eq!(fault.key, "shear_factor");
            assert!(fault.message.contains(message) && fault.help.contains(help), "{text}: {fault:?}");
        }
        // The stress of some of these tends to a limit.
        for text in [
            "1",
            "1/(1 + e/1e-3)",
            "1/sqrt(1 + (e/1e-2)^2)",
            "1 + (e/0.1)^2",
            "1/(1 + (e/1e-3)^0.9)",
            "exp(1)/(1 + e + sqrt(e))",
        ] {
            assert_eq!(written(text).fault(), None, "{text}");
        }
    }

    const LAWS: [&str; 4] =
        ["1/(1 + e/0.1)", "1 + (e/0.3)^2", "0.1 + 0.9/cosh(e)^0.2", "0.2 + 0.8*min(1, 0.1/max(e, 1e-3))"];

    fn check<const S: usize>(law: &StrainElasticity, strain: Mandel<S>, other: Mandel<S>) {
        let small = 1e-6;
        let derivative = |stress: &dyn Fn(&Mandel<S>) -> Mandel<S>, j: usize| -> Mandel<S> {
            let moved = |step: f64| {
                let mut moved = strain;
                moved[j] += step;
                stress(&moved)
            };
            let [above, below] = [moved(small), moved(-small)];
            std::array::from_fn(|i| (above[i] - below[i]) / (2.0 * small))
        };
        let tangent = law.tangent(&strain);
        for j in 0..S {
            let slope = derivative(&|strain| law.stress(strain), j);
            let energy = derivative(&|strain| [law.energy(strain); S], j)[0];
            let stress = law.stress(&strain)[j];
            assert!((energy - stress).abs() < 1e-6 * (1.0 + stress.abs()), "{energy} {stress}");
            for i in 0..S {
                let wanted = slope[i];
                assert!(
                    (tangent[i][j] - wanted).abs() < 1e-5 * (1.0 + wanted.abs()),
                    "{i} {j}: {} {wanted}",
                    tangent[i][j]
                );
                assert!((tangent[i][j] - tangent[j][i]).abs() < 1e-12 * (1.0 + tangent[i][j].abs()));
            }
        }
        let work: f64 =
            (0..S).map(|c| (whole(law, &strain)[c] - whole(law, &other)[c]) * (strain[c] - other[c])).sum();
        assert!(work >= -1e-12, "{work}");
        // The work of the mean stress is the change of the energy, and its symmetric derivative by the mean strain that by differences.
        let end = |mean: &Mandel<S>| -> Mandel<S> { std::array::from_fn(|c| 2.0 * mean[c] - other[c]) };
        let mean_stress = |mean: &Mandel<S>| law.mean_stress([&other, mean, &end(mean)]);
        let last = end(&strain);
        let work: f64 = (0..S).map(|c| mean_stress(&strain)[c] * (last[c] - other[c])).sum();
        let change = law.energy_change([&other, &last]);
        let difference = law.energy(&last) - law.energy(&other);
        let accepted = 1e-12 * (1.0 + law.energy(&last).abs() + law.energy(&other).abs());
        assert!((work - change).abs() < accepted, "{work} {change}");
        assert!((difference - change).abs() < accepted, "{difference} {change}");
        let tangent = law.mean_tangent([&other, &strain, &last]);
        let slopes: [Mandel<S>; S] = std::array::from_fn(|j| derivative(&mean_stress, j));
        for i in 0..S {
            for j in 0..S {
                let wanted = 0.5 * (slopes[j][i] + slopes[i][j]);
                assert!(
                    (tangent[i][j] - wanted).abs() < 1e-4 * (1.0 + wanted.abs()),
                    "{i} {j}: {} {wanted}",
                    tangent[i][j]
                );
            }
        }
    }

    proptest! {
        #[test]
        fn tangents_are_derivatives_and_stresses_of_energies_and_monotone(
            strain in prop::array::uniform6(-1.0f64..1.0), other in prop::array::uniform6(-1.0f64..1.0), number in 0_usize..4
        ) {
            let law = written(LAWS[number]).law(BODY, Comparison::Softer);
            let size = |strain: &[f64; 6]| Point::of(strain).size;
            let end: [f64; 6] = std::array::from_fn(|c| 2.0 * strain[c] - other[c]);
            prop_assume!([strain, other, end].iter().all(|strain| size(strain) > 0.15));
            check::<6>(&law, strain, other);
            let plane = |all: [f64; 6]| [all[0], all[1], all[2], all[5]];
            let end = plane(end);
            prop_assume!([plane(strain), plane(other), end].iter().all(|strain| Point::of(strain).size > 0.15));
            check::<4>(&law, plane(strain), plane(other));
            // Without stress across the plane, strains are larger than those within it.
            let thin = |all: [f64; 4]| [all[0], all[1], all[3]];
            let [strain, other, end] = [plane(strain), plane(other), end].map(thin);
            let on_way = |share: f64| add_scaled(&other, share, &add_scaled(&end, -1.0, &other));
            let size = |share: f64| Point::of(&law.with_thickness(&on_way(share))).size;
            // No kink on the way.
            prop_assume!((0..=200).all(|k| size(f64::from(k) / 200.0) > 0.15));
            check::<3>(&law, strain, other);
        }
    }

    #[test]
    fn plates_are_free_of_stress_across_them() {
        // Pulled by 0.3 along one axis, a bar of the modulus 9 K G f / (3 K + G f) thins alike along the other two, where K = 40 and G = 15.
        let law = written("1/(1 + e/0.1)").law(BODY, Comparison::Softer);
        let mut strain = [0.3, -0.1, 0.0];
        for _ in 0..200 {
            let across = law.with_thickness(&strain)[2];
            strain[1] = 0.5 * (strain[1] + across);
        }
        let e = 2.0 / 3.0_f64.sqrt() * (strain[0] - strain[1]);
        let shear = 15.0 / (1.0 + e / 0.1);
        let modulus = 9.0 * 40.0 * shear / (120.0 + shear);
        let stress = whole(&law, &strain);
        assert!((stress[0] - 0.3 * modulus).abs() < 1e-12 && stress[1].abs() < 1e-12, "{stress:?} {modulus}");
        // A constant is linear elasticity in plane stress.
        let (law, strain) = (written("0.5").law(BODY, Comparison::Stiffer), [0.1, -0.3, 0.2]);
        let half = Isotropic { volumetric: 35.0, shear: 15.0 }.in_plane_stress();
        let (found, wanted) = (whole(&law, &strain), half.apply(&strain));
        assert!((0..3).all(|c| (found[c] - wanted[c]).abs() < 1e-13), "{found:?} {wanted:?}");
        assert_eq!(law.stress(&[0.0; 3]), [0.0; 3]);
    }

    #[test]
    fn explicit_steps_are_bounded_by_the_steepest_stress_up_to_the_reference_strain_and_beyond_once_it_is_covered()
     {
        // d/de of e (1 + (e/0.1)^2) is 1 + 300 e^2.
        let law = written("1 + (e/0.1)^2").law(BODY, Comparison::Stiffer);
        let wide = law.covering(2.0).expect("it is bounded");
        for (law, most) in [(&law, 4.0), (&wide, 13.0)] {
            let Isotropic { volumetric, shear } = law.linear::<6>();
            assert!(shear >= 30.0 * most && shear < 30.3 * most, "{shear}");
            assert!((3.0 * volumetric + shear - 120.0).abs() < 1e-12, "the bulk modulus stays");
        }
        let strain = [0.1, -0.3, 0.2, 0.05, 0.02, -0.07];
        let (one, other) = (whole::<6>(&law, &strain), whole::<6>(&wide, &strain));
        assert!((0..6).all(|c| (one[c] - other[c]).abs() < 1e-12));
        assert_eq!(written("1/(1 + e/0.1)").fault_of_explicit_steps(), None);
        let steep = written("1 + e^(-0.5)").fault_of_explicit_steps().expect("it is infinitely steep");
        assert!(steep.message.contains("no explicit step is stable"), "{steep:?}");
    }

    #[test]
    fn mean_stresses_of_small_steps_are_stresses() {
        let law = written("1/(1 + e/0.1)").law(BODY, Comparison::Softer);
        let strain = [0.1, -0.3, 0.2, 0.05, 0.02, -0.07];
        let moved = strain.map(|component| component + 1e-13);
        let (mean, tangent) =
            (law.mean_stress([&strain, &moved, &moved]), law.mean_tangent([&strain, &moved, &moved]));
        let (stress, wanted) = (law.stress(&strain), law.tangent(&strain));
        assert!((0..6).all(|c| (mean[c] - stress[c]).abs() < 1e-11), "{mean:?}");
        assert!((0..6).all(|c| (tangent[0][c] - wanted[0][c]).abs() < 1e-9), "{tangent:?}");
        let strain = [0.1, -0.3, 0.2];
        let stress = law.stress(&strain);
        for small in [1e-13, 1e-10, 1e-7] {
            let moved = strain.map(|component| component + small);
            let mean = law.mean_stress([&strain, &add_scaled(&strain, 0.5, &[small; 3]), &moved]);
            let off = (0..3).map(|c| (mean[c] - stress[c]).abs()).fold(0.0, f64::max);
            assert!(off < 100.0 * small + 1e-12, "{small}: {off}");
        }
        let rest = [0.0; 6];
        assert_eq!((law.mean_stress([&rest; 3]), law.stress(&rest), law.energy(&rest)), (rest, rest, 0.0));
        assert!(law.mean_tangent([&rest; 3]).as_flattened().iter().all(|entry| entry.is_finite()));
    }
}
