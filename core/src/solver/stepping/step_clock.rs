//! Time and memory traffic of steps by phase.

use super::equations::StepMatrix;
use crate::{
    error::Result,
    linear_algebra::petsc::{DistributedVector, Matrix, Stage},
};
use std::{cell::Cell, time::Duration};

/// Seconds spent by phase.
#[derive(Debug, Clone, Copy, Default)]
pub struct StepClock {
    /// Explicit stress, history and forces.
    pub history: Duration,
    /// Newton and linear solves.
    pub solve: Duration,
    /// Energy balance and certificates of the step.
    pub balance: Duration,
    /// Matrix assembly and preconditioner, where the step length has changed or cells have flowed.
    pub assembly: Duration,
    /// The part of `assembly` spent before the first step.
    pub first_assembly: Duration,
}

/// Stages of PETSc's `-log_view`.
pub(super) struct Stages {
    pub assembly: Stage,
    pub history: Stage,
    pub solve: Stage,
    pub balance: Stage,
}

impl Stages {
    pub(super) fn register() -> Result<Self> {
        Ok(Self {
            assembly: Stage::register("assembly")?,
            history: Stage::register("history")?,
            solve: Stage::register("solve")?,
            balance: Stage::register("balance")?,
        })
    }
}

/// Least number of bytes that the steps moved through the memory of this rank, by phase.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StepTraffic {
    /// Explicit stress, history and forces; time-dependent loads are not counted.
    pub history: u64,
    /// Matrices, factors and multigrid levels, each time they are read, without the vectors of iterations; `None` where the
    /// solver does not count them.
    pub solve: Option<u64>,
    /// Energy balance.
    pub balance: u64,
}

impl Default for StepTraffic {
    fn default() -> Self {
        Self { history: 0, solve: Some(0), balance: 0 }
    }
}

impl StepTraffic {
    /// Adds a part of a solve; the sum is unknown as soon as one part is unknown.
    pub(super) fn add_solve(&mut self, bytes: Option<u64>) {
        self.solve = self.solve.zip(bytes).map(|(sum, more)| sum + more);
    }
}

/// A matrix whose products are counted.
pub(super) struct CountedMatrix<'a> {
    pub matrix: &'a Matrix,
    pub products: &'a Cell<u64>,
}

impl StepMatrix for CountedMatrix<'_> {
    fn multiply(&self, x: &DistributedVector, y: &mut DistributedVector) -> Result<()> {
        self.products.set(self.products.get() + 1);
        self.matrix.multiply(x, y)
    }

    fn assembled(&self) -> Option<&Matrix> {
        Some(self.matrix)
    }
}
