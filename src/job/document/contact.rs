//! `[[contact]]`: the laws on boundaries that touch an obstacle.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Adhesion, Memory};
use crate::job::Scalar;

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
    pub friction: Option<Friction>,
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

/// Where on a facet the contact laws hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Quadrature {
    /// At its nodes (trapezoidal rule): each node has its own law.
    #[default]
    Nodal,
    /// At Gauss points.
    Gauss,
}

/// The normal law.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum NormalLaw {
    /// A piecewise linear function of the normal velocity that may fall, equation (72).
    DampedResponse(DampedResponse),
    /// Any polyline of pressure over normal velocity, with upward jumps.
    Graph(Graph),
    /// A spring that is felt beyond the gap.
    Compliance(Compliance),
    /// A rigid obstacle: the normal displacement never exceeds the gap.
    Unilateral(Unilateral),
}

/// Pressure as a continuous piecewise linear function of the normal velocity, zero at rest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DampedResponse {
    /// Normal velocities r_1 < r_2 < ... above zero where the slope changes.
    #[schemars(extend("unit" = "m/s"), example = [0.003, 0.005])]
    pub breakpoints: Vec<f64>,
    /// Slopes before, between and after the breakpoints: one more than breakpoints; negative ones fall.
    #[schemars(length(min = 1), extend("unit" = "Pa s/m"), example = [10.0, -10.0, 10.0])]
    pub slopes: Vec<f64>,
    /// How the function goes on for negative velocities.
    #[serde(default)]
    pub symmetry: Symmetry,
}

/// How a function of velocities above zero goes on below.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Symmetry {
    /// p(-r) = p(r): the potential of (72) as printed.
    #[default]
    Even,
    /// p(-r) = -p(r): resists both ways.
    Odd,
    /// p(r) = 0 below zero: only approach is resisted.
    OneSided,
}

/// Pressure over normal velocity as a polyline.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Graph {
    /// Corners [normal velocity, pressure], velocities ascending; two with the same velocity are an upward jump.
    #[schemars(length(min = 1), extend("unit" = "[m/s, Pa]"), example = [[0.0, 0.0], [0.003, 0.03]])]
    pub points: Vec<[f64; 2]>,
    /// Slope below the first point.
    #[serde(default)]
    #[schemars(extend("unit" = "Pa s/m"))]
    pub slope_before: f64,
    /// Slope above the last point.
    #[serde(default)]
    #[schemars(extend("unit" = "Pa s/m"))]
    pub slope_after: f64,
}

/// Normal compliance: pressure `stiffness * max(normal displacement - gap, 0)^exponent`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Compliance {
    /// Pressure at unit penetration.
    #[schemars(extend("unit" = "Pa/m^exponent", "exclusiveMinimum" = 0), example = 1e4)]
    pub stiffness: f64,
    /// Power of the penetration; 1 is a bed of springs.
    #[serde(default = "one")]
    #[schemars(range(min = 1, max = 10), example = 1.5)]
    pub exponent: f64,
    /// Distance to the obstacle along the normal, at time t at the point x, y, z; infinite: nothing to touch. Absent: 0,
    /// or what [contact.obstacle] says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "m"), example = "0.01 - 0.1*t")]
    pub gap: Option<Scalar>,
}

fn one() -> f64 {
    1.0
}

/// Unilateral constraint: normal displacement <= gap, or normal velocity <= 0.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Unilateral {
    /// What is bounded.
    #[serde(default)]
    pub bound: Bound,
    /// Distance to the obstacle along the normal, at time t at the point x, y, z; infinite: nothing to touch. Absent: 0,
    /// or what [contact.obstacle] says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "m"), example = "0.01 - 0.1*t")]
    pub gap: Option<Scalar>,
}

/// What a rigid obstacle bounds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Bound {
    /// The normal displacement never exceeds the gap.
    #[default]
    Displacement,
    /// The normal velocity never exceeds zero: the body only ever moves away.
    Velocity,
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

/// The friction law.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Friction {
    /// A given bound on the friction traction.
    Tresca(Tresca),
    /// A bound proportional to the contact pressure.
    Coulomb(Coulomb),
    /// A coefficient that falls with the sliding velocity.
    SlipWeakening(SlipWeakening),
}

/// Tresca friction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Tresca {
    /// Largest friction traction.
    #[schemars(range(min = 0), extend("unit" = "Pa"), example = 2.0)]
    pub bound: f64,
}

/// Coulomb friction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Coulomb {
    /// Largest friction traction per contact pressure.
    #[schemars(range(min = 0), example = 0.3)]
    pub coefficient: f64,
}

/// Friction whose coefficient falls from static to dynamic with the sliding velocity.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SlipWeakening {
    /// Coefficient at rest; not below the dynamic one.
    #[serde(rename = "static")]
    #[schemars(range(min = 0), example = 0.5)]
    pub at_rest: f64,
    /// Coefficient when sliding fast.
    #[schemars(range(min = 0), example = 0.3)]
    pub dynamic: f64,
    /// Sliding velocity over which the coefficient falls.
    #[schemars(extend("unit" = "m/s", "exclusiveMinimum" = 0), example = 0.01)]
    pub decay_velocity: f64,
}
