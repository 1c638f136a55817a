//! Other start velocities of a step that may have several solutions.

use super::{Contact, point::Vectors::Body};

impl<const D: usize> Contact<D> {
    /// The largest velocity in m/s at which a law on this rank has a kink; 0 where no law has one.
    pub fn largest_kink_velocity(&self) -> f64 {
        let normal = self.law.corners().iter().fold(0.0, |largest, p| f64::max(largest, p[0].abs()));
        let sliding =
            self.friction.as_ref().map_or(0.0, |friction| friction.law.corner_velocity(friction.context));
        f64::max(normal, sliding)
    }

    /// Sets the normal velocity of the nodal points to the value of `velocity` for their node, in m/s, and the velocity along a
    /// tangent to the same value where there is friction. `nodal` contains velocities at the owned nodes of the body.
    pub fn set_start_velocities(&self, velocity: impl Fn(usize) -> f64, nodal: &mut [f64]) {
        for point in self.points.iter().filter(|point| !self.needs_ghosts && point.free_length > 0.0) {
            let target = velocity(point.node()) / point.free_length;
            point.add_along(Body, target - point.along(Body, nodal), nodal);
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
