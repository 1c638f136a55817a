//! Linear viscosity `A(e) = volumetric tr(e) I + shear e`, section 5 of Wang and Cheng (2022).

use super::isotropic::Isotropic;
use crate::laws::law::LawFault;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Viscous stress `volumetric tr(e) I + shear e` of the strain rate e.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Viscosity")]
pub struct Viscosity<N = f64> {
    /// Factor of the trace of the strain rate. It may be negative if d volumetric + shear is positive, with the dimension d, 3 of
    /// bodies of revolution. An expression in x, y, z is evaluated at the centre of each cell.
    #[schemars(extend("variables" = "x, y, z", "unit" = "Pa s"), example = 25.0)]
    pub volumetric: N,
    /// Factor of the strain rate. An expression in x, y, z is evaluated at the centre of each cell.
    #[schemars(extend("variables" = "x, y, z", "unit" = "Pa s", "exclusiveMinimum" = 0), example = 50.0)]
    pub shear: N,
}

impl Viscosity {
    /// `A` in Pa s.
    pub fn tensor(&self) -> Isotropic {
        Isotropic { volumetric: self.volumetric, shear: self.shear }
    }

    /// The fault of the parameters in this dimension: the tensor must be positive definite, also in double precision.
    pub fn fault(&self, dimension: usize) -> Option<LawFault> {
        let Self { volumetric, shear } = *self;
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
        let law = |volumetric| Viscosity { volumetric, shear: 50.0 };
        assert_eq!(law(25.0).tensor().smallest_modulus::<3>(), 50.0, "the paper's");
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
