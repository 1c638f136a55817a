//! A rigid obstacle: `u_nu <= gap`, or `v_nu <= 0`.
//!
//! Within a step both are graphs over the normal velocity that are zero up to a velocity and vertical there: the velocity that
//! closes the gap at the end of the step, or zero.

use crate::laws::contact::normal_law::{NodeContext, NormalParameters, Resolved, Response};
use crate::{
    error::Result,
    laws::{expression::Scalar, law::LawFault},
    linear_algebra::tensor::larger,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Unilateral constraint: normal displacement <= gap, or normal velocity <= 0.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("also" = "impact, collision, bounce, shock, wall, hard, hard contact, Signorini"))]
pub struct Unilateral {
    /// The quantity that the obstacle bounds.
    #[serde(default)]
    pub bound: Bound,
    /// Gap: distance from the undeformed boundary to the obstacle along the outward normal, as a number or an expression in the
    /// time t and the undeformed coordinates x, y, z. inf: no obstacle. Absent: 0, or the distance to [contact.obstacle] if
    /// there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("infinite" = true, "unit" = "m"), example = "0.01 - 0.1*t")]
    pub gap: Option<Scalar>,
}

/// The quantity that a rigid obstacle bounds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Bound {
    /// The normal displacement never exceeds the gap.
    #[default]
    Displacement,
    /// The normal velocity never exceeds zero: the boundary can only move away from the obstacle.
    Velocity,
}

impl NormalParameters for Unilateral {
    type Response = Self;

    fn response(&self) -> Result<Self> {
        Ok(self.clone())
    }

    fn gap(&self) -> Option<&Scalar> {
        self.gap.as_ref()
    }

    fn own_faults(&self) -> Vec<LawFault> {
        if self.bound == Bound::Displacement || self.gap.is_none() {
            return Vec::new();
        }
        let help = "delete it, or bound the displacement";
        vec![LawFault::at_value("gap", "a bound on the velocity has no gap", help)]
    }

    fn against_obstacle(&self, _name: &str) -> Option<[String; 2]> {
        let words =
            ["a bound on the velocity has no obstacle", "delete the obstacle, or bound the displacement"];
        (self.bound == Bound::Velocity).then(|| words.map(String::from))
    }
}

impl Unilateral {
    /// The normal velocity in m/s at which the graph is vertical.
    fn wall(&self, node: NodeContext) -> f64 {
        match self.bound {
            Bound::Displacement => -node.penetration / node.step_length,
            Bound::Velocity => 0.0,
        }
    }
}

impl Response for Unilateral {
    fn resolve(&self, s: f64, c: f64, node: NodeContext) -> Resolved {
        let wall = self.wall(node);
        if s >= c * wall {
            Resolved { velocity: wall, pressure: s - c * wall, derivative: 0.0, branch: 1 }
        } else {
            // Not computed from the velocity of the vertical part, which may be infinite.
            Resolved::free(s, c)
        }
    }

    fn pressure(&self, velocity: f64, node: NodeContext) -> f64 {
        if velocity < self.wall(node) { 0.0 } else { f64::INFINITY }
    }

    fn slope(&self, velocity: f64, node: NodeContext) -> f64 {
        self.pressure(velocity, node)
    }

    fn distance(&self, velocity: f64, pressure: f64, node: NodeContext, range: [f64; 2]) -> f64 {
        let (beyond, pressure) = ((velocity - self.wall(node)) / range[0], pressure / range[1]);
        f64::min(larger(beyond, 0.0).hypot(pressure), beyond.hypot(larger(-pressure, 0.0)))
    }

    fn has_vertical_parts(&self) -> bool {
        true
    }

    fn depends_on_displacement(&self) -> bool {
        self.bound == Bound::Displacement
    }

    fn velocity_bound(&self, node: NodeContext) -> Option<f64> {
        Some(self.wall(node))
    }

    fn growth_constants(&self) -> Result<[f64; 2], &'static str> {
        Err("the growth constant is infinite because a contact law ends in a vertical ray")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wall_is_touched_at_any_pressure_and_left_at_none() {
        let wall = Unilateral { bound: Bound::Velocity, gap: None };
        let node = NodeContext { penetration: 3.0, step_length: 0.5, ..NodeContext::default() };
        let touching = wall.resolve(7.0, 2.0, node);
        assert_eq!((touching.velocity, touching.pressure, touching.derivative), (0.0, 7.0, 0.0));
        let open = wall.resolve(-6.0, 2.0, node);
        assert_eq!((open.velocity, open.pressure, open.derivative), (-3.0, 0.0, 0.5));
        let off = |velocity, pressure| wall.distance(velocity, pressure, node, [2.0, 4.0]);
        assert_eq!([off(0.0, 5.0), off(-1.0, 0.0), off(-1.0, 1.0), off(1.0, 5.0)], [0.0, 0.0, 0.25, 0.5]);
        assert_eq!([off(6.0, -16.0), off(-2.0, 8.0)], [5.0, 1.0], "by Pythagoras; the upright is nearer");
    }
}
