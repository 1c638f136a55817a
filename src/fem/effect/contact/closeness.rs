//! Distances of a body from an obstacle.

/// How near a body and its obstacle have come in any step so far; minus infinity where they never could touch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Closeness {
    /// Largest penetration in m of a point that may have a contact pressure, at least 0 if it had one.
    pub penetration: f64,
    /// Largest penetration in m of a point that supports hold along the normal, at which a constraint has no contact pressure.
    pub held: f64,
}

impl Default for Closeness {
    fn default() -> Self {
        Self { penetration: f64::NEG_INFINITY, held: f64::NEG_INFINITY }
    }
}

impl Closeness {
    /// As numbers of a checkpoint.
    pub fn saved(self) -> [Option<f64>; 2] {
        [self.penetration, self.held].map(|penetration| penetration.is_finite().then_some(penetration))
    }

    /// From the numbers of a checkpoint.
    pub fn restored(saved: [Option<f64>; 2]) -> Self {
        let [penetration, held] = saved.map(|penetration| penetration.unwrap_or(f64::NEG_INFINITY));
        Self { penetration, held }
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
