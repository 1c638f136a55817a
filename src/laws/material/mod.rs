//! Material laws: pure functions at a point, with their keys in the job file.
//!
//! Each law has a file in this folder, with its parameters as in the job file, their units and ranges, its formula and source, and
//! the combinations that are refused. This file is the list of all: modules and the keys of the table `[material]`. Viscoplastic
//! laws are listed in `viscoplasticity.rs`.

mod by_material;
mod damage;
mod elasticity;
mod isotropic;
mod local;
mod viscoplasticity;
mod viscosity;

use crate::laws::expression::Scalar;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use by_material::ByMaterial;
pub use damage::Damage;
pub use elasticity::{Elastic, Elasticity, Hypothesis};
pub use isotropic::Isotropic;
pub use local::Numbers;
pub use viscoplasticity::*;
pub use viscosity::Viscosity;

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
    #[schemars(extend("variables" = "x, y, z", "unit" = "kg/m^d", "exclusiveMinimum" = 0), example = 1.0)]
    pub density: Option<N>,
    /// Isotropic linear elasticity. Absent: no elastic stress.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub elasticity: Option<Elasticity<N>>,
    /// Linear viscosity. Absent: no viscous stress.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub viscosity: Option<Viscosity<N>>,
    /// Viscoplastic flow, which relaxes the elastic stress; requires elasticity. Absent: no viscoplastic flow.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub viscoplasticity: Option<Viscoplasticity<N>>,
    /// Isotropic damage d of each cell, from 0 (sound) to `largest`; requires elasticity. Damage multiplies the elastic stress,
    /// relaxed by viscoplastic flow, by 1 - d and leaves the viscous stress unchanged. It grows as `viscosity d' = (1 - d)^exponent
    /// max(Y - threshold, 0)`, where `Y = s : E^-1 s / 2` is the elastic energy per volume at the stress s of undamaged material,
    /// and never decreases. Absent: no damage.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub damage: Option<Damage>,
}

impl Material {
    /// Whether it resists motion: no body consists of a material without density, elasticity and viscosity.
    pub fn resists(&self) -> bool {
        self.density.is_some() || self.elasticity.is_some() || self.viscosity.is_some()
    }

    /// The keys of its laws that require elasticity, with the message where it is absent.
    pub fn laws_that_require_elasticity(&self) -> impl Iterator<Item = (&'static str, &'static str)> {
        let flow =
            self.viscoplasticity.as_ref().map(|_| ("viscoplasticity", Viscoplasticity::WITHOUT_ELASTICITY));
        flow.into_iter().chain(self.damage.map(|_| ("damage", Damage::WITHOUT_ELASTICITY)))
    }
}
