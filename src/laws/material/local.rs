//! Materials whose properties vary with place.

use super::{Elasticity, Material, Viscosity};
use crate::laws::{expression::Scalar, law::LawFault};

/// The keys of properties that may be expressions, relative to the table of the material.
const KEYS: [&str; 4] = ["density", "elasticity.youngs_modulus", "viscosity.volumetric", "viscosity.shear"];
/// The only one of them that may be zero or negative.
const VOLUMETRIC: usize = 2;

impl Material {
    /// The keys of properties that may be expressions, relative to the table of the material.
    pub const VARIABLE: [&str; 4] = KEYS;

    /// Their values, in this order.
    fn properties(&self) -> [Option<&Scalar>; 4] {
        [
            self.density.as_ref(),
            self.elasticity.as_ref().map(|law| &law.youngs_modulus),
            self.viscosity.as_ref().map(|law| &law.volumetric),
            self.viscosity.as_ref().map(|law| &law.shear),
        ]
    }

    /// Whether a property is an expression.
    pub fn has_expressions(&self) -> bool {
        self.properties().into_iter().flatten().any(|value| matches!(value, Scalar::Expression(_)))
    }

    /// The values of these properties at a place in m; none for those that are absent.
    pub fn numbers_at(&self, place: &[f64]) -> [Option<f64>; 4] {
        self.properties().map(|value| value.map(|value| value.evaluate(0.0, place)))
    }

    /// The material at a place in m with as many coordinates as the body has dimensions; refused where a property is not finite, or
    /// not positive as it must be.
    pub fn at(&self, place: &[f64]) -> Result<Material<f64>, LawFault> {
        let numbers = self.numbers_at(place);
        for (k, number) in numbers.into_iter().enumerate() {
            let Some(number) = number else { continue };
            let wrong = if !number.is_finite() {
                "finite"
            } else if number <= 0.0 && k != VOLUMETRIC {
                "positive"
            } else {
                continue;
            };
            return Err(LawFault::at_value(
                KEYS[k],
                format!("the value {number} is not {wrong}"),
                format!(
                    "correct the expression so that it is {wrong} in the whole body, for example with max(..)"
                ),
            ));
        }
        let material = self.with(numbers);
        match material.viscosity.and_then(|law| law.fault(place.len())) {
            Some(fault) => Err(fault.within("viscosity")),
            None => Ok(material),
        }
    }

    /// The material with these numbers of its properties, in the order of [`Material::VARIABLE`]; absent ones stay absent.
    pub fn with(&self, [density, modulus, volumetric, shear]: [Option<f64>; 4]) -> Material<f64> {
        let elasticity = self.elasticity.as_ref().zip(modulus);
        let viscosity = self.viscosity.as_ref().and(volumetric.zip(shear));
        Material {
            hypothesis: self.hypothesis,
            density: self.density.as_ref().and(density),
            elasticity: elasticity
                .map(|(law, youngs_modulus)| Elasticity { youngs_modulus, poisson_ratio: law.poisson_ratio }),
            viscosity: viscosity.map(|(volumetric, shear)| Viscosity { volumetric, shear }),
            viscoplasticity: self.viscoplasticity,
            damage: self.damage,
        }
    }
}

impl Material<f64> {
    /// The numbers of its properties, in the order of [`Material::VARIABLE`].
    pub fn numbers(&self) -> [Option<f64>; 4] {
        [
            self.density,
            self.elasticity.map(|law| law.youngs_modulus),
            self.viscosity.map(|law| law.volumetric),
            self.viscosity.map(|law| law.shear),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::expression::Expression;

    fn of(text: &str) -> Scalar {
        Scalar::Expression(Expression::parse(text).expect("an expression"))
    }

    fn graded() -> Material {
        Material {
            hypothesis: None,
            density: Some(Scalar::Number(3.0)),
            elasticity: Some(Elasticity { youngs_modulus: of("10 - y"), poisson_ratio: 0.25 }),
            viscosity: Some(Viscosity { volumetric: of("-x"), shear: of("4") }),
            viscoplasticity: None,
            damage: None,
        }
    }

    #[test]
    fn properties_are_those_of_the_place() {
        assert!(graded().has_expressions());
        let there = graded().at(&[1.0, 2.0]).expect("a material");
        assert_eq!(there.numbers(), [Some(3.0), Some(8.0), Some(-1.0), Some(4.0)]);
        assert_eq!(there.elasticity.expect("elastic").poisson_ratio, 0.25);
        let rigid = Material { elasticity: None, viscosity: None, ..graded() };
        assert!(!rigid.has_expressions());
        assert_eq!(rigid.at(&[0.0, 0.0]).expect("a material").numbers(), [Some(3.0), None, None, None]);
    }

    #[test]
    fn what_is_not_positive_there_is_refused_with_its_key() {
        let refused = |material: Material, place: &[f64]| material.at(place).expect_err("refused");
        let fault = refused(graded(), &[0.0, 10.0]);
        assert_eq!(
            (&*fault.key, &*fault.message),
            ("elasticity.youngs_modulus", "the value 0 is not positive")
        );
        let fault = refused(Material { density: Some(of("sqrt(y)")), ..graded() }, &[0.0, -1.0]);
        assert_eq!((&*fault.key, &*fault.message), ("density", "the value NaN is not finite"));
        // 3 volumetric + shear is 4 - 3 x, in the plane 4 - 2 x.
        assert_eq!(refused(graded(), &[1.5, 0.0, 0.0]).key, "viscosity.volumetric");
        assert!(graded().at(&[1.5, 0.0]).is_ok());
    }
}
