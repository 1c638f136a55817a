//! Distances of a body from an obstacle.

use crate::parallel::session::Session;

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
    /// Longest way in m of the obstacle in a step, where a force moves it.
    pub leap: f64,
    /// Largest distance in m by which a point with contact pressure had moved along an obstacle.
    pub moved: f64,
    /// Largest change in m of the gap of such a point by that.
    pub shift: f64,
    /// The same as a share of the spread of the normal displacements of the boundary.
    pub shift_to_spread: f64,
    /// Largest inclination in rad of the resultant of the pressures to the obstacle where such changes are not negligible.
    pub inclination: f64,
}

/// How many numbers these are.
const COUNT: usize = 9;

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
        let Self { penetration, held, slip, sharpness, leap, moved, shift, shift_to_spread, inclination } =
            self;
        [penetration, held, slip, sharpness, leap, moved, shift, shift_to_spread, inclination]
    }

    /// The one over all ranks. Collective.
    pub fn of_all(self, session: &Session) -> Self {
        Self::of(session.largest(self.numbers()))
    }

    /// The one with these numbers.
    fn of(
        [penetration, held, slip, sharpness, leap, moved, shift, shift_to_spread, inclination]: [f64; COUNT],
    ) -> Self {
        Self { penetration, held, slip, sharpness, leap, moved, shift, shift_to_spread, inclination }
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
