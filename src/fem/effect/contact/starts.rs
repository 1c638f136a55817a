//! Other start velocities of a step.

use super::{
    Contact,
    point::{Point, Vectors::Body},
};
use crate::{
    linear_algebra::tensor::{dot, larger},
    parallel::session::Session,
};

/// Points that a motion closes by less than this share of the fastest one do not count.
const SLOW: f64 = 1e-3;

impl<const D: usize> Contact<D> {
    /// The largest velocity in m/s at which a law on this rank has a kink; 0 where no law has one.
    pub fn largest_kink_velocity(&self) -> f64 {
        let normal = self.law.corners().iter().fold(0.0, |largest, p| f64::max(largest, p[0].abs()));
        let sliding =
            self.friction.as_ref().map_or(0.0, |friction| friction.law.corner_velocity(friction.context));
        f64::max(normal, sliding)
    }

    /// The multiple of a motion that closes the gap of a point on this rank first, in the step that has begun; infinite where it closes none.
    pub fn multiple_to_touch(&self, velocity: &[f64]) -> f64 {
        let way = |point: &Point<D>| point.context.step_length * point.normal_component(Body, velocity);
        let carrying = || self.points.iter().filter(|point| point.carries(&self.law) && point.can_touch());
        let longest = carrying().map(way).fold(0.0, larger);
        let closing = carrying().filter(|point| way(point) > SLOW * longest);
        let multiples = closing.map(|point| (-point.context.penetration).max(0.0) / way(point));
        multiples.fold(f64::INFINITY, f64::min)
    }

    /// Adds to nodal forces in N of the body, with ghosts, those with which the force on the obstacle presses it against the points in front
    /// of it, with pressures in proportion to the components of their normals along the force. Collective.
    pub fn add_driving_force(&self, session: &Session, nodal: &mut [f64]) {
        let [Some(motion), _] = self.driven() else { return };
        let Some((direction, _)) = self.obstacle.as_ref().and_then(|obstacle| obstacle.translation()) else {
            return;
        };
        let driving = motion.driving();
        let against = |point: &Point<D>| (-driving.signum() * dot(&point.normal, direction)).max(0.0);
        let faced = || self.points.iter().filter(|point| point.can_touch());
        let [area] = session.sum([faced().map(|point| point.weight * against(point).powi(2)).sum()]);
        if area > 0.0 {
            let pressure = driving.abs() / area;
            faced().for_each(|point| point.add_force(Body, -pressure * against(point), nodal));
        }
    }

    /// The power in W of the pressures on this rank in a rigid motion, at a motion plus this multiple of the rigid one.
    pub fn power_of_pressures(&self, motions: [&[f64]; 2], multiple: f64) -> f64 {
        let power = |point: &Point<D>| {
            let [along, rigid] = motions.map(|motion| point.normal_component(Body, motion));
            let pressure = self.law.pressure(along + multiple * rigid, point.context);
            // Beyond a wall it is infinite.
            if rigid == 0.0 || pressure == 0.0 { 0.0 } else { point.weight * pressure * rigid }
        };
        self.points.iter().filter(|point| point.carries(&self.law) && point.can_touch()).map(power).sum()
    }

    /// Sets the pressures of points that have their own to those at this share of the way between two such multiples.
    pub fn set_pressures_between(&mut self, motions: [&[f64]; 2], ends: [f64; 2], share: f64) {
        for point in self.points.iter_mut().filter(|point| point.unknown.has_pressure()) {
            let [along, rigid] = motions.map(|motion| point.normal_component(Body, motion));
            let [low, high] = ends.map(|multiple| self.law.pressure(along + multiple * rigid, point.context));
            let pressure = low + share * (high - low);
            if pressure.is_finite() {
                point.pressure = pressure;
            }
        }
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
