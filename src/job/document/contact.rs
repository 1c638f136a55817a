//! `[[contact]]`: the laws on boundaries that touch an obstacle.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::contact::{Adhesion, FrictionLaw, Memory, NormalLaw, Quadrature};
use crate::expression::Scalar;

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
    pub obstacle: Option<Obstacle>,
    /// The friction traction; absent: sigma_tau = 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub friction: Option<FrictionLaw>,
    /// Bonds to the obstacle, made at displacement zero: they pull back what moves away and give way. The bonding b at a node
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

/// A rigid obstacle that may move; friction acts on the velocity relative to it, over a step the mean one. The gap is measured from the place where a point of the boundary was at first along its
/// normal there (deformations are small); where that ray does not meet the obstacle there is no contact.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Obstacle {
    /// All that lies beyond a plane, in 2D a line.
    Plane(Plane),
    /// A sphere, in 2D a disc.
    Sphere(Sphere),
}

/// A plane that bounds an obstacle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Plane {
    /// A point of the plane, one component an axis: numbers, or expressions in t. Motion along the plane is that of a belt.
    #[schemars(extend("unit" = "m"), example = serde_json::json!([0.0, "-0.01 + 0.1*t"]))]
    pub point: Vec<Scalar>,
    /// The plane's normal, out of the obstacle toward the body, of any length: numbers, or expressions in t.
    #[schemars(example = [0.0, 1.0])]
    pub normal: Vec<Scalar>,
    /// Angular velocity at which the plane turns in itself about its normal through `point`, counterclockwise seen from the
    /// body, in 3D: a number, or an expression in t. Only friction feels it. Absent: 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "rad/s"), example = 10.0)]
    pub rotation: Option<Scalar>,
}

/// A sphere as an obstacle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sphere {
    /// Its centre, one component an axis: numbers, or expressions in t.
    #[schemars(extend("unit" = "m"), example = serde_json::json!([0.5, "-1.01 + 0.1*t"]))]
    pub centre: Vec<Scalar>,
    /// Its radius.
    #[schemars(extend("unit" = "m", "exclusiveMinimum" = 0), example = 1.0)]
    pub radius: f64,
    /// Whether the obstacle is all outside of the sphere, with the body inside.
    #[serde(default)]
    pub hollow: bool,
    /// Angular velocity at which the sphere turns about its centre, counterclockwise, in 3D seen from where `axis` points: a
    /// number, or an expression in t. Only friction feels it. Absent: 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "rad/s"), example = "-2*t")]
    pub rotation: Option<Scalar>,
    /// What the sphere turns about in 3D, a vector of any length; absent in 2D.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = [0.0, 1.0, 0.0])]
    pub axis: Option<Vec<f64>>,
}
