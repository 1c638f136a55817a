//! `[[support]]`, `[[traction]]`, `[[body_force]]` and `[initial]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::job::Scalar;

/// Boundaries whose displacement is held at its initial value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Support {
    /// Names of boundaries.
    #[schemars(length(min = 1), example = ["left"])]
    pub on: Vec<String>,
    /// Which components are held.
    #[schemars(example = &"all", example = ["x"])]
    pub fix: Fix,
}

/// Components of the displacement that a support holds.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Fix {
    /// All of them, or the one along the normal.
    Named(Named),
    /// A list of axes.
    Axes(#[schemars(length(min = 1))] Vec<Axis>),
}

/// A set of components with a name of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Named {
    /// Every component.
    All,
    /// The component along the normal; the boundary must be flat and square to an axis.
    Normal,
}

/// An axis of the coordinate system.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Axis {
    /// The first.
    X,
    /// The second.
    Y,
    /// The third.
    Z,
}

impl Axis {
    /// 0 for x, 1 for y, 2 for z.
    pub fn index(self) -> usize {
        self as usize
    }
}

/// A force per area on boundaries.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Traction {
    /// Names of boundaries.
    #[schemars(length(min = 1), example = ["top"])]
    pub on: Vec<String>,
    /// One component an axis: numbers, or expressions in t, x, y, z.
    #[schemars(extend("unit" = "Pa"), example = [0.0, -10.0], example = ["0", "-10*min(t/0.1, 1)"])]
    pub value: Vec<Scalar>,
}

/// A force per volume in the whole body.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BodyForce {
    /// One component an axis: numbers, or expressions in t, x, y, z.
    #[schemars(extend("unit" = "N/m^d"), example = [0.0, -9.81])]
    pub value: Vec<Scalar>,
}

/// The state at time 0.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Initial {
    /// One component an axis: numbers, or expressions in x, y, z; absent: zero.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "m"), example = [0.0, 0.0])]
    pub displacement: Option<Vec<Scalar>>,
    /// One component an axis: numbers, or expressions in x, y, z; absent: zero.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "m/s"), example = [0.0, 0.0])]
    pub velocity: Option<Vec<Scalar>>,
}
