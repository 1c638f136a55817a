//! Distances of velocities and tractions from the graphs of the laws. All vectors are those of Newton's method.

use super::{
    Contact,
    point::{Point, Unknown, Vectors::Newton},
    reference::worst,
};
use crate::linear_algebra::tensor::larger;

/// Share of the mean pressure of all forces of a step that is the smallest reference for errors of the pressure.
const FORCE_SHARE: f64 = 0.01;

impl<const D: usize> Contact<D> {
    /// Largest normal velocity and pressure, sliding velocity and friction traction at points on this rank, as absolute values.
    /// Where the law has no pressure, the velocity is that in any direction: its rounding limits the resolution along the normal.
    pub fn range(&self, velocity: &[f64]) -> [f64; 4] {
        let nothing = self.normal.law.is_zero();
        let normal = self.normal.points.iter().fold([0.0; 2], |[v, p], point| {
            let moved =
                if nothing { point.speed(velocity) } else { point.normal_component(Newton, velocity).abs() };
            let along = larger(moved, point.context_velocity());
            [larger(v, along), larger(p, point.pressure_at(&self.normal.law, Newton, velocity).abs())]
        });
        let sliding = self.friction.as_ref().map_or([0.0; 2], |f| f.range(&self.normal.points, velocity));
        [normal[0], normal[1], sliding[0], sliding[1]]
    }

    /// Largest scaled distance of (velocity, traction from equilibrium) to the graphs of both laws. `residual` contains the
    /// residual of the equations of motion, in N; `range` scales where the law has no range of its own or a smaller one.
    pub fn inclusion_residual(&self, velocity: &[f64], residual: &[f64], range: [f64; 4]) -> f64 {
        let sliding = [range[2], range[3]];
        // Without a range, the reference pressure is the mean pressure of the forces; where the law has a range, a share of it.
        let share = if self.normal.law.is_zero() || self.normal.law.depends_on_displacement() {
            1.0
        } else {
            FORCE_SHARE
        };
        let reference = self.reference;
        let range = reference.range([range[0], range[1]], share, 0);
        let is_free = |p: &&Point<D>| !matches!(p.unknown, Unknown::Held | Unknown::Stop);
        let free = self.normal.points.iter().filter(is_free).filter(|p| p.can_touch());
        let distance = |p: &Point<D>| {
            let pressure = p.pressure_at(&self.normal.law, Newton, velocity) - p.open_pressure(residual);
            self.normal.law.distance_worn(p.normal_component(Newton, velocity), pressure, p.context, range)
        };
        let normal = worst(free.map(distance));
        let Some(friction) = &self.friction else { return normal };
        normal.max(friction.inclusion_residual(&self.normal.points, velocity, residual, sliding, reference))
    }
}
