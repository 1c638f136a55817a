//! Contact with an obstacle that moves along the boundary.

use super::{Contact, point::Point, tangential_point::ROUNDING};
use crate::{
    contact::Rate,
    error::{Error, Result},
    tensor::{dot, norm},
};

impl<const D: usize> Contact<D> {
    /// Whether friction here acts on the velocity relative to an obstacle that may move along the boundary.
    pub fn may_drift(&self) -> bool {
        self.friction.is_some() && self.gap.may_drag()
    }

    /// The sum over points here of the squares of the obstacle's velocity along the tangents, in (m/s)^2.
    pub fn drift_square(&self) -> f64 {
        let drift = self.friction.iter().flat_map(|friction| &friction.drift);
        drift.map(|drift| dot(drift, drift)).sum()
    }

    /// Evaluates the velocity of the obstacle along the boundary in a step, for friction. Refuses supports that hold one tangent
    /// of a point along this motion and leave another free: the direction of sliding depends on both, and only the free one is an
    /// unknown. Where supports hold all tangents, the friction does not matter.
    pub(super) fn set_drift(&mut self, rate: Rate) -> Result<()> {
        let Some(friction) = self.friction.as_mut().filter(|_| self.gap.may_drag()) else { return Ok(()) };
        let (gap, points, motion) = (&self.gap, &self.points, self.gap.motion::<D>(rate)?);
        let velocity = |point: &Point<D>| gap.velocity_along(&motion, rate.time, &point.place, &point.normal);
        friction.drift.clear();
        for point in &friction.points {
            friction.drift.push(point.part(&velocity(&points[point.at])?));
        }
        for (at, tangent) in &friction.held {
            let (point, velocity) = (&points[*at], velocity(&points[*at])?);
            let along = dot(tangent, &velocity);
            if point.can_touch() && along.abs() > ROUNDING * norm(&velocity) {
                return Err(Error::Refused(format!(
                    "friction at {:?} m: a support holds a direction there in which the obstacle moves, at {along} m/s at t = {} s, \
                     and leaves another free, so that the friction along that is not known; hold all components there, or none",
                    point.place, rate.time
                )));
            }
        }
        Ok(())
    }
}
