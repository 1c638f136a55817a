//! `[material]` and `[[region]]`: what the body is made of.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::laws::material::{Damage, Elasticity, Hypothesis, Viscoplasticity, Viscosity};

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
