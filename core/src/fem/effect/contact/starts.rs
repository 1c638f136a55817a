//! Other start velocities of a step.

use super::{
    Contact,
    point::{Point, Vectors::Body},
};
use crate::parallel::session::Session;

impl<const D: usize> Contact<D> {
    /// The largest velocity in m/s at which a law on this rank has a kink; 0 where no law has one.
    pub fn largest_kink_velocity(&self) -> f64 {
        let normal = self.normal.law.corners().iter().fold(0.0, |largest, p| f64::max(largest, p[0].abs()));
        let sliding =
            self.friction.as_ref().map_or(0.0, |friction| friction.law.corner_velocity(friction.context));
        f64::max(normal, sliding)
    }

    /// Adds to nodal forces in N of the body, with ghosts, those with which the force on the obstacle presses it against the points in front
    /// of it, with pressures in proportion to the components of their normals along the force. Collective.
    pub fn add_driving_force(&self, session: &Session, nodal: &mut [f64]) {
        let [Some(motion), _] = &self.obstacle.motions else { return };
        let driving = motion.driving;
        let against = |point: &Point<D>| (-driving.signum() * point.along_obstacle).max(0.0);
        let faced = || self.normal.points.iter().filter(|point| point.can_touch());
        let [area] = session.sum([faced().map(|point| point.weight * against(point).powi(2)).sum()]);
        if area > 0.0 {
            let pressure = driving.abs() / area;
            faced().for_each(|point| point.add_force(Body, -pressure * against(point), nodal));
        }
    }

    /// Sets the normal velocity of the nodal points to the value of `velocity` for their node, in m/s, and the velocity along a
    /// tangent to the same value where there is friction. `nodal` contains velocities at the owned nodes of the body.
    pub fn set_start_velocities(&self, velocity: impl Fn(usize) -> f64, nodal: &mut [f64]) {
        for point in self.normal.points.iter().filter(|point| point.free_length > 0.0) {
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
