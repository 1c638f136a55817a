//! Points that may slide along an obstacle any distance.
//!
//! In each step such a point faces a plane at right angles to the normal of the obstacle, whose distance is that from where the point is at
//! the start. The normal is the one that it sees in the middle of the step if it goes on at its velocity: on a circle it is then at right
//! angles to the chord along which the point moves, which ends on the circle, and without friction its speed stays the same. Distance and
//! normal follow from the displacement and the velocity at the start of the step. Nothing else is kept.

use super::{Contact, point::Point};
use crate::{
    fem::effect::Step,
    linear_algebra::tensor::{Vector, add_scaled},
};
use std::borrow::Cow;

impl<const D: usize> Contact<D> {
    /// Lets a point, by its number, face the obstacle in a step, at displacements and velocities of the converged state with ghosts.
    pub(super) fn follow_surface(
        &mut self,
        at: usize,
        step: Step,
        [displacement, velocity]: [&[f64]; 2],
    ) {
        let point = &mut self.normal.points[at];
        let Some(undeformed) = point.undeformed() else { return };
        let moved = point.value(displacement);
        let ahead = add_scaled(&moved, 0.5 * step.length, &point.value(velocity));
        let middle = add_scaled(&undeformed, 1.0, &ahead);
        let [before, after] = [self.obstacle.seen_before(&middle), self.obstacle.seen_after(&middle)];
        let seen: Vector<D> = std::array::from_fn(|i| 0.5 * (before[i] + after[i]));
        point.slide(&self.obstacle.gap, (seen, step.time - 0.5 * step.length), &moved);
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
