//! The job as plain structs: the single source of every key's name, meaning, unit, range and default. Those of material laws stand
//! with the laws.
//!
//! Doc comments become the text of `solver describe`; the `schemars` attributes become the ranges that
//! `validate` checks before these structs are filled.

mod boundary;
mod contact;
mod material;
mod mesh;
mod output;
mod time;

pub use crate::laws::contact::Quadrature;
pub use boundary::{Axis, BodyForce, Fix, Initial, Named, Support, Traction};
pub use contact::Contact;
pub use material::{Material, Region};
pub use mesh::{Cuboid, CuboidGrading, Diagonal, Mesh, Partition, Rectangle, RectangleGrading};
pub use output::{Checkpoint, Every, Output, Probe, Profile};
pub use time::{
    Accept, Adaptive, FactorPrecision, FrictionIteration, Method, Preconditioner, Scheme, Solver, Time,
};

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A job: the body, what acts on it, how long, and what to keep. A table that is absent is an effect that
/// does not exist in the run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Job {
    /// What the job is about; changes nothing in the run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub about: Option<About>,
    /// The body's mesh.
    pub mesh: Mesh,
    /// The material of every cell that no region names.
    pub material: Material,
    /// Parts of the body, named by the mesh's physical groups, that are of another material.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub region: Vec<Region>,
    /// Boundaries whose displacement is held at its initial value.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub support: Vec<Support>,
    /// Forces per area on boundaries.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub traction: Vec<Traction>,
    /// Forces per volume in the whole body; several add up.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub body_force: Vec<BodyForce>,
    /// Boundaries that touch an obstacle.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub contact: Vec<Contact>,
    /// The state at time 0; absent: at rest in the mesh's own shape.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub initial: Option<Initial>,
    /// How long and in which steps.
    pub time: Time,
    /// How the equations of a step are solved.
    #[serde(default)]
    pub solver: Solver,
    /// What is written, and where.
    #[serde(default)]
    pub output: Output,
    /// When the complete state is saved; absent: only when the run is stopped or fails.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub checkpoint: Option<Checkpoint>,
    /// Numbers this job is known to give, by the quoted name of the quantity, such as "final_von_mises" or
    /// "probe.tip.velocity_y"; every example job is a regression test.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    #[schemars(extend("key_help" = "quote the whole name: \"probe.tip.velocity_y\" = { value = .., relative = .. }"))]
    pub check: BTreeMap<String, Expected>,
}

/// What the job is about; changes nothing in the run.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct About {
    /// One line that says what happens.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = "Dynamic viscoplastic contact with normal damped response")]
    pub title: Option<String>,
    /// Where the problem comes from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = "Wang and Cheng (2022), section 5")]
    pub reference: Option<String>,
    /// Who wrote the job.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub authors: Vec<String>,
}

/// A number the job is known to give, and how far off the run may be.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Expected {
    /// The expected number, in the quantity's own unit.
    #[schemars(example = 0.00602756)]
    pub value: f64,
    /// Largest accepted |difference| / |value|.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0), example = 1e-6)]
    pub relative: Option<f64>,
    /// Largest accepted |difference|, in the quantity's own unit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0), example = 1e-9)]
    pub absolute: Option<f64>,
}
