//! Linear isotropic elasticity, and the hypothesis of plane problems.

use super::isotropic::Isotropic;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The hypothesis of a 2D problem.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Hypothesis {
    /// A thin plate without stress in the direction of its thickness.
    PlaneStress,
    /// A section of a long body that cannot strain in the direction of its length.
    PlaneStrain,
    /// A body of revolution that moves without turning: x is the distance from the axis, y the place along it. Forces, masses and
    /// energies are those of the whole turn, densities masses per volume.
    Axisymmetric,
    /// Three dimensions. Job files of 3D bodies contain no hypothesis.
    #[serde(skip)]
    Space,
}

impl Hypothesis {
    /// The hypothesis that corresponds to this number of stress components; that of plane strain also stands for a body of revolution,
    /// in which only the hoop strain differs.
    pub fn of(components: usize) -> Self {
        match components {
            3 => Self::PlaneStress,
            4 => Self::PlaneStrain,
            _ => Self::Space,
        }
    }
}

/// Isotropic linear elasticity, at a point or with a modulus that may vary with place.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Elasticity", description = "Isotropic linear elasticity.")]
pub struct Elasticity<N = f64> {
    /// Young's modulus. An expression in x, y, z is evaluated at the centre of each cell.
    #[schemars(extend("variables" = "x, y, z", "unit" = "Pa", "exclusiveMinimum" = 0), example = 1000.0)]
    pub youngs_modulus: N,
    /// Poisson's ratio.
    #[schemars(extend("exclusiveMinimum" = -1, "exclusiveMaximum" = 0.5), example = 0.4)]
    pub poisson_ratio: f64,
}

impl Elasticity {
    /// The stress-strain relation under this hypothesis, section 5 of Wang and Cheng (2022) for plane stress.
    ///
    /// Plane stress: `E k / (1 - k^2) tr(e) I + E / (1 + k) e` with the trace over the plane; otherwise
    /// `E k / ((1 + k)(1 - 2 k)) tr(e) I + E / (1 + k) e`.
    pub fn tensor(&self, hypothesis: Hypothesis) -> Isotropic {
        let (modulus, ratio) = (self.youngs_modulus, self.poisson_ratio);
        let volumetric = match hypothesis {
            Hypothesis::PlaneStress => modulus * ratio / (1.0 - ratio * ratio),
            Hypothesis::PlaneStrain | Hypothesis::Axisymmetric | Hypothesis::Space => {
                modulus * ratio / ((1.0 + ratio) * (1.0 - 2.0 * ratio))
            }
        };
        Isotropic { volumetric, shear: modulus / (1.0 + ratio) }
    }
}

/// A law with the elasticity of its material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Elastic<L> {
    /// The law's parameters.
    pub parameters: L,
    /// The elastic tensor `E` in Pa.
    pub elasticity: Isotropic,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear_algebra::tensor::Mandel;

    const PAPER: Elasticity = Elasticity { youngs_modulus: 1000.0, poisson_ratio: 0.4 };

    #[test]
    fn plane_stress_gives_youngs_modulus_in_uniaxial_tension() {
        let stress = PAPER.tensor(Hypothesis::PlaneStress).apply(&[1e-3, -0.4e-3, 0.0]);
        assert!((stress[0] - 1.0).abs() < 1e-14 && stress[1].abs() < 1e-14, "{stress:?}");
    }

    #[test]
    fn space_gives_youngs_modulus_in_uniaxial_tension() {
        let stress = PAPER.tensor(Hypothesis::Space).apply(&[1e-3, -0.4e-3, -0.4e-3, 0.0, 0.0, 0.0]);
        assert!((stress[0] - 1.0).abs() < 1e-12 && stress[1].abs() < 1e-12, "{stress:?}");
    }

    #[test]
    fn plane_strain_is_space_without_out_of_plane_strain() {
        let plane: Mandel<4> = PAPER.tensor(Hypothesis::PlaneStrain).apply(&[0.1, 0.2, 0.0, 0.3]);
        let space: Mandel<6> = PAPER.tensor(Hypothesis::Space).apply(&[0.1, 0.2, 0.0, 0.0, 0.0, 0.3]);
        assert_eq!(plane, [space[0], space[1], space[2], space[5]]);
    }
}
