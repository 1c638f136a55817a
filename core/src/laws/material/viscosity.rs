//! Viscosity: linear, `A(e) = volumetric tr(e) I + shear e` of section 5 of Wang and Cheng (2022), or a formula of the strain rate.

use super::{elasticity::Hypothesis, isotropic::Isotropic, viscosity_formula::ViscosityFormula};
use crate::laws::law::LawFault;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Viscous stress `volumetric tr(e) I + shear e` of the strain rate e, or a formula of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(
    rename = "Viscosity",
    description = "Viscous stress `volumetric tr(e) I + shear e` of the strain rate e, given by both keys, or a formula of it in the table `expression`."
)]
pub struct Viscosity<N = f64> {
    /// Factor of the trace of the strain rate; required without `expression`. It may be negative if d volumetric + shear is positive,
    /// with the dimension d, 3 of bodies of revolution. An expression in x, y, z is evaluated at the centre of each cell.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("variables" = "x, y, z", "unit" = "Pa s"), example = 25.0)]
    pub volumetric: Option<N>,
    /// Factor of the strain rate; required without `expression`. An expression in x, y, z is evaluated at the centre of each cell.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("variables" = "x, y, z", "unit" = "Pa s", "exclusiveMinimum" = 0), example = 50.0)]
    pub shear: Option<N>,
    /// A formula of the strain rate in place of `volumetric` and `shear`: the viscous stress is `bulk tr(e) I + shear dev e` for the strain
    /// rate e, with trace and deviator of the plane in plane stress. Absent: the viscosity is linear.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub expression: Option<ViscosityFormula>,
}

impl<N> Viscosity<N> {
    /// A linear viscosity.
    pub fn linear(volumetric: N, shear: N) -> Self {
        Self { volumetric: Some(volumetric), shear: Some(shear), expression: None }
    }

    /// The viscosity with these moduli, if it is linear; `None` if one of them is absent then.
    pub fn with(&self, volumetric: Option<f64>, shear: Option<f64>) -> Option<Viscosity> {
        let expression = self.expression.clone();
        let is_complete = expression.is_some() || (volumetric.is_some() && shear.is_some());
        is_complete.then_some(Viscosity { volumetric, shear, expression })
    }

    /// The faults of its choice of keys: both moduli or a formula.
    pub fn faults_of_choice(&self) -> Vec<LawFault> {
        let given = [("volumetric", self.volumetric.is_some()), ("shear", self.shear.is_some())];
        let of_formula = |(key, _)| {
            LawFault::at_key(
                key,
                format!("`{key}` and `expression` exclude each other"),
                "delete it, or give volumetric and shear in place of the table expression",
            )
        };
        let lacking = |(key, _)| {
            LawFault::at_key(
                "",
                format!("missing key `{key}` of the viscosity"),
                "give volumetric and shear in Pa s, or the table expression",
            )
        };
        let is_formula = self.expression.is_some();
        let wrong = given.into_iter().filter(|(_, is_given)| *is_given == is_formula);
        if is_formula { wrong.map(of_formula).collect() } else { wrong.map(lacking).collect() }
    }
}

impl Viscosity {
    /// `A` in Pa s; of a formula the linear part, see [`ViscosityFormula::tensor`].
    pub fn tensor(&self, hypothesis: Hypothesis) -> Isotropic {
        let normal_components = if hypothesis == Hypothesis::PlaneStress { 2 } else { 3 };
        match &self.expression {
            Some(formula) => formula.tensor(normal_components),
            None => Isotropic {
                volumetric: self.volumetric.unwrap_or_default(),
                shear: self.shear.unwrap_or_default(),
            },
        }
    }

    /// The fault of the parameters in this dimension: the tensor must be positive definite, also in double precision.
    pub fn fault(&self, dimension: usize) -> Option<LawFault> {
        if let Some(formula) = &self.expression {
            return Some(formula.fault()?.within("expression"));
        }
        let (volumetric, shear) = self.volumetric.zip(self.shear)?;
        let modulus = dimension as f64 * volumetric + shear;
        let (message, help) = if shear <= 0.0 {
            return None;
        } else if modulus <= 0.0 {
            (
                format!("this viscosity adds energy: {dimension}*volumetric + shear is {modulus} Pa s"),
                format!("volumetric must be above {}", -shear / dimension as f64),
            )
        } else if volumetric > MOST_VOLUMETRIC * shear {
            (
                format!(
                    "volumetric is {:.1e} times shear: rounding errors hide the shear part",
                    volumetric / shear
                ),
                format!("volumetric must be at most {MOST_VOLUMETRIC:e} times shear"),
            )
        } else {
            return None;
        };
        Some(LawFault::at_value("volumetric", message, help))
    }
}

/// Largest quotient of the volumetric and the shear viscosity: beyond it, double precision has less than four digits left for the
/// shear part, and the matrix of a step is soon no longer positive definite.
const MOST_VOLUMETRIC: f64 = 1e12;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_viscosity_is_positive_where_all_of_its_moduli_are() {
        let law = |volumetric| Viscosity::linear(volumetric, 50.0);
        assert_eq!(law(25.0).tensor(Hypothesis::PlaneStress).smallest_modulus::<3>(), 50.0, "the paper's");
        assert_eq!((law(25.0).fault(2), law(-24.9).fault(2), law(5e13).fault(2)), (None, None, None));
        let fault = law(1e300).fault(2).expect("the shear part is lost");
        assert_eq!(fault.message, "volumetric is 2.0e298 times shear: rounding errors hide the shear part");
        let fault = law(-20.0).fault(3).expect("3 x -20 + 50 is negative");
        assert_eq!(
            (&*fault.key, &*fault.help),
            ("volumetric", "volumetric must be above -16.666666666666668")
        );
    }
}
