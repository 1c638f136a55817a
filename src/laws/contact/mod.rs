//! Contact laws: pure functions at a point of the contact boundary, with their keys in the job file.
//!
//! Each normal or friction law has a file in the folder `laws` and an entry in one of the lists in `laws.rs`; adhesion, memory and
//! wear have files in this folder. The file of a law defines its parameters, as in the job file, its formula and derivative, and the
//! combinations that are refused. This file also has the keys of the table `[[contact]]`.

mod adhesion;
mod discrete_gradient;
mod friction_law;
mod interface;
mod laws;
mod memory;
mod normal_law;
mod obstacle;
mod obstacle_load;
mod obstacle_motion;
mod obstacle_surface;
mod obstacle_sweep;
mod obstacles;
mod polyline;
mod stl;
mod table;
mod wear;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::laws::expression::Scalar;

pub use adhesion::{Adhesion, Toughness};
pub use friction_law::{FrictionBound, FrictionHistory, SlidingContext, Slip};
pub use interface::Interface;
pub use laws::*;
pub use memory::Memory;
pub use normal_law::{NodeContext, NormalParameters, Resolved, Response};
pub use obstacle_load::ObstacleLoad;
pub use obstacle_motion::{ObstacleMotion, Rate};
pub use obstacle_sweep::Sweep;
pub use obstacles::{Gap, Plane, Shape, Sphere};
pub use polyline::Polyline;
pub use table::{ContactTable, Quadrature};
pub use wear::Wear;

/// Boundaries that may touch an obstacle, and their contact laws.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Contact {
    /// The names of the boundaries.
    #[schemars(length(min = 1), example = ["bottom"])]
    pub on: Vec<String>,
    /// The part of these boundaries to which the contact applies: the facets at whose centre this expression in x, y, z is not 0. A
    /// boundary may be in several contact tables if each has a `where`, and no facet belongs to two; a node between them belongs to the
    /// one with the larger part of its area. A product of conditions holds where all hold, their `max` where one holds. Absent: the
    /// whole boundaries.
    #[serde(default, skip_serializing_if = "Option::is_none", rename = "where")]
    #[schemars(extend("variables" = "x, y, z"), example = "x < 1", example = "(x > 1)*(x < 2)")]
    pub part: Option<Scalar>,
    /// The points of a facet at which the contact laws are evaluated.
    #[serde(default)]
    pub quadrature: Quadrature,
    /// The normal law: the contact pressure -sigma_nu as a function of the normal velocity or the normal displacement.
    pub normal: NormalLaw,
    /// Whether the mass of the cells at these boundaries is moved to nodes behind them (mass redistribution), so that the boundary
    /// loses no kinetic energy in impacts and the contact pressure does not oscillate. Total mass, centre of mass and moments of
    /// inertia stay the same; gravity and body forces move with the mass. Requires an implicit scheme.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub redistribute_mass: bool,
    /// A rigid obstacle, which may move. It replaces the key `gap` of the normal laws `compliance`, `displacement_graph` and `unilateral`;
    /// other normal laws have no distance to an obstacle. Absent: `gap` applies.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub obstacle: Option<Gap>,
    /// A force that moves the obstacle (indentation), or a moment that turns it (rolling). Its displacement and velocity, angle and
    /// angular velocity are in `resultants.csv`. Absent: the obstacle moves as its keys prescribe.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub obstacle_load: Option<ObstacleLoad>,
    /// The friction law: the bound on the tangential traction sigma_tau. Absent: no friction, sigma_tau = 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub friction: Option<FrictionLaw>,
    /// Wear: the body's surface recedes where it slides under pressure, so that the gap widens. The depth grows by `coefficient`
    /// times the contact pressure times the length of sliding relative to the obstacle (Archard's law); fields have it as `wear`.
    /// Requires a friction law and a normal law with a gap. Absent: no wear.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wear: Option<Wear>,
    /// Adhesion to an obstacle at rest: bonds that form at displacement zero, resist opening and sliding, and break. The bonding b
    /// at a node, 1 for intact and 0 for broken bonds, starts at 1 and decreases as `viscosity b' = -max(b (stiffness R(opening)^2
    /// + tangential_stiffness R(sliding)^2) - energy, 0)`, where R(s) = min(s, length). Broken bonds are not restored. The traction
    /// is `b^2 stiffness R(opening)` along the normal and `b^2 tangential_stiffness R(sliding)` against the sliding. The output
    /// `contact_pressure` is the pressure of the normal law without the traction of adhesion. Absent: no adhesion.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub adhesion: Option<Adhesion>,
    /// Memory of the foundation: a pressure that depends on the history of the normal displacement and is added to the pressure of
    /// the normal law, `integral from 0 to t of stiffness_rate exp(-(t - s) / decay_time) max(normal displacement(s), 0) ds`. Field
    /// files contain it as `memory_pressure`; the output `contact_pressure` is the pressure of the normal law only. The work of
    /// both pressures is part of `contact_dissipation`, which is negative while the foundation returns energy. Absent: no memory.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub memory: Option<Memory>,
}
