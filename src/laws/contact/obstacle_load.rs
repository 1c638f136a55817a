//! The keys of a force that moves an obstacle.

use crate::laws::{expression::Scalar, law::LawFault};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A force under which the obstacle moves along a direction, in addition to the motion that its keys prescribe: `mass x'' = force +
/// resultant of the contact tractions on the obstacle along the direction`. The motion is solved together with each step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ObstacleLoad {
    /// The direction of the motion and of the force, one component per axis, of any length.
    #[schemars(example = [0.0, -1.0])]
    pub direction: Vec<f64>,
    /// The force along the direction: a number, or an expression in t. In 2D it is a force per metre of thickness.
    #[schemars(extend("unit" = "N"), example = "min(t, 2 - t)")]
    pub force: Scalar,
    /// Mass of the obstacle, in 2D per metre of thickness. 0: the force and the contact tractions are in equilibrium in each step.
    #[serde(default)]
    #[schemars(extend("unit" = "kg"), range(min = 0), example = 0.5)]
    pub mass: f64,
    /// Velocity along the direction at time 0.
    #[serde(default)]
    #[schemars(extend("unit" = "m/s"), example = 1.0)]
    pub velocity: f64,
}

impl ObstacleLoad {
    /// The faults of the keys, which are those of the table of the contact.
    pub(super) fn faults(&self, has_obstacle: bool) -> Vec<LawFault> {
        let mut faults = Vec::new();
        if !has_obstacle {
            let help = "add [contact.obstacle], or delete the table";
            faults.push(LawFault::at_key(
                "obstacle_load",
                "a force moves an obstacle, but there is none",
                help,
            ));
        }
        if !self.direction.is_empty() && self.direction.iter().all(|&x| x == 0.0) {
            let help = "give the direction in which the force acts";
            faults.push(LawFault::at_value(
                "obstacle_load.direction",
                "the direction is the zero vector",
                help,
            ));
        }
        if self.force.depends_on_position() {
            let help = "use t only";
            faults.push(LawFault::at_value("obstacle_load.force", "the force depends on time only", help));
        }
        faults
    }
}
