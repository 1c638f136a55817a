//! `[contact.memory]`: a foundation that remembers.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Memory of the foundation below a contact boundary.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Memory {
    /// How fast the pressure grows at first, per normal displacement. Held for long, a displacement is opposed like by a spring
    /// of `stiffness_rate decay_time`. The pressure follows late, so that a body on it swings more and more, whatever the step,
    /// unless the normal law or the body damp that.
    #[schemars(range(min = 0), extend("unit" = "Pa/(m s)"), example = 1e4)]
    pub stiffness_rate: f64,
    /// Time in which the foundation forgets all but a part of 1/e.
    #[schemars(extend("unit" = "s", "exclusiveMinimum" = 0), example = 2.0)]
    pub decay_time: f64,
}
