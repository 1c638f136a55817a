//! The job as plain structs: the single source of the name, meaning, unit, range and default of each key. The keys of material and
//! contact laws are defined with the laws.
//!
//! Doc comments become the text of `solver describe`; the `schemars` attributes become the ranges that
//! `validate` checks before these structs are filled.

mod boundary;
mod contact;
mod heat;
mod material;
mod mesh;
mod output;
mod parameters;
mod time;

pub use crate::laws::{
    contact::{Contact, Quadrature, Side, Sliding},
    material::Material,
    schemes::Scheme,
};
pub use boundary::{
    Axis, BodyForce, Fix, FixedDirections, Gravity, Initial, InitialStress, Reset, Resistance, Support,
    Traction,
};
pub(super) use contact::{check_contact, check_names as check_contact_names};
pub use heat::{Convection, HeatBoundary};
pub use material::Region;
pub(super) use material::{check_in_body as check_material_in_body, check_material};
pub use mesh::{
    Blocks, Cuboid, CuboidGrading, Diagonal, Mesh, MeshSource, Partition, Rectangle, RectangleGrading,
    Rotation, boundary_of_block, region_of_block,
};
pub use output::{Checkpoint, Every, FurtherField, Output, Probe, ProbedQuantity, Profile};
pub use parameters::Parameter;
pub use time::{Accept, Adaptive, FactorPrecision, FrictionIteration, Method, Preconditioner, Solver, Time};

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::written::Written;

/// A job: the body, its loads and contacts, the simulated time and the output. An effect whose table is absent is not simulated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Job {
    /// Title, source and authors of the job. They do not affect the run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub about: Option<About>,
    /// Numbers with names, for example V = 0.05 and T = "2*pi/V". Wherever a key expects a number, it accepts an expression of them
    /// in quotes, such as end = "3*T" and cells = ["2*n", "n"]; expressions in t, x, y, z may contain them, too. A parameter may
    /// depend on others, in any order. A name is any word of letters, digits and _ that does not start with a digit, except pi and inf. A
    /// formula with a variable of this name, such as x or d, does not accept it, because it is not clear which is meant.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub parameters: BTreeMap<String, Parameter>,
    /// The values that expressions of parameters give, as the job file has them.
    #[serde(skip)]
    pub written: Written,
    /// The mesh of the body or bodies.
    pub mesh: Mesh,
    /// The material of all cells that belong to no `[[region]]`.
    pub material: Material,
    /// Regions of the body with their own material, named by the groups or sets of the mesh file, or by the names of generated blocks.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(extend("also" = "coating, layer, inclusion, composite"))]
    pub region: Vec<Region>,
    /// Boundaries on which components of the displacement are held or moved, or which rest on springs and dashpots.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub support: Vec<Support>,
    /// Tractions, which are forces per area, on boundaries. Tractions on the same boundary are added.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub traction: Vec<Traction>,
    /// Forces per volume on the whole body. Several body forces are added.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub body_force: Vec<BodyForce>,
    /// Gravity on all materials with a density. Absent: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gravity: Option<Gravity>,
    /// Temperatures, heat fluxes and convection on boundaries; requires [material.heat]. No heat passes other boundaries.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub heat: Vec<HeatBoundary>,
    /// Boundaries that may touch an obstacle, and their contact laws.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub contact: Vec<Contact>,
    /// The state at time 0. Absent: zero displacement and velocity.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub initial: Option<Initial>,
    /// The end of the run, the steps and the time scheme.
    pub time: Time,
    /// How the equations of a step are solved. Every key is optional.
    #[serde(default)]
    pub solver: Solver,
    /// The output folder and its contents.
    #[serde(default)]
    pub output: Output,
    /// When the complete state is saved for a restart. Absent: only when the run is stopped or fails.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub checkpoint: Option<Checkpoint>,
    /// Expected results, by the quoted name of the quantity, such as "final_von_mises" or "probe.tip.velocity_y". A run says at its end which of
    /// its results are not as expected, and refuses names of which it will have no value.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    #[schemars(extend("key_help" = "quote the whole name: \"probe.tip.velocity_y\" = { value = .., relative = .. }"))]
    pub check: BTreeMap<String, Expected>,
}

/// Title, source and authors of the job. They do not affect the run.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct About {
    /// One line that states what the job simulates.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = "Dynamic viscoplastic contact with normal damped response")]
    pub title: Option<String>,
    /// The source of the problem.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = "Wang and Cheng (2022), section 5")]
    pub reference: Option<String>,
    /// The authors of the job.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub authors: Vec<String>,
}

/// An expected result and its tolerance; at least one of `relative` and `absolute` is required.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Expected {
    /// The expected value, in the unit of the quantity.
    #[schemars(example = 0.00602756)]
    pub value: f64,
    /// Largest accepted |result - value| / |value|.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0), example = 1e-6)]
    pub relative: Option<f64>,
    /// Largest accepted |result - value|, in the unit of the quantity.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0), example = 1e-9)]
    pub absolute: Option<f64>,
}
