//! Other velocities for a step to start from, where it may have several solutions.

use super::Contact;
use crate::contact::{FrictionLaw, NormalLaw};

impl<const D: usize> Contact<D> {
    /// The largest velocity in m/s at which a law here turns a corner; 0 where none is given.
    pub fn corner_velocity(&self) -> f64 {
        let normal = match &self.law {
            NormalLaw::Graph(graph) => graph.points().iter().fold(0.0, |most, p| f64::max(most, p[0].abs())),
            NormalLaw::Compliance(_) | NormalLaw::Unilateral(_) => 0.0,
        };
        let sliding = match self.friction() {
            Some(FrictionLaw::SlipWeakening { decay_velocity, .. }) => decay_velocity,
            _ => 0.0,
        };
        f64::max(normal, sliding)
    }

    /// Gives the nodal points the normal velocity in m/s that `velocity` says for their node, and as much along a tangent
    /// where there is friction. `nodal` holds velocities at owned nodes.
    pub fn start_at(&self, velocity: impl Fn(usize) -> f64, nodal: &mut [f64]) {
        for point in self.points.iter().filter(|point| !self.needs_ghosts && point.stretch > 0.0) {
            let wanted = velocity(point.node()) / point.stretch;
            point.add_along(wanted - point.along(nodal), nodal);
        }
        if let Some(friction) = &self.friction {
            let mut sliding = vec![0.0; nodal.len()];
            friction.add_unit_sliding(&mut sliding);
            for (at, (value, sliding)) in nodal.iter_mut().zip(sliding).enumerate() {
                *value += velocity(at / D) * sliding;
            }
        }
    }
}
