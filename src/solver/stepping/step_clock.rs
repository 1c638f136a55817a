//! Where the time of steps goes, and what they move through memory.

use crate::{error::Result, linear_algebra::petsc::Stage};
use std::time::Duration;

/// Seconds spent by phase.
#[derive(Debug, Clone, Copy, Default)]
pub struct StepClock {
    /// Explicit stress, history and forces.
    pub history: Duration,
    /// Newton and linear solves.
    pub solve: Duration,
    /// Energy balance and certificates of the step.
    pub balance: Duration,
    /// Matrix assembly and preconditioner, whenever the step length changes.
    pub assembly: Duration,
    /// The part of `assembly` before the first step.
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
    pub fn register() -> Result<Self> {
        Ok(Self {
            assembly: Stage::register("assembly")?,
            history: Stage::register("history")?,
            solve: Stage::register("solve")?,
            balance: Stage::register("balance")?,
        })
    }
}

/// Bytes that the steps moved through the memory of this rank at the least, by phase.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StepTraffic {
    /// Explicit stress, history and forces; loads that depend on time are not counted.
    pub history: u64,
    /// Matrices, factors and multigrid levels as often as they are read, not the vectors of iterations; `None` where the
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
    /// Adds a part of a solve; the sum is unknown once a part is.
    pub(super) fn add_solve(&mut self, bytes: Option<u64>) {
        self.solve = self.solve.zip(bytes).map(|(sum, more)| sum + more);
    }
}
