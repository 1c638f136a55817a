//! What is proven of a curve by enclosures of its formula.

use crate::laws::expression::{Enclosure, Formula, Interval, REACH, Unproven, Variable};

/// What is proven of a curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Facts {
    /// The steepest decrease; 0 for a nondecreasing curve.
    pub fall: f64,
    /// About where it is taken.
    pub steepest: f64,
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
    pub formula: &'a Formula,
    pub variable: Variable,
}

impl Search<'_> {
    /// The facts of a curve that is smooth in these ranges and has these corners.
    pub(super) fn facts(&self, branches: &[[f64; 2]], corners: &[[f64; 2]]) -> Result<Facts, Unproven> {
        let [fall, steepest] = self.supremum(branches, REACH, |known| -known.slope)?;
        let [greatest, nearer] = self.near_and_far(branches, |known| known.value)?;
        let is_bounded = greatest <= nearer.max(0.0) * UNBOUNDED;
        // Beyond the corners the pressure grows by at most its steepest slope there.
        let outer = [branches[0], branches[branches.len() - 1]];
        let [slope, near] = self.near_and_far(&outer, |known| known.slope.size())?;
        let last = corners.iter().fold(0.0, |last: f64, corner| last.max(corner[0].abs()));
        let [inner, _] = self.supremum(branches, last, |known| known.value.size())?;
        Ok(Facts {
            fall: fall.max(0.0),
            steepest,
            greatest: if is_bounded { greatest } else { f64::INFINITY },
            growth: (slope <= near * SUPERLINEAR && slope.is_finite()).then_some([inner, slope]),
        })
    }

    /// The largest value of a part of the enclosures over the ranges, as far as the variable is at most `reach`, and about where.
    fn supremum(
        &self,
        ranges: &[[f64; 2]],
        reach: f64,
        of: impl Fn(&Enclosure) -> Interval,
    ) -> Result<[f64; 2], Unproven> {
        let within =
            |[low, high]: &[f64; 2]| Interval::new(low.clamp(-reach, reach), high.clamp(-reach, reach));
        let parts: Vec<[(Variable, Interval); 1]> =
            ranges.iter().map(|range| [(self.variable, within(range))]).collect();
        self.formula.supremum(parts.iter().map(|part| &part[..]), self.variable, of)
    }

    /// The largest value up to the reach, and up to its square root.
    fn near_and_far(
        &self,
        ranges: &[[f64; 2]],
        of: impl Fn(&Enclosure) -> Interval,
    ) -> Result<[f64; 2], Unproven> {
        let [[far, _], [near, _]] =
            [self.supremum(ranges, REACH, &of)?, self.supremum(ranges, REACH.sqrt(), &of)?];
        Ok([far, near])
    }
}
