//! Materials whose properties vary with place.

use super::{Elasticity, Material, Viscoplasticity};
use crate::laws::{expression::Scalar, law::LawFault};

/// The number of properties that may be expressions.
const COUNT: usize = 5;
/// The keys of those that every material may have, relative to its table; the last property is the yield stress of its flow.
const KEYS: [&str; COUNT - 1] =
    ["density", "elasticity.youngs_modulus", "viscosity.volumetric", "viscosity.shear"];
/// The property that may be negative.
const VOLUMETRIC: usize = 2;

/// The numbers of the properties that may be expressions: density, Young's modulus, volumetric and shear viscosity, yield stress; none
/// for those that are absent.
pub type Numbers = [Option<f64>; COUNT];

impl Material {
    /// The properties that may be expressions, with their keys relative to the table of the material.
    pub fn variables(&self) -> impl Iterator<Item = (String, &Scalar)> {
        let given = self.properties().into_iter().enumerate();
        given.filter_map(|(number, value)| Some((self.key(number), value?)))
    }

    /// The material without the laws that contain an expression.
    pub fn constant(&self) -> Material<f64> {
        let number = |value: Option<&Scalar>| match value {
            Some(Scalar::Number(number)) => Some(*number),
            _ => None,
        };
        let constant = self.with(self.properties().map(number));
        let has_constant_flow = !matches!(self.properties(), [.., Some(Scalar::Expression(_))]);
        Material { viscoplasticity: constant.viscoplasticity.filter(|_| has_constant_flow), ..constant }
    }

    fn properties(&self) -> [Option<&Scalar>; COUNT] {
        [
            self.density.as_ref(),
            self.elasticity.as_ref().map(|law| &law.youngs_modulus),
            self.viscosity.as_ref().and_then(|law| law.volumetric.as_ref()),
            self.viscosity.as_ref().and_then(|law| law.shear.as_ref()),
            self.viscoplasticity.as_ref().and_then(Viscoplasticity::yield_stress),
        ]
    }

    /// The key of a property.
    fn key(&self, property: usize) -> String {
        if let Some(key) = KEYS.get(property) {
            return (*key).to_owned();
        }
        let name = self.viscoplasticity.as_ref().map_or("", Viscoplasticity::name);
        let key = Viscoplasticity::YIELD_STRESSES.iter().find(|(law, _)| *law == name);
        format!("viscoplasticity.{name}.{}", key.and_then(|(_, key)| *key).unwrap_or_default())
    }

    /// Whether a property is an expression.
    pub fn has_expressions(&self) -> bool {
        self.properties().into_iter().flatten().any(|value| matches!(value, Scalar::Expression(_)))
    }

    /// The values of these properties at a place in m.
    pub fn numbers_at(&self, place: &[f64]) -> Numbers {
        self.properties().map(|value| value.map(|value| value.evaluate(0.0, place)))
    }

    /// The material at a place in m, in a body with as many normal strains; refused where a property is not finite, or
    /// not positive as it must be. A yield stress may be zero.
    pub fn at(&self, place: &[f64], normal_strains: usize) -> Result<Material<f64>, LawFault> {
        let numbers = self.numbers_at(place);
        for (k, number) in numbers.into_iter().enumerate() {
            let Some(number) = number else { continue };
            let wrong = if !number.is_finite() {
                "finite"
            } else if k < KEYS.len() && k != VOLUMETRIC && number <= 0.0 {
                "positive"
            } else if k == KEYS.len() && number < 0.0 {
                "at least 0"
            } else {
                continue;
            };
            let help = match k == KEYS.len() && number == f64::INFINITY {
                true => "write a large number, such as 1e30, where the material does not flow, or give this region its own material without \
                         `viscoplasticity`"
                    .into(),
                false => format!("correct the expression so that it is {wrong} in the whole body, for example with max(..)"),
            };
            return Err(LawFault::at_value(self.key(k), format!("the value {number} is not {wrong}"), help));
        }
        let material = self.with(numbers);
        let fault = material.fault_of_viscosity(normal_strains).or_else(|| material.fault_of_flow());
        fault.map_or(Ok(material), Err)
    }

    /// The material with these numbers; properties that are absent stay absent.
    pub fn with(&self, [density, modulus, volumetric, shear, yield_stress]: Numbers) -> Material<f64> {
        let elasticity = self.elasticity.as_ref().zip(modulus);
        let flow = self.viscoplasticity.as_ref();
        Material {
            hypothesis: self.hypothesis,
            density: self.density.as_ref().and(density),
            elasticity: elasticity.map(|(law, youngs_modulus)| Elasticity {
                youngs_modulus,
                poisson_ratio: law.poisson_ratio,
                expression: law.expression.clone(),
            }),
            viscosity: self.viscosity.as_ref().and_then(|law| law.with(volumetric, shear)),
            viscoplasticity: flow.map(|law| law.with_yield_stress(yield_stress.unwrap_or(0.0))),
            damping: self.damping,
            orthotropic: self.orthotropic,
            damage: self.damage,
            heat: self.heat,
        }
    }
}

impl Material<f64> {
    /// The fault of the viscosity in a body with as many normal strains: two in the plane; its key is that of the table of the material.
    pub fn fault_of_viscosity(&self, normal_strains: usize) -> Option<LawFault> {
        Some(self.viscosity.as_ref()?.fault(normal_strains)?.within("viscosity"))
    }

    /// The fault of the viscoplastic law; its key is that of the table of the material.
    pub fn fault_of_flow(&self) -> Option<LawFault> {
        let law = self.viscoplasticity.as_ref()?;
        Some(law.fault()?.within(law.name()).within("viscoplasticity"))
    }

    /// The fault of the viscoplastic law in plane stress; its key is that of the table of the material.
    pub fn fault_in_plane_stress(&self) -> Option<LawFault> {
        let law = self.viscoplasticity.as_ref()?;
        Some(law.fault_in_plane_stress()?.within(law.name()).within("viscoplasticity"))
    }

    /// The numbers of its properties.
    pub fn numbers(&self) -> Numbers {
        [
            self.density,
            self.elasticity.as_ref().map(|law| law.youngs_modulus),
            self.viscosity.as_ref().and_then(|law| law.volumetric),
            self.viscosity.as_ref().and_then(|law| law.shear),
            self.viscoplasticity.as_ref().and_then(|law| law.yield_stress().copied()),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::{
        expression::Expression,
        material::{DruckerPrager, Metric, Perzyna, Viscosity},
    };

    fn of(text: &str) -> Scalar {
        Scalar::Expression(Expression::parse(text).expect("an expression"))
    }

    fn graded() -> Material {
        Material {
            hypothesis: None,
            density: Some(Scalar::Number(3.0)),
            elasticity: Some(Elasticity::linear(of("10 - y"), 0.25)),
            viscosity: Some(Viscosity::linear(of("-x"), of("4"))),
            orthotropic: None,
            damping: None,
            viscoplasticity: None,
            damage: None,
            heat: None,
        }
    }

    #[test]
    fn properties_are_those_of_the_place() {
        assert!(graded().has_expressions());
        let there = graded().at(&[1.0, 2.0], 2).expect("a material");
        assert_eq!(there.numbers(), [Some(3.0), Some(8.0), Some(-1.0), Some(4.0), None]);
        assert_eq!(there.elasticity.expect("elastic").poisson_ratio, 0.25);
        let rigid = Material { elasticity: None, viscosity: None, ..graded() };
        assert!(!rigid.has_expressions());
        assert_eq!(
            rigid.at(&[0.0, 0.0], 2).expect("a material").numbers(),
            [Some(3.0), None, None, None, None]
        );
    }

    #[test]
    fn the_yield_stress_is_that_of_the_place() {
        let law = |yield_stress, exponent| {
            let parameters = Perzyna {
                relaxation: 100.0,
                yield_stress,
                exponent,
                hardening_modulus: Some(7.0),
                kinematic_modulus: None,
                metric: Metric::Compliance,
            };
            Material { viscoplasticity: Some(Viscoplasticity::Perzyna(parameters)), ..graded() }
        };
        let there = law(of("2 - y"), 1.0).at(&[0.0, 0.5], 2).expect("a material").viscoplasticity;
        let expected = Perzyna {
            relaxation: 100.0,
            yield_stress: 1.5,
            exponent: 1.0,
            hardening_modulus: Some(7.0),
            kinematic_modulus: None,
            metric: Metric::Compliance,
        };
        assert_eq!(there, Some(Viscoplasticity::Perzyna(expected)));
        let refused =
            |exponent, y: f64| law(of("2 - y"), exponent).at(&[0.0, y], 2).expect_err("refused").key;
        assert!(law(of("2 - y"), 1.0).at(&[0.0, 2.0], 2).is_ok(), "zero");
        assert_eq!(refused(1.0, 3.0), "viscoplasticity.perzyna.yield_stress");
        assert_eq!(refused(2.0, 2.0), "viscoplasticity.perzyna.exponent");
        let cone = DruckerPrager { relaxation: 1.0, friction_coefficient: 0.5, cohesion: of("1 + x") };
        let cone = Material { viscoplasticity: Some(Viscoplasticity::DruckerPrager(cone)), ..graded() };
        assert_eq!(cone.at(&[1.0, 0.0], 2).expect("a material").numbers()[4], Some(2.0));
        assert_eq!(cone.key(4), "viscoplasticity.drucker_prager.cohesion");
        let keys: Vec<String> = cone.variables().map(|(key, _)| key).collect();
        assert_eq!(keys.last().map(String::as_str), Some("viscoplasticity.drucker_prager.cohesion"));
        assert!(cone.constant().viscoplasticity.is_none() && cone.constant().elasticity.is_none());
    }

    #[test]
    fn what_is_not_positive_there_is_refused_with_its_key() {
        let refused =
            |material: Material, place: &[f64]| material.at(place, place.len()).expect_err("refused");
        let fault = refused(graded(), &[0.0, 10.0]);
        assert_eq!(
            (&*fault.key, &*fault.message),
            ("elasticity.youngs_modulus", "the value 0 is not positive")
        );
        let fault = refused(Material { density: Some(of("sqrt(y)")), ..graded() }, &[0.0, -1.0]);
        assert_eq!((&*fault.key, &*fault.message), ("density", "the value NaN is not finite"));
        // 3 volumetric + shear is 4 - 3 x, in the plane 4 - 2 x.
        assert_eq!(refused(graded(), &[1.5, 0.0, 0.0]).key, "viscosity.volumetric");
        assert!(graded().at(&[1.5, 0.0], 2).is_ok());
    }
}
