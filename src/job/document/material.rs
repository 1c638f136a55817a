//! `[material]` and `[[region]]`: what the body is made of.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Damage;

/// A material; each effect is there only if its table or key is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// What a 2D body stands for; must be absent in 3D.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hypothesis: Option<Hypothesis>,
    /// Mass per volume. Absent: no inertia, the problem is quasistatic.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "kg/m^d", "exclusiveMinimum" = 0), example = 1.0)]
    pub density: Option<f64>,
    /// Isotropic linear elasticity; absent: no elastic stress.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub elasticity: Option<Elasticity>,
    /// Linear viscosity; absent: no viscous stress.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub viscosity: Option<Viscosity>,
    /// Viscoplastic flow; absent: no stress history is kept.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub viscoplasticity: Option<Viscoplasticity>,
    /// Isotropic damage d of the cells: of elastic and viscoplastic stress the share 1 - d is left; viscous stress stays whole.
    /// It grows as `viscosity d' = (1 - d)^exponent max(Y - threshold, 0)`, with the elastic energy per volume
    /// `Y = s : E^-1 s / 2` of sound material under the same strain, and never heals. Absent: no damage is kept.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub damage: Option<Damage>,
}

/// What a 2D body stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Hypothesis {
    /// A thin plate, free of stress across its thickness.
    PlaneStress,
    /// A slice of a long body that can't strain along its length.
    PlaneStrain,
}

/// Isotropic linear elasticity.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Elasticity {
    /// Young's modulus.
    #[schemars(extend("unit" = "Pa", "exclusiveMinimum" = 0), example = 1000.0)]
    pub youngs_modulus: f64,
    /// Poisson's ratio.
    #[schemars(extend("exclusiveMinimum" = -1, "exclusiveMaximum" = 0.5), example = 0.4)]
    pub poisson_ratio: f64,
}

/// Viscous stress `volumetric tr(e) I + shear e` of the strain rate e.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Viscosity {
    /// Factor of the strain rate's trace; may be negative as long as d volumetric + shear stays positive.
    #[schemars(extend("unit" = "Pa s"), example = 25.0)]
    pub volumetric: f64,
    /// Factor of the strain rate itself.
    #[schemars(extend("unit" = "Pa s", "exclusiveMinimum" = 0), example = 50.0)]
    pub shear: f64,
}

/// The viscoplastic law.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Viscoplasticity {
    /// Overstress law with the von Mises yield set.
    Perzyna(Perzyna),
    /// Linear relaxation of stress.
    Maxwell(Maxwell),
    /// Overstress law with a yield stress that grows with pressure; 3D and plane strain.
    DruckerPrager(DruckerPrager),
}

/// Maxwell's linear relaxation: held stress decays as `ds/dt = -dev s / relaxation_time - mean s / volumetric_relaxation_time`;
/// in plane stress by the in-plane part of the same strain rate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Maxwell {
    /// Time in which held deviatoric stress falls by the factor e.
    #[schemars(extend("unit" = "s", "exclusiveMinimum" = 0), example = 0.5)]
    pub relaxation_time: f64,
    /// The same of the mean stress; absent: it does not relax.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "s", "exclusiveMinimum" = 0), example = 5.0)]
    pub volumetric_relaxation_time: Option<f64>,
}

/// Drucker and Prager's yield set K: sqrt(J2) + friction_coefficient p <= cohesion with the mean stress p (tension positive);
/// flow at the rate (s - P_K s)/(2 relaxation), where P_K is the nearest point in (t, t).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DruckerPrager {
    /// The viscosity lambda: the larger, the slower stress beyond the yield set relaxes.
    #[schemars(extend("unit" = "Pa s", "exclusiveMinimum" = 0), example = 100.0)]
    pub relaxation: f64,
    /// What pressure adds to the yield stress in shear, sqrt(J2) over pressure.
    #[schemars(range(min = 0), example = 0.6)]
    pub friction_coefficient: f64,
    /// Yield stress in pure shear without pressure.
    #[schemars(range(min = 0), extend("unit" = "Pa"), example = 1e4)]
    pub cohesion: f64,
}

/// Perzyna's law `G(s) = -(1/(2 relaxation)) (f/yield_stress)^(exponent - 1) E (s - P_K s)`, where P_K projects on the von Mises
/// yield set K and f is the von Mises norm beyond the yield stress.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Perzyna {
    /// The viscosity lambda: the larger, the slower stress beyond the yield set relaxes.
    #[schemars(extend("unit" = "Pa s", "exclusiveMinimum" = 0), example = 100.0)]
    pub relaxation: f64,
    /// Von Mises norm at which flow begins.
    #[schemars(range(min = 0), extend("unit" = "Pa"), example = 19.0)]
    pub yield_stress: f64,
    /// Power of the overstress; 1 is Wang and Cheng's law. Above 1 the yield stress must be positive, and the bound of
    /// explicit steps holds while the von Mises norm is at most twice the yield stress.
    #[serde(default = "one")]
    #[schemars(range(min = 1), example = 3.0)]
    pub exponent: f64,
    /// Growth of the yield stress with the accumulated viscoplastic strain, which is kept for every cell; absent: no hardening.
    /// What hardening stores is part of viscoplastic_dissipation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0), extend("unit" = "Pa"), example = 100.0)]
    pub hardening_modulus: Option<f64>,
    /// The norm in which the projection on the yield set is the nearest point.
    #[serde(default)]
    pub metric: Metric,
}

fn one() -> f64 {
    1.0
}

/// A norm of stresses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Metric {
    /// (E t, t): Wang and Cheng's.
    #[default]
    Elasticity,
    /// (E^-1 t, t): the usual choice in plasticity.
    Compliance,
    /// (t, t).
    Frobenius,
}

/// A part of the body, named by a physical group of the mesh, with its own material: all its effects stand here, none is
/// taken over from the main material.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Region {
    /// The physical group's name.
    #[schemars(length(min = 1), example = &"core")]
    pub name: String,
    /// Its material; the hypothesis is the body's and stands in the main material only.
    pub material: Material,
}
