//! Distances of a body from an obstacle.

use crate::{linear_algebra::tensor::larger, parallel::session::Session};

/// How near a body and its obstacle have come in any step so far; minus infinity where they never could touch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Closeness {
    /// Largest penetration in m of a point that may have a contact pressure, at least 0 if it had one.
    pub penetration: f64,
    /// Largest penetration in m of a point that supports hold along the normal, at which a constraint has no contact pressure.
    pub held: f64,
    /// Largest distance by which a point with contact pressure had slid along another body, as a share of the size of the facets there.
    pub slip: f64,
    /// Largest angle in rad of edges of another body over points with contact pressure.
    pub sharpness: f64,
    /// 1 if another body ended over the facets around such a point.
    pub ends: f64,
    /// Longest way in m of the obstacle in a step, where a force moves it.
    pub leap: f64,
    /// Largest distance in m by which a point with contact pressure had moved along an obstacle.
    pub moved: f64,
    /// Largest change in m of the gap of such a point by that.
    pub shift: f64,
    /// The same as a share of the spread of the normal displacements of the boundary, or the standard deviation of these changes as a share of
    /// that of the displacements under pressure, whichever is larger.
    pub shift_to_spread: f64,
    /// Largest inclination in rad of the resultant of the pressures to the obstacle where such changes are not negligible.
    pub inclination: f64,
    /// The hardest ejection of a point in one step.
    pub ejection: Ejection,
}

/// How an obstacle ejects a point with mass that is inside of it at the start of a step, or into which its gap leaps: a constraint moves the
/// point out within this step, however short.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ejection {
    /// The strain of the body by it: its speed as a share of that of compression waves.
    pub strain: f64,
    /// The overlap in m.
    pub overlap: f64,
    /// The end of the step in s.
    pub time: f64,
}

impl Ejection {
    /// None so far.
    const NONE: Self =
        Self { strain: f64::NEG_INFINITY, overlap: f64::NEG_INFINITY, time: f64::NEG_INFINITY };

    /// The harder one of two.
    pub(super) fn or(self, other: Self) -> Self {
        if larger(self.strain, other.strain) > self.strain { other } else { self }
    }

    /// The hardest one over all ranks. Collective.
    fn of_all(self, session: &Session) -> Self {
        let [strain] = session.largest([self.strain]);
        let mine = if self.strain.to_bits() == strain.to_bits() { self } else { Self::NONE };
        let [overlap, time] = session.largest([mine.overlap, mine.time]);
        Self { strain, overlap, time }
    }
}

/// How many numbers these are.
const COUNT: usize = 13;

impl Default for Closeness {
    fn default() -> Self {
        Self::of([f64::NEG_INFINITY; COUNT])
    }
}

impl Closeness {
    /// As numbers of a checkpoint.
    pub fn saved(self) -> Vec<Option<f64>> {
        self.numbers().map(|number| number.is_finite().then_some(number)).to_vec()
    }

    /// All of them.
    fn numbers(self) -> [f64; COUNT] {
        let Self { penetration, held, slip, sharpness, leap, moved, shift, shift_to_spread, .. } = self;
        let Self { inclination, ejection: Ejection { strain, overlap, time }, ends, .. } = self;
        [
            penetration,
            held,
            slip,
            sharpness,
            leap,
            moved,
            shift,
            shift_to_spread,
            inclination,
            strain,
            overlap,
            time,
            ends,
        ]
    }

    /// The one over all ranks. Collective.
    pub fn of_all(self, session: &Session) -> Self {
        Self { ejection: self.ejection.of_all(session), ..Self::of(session.largest(self.numbers())) }
    }

    /// The one with these numbers.
    fn of(numbers: [f64; COUNT]) -> Self {
        let [penetration, held, slip, sharpness, leap, moved, shift, shift_to_spread, ..] = numbers;
        let [.., inclination, strain, overlap, time, ends] = numbers;
        let ejection = Ejection { strain, overlap, time };
        Self {
            penetration,
            held,
            slip,
            sharpness,
            ends,
            leap,
            moved,
            shift,
            shift_to_spread,
            inclination,
            ejection,
        }
    }

    /// From the numbers of a checkpoint.
    pub fn restored(saved: &[Option<f64>]) -> Self {
        Self::of(std::array::from_fn(|at| saved.get(at).copied().flatten().unwrap_or(f64::NEG_INFINITY)))
    }
}

/// The gaps of a contact at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gaps {
    /// The smallest gap in m, from the displaced boundary; infinite where no point can touch.
    pub smallest: f64,
    /// The largest finite gap in m; minus infinity where there is none.
    pub largest: f64,
    /// Points from which no obstacle lies along the normal.
    pub without: usize,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_checkpoint_keeps_is_restored() {
        let ejection = Ejection { strain: 0.5, overlap: 1e-6, time: 0.25 };
        let kept = Closeness { slip: 2.0, leap: 3.0, inclination: 4.0, ejection, ..Closeness::default() };
        assert_eq!(Closeness::restored(&kept.saved()), kept);
        let earlier = Closeness { ejection: Ejection::NONE, ..kept };
        assert_eq!(Closeness::restored(&kept.saved()[..9]), earlier);
    }

    #[test]
    fn the_hardest_ejection_is_kept_whole() {
        let soft = Ejection { strain: 0.1, overlap: 2.0, time: 1.0 };
        let hard = Ejection { strain: 0.2, overlap: 1.0, time: 2.0 };
        assert_eq!([Ejection::NONE.or(soft), soft.or(hard), hard.or(soft)], [soft, hard, hard]);
    }
}
