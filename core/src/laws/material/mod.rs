//! Material laws: pure functions at a point, with their keys in the job file.
//!
//! Each law has a file in this folder, with its parameters as in the job file, their units and ranges, its formula and source, and
//! the combinations that are refused. This file is the list of all: modules and the keys of the table `[material]`. Viscoplastic
//! laws are listed in `viscoplasticity.rs`.

mod anisotropic;
mod by_material;
mod damage;
mod damping;
mod elasticity;
mod elasticity_formula;
mod growth;
mod heat;
mod isotropic;
mod local;
mod orthotropic;
mod stored;
mod viscoplasticity;
mod viscosity;
mod viscosity_formula;

use crate::laws::expression::Scalar;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use anisotropic::Anisotropic;
pub use by_material::ByMaterial;
pub use damage::Damage;
pub use damping::Damping;
pub use elasticity::{Elastic, Elasticity, Hypothesis};
pub use elasticity_formula::{Comparison, ElasticityFormula, StrainElasticity};
pub use heat::Heat;
pub use isotropic::{Isotropic, LinearTensor};
pub use local::Numbers;
pub use orthotropic::Orthotropic;
pub use viscoplasticity::*;
pub use viscosity::Viscosity;
pub use viscosity_formula::{RateViscosity, ViscosityFormula};

/// A material: as in the job, where some properties may vary with place, or with the numbers of a point (`Material<f64>`). An effect is
/// simulated only if its table or key is present.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(
    rename = "Material",
    description = "A material. An effect is simulated only if its table or key is present."
)]
pub struct Material<N = Scalar> {
    /// The hypothesis of a 2D problem. Required in 2D, not allowed in 3D.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hypothesis: Option<Hypothesis>,
    /// Mass density. An expression in x, y, z is evaluated at the centre of each cell. Absent: no inertia, the problem is
    /// quasistatic.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("also" = "rho, inertia, dynamic, static, quasistatic", "variables" = "x, y, z", "unit" = "kg/m^d", "exclusiveMinimum" = 0), example = 1.0)]
    pub density: Option<N>,
    /// Isotropic elasticity. Absent: no elastic stress.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub elasticity: Option<Elasticity<N>>,
    /// Orthotropic linear elasticity, in place of isotropic elasticity; without viscoplasticity, damage and damping by the stiffness.
    /// Absent: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub orthotropic: Option<Orthotropic>,
    /// Viscosity. Absent: no viscous stress.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub viscosity: Option<Viscosity<N>>,
    /// Rayleigh damping. Absent: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub damping: Option<Damping>,
    /// Viscoplastic flow, which relaxes the elastic stress; requires elasticity. Absent: no viscoplastic flow.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub viscoplasticity: Option<Viscoplasticity<N>>,
    /// Isotropic damage d of each cell, from 0 (sound) to `largest`; requires elasticity. Damage multiplies the elastic stress,
    /// relaxed by viscoplastic flow, by 1 - d and leaves the viscous stress unchanged. It grows as `viscosity d' = (1 - d)^exponent
    /// max(Y - threshold, 0)`, where `Y = s : E^-1 s / 2` is the elastic energy per volume at the stress s of undamaged material,
    /// and never decreases. Absent: no damage.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub damage: Option<Damage>,
    /// Heat, with the temperature as one more field; all materials of the body have it, or none. Absent: no temperature.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heat: Option<Heat>,
}

impl Material {
    /// Whether it resists motion: no body consists of a material without density, elasticity and viscosity.
    pub fn resists(&self) -> bool {
        self.density.is_some()
            || self.elasticity.is_some()
            || self.orthotropic.is_some()
            || self.viscosity.is_some()
    }

    /// The keys of its laws that require isotropic elasticity, with the message where it is absent.
    pub fn laws_that_require_elasticity(&self) -> impl Iterator<Item = (&'static str, &'static str)> {
        let flow =
            self.viscoplasticity.as_ref().map(|_| ("viscoplasticity", Viscoplasticity::WITHOUT_ELASTICITY));
        let damping = self.damping.filter(|damping| damping.stiffness > 0.0);
        let damping = damping.map(|_| ("damping.stiffness", Damping::WITHOUT_ELASTICITY));
        let damage = self.damage.map(|_| ("damage", Damage::WITHOUT_ELASTICITY));
        flow.into_iter().chain(damping).chain(damage)
    }
}

impl<N> Material<N> {
    /// The factor in s of the elastic stiffness in the viscosity.
    fn stiffness_damping(&self) -> f64 {
        self.damping.map_or(0.0, |damping| damping.stiffness)
    }

    /// The factor in 1/s of the mass in forces on the velocity.
    fn mass_damping(&self) -> f64 {
        self.damping.map_or(0.0, |damping| damping.mass)
    }

    /// Whether it has a viscous stress.
    pub fn is_viscous(&self) -> bool {
        self.viscosity.is_some() || self.stiffness_damping() > 0.0
    }

    /// Whether forces in proportion to the mass damp it.
    pub fn is_damped_by_mass(&self) -> bool {
        self.mass_damping() > 0.0
    }
}

impl Material<f64> {
    /// The viscosity tensor `A` in Pa s, with the part of the damping; of a formula its linear part.
    pub fn viscosity_tensor(&self, hypothesis: Hypothesis) -> Option<Isotropic> {
        let own = self.viscosity.as_ref().map(|viscosity| viscosity.tensor(hypothesis));
        let factor = self.stiffness_damping();
        let Some(elasticity) = self.elasticity.as_ref().filter(|_| factor > 0.0) else { return own };
        let (own, elastic) = (own.unwrap_or_default(), elasticity.tensor(hypothesis));
        Some(Isotropic {
            volumetric: own.volumetric + factor * elastic.volumetric,
            shear: own.shear + factor * elastic.shear,
        })
    }

    /// What the viscous stress adds to that of [`viscosity_tensor`](Self::viscosity_tensor), if it is not linear.
    pub fn rate_viscosity(&self) -> Option<&ViscosityFormula> {
        self.viscosity.as_ref()?.expression.as_ref().filter(|formula| !formula.is_constant())
    }

    /// The force per volume and velocity in kg/(m^d s).
    pub fn drag(&self) -> Option<f64> {
        self.density.filter(|_| self.is_damped_by_mass()).map(|density| self.mass_damping() * density)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn material(mass: f64, stiffness: f64) -> Material<f64> {
        Material {
            hypothesis: None,
            density: Some(3.0),
            elasticity: Some(Elasticity::linear(100.0, 0.25)),
            orthotropic: None,
            viscosity: None,
            damping: Some(Damping { mass, stiffness }),
            viscoplasticity: None,
            damage: None,
            heat: None,
        }
    }

    #[test]
    fn damping_by_the_stiffness_is_a_viscosity_with_the_moduli_of_elasticity() {
        // Lame's moduli are 40 Pa, and in plane stress 80/3 Pa in place of the first.
        let damped = material(0.0, 0.5);
        assert!(damped.is_viscous() && damped.drag().is_none());
        let close = |found: Option<Isotropic>, [volumetric, shear]: [f64; 2]| {
            let found = found.expect("a viscosity");
            assert!((found.volumetric - volumetric).abs() < 1e-13 && (found.shear - shear).abs() < 1e-13);
        };
        close(damped.viscosity_tensor(Hypothesis::Space), [20.0, 40.0]);
        close(damped.viscosity_tensor(Hypothesis::PlaneStress), [40.0 / 3.0, 40.0]);
        let viscosity = Some(Viscosity::linear(-1.0, 5.0));
        close(Material { viscosity, ..damped }.viscosity_tensor(Hypothesis::PlaneStrain), [19.0, 45.0]);
    }

    #[test]
    fn what_is_zero_or_absent_damps_nothing() {
        for damped in [material(0.0, 0.0), Material { damping: None, ..material(1.0, 1.0) }] {
            assert!(!damped.is_viscous() && !damped.is_damped_by_mass());
            assert_eq!((damped.viscosity_tensor(Hypothesis::Space), damped.drag()), (None, None));
        }
        assert_eq!(material(0.5, 0.0).drag(), Some(1.5));
        assert_eq!(Material { density: None, ..material(0.5, 0.0) }.drag(), None);
    }
}
