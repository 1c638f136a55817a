//! `[material]` and `[[region]]`: the materials of the body.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::laws::material::Material;

/// A part of the body with its own material. The region inherits no effect from the table `[material]`: its own table contains all
/// effects.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Region {
    /// The name of the physical group of the mesh that contains the cells of the region.
    #[schemars(length(min = 1), example = &"core")]
    pub name: String,
    /// The material of the region. The hypothesis applies to the whole body and is allowed in the table `[material]` only.
    pub material: Material,
}
