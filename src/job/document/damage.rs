//! `[material.damage]`: how the material loses its stiffness.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Isotropic damage with a rate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Damage {
    /// Elastic energy per volume Y above which damage grows; stress squared over twice Young's modulus in tension.
    #[schemars(range(min = 0), extend("unit" = "Pa"), example = 50.0)]
    pub threshold: f64,
    /// What slows damage: Y at twice the threshold takes about viscosity/threshold to break a cell.
    #[schemars(extend("unit" = "Pa s", "exclusiveMinimum" = 0), example = 10.0)]
    pub viscosity: f64,
    /// Power of what is left, 1 - d; 0 is Frémond and Nedjar's law.
    #[serde(default)]
    #[schemars(range(min = 0, max = 10), example = 1.0)]
    pub exponent: f64,
    /// Damage that no cell exceeds; what then is left keeps broken cells from moving freely.
    #[serde(default = "nearly_all")]
    #[schemars(range(min = 0), extend("exclusiveMaximum" = 1), example = 0.99)]
    pub largest: f64,
}

fn nearly_all() -> f64 {
    0.99
}
