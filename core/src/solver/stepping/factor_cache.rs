//! Matrices with their preconditioners, stored for later steps of the same lengths.
//!
//! Step lengths are powers of two times the first one. The preconditioner of such a length is used for all nearby lengths: two
//! matrices `M / k + A + k E` whose lengths have the ratio `r` are spectrally equivalent with factors from `1 / r` to `r`.

use super::{linear_solver::Preconditioner, solver::LinearSolver};
use crate::linear_algebra::petsc::Matrix;

/// Largest number of stored matrices, including the one in use.
const MAX_MATRICES: usize = 8;
/// Bytes that they may occupy on a rank.
const MAX_BYTES: f64 = 512e6;

/// A matrix with its linear solver.
pub(super) struct Prepared {
    /// Length in s of the steps to which the matrix belongs.
    pub length: f64,
    pub matrix: Matrix,
    pub solver: Box<dyn LinearSolver>,
    /// The parameters of each contact's graphs.
    pub scales: Vec<[f64; 2]>,
}

/// Matrices with their preconditioners that are not in use, the most recently used at the end.
pub(super) struct FactorCache {
    entries: Vec<Prepared>,
    capacity: usize,
}

impl FactorCache {
    /// An empty cache for this number of matrices besides the one in use.
    pub(super) fn new(capacity: usize) -> Self {
        Self { entries: Vec::new(), capacity }
    }

    /// Stores an entry; returns the least recently used one if there are too many.
    pub(super) fn insert(&mut self, prepared: Prepared) -> Option<Prepared> {
        self.entries.push(prepared);
        (self.entries.len() > self.capacity).then(|| self.entries.remove(0))
    }

    /// Removes and returns the entry of this length.
    pub(super) fn remove(&mut self, length: f64) -> Option<Prepared> {
        let at = self.entries.iter().position(|prepared| prepared.length == length)?;
        Some(self.entries.remove(at))
    }
}

/// The power of two times `base` nearest to this length.
pub(super) fn nearest_cached_length(base: f64, length: f64) -> f64 {
    base * 2f64.powi((length / base).log2().round() as i32)
}

impl Preconditioner {
    /// Estimated bytes of a factor or a hierarchy over all ranks, given those of the matrix: nested dissection's `n log n` and
    /// `n^(4/3)` entries, or a size proportional to the unknowns.
    pub fn bytes(self, dimension: usize, unknowns: usize, matrix: f64) -> f64 {
        let n = unknowns as f64;
        match self {
            Self::Auto | Self::Cholesky => {
                let entries = if dimension == 2 { 7.0 * n * n.log2() } else { 28.0 * n.powf(4.0 / 3.0) };
                8.0 * entries
            }
            Self::Gamg => 2.0 * matrix,
            Self::Boomeramg => 3.5 * matrix,
        }
    }

    /// Number of matrices of different lengths to store, each with its preconditioner, including the one in use: as many as fit
    /// into 512 MB on each rank, at most 8.
    pub fn cache_capacity(self, dimension: usize, unknowns: usize, ranks: usize, matrix: f64) -> usize {
        let each = (matrix + self.bytes(dimension, unknowns, matrix)) / ranks as f64;
        ((MAX_BYTES / each.max(1.0)) as usize).clamp(1, MAX_MATRICES)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solver::stepping::{FactorPrecision, ProblemSize};

    #[test]
    fn cached_lengths_are_powers_of_two_times_the_base() {
        for (length, cached) in [(0.01, 0.01), (0.08, 0.08), (0.012, 0.01), (0.015, 0.02), (0.0072, 0.01)] {
            assert_eq!(nearest_cached_length(0.01, length), cached);
        }
    }

    #[test]
    fn the_capacity_decreases_with_the_size_of_the_problem() {
        let capacity = |unknowns: usize, ranks| {
            let precision = FactorPrecision::Auto;
            let problem = ProblemSize {
                dimension: 3,
                order: 1,
                unknowns,
                inverse_quality: 1.2,
                ranks,
                steps: 2,
                interface: 0,
                motions: 0,
                contact: true,
                condensed: true,
                friction: false,
                flows: false,
                precision,
            };
            Preconditioner::Auto.resolve(problem).0.cache_capacity(
                3,
                unknowns,
                ranks,
                540.0 * unknowns as f64,
            )
        };
        assert_eq!([capacity(5_000, 1), capacity(100_000, 1), capacity(1_000_000, 1)], [8, 3, 1]);
        assert_eq!(capacity(1_000_000, 8), 2);
    }
}
