//! How far velocities and tractions are off the graphs of the laws.

use super::{
    Contact,
    point::{Point, Unknown},
};
use crate::tensor::larger;

/// Share of the mean pressure of all forces of a step, beside which errors of the pressure count at least.
const FORCE_SHARE: f64 = 0.01;

/// What the velocities and tractions of a contact are held against where its laws have no range of their own. It follows from the
/// step's matrix and forces alone, not from the way in which the step is solved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReferenceValues {
    /// What resists a motion of the boundary alone, along the normal and in sliding, in Pa s/m.
    pub resistance: [f64; 2],
    /// The boundary in m^(D-1), over all ranks.
    pub area: f64,
    /// The forces of the step, in N.
    pub forces: f64,
}

impl Default for ReferenceValues {
    fn default() -> Self {
        Self { resistance: [1.0; 2], area: 1.0, forces: 0.0 }
    }
}

impl ReferenceValues {
    /// The mean traction of all forces, in Pa.
    pub fn traction(self) -> f64 {
        if self.area > 0.0 { self.forces / self.area } else { 0.0 }
    }
}

/// The largest distance; a distance that is no number is beyond all others.
pub(super) fn worst(distances: impl Iterator<Item = f64>) -> f64 {
    distances.fold(0.0, |worst, distance| if distance.is_nan() { f64::INFINITY } else { distance.max(worst) })
}

impl<const D: usize> Contact<D> {
    /// Largest normal velocity and pressure, sliding velocity and friction traction at points here, without signs. Where the
    /// law knows no pressure, the velocity is that in any direction: what is felt along the others bounds what can be told.
    pub fn range(&self, velocity: &[f64]) -> [f64; 4] {
        let nothing = self.law.is_zero();
        let normal = self.points.iter().fold([0.0; 2], |[v, p], point| {
            let moved = if nothing { point.speed(velocity) } else { point.normal_component(velocity).abs() };
            let along = larger(moved, point.context_velocity());
            [larger(v, along), larger(p, point.pressure_at(&self.law, velocity).abs())]
        });
        let sliding = self.friction.as_ref().map_or([0.0; 2], |f| f.range(&self.points, velocity));
        [normal[0], normal[1], sliding[0], sliding[1]]
    }

    /// Largest scaled distance of (velocity, traction from equilibrium) to the graphs of both laws. `residual` holds what is
    /// left of the equations of motion at the owned nodes, in N; `range` scales where the law has no range of its own or a smaller one.
    pub fn inclusion_residual(&self, velocity: &[f64], residual: &[f64], range: [f64; 4]) -> f64 {
        let sliding = [range[2], range[3]];
        // The velocity that the pressures would change, and the pressure of the forces, count where there is no other; of the
        // latter a share where the law has a range of its own.
        let share = if self.law.is_zero() || self.law.depends_on_displacement() { 1.0 } else { FORCE_SHARE };
        let reference = self.reference;
        let range =
            [range[0].max(range[1] / reference.resistance[0]), range[1].max(share * reference.traction())];
        let range = range.map(|size| if size > 0.0 { size } else { 1.0 });
        let free = self.points.iter().filter(|p| p.unknown != Unknown::Held && p.can_touch());
        let distance = |p: &Point<D>| {
            let pressure = p.pressure_at(&self.law, velocity) - p.open_pressure(residual);
            self.law.distance(p.normal_component(velocity), pressure, p.context, range)
        };
        let normal = worst(free.map(distance));
        let Some(friction) = &self.friction else { return normal };
        normal.max(friction.inclusion_residual(&self.points, velocity, residual, (sliding, reference)))
    }
}
