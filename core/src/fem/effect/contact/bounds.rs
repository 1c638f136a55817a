//! Contacts whose laws are bounds on one velocity component at each point.

use super::{
    normal::NormalContact,
    point::{Unknown, Vectors::Newton},
};
use crate::laws::contact::NodeContext;

/// Largest deviation of a unit normal from an axis.
const ALIGNED: f64 = 1e-9;

impl<const D: usize> NormalContact<D> {
    /// The first position in m where the law is not merely a bound on a velocity component, if there is one.
    pub fn oblique_normal(&self) -> Option<&[f64; D]> {
        let is_bound = self.law.velocity_bound(NodeContext::default()).is_some();
        let free = self.points.iter().filter(|p| !matches!(p.unknown, Unknown::Held | Unknown::Stop));
        let is_simple = |axis: Option<usize>| is_bound && axis.is_some();
        free.into_iter().find(|p| !is_simple(axis(&p.direction))).map(|p| &p.place)
    }

    /// Lowers `upper` and raises `lower`, vectors of Newton's method with one entry for each velocity component, to the bounds of
    /// the law.
    pub fn add_bounds(&self, lower: &mut [f64], upper: &mut [f64]) {
        for point in self.points.iter().filter(|p| p.unknown == Unknown::Parameter) {
            let Some((axis, bound)) = axis(&point.direction).zip(self.law.velocity_bound(point.context))
            else {
                continue;
            };
            let (at, bound) = (point.first(Newton) * D + axis, bound / point.free_length);
            if point.direction[axis] > 0.0 {
                upper[at] = upper[at].min(bound);
            } else {
                lower[at] = lower[at].max(-bound);
            }
        }
    }

    /// Sets the pressures at points on their bounds to those that balance the remaining forces in N there, elsewhere to zero. Both
    /// arguments are vectors of Newton's method.
    pub fn set_reactions(&mut self, velocity: &[f64], residual: &[f64]) {
        let law = &self.law;
        for point in self.points.iter_mut().filter(|p| p.unknown == Unknown::Parameter) {
            let bound = law.velocity_bound(point.context).unwrap_or(f64::INFINITY) / point.free_length;
            let reaction = -point.share(Newton, residual) / (point.weight * point.free_length);
            point.pressure = if point.along(Newton, velocity) >= bound { reaction.max(0.0) } else { 0.0 };
        }
    }
}

/// The axis to which a direction is parallel.
fn axis<const D: usize>(direction: &[f64; D]) -> Option<usize> {
    let along = (0..D).find(|&i| direction[i].abs() > 0.5)?;
    (0..D).all(|i| i == along || direction[i].abs() <= ALIGNED).then_some(along)
}
