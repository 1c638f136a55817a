//! The keys of a force and a moment that move an obstacle.

use super::interface::Interface;
use crate::laws::{expression::Scalar, law::LawFault};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A force under which the obstacle moves along `direction`, a `moment` under which it turns about its centre, or both, in addition to
/// the motion that its keys prescribe: `mass x'' = force + resultant of the contact tractions on the obstacle along the direction`, and
/// in the same way for the rotation. Both motions are solved together with each step.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("also" = "indentation, rolling"))]
pub struct ObstacleLoad {
    /// The direction of the motion and of the force, one component per axis, of any length. Absent: no force moves the obstacle.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(example = [0.0, -1.0])]
    pub direction: Vec<f64>,
    /// The force along the direction: a number, or an expression in t. In a plane problem it is a force per metre of thickness.
    #[serde(default)]
    #[schemars(extend("variables" = "t", "unit" = "N"), example = "min(t, 2 - t)")]
    pub force: Scalar,
    /// Mass of the obstacle, in a plane problem per metre of thickness. 0: the force and the contact tractions are in equilibrium in
    /// each step. The kinetic energy of the obstacle is `obstacle_kinetic_energy` in `history.csv`; implicit_euler and lagged_euler damp its motion, by
    /// `obstacle_numerical_dissipation`.
    #[serde(default)]
    #[schemars(extend("unit" = "kg"), range(min = 0), example = 0.5)]
    pub mass: f64,
    /// Velocity along the direction at time 0.
    #[serde(default)]
    #[schemars(extend("unit" = "m/s"), example = 1.0)]
    pub velocity: f64,
    /// The moment (torque) about the centre of an obstacle other than a plane, counterclockwise; in 3D about its `axis`, as seen against its direction: a
    /// number, or an expression in t. In a plane problem it is a moment per metre of thickness. It acts against friction only: the
    /// shape itself does not turn, and should be round about the axis. Absent: the obstacle turns by its key `rotation`, or not at all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("variables" = "t", "unit" = "N m"), example = 0.0)]
    pub moment: Option<Scalar>,
    /// Moment of inertia about the centre or the axis, in a plane problem per metre of thickness. 0: the moment and the contact tractions
    /// are in equilibrium in each step; steps of an obstacle that also moves along `direction` may then fail.
    #[serde(default, skip_serializing_if = "is_zero")]
    #[schemars(extend("unit" = "kg m^2"), range(min = 0), example = 1e-3)]
    pub moment_of_inertia: f64,
    /// Angular velocity at time 0, with the sign of `moment`.
    #[serde(default, skip_serializing_if = "is_zero")]
    #[schemars(extend("unit" = "rad/s"), example = 10.0)]
    pub angular_velocity: f64,
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

impl ObstacleLoad {
    /// The faults of the keys, which are those of the table of the contact.
    pub(super) fn faults(&self, interface: Interface<'_>) -> Vec<LawFault> {
        let mut faults = Vec::new();
        let mut at_key = |key: &str, message, help| faults.push(LawFault::at_key(key, message, help));
        if !interface.has_obstacle {
            let help = "add [contact.obstacle], or delete the table";
            at_key("obstacle_load", "a force moves an obstacle, but there is none", help);
        }
        if self.direction.is_empty() && self.moment.is_none() {
            let help = "add `direction` and `force`, or `moment`, or all three";
            at_key(
                "obstacle_load",
                "neither a force along a `direction` nor a `moment` moves the obstacle",
                help,
            );
        } else if self.direction.is_empty()
            && (self.force != Scalar::default() || self.mass > 0.0 || self.velocity != 0.0)
        {
            let help = "add `direction`, or delete `force`, `mass` and `velocity`";
            at_key("obstacle_load", "`force`, `mass` and `velocity` need a `direction`", help);
        }
        let turns = self.moment_of_inertia > 0.0 || self.angular_velocity != 0.0;
        if self.moment.is_none() && turns {
            let help = "add `moment`, which may be 0";
            at_key("obstacle_load", "`moment_of_inertia` and `angular_velocity` need a `moment`", help);
        }
        if self.moment.is_some() && interface.friction.is_none() {
            let help = "add [contact.friction], or delete the key";
            at_key("obstacle_load.moment", "a moment acts against friction, and this contact has none", help);
        }
        if !self.direction.is_empty() && self.direction.iter().all(|&x| x == 0.0) {
            let help = "give the direction in which the force acts";
            faults.push(LawFault::at_value(
                "obstacle_load.direction",
                "the direction is the zero vector",
                help,
            ));
        }
        faults
    }
}
