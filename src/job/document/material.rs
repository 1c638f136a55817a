//! `[material]` and `[[region]]`: what the body is made of.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::laws::material::{Damage, Elasticity, Hypothesis, Viscoplasticity, Viscosity};

/// A material. An effect is simulated only if its table or key is present.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// The hypothesis of a plane problem. Required in 2D, not allowed in 3D.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hypothesis: Option<Hypothesis>,
    /// Mass density. Absent: no inertia, the problem is quasistatic.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "kg/m^d", "exclusiveMinimum" = 0), example = 1.0)]
    pub density: Option<f64>,
    /// Isotropic linear elasticity. Absent: no elastic stress.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub elasticity: Option<Elasticity>,
    /// Linear viscosity. Absent: no viscous stress.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub viscosity: Option<Viscosity>,
    /// Viscoplastic flow, which relaxes the elastic stress; requires elasticity. Absent: no viscoplastic flow.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub viscoplasticity: Option<Viscoplasticity>,
    /// Isotropic damage d of each cell, from 0 (sound) to `largest`; requires elasticity. Damage multiplies the elastic stress,
    /// relaxed by viscoplastic flow, by 1 - d and leaves the viscous stress unchanged. It grows as `viscosity d' = (1 - d)^exponent
    /// max(Y - threshold, 0)`, where `Y = s : E^-1 s / 2` is the elastic energy per volume at the stress s of undamaged material,
    /// and never decreases. Absent: no damage.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub damage: Option<Damage>,
}

/// A part of the body with its own material. The region inherits no effect from the table `[material]`: its own table contains all
/// effects.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Region {
    /// The name of the physical group of the mesh that contains the cells of the region.
    #[schemars(length(min = 1), example = &"core")]
    pub name: String,
    /// The material of the region. The hypothesis applies to the whole body and is allowed in the table `[material]` only.
    pub material: Material,
}
