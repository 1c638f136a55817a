//! Points that may slide along an obstacle any distance.
//!
//! In each step such a point faces a plane, whose distance is that from where the point is at the end of the step if it goes on at its
//! velocity, along the normal that it sees where the equations of the step hold. At the end of the step the forces of a smooth obstacle on a
//! surface that slides under it are then in equilibrium, so that without friction there is no drag. In its middle the normal is on a circle at
//! right angles to the chord along which the point moves, and without friction its speed stays the same. Distance and normal follow from
//! displacement and velocity at the start of the step. Nothing else is kept.

use super::{Contact, point::Point};
use crate::{
    fem::effect::Step,
    linear_algebra::tensor::{Vector, add_scaled},
};
use std::borrow::Cow;

impl<const D: usize> Contact<D> {
    /// Lets a point, by its number, face the obstacle in a step, at displacements and velocities of the converged state with ghosts.
    pub(super) fn follow_surface(&mut self, at: usize, step: Step, [displacement, velocity]: [&[f64]; 2]) {
        let point = &mut self.normal.points[at];
        let Some(undeformed) = point.undeformed() else { return };
        let (moved, velocity) = (point.value(displacement), point.value(velocity));
        let ahead = |share: f64| add_scaled(&moved, share * step.length, &velocity);
        let share = if self.blend.extrapolates() { 0.5 } else { 1.0 };
        let place = add_scaled(&undeformed, 1.0, &ahead(share));
        let [before, after] = [self.obstacle.seen_before(&place), self.obstacle.seen_after(&place)];
        let seen: Vector<D> = std::array::from_fn(|i| before[i] + share * (after[i] - before[i]));
        point.slide(&self.obstacle.gap, (seen, step.start() + share * step.length), &ahead(1.0));
    }

    /// A point as it faces the obstacle at `time`, where it is after the last step, at these displacements.
    pub(super) fn facing<'a>(
        &self,
        point: &'a Point<D>,
        time: f64,
        displacement: &[f64],
    ) -> Cow<'a, Point<D>> {
        let Some(undeformed) = point.undeformed() else { return point.facing(&self.obstacle.gap, time) };
        let moved = point.value(displacement);
        let seen = self.obstacle.seen_before(&add_scaled(&undeformed, 1.0, &moved));
        let mut point = point.clone();
        point.slide(&self.obstacle.gap, (seen, time), &moved);
        Cow::Owned(point)
    }
}
