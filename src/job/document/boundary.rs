//! `[[support]]`, `[[traction]]`, `[[body_force]]` and `[initial]`.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::job::Scalar;

/// A support: boundaries on which components of the displacement keep their initial values.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Support {
    /// The names of the boundaries.
    #[schemars(length(min = 1), example = ["left"])]
    pub on: Vec<String>,
    /// The components of the displacement that keep their initial values: "all", "normal" or a list of axes.
    #[schemars(example = &"all", example = ["x"])]
    pub fix: Fix,
}

/// The components of the displacement that a support holds.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Fix {
    /// All components, or the normal one.
    Keyword(FixedDirections),
    /// The components along the listed axes.
    Axes(#[schemars(length(min = 1))] Vec<Axis>),
}

/// A set of components that has a name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FixedDirections {
    /// All components.
    All,
    /// The normal component. The boundary must be flat and perpendicular to a coordinate axis.
    Normal,
}

/// An axis of the coordinate system.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Axis {
    /// The x axis.
    X,
    /// The y axis.
    Y,
    /// The z axis, in 3D only.
    Z,
}

impl Axis {
    /// 0 for x, 1 for y, 2 for z.
    pub fn index(self) -> usize {
        self as usize
    }
}

/// A traction, which is a force per area, on boundaries. If several apply to the same boundary, they are added.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Traction {
    /// The names of the boundaries.
    #[schemars(length(min = 1), example = ["top"])]
    pub on: Vec<String>,
    /// The force per area on the body, one component per axis: numbers, or expressions in the time t and the undeformed coordinates
    /// x, y, z.
    #[schemars(extend("unit" = "Pa"), example = [0.0, -10.0], example = ["0", "-10*min(t/0.1, 1)"])]
    pub value: Vec<Scalar>,
}

/// A force per volume on the whole body. If there are several, they are added.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BodyForce {
    /// The force per volume on the body, one component per axis: numbers, or expressions in the time t and the undeformed
    /// coordinates x, y, z.
    #[schemars(extend("unit" = "N/m^d"), example = [0.0, -9.81])]
    pub value: Vec<Scalar>,
}

/// The state at time 0.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Initial {
    /// The last state of another run, from which this one starts at time 0: a checkpoint, or an output folder for its newest
    /// checkpoint. The mesh must be the same; loads, supports, contacts, laws and scheme may differ. Histories that this job does not
    /// have are dropped, those that only this job has start at rest; the log names both. Components held by supports keep the saved
    /// displacement. Not together with the other keys of this table.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("format" = "path"), example = "out/first_stage", example = "out/first_stage/checkpoint-64.h5")]
    pub from: Option<PathBuf>,
    /// The displacement at time 0, one component per axis: numbers, or expressions in the undeformed coordinates x, y, z. Absent:
    /// zero.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "m"), example = [0.0, 0.0])]
    pub displacement: Option<Vec<Scalar>>,
    /// The velocity at time 0, one component per axis: numbers, or expressions in the undeformed coordinates x, y, z. Absent: zero.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "m/s"), example = [0.0, 0.0])]
    pub velocity: Option<Vec<Scalar>>,
}
