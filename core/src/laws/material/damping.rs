//! Rayleigh damping: forces `mass M v + stiffness K v` of a material, with its mass and its elastic stiffness (J. W. S. Rayleigh, The
//! Theory of Sound, 1877, section 102).
//!
//! The second part is a viscosity with the structure of elasticity, and belongs to `A`. A vibration of the undamped body with the
//! angular frequency `w` decays with the damping ratio `mass / (2 w) + stiffness w / 2`; a free body slows down as `exp(-mass t)`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Rayleigh damping: forces in proportion to the velocity, by the mass and the elastic stiffness of the material.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Damping {
    /// Factor of the mass: the force per volume is `-mass * density * velocity`; requires a density. A vibration with the angular
    /// frequency w has the damping ratio mass / (2 w) from it, and a body in free flight slows down as exp(-mass * t).
    #[serde(default)]
    #[schemars(range(min = 0), extend("unit" = "1/s"), example = 0.5)]
    pub mass: f64,
    /// Factor of the elastic stiffness: the stress `stiffness * E(strain rate)` is part of the viscous stress, in results and
    /// certificates too; requires elasticity. Damage and flow do not reduce it. A vibration with the angular frequency w has the damping
    /// ratio stiffness * w / 2 from it.
    #[serde(default)]
    #[schemars(range(min = 0), extend("unit" = "s"), example = 1e-3)]
    pub stiffness: f64,
}

impl Damping {
    /// The message if it needs elasticity and that is missing.
    pub const WITHOUT_ELASTICITY: &'static str =
        "damping by the stiffness requires elasticity, whose stiffness it multiplies";
    /// The message if it needs a density and that is missing.
    pub const WITHOUT_DENSITY: &'static str = "damping by the mass requires a density";
}
