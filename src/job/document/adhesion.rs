//! `[contact.adhesion]`: bonds between body and obstacle.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Adhesive bonds on a contact boundary.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Adhesion {
    /// Traction per opening of whole bonds. They pull with at most `sqrt(stiffness energy)` when opened slowly.
    #[schemars(range(min = 0), extend("unit" = "Pa/m"), example = 1e6)]
    pub stiffness: f64,
    /// Traction per sliding of whole bonds; absent: sliding stretches no bond.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0), extend("unit" = "Pa/m"), example = 5e5)]
    pub tangential_stiffness: Option<f64>,
    /// Dupré's energy: what it takes to part a unit of area slowly.
    #[schemars(range(min = 0), extend("unit" = "J/m^2"), example = 10.0)]
    pub energy: f64,
    /// What slows debonding; absent: bonds give way at once.
    #[serde(default)]
    #[schemars(range(min = 0), extend("unit" = "J s/m^2"), example = 0.1)]
    pub viscosity: f64,
    /// Opening or sliding beyond which bonds pull no harder; absent: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "m", "exclusiveMinimum" = 0), example = 0.01)]
    pub length: Option<f64>,
}
