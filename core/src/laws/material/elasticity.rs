//! Isotropic elasticity, and the hypothesis of plane problems.

use super::{
    elasticity_formula::{Comparison, ElasticityFormula, StrainElasticity},
    isotropic::Isotropic,
};
use crate::laws::law::LawFault;
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

/// Isotropic elasticity, at a point or with a modulus that may vary with place.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(
    rename = "Elasticity",
    description = "Isotropic elasticity, linear unless it has the table `expression`."
)]
pub struct Elasticity<N = f64> {
    /// Young's modulus. An expression in x, y, z is evaluated at the centre of each cell: `if(y > 0.9, 2e11, 7e10)` is a coat that sticks to
    /// its body, where facets of cells lie in y = 0.9.
    #[schemars(extend("also" = "E, young, elastic modulus", "variables" = "x, y, z", "unit" = "Pa", "exclusiveMinimum" = 0), example = 1000.0)]
    pub youngs_modulus: N,
    /// Poisson's ratio.
    #[schemars(extend("also" = "nu, poisson", "exclusiveMinimum" = -1, "exclusiveMaximum" = 0.5), example = 0.4)]
    pub poisson_ratio: f64,
    /// A formula of the strain by which the shear modulus is multiplied; the bulk modulus stays. Without viscoplasticity, damage, damping by
    /// the stiffness, initial stress and thermal strain. Absent: elasticity is linear.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub expression: Option<ElasticityFormula>,
}

impl<N> Elasticity<N> {
    /// Linear elasticity.
    pub const fn linear(youngs_modulus: N, poisson_ratio: f64) -> Self {
        Self { youngs_modulus, poisson_ratio, expression: None }
    }

    /// The fault of its formula; its key is that of the table of the elasticity.
    pub fn fault(&self) -> Option<LawFault> {
        Some(self.expression.as_ref()?.fault()?.within("expression"))
    }
}

impl Elasticity {
    /// The law of the stress, if it is a formula in which the strain occurs.
    pub fn strain_elasticity(&self, comparison: Comparison) -> Option<StrainElasticity> {
        let formula = self.expression.as_ref().filter(|formula| !formula.is_constant())?;
        Some(formula.law(self.tensor(Hypothesis::Space), comparison))
    }

    /// The stress-strain relation under this hypothesis, if it is linear.
    pub fn linear_tensor(&self, hypothesis: Hypothesis) -> Option<Isotropic> {
        let Some(formula) = &self.expression else { return Some(self.tensor(hypothesis)) };
        let in_space = self.tensor(Hypothesis::Space).with_shear_times(formula.at_rest());
        let tensor =
            if hypothesis == Hypothesis::PlaneStress { in_space.in_plane_stress() } else { in_space };
        formula.is_constant().then_some(tensor)
    }

    /// The linear stress-strain relation under this hypothesis, with a formula that where it is 1, section 5 of Wang and Cheng (2022) for plane stress.
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

    const PAPER: Elasticity = Elasticity::linear(1000.0, 0.4);

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
