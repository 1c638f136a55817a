//! Contact points counted by state.

use super::{
    Contact,
    friction::{Friction, FrictionStatus},
    point::Vectors::Newton,
};

/// Number of branches of normal laws that are counted separately; the last count includes all further branches.
const BRANCHES: usize = 8;

/// Number of entries of a [`PointCount`].
pub const COUNTS: usize = BRANCHES + 5;

/// Numbers of points of contact boundaries by state.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PointCount {
    /// On a vertical part of the normal graph: at rest in a jump, or at an obstacle.
    pub held: usize,
    /// Without pressure.
    pub open: usize,
    /// On each branch of the normal law, in the order of velocity; the last entry includes all further branches.
    pub branches: [usize; BRANCHES],
    /// With friction, sticking.
    pub sticking: usize,
    /// With friction and sliding.
    pub slipping: usize,
    /// With friction whose bound depends on the pressure, which is zero.
    pub separated: usize,
}

impl PointCount {
    /// As an array, for sums over ranks.
    pub fn to_array(self) -> [f64; COUNTS] {
        let mut out = [0.0; COUNTS];
        let numbers = [self.held, self.open, self.sticking, self.slipping, self.separated];
        out.iter_mut().zip(numbers.into_iter().chain(self.branches)).for_each(|(o, n)| *o = n as f64);
        out
    }

    /// From the array.
    pub fn from_array(numbers: [f64; COUNTS]) -> Self {
        let [held, open, sticking, slipping, separated, branches @ ..] = numbers.map(|n| n as usize);
        Self { held, open, branches, sticking, slipping, separated }
    }
}

impl<const D: usize> Contact<D> {
    /// Counts the points on this rank by state, at velocities in a vector of Newton's method.
    pub fn count(&self, velocity: &[f64]) -> PointCount {
        let mut count = PointCount::default();
        for point in self.normal.points.iter().filter(|point| point.carries(&self.normal.law)) {
            count.open += usize::from(point.pressure_at(&self.normal.law, Newton, velocity) == 0.0);
            let along = point.velocity_along_normal(Newton, velocity);
            let branch = if point.unknown.has_pressure() {
                let found = self.normal.law.resolve_worn(
                    self.normal.scale * along + point.pressure,
                    self.normal.scale,
                    point.context,
                );
                count.held += usize::from(found.derivative == 0.0);
                found.branch
            } else {
                self.normal.law.branch(along, point.context)
            };
            count.branches[branch.min(BRANCHES - 1)] += 1;
        }
        for (motion, _) in self.friction.iter().flat_map(|f: &Friction<D>| f.motions(Newton, velocity)) {
            match motion {
                FrictionStatus::Sticks => count.sticking += 1,
                FrictionStatus::Slides => count.slipping += 1,
                FrictionStatus::Separated => count.separated += 1,
            }
        }
        count
    }
}
