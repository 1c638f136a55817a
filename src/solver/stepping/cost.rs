//! Estimated costs of preconditioners.
//!
//! Nested dissection leaves `n log n` entries of a factor in 2D and `n^(4/3)` in 3D, and needs `n^(3/2)` and `n^2`
//! operations; the work of multigrid is proportional to the unknowns. The constants were measured on one core of a common server
//! with 10^4 to 10^6 unknowns (docs/speed.md); estimates can be wrong by a factor of two.

use super::linear_solver::{FactorPrecision, Preconditioner, ProblemSize};
use crate::{fem::body::Body, linear_algebra::petsc::Precision, parallel::session::Session};

/// Costs of a preconditioner and of the solves of a step, on one rank and over all ranks together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cost {
    /// Bytes of a factor or a hierarchy.
    pub memory: f64,
    /// Seconds of assembly and set-up.
    pub set_up: f64,
    /// Seconds of a step.
    pub step: f64,
    /// Krylov iterations of a step with communication.
    pub iterations: f64,
}

/// Size in bytes above which a factor in double precision does not fit any cache.
const BEYOND_CACHES: f64 = 16e6;
/// Seconds for the messages of a V-cycle between processes of one machine: 25 exchanges with two neighbours (docs/scaling.md).
const MESSAGES: f64 = 100e-6;
/// Number of V-cycles whose messages take as long as those of a set-up.
const SET_UP_CYCLES: f64 = 100.0;

/// Iterations of a step without contact, with contact, and with friction, which may fix nodes that are free in the preconditioner's
/// matrix.
struct Iterations {
    without: f64,
    contact: f64,
    friction: f64,
}

impl ProblemSize {
    /// The problem size for this number of steps of this body.
    pub fn of<const D: usize, const S: usize>(
        session: &Session,
        body: &Body<D, S>,
        steps: u64,
        precision: FactorPrecision,
    ) -> Self {
        Self {
            dimension: D,
            unknowns: body.mesh.total_nodes * D,
            ranks: session.ranks(),
            steps,
            contact: !body.contacts.is_empty(),
            friction: body.contacts.iter().any(|contact| contact.friction().is_some()),
            precision,
        }
    }

    fn pick(self, in_plane: f64, in_space: f64) -> f64 {
        if self.dimension == 2 { in_plane } else { in_space }
    }

    /// Bytes of the matrix in compressed rows, where a node and its neighbours are 7 nodes in 2D and 15 in 3D.
    pub fn matrix(self) -> f64 {
        12.0 * self.unknowns as f64 * self.pick(7.0 * 2.0, 15.0 * 3.0)
    }

    fn iterations(self, Iterations { without, contact, friction }: Iterations) -> f64 {
        match (self.contact, self.friction) {
            (false, _) => without,
            (true, false) => contact,
            (true, true) => friction,
        }
    }

    /// The precision of factors: single where it is requested, or where it takes less time. In 3D two or three corrections
    /// reach the accuracy of one solve in double precision, in 2D four to seven (docs/speed.md).
    pub fn factor_precision(self) -> Precision {
        let served = self.contact
            && (self.ranks == 1 || Preconditioner::Cholesky.is_redundant(self.ranks, self.unknowns));
        let pays = || {
            let time = |precision| self.work(self.factor(precision));
            self.dimension == 3
                && self.factor(Precision::Double).memory > BEYOND_CACHES
                && time(Precision::Single) < time(Precision::Double)
        };
        match self.precision {
            FactorPrecision::Single if served => Precision::Single,
            FactorPrecision::Auto if served && pays() => Precision::Single,
            _ => Precision::Double,
        }
    }

    /// The cost of a factor, including the solves of a step.
    fn factor(self, precision: Precision) -> Cost {
        let n = self.unknowns as f64;
        let entries = self.pick(7.0 * n * n.max(2.0).log2(), 28.0 * n.powf(4.0 / 3.0));
        let [memory, set_up, step] = match precision {
            Precision::Double => [
                8.0,
                self.pick(10e-6 * n + 10e-9 * n.powf(1.5), 5e-6 * n + 0.9e-9 * n * n),
                self.pick(2.4e-9, 1.2e-9),
            ],
            Precision::Single => [
                4.0,
                self.pick(5e-6 * n + 3e-9 * n.powf(1.5), 5e-6 * n + 0.25e-9 * n * n),
                self.pick(8.0e-9, 1.7e-9),
            ],
        };
        Cost { memory: memory * entries, set_up, step: step * entries, iterations: 0.0 }
    }

    /// The cost of this preconditioner.
    pub fn cost(self, preconditioner: Preconditioner) -> Cost {
        let n = self.unknowns as f64;
        match preconditioner {
            Preconditioner::Auto | Preconditioner::Cholesky => self.factor(self.factor_precision()),
            Preconditioner::Gamg => {
                let iterations =
                    self.iterations(Iterations { without: 20.0, contact: 30.0, friction: 300.0 });
                Cost {
                    memory: 2.2 * self.matrix(),
                    set_up: n * self.pick(7e-6, 22e-6),
                    step: iterations * n * self.pick(100e-9, 180e-9),
                    iterations,
                }
            }
            Preconditioner::Boomeramg => {
                let iterations =
                    self.iterations(Iterations { without: 14.0, contact: 20.0, friction: 200.0 });
                Cost {
                    memory: 3.5 * self.matrix(),
                    set_up: n * self.pick(1.5e-6, 5e-6),
                    step: iterations * n * self.pick(120e-9, 300e-9),
                    iterations,
                }
            }
        }
    }

    /// Seconds of set-up and of the steps that share one matrix, on one rank.
    fn work(self, cost: Cost) -> f64 {
        cost.set_up + self.steps as f64 * cost.step
    }

    /// Seconds of set-up and of the steps that share one matrix: work that every rank repeats, or work shared with messages.
    pub(super) fn seconds(self, preconditioner: Preconditioner) -> f64 {
        let (cost, steps) = (self.cost(preconditioner), self.steps as f64);
        let work = self.work(cost);
        if self.ranks == 1 || preconditioner.is_redundant(self.ranks, self.unknowns) {
            return work;
        }
        work / self.ranks as f64 + (SET_UP_CYCLES + steps * cost.iterations) * MESSAGES
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_factor_in_space_soon_outgrows_multigrid() {
        let problem = ProblemSize {
            dimension: 3,
            unknowns: 1_000_000,
            ranks: 1,
            steps: 1,
            contact: true,
            friction: false,
            precision: FactorPrecision::Double,
        };
        let [factor, multigrid] =
            [Preconditioner::Cholesky, Preconditioner::Gamg].map(|which| problem.cost(which));
        assert!(factor.memory > 5.0 * multigrid.memory && factor.set_up > 5.0 * multigrid.set_up);
    }
}
