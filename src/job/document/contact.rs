//! `[[contact]]`: the laws on boundaries that touch an obstacle.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::laws::contact::{Adhesion, FrictionLaw, Gap, Memory, NormalLaw, Quadrature};

/// Boundaries that touch an obstacle, and the laws there.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Contact {
    /// Names of boundaries.
    #[schemars(length(min = 1), example = ["bottom"])]
    pub on: Vec<String>,
    /// Where on a facet the laws hold.
    #[serde(default)]
    pub quadrature: Quadrature,
    /// The contact pressure -sigma_nu.
    pub normal: NormalLaw,
    /// A rigid obstacle that may move, for `compliance` and `unilateral` in place of their `gap`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub obstacle: Option<Gap>,
    /// The friction traction; absent: sigma_tau = 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub friction: Option<FrictionLaw>,
    /// Bonds to an obstacle at rest, made at displacement zero: they pull back what moves away and give way. The bonding b at a node
    /// falls from 1 as `viscosity b' = -max(b (stiffness R(opening)^2 + tangential_stiffness R(sliding)^2) - energy, 0)`, R
    /// the cut at `length`, and never comes back; the traction is `b^2 stiffness R(opening)` along the normal and
    /// `b^2 tangential_stiffness R(sliding)` against the sliding. `contact_pressure` is that of the normal law alone.
    /// Absent: no bonds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub adhesion: Option<Adhesion>,
    /// Memory of the foundation: a pressure beside that of the normal law,
    /// `integral from 0 to t of stiffness_rate exp(-(t - s) / decay_time) max(normal displacement(s), 0) ds`, the field
    /// `memory_pressure`. `contact_pressure` is that of the normal law alone; the work of both is `contact_dissipation`, negative
    /// where the foundation gives back more than it took. Absent: no memory.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub memory: Option<Memory>,
}
