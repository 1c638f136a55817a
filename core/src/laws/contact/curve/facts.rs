//! What is proven of a curve by enclosures of its formula.

use crate::laws::expression::{
    Enclosure, Formula, Interval, OfMotion, Place, REACH, Supremum, Unproven, Variable,
};

/// What is proven of a curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Facts {
    /// The steepest decrease; 0 for a nondecreasing curve.
    pub fall: f64,
    /// About where it falls without bound, if it does.
    pub falls_without_bound: Option<Place>,
    /// Whether its slope may be infinite.
    pub is_steep: bool,
    /// The largest pressure in Pa.
    pub greatest: f64,
    /// Growth constants in Pa and Pa per unit of the variable, if there are any.
    pub growth: Option<[f64; 2]>,
}

/// An unbounded pressure grows at least by this factor from the square root of the reach to the reach.
const UNBOUNDED: f64 = 1.1;

/// A slope grows by more than this factor there if the pressure grows faster than its variable.
const SUPERLINEAR: f64 = 10.0;

/// A formula of one variable.
pub(super) struct Search<'a> {
    pub formula: &'a Formula<OfMotion>,
    pub variable: Variable,
}

impl Search<'_> {
    /// The facts of a curve that is smooth in these ranges and has these corners.
    pub(super) fn facts(&self, branches: &[[f64; 2]], corners: &[[f64; 2]]) -> Result<Facts, Unproven> {
        let [fall, near] = self.far_and_near(branches, |known| -known.slope)?;
        let is_unbounded = fall.bound == f64::INFINITY || fall.bound > SUPERLINEAR * near.bound.max(0.0);
        let rise = self.supremum(branches, REACH.sqrt(), |known| known.slope)?;
        let [greatest, nearer] = self.far_and_near(branches, |known| known.value)?;
        let is_bounded = greatest.bound <= nearer.bound.max(0.0) * UNBOUNDED;
        let last = corners.iter().fold(0.0, |last: f64, corner| last.max(corner[0].abs()));
        let growth =
            [last, 1.0 + 2.0 * last].into_iter().find_map(|from| self.growth(branches, from).transpose());
        let at_corners = corners.iter().fold(0.0, |most: f64, corner| most.max(corner[1].abs()));
        Ok(Facts {
            fall: fall.bound.max(0.0),
            falls_without_bound: (fall.bound > 0.0 && is_unbounded).then_some(fall.place),
            is_steep: rise.bound == f64::INFINITY,
            greatest: if is_bounded { greatest.bound.max(at_corners) } else { f64::INFINITY },
            growth: growth.transpose()?.map(|[inner, slope]| [inner.max(at_corners), slope]),
        })
    }

    /// Growth constants: the largest pressure up to `from`, and the steepest slope beyond, if that is bounded.
    fn growth(&self, branches: &[[f64; 2]], from: f64) -> Result<Option<[f64; 2]>, Unproven> {
        let [first, last] = [branches[0], branches[branches.len() - 1]];
        let outer = [[first[0], first[1].min(-from)], [last[0].max(from), last[1]]];
        let [far, near] = self.far_and_near(&outer, |known| known.slope.size())?;
        let inner = self.supremum(branches, from, |known| known.value.size())?;
        let is_linear = far.bound.is_finite() && far.bound <= near.bound * SUPERLINEAR;
        Ok(is_linear.then_some([inner.bound, far.bound]))
    }

    /// The largest value of a part of the enclosures over the ranges, as far as the variable is at most `reach`.
    fn supremum(
        &self,
        ranges: &[[f64; 2]],
        reach: f64,
        of: impl Fn(&Enclosure) -> Interval,
    ) -> Result<Supremum, Unproven> {
        let within =
            |[low, high]: &[f64; 2]| Interval::new(low.clamp(-reach, reach), high.clamp(-reach, reach));
        let parts: Vec<[(Variable, Interval); 1]> =
            ranges.iter().map(|range| [(self.variable, within(range))]).collect();
        self.formula.supremum(parts.iter().map(|part| &part[..]), self.variable, of)
    }

    /// The largest value up to the reach, and up to its square root.
    fn far_and_near(
        &self,
        ranges: &[[f64; 2]],
        of: impl Fn(&Enclosure) -> Interval,
    ) -> Result<[Supremum; 2], Unproven> {
        Ok([self.supremum(ranges, REACH, &of)?, self.supremum(ranges, REACH.sqrt(), &of)?])
    }
}
