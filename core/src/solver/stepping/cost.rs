//! Estimated costs of preconditioners.
//!
//! Nested dissection leaves `n log n` entries of a factor in 2D and `n^(4/3)` in 3D, and needs `n^(3/2)` and `n^2`
//! operations; the work of multigrid is proportional to the unknowns. The constants were measured on one core of a common server
//! with 10^4 to 10^6 unknowns (docs/speed.md); without Newton iterations, flow and friction they can be wrong by a factor of two. They
//! serve for choices only, and are the same on every machine: a choice that depended on measured times could differ between a run and
//! its restart, whose results would then differ in the last bits. `solver check` estimates times from steps that it tries.

use super::{
    linear_solver::{FactorPrecision, Preconditioner, ProblemSize},
    substructuring::{MAX_INTERFACE_UNKNOWNS, interface_nodes},
};
use crate::{
    fem::body::Body,
    linear_algebra::petsc::Precision,
    parallel::{agreement::Agreed, session::Session},
};

/// Costs of a preconditioner and of the solves of a step, on the ranks of the problem.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cost {
    /// Bytes of a factor or a hierarchy over all ranks.
    pub memory: f64,
    /// Seconds of assembly and set-up.
    pub set_up: f64,
    /// Seconds of a step.
    pub step: f64,
}

/// Size in bytes above which a factor in double precision does not fit any cache.
const CACHE_SIZE: f64 = 16e6;
/// Seconds for the messages of a V-cycle between processes of one machine: 25 exchanges with two neighbours (docs/scaling.md).
const CYCLE_MESSAGE_TIME: f64 = 100e-6;
/// Number of V-cycles whose messages take as long as those of a set-up.
const SET_UP_CYCLES: f64 = 100.0;
/// Seconds for the messages of a step with a shared factor between processes of one machine (docs/scaling.md).
const STEP_MESSAGE_TIME: f64 = 85e-6;
/// Seconds for the messages of a solve with the dense matrix of the interface for each of its unknowns: two for each panel of 128, of some
/// 3 us (docs/scaling.md).
const PANEL_MESSAGE_TIME: f64 = 6e-6 / 128.0;
/// Factor by which a step with MUMPS takes longer than one with a factor on one rank: 233 ms on two ranks instead of 32 ms for the
/// problem of Wang and Cheng on 256 x 256 cells, 1.25 s instead of 0.15 s on 512 x 512.
const MUMPS_FACTOR: f64 = 8.0;
/// Seconds of a step for each unknown besides the solve: stress, history, forces, energies.
const OTHER_TIME: f64 = 55e-9;

/// Mean of the inverse quality of the triangles of a square divided into squares.
const REGULAR_TRIANGLES: f64 = 1.207;
/// Mean of the inverse quality of the tetrahedra of a cube divided into cubes.
const REGULAR_TETRAHEDRA: f64 = 1.394;

/// What the assembly of a matrix and its order of elimination need beside it, as a multiple of it.
const ASSEMBLY: f64 = 3.0;
/// Bytes for each entry of the dense matrix of the motions of contact nodes, which each rank has: half of it and half of its factor, its
/// factor on a subspace, and two copies while these are computed.
const DENSE_ENTRY: f64 = 2.0 * 4.0 + 3.0 * 8.0;
/// Number of motions of contact nodes whose dense matrix costs no more than the factorisation.
const MAX_CONDENSED_MOTIONS: usize = 4_000;

/// The number of motions on which the contacts of a body act, over all ranks. Collective.
fn motion_count<const D: usize, const S: usize>(session: &Session, body: &Body<D, S>) -> usize {
    session.total(body.contact_nodes().iter().map(|contact| contact.active).sum())
}

/// Iterations of a step without contact, with contact, and with friction, which may fix nodes that are free in the preconditioner's
/// matrix, or with other equations that differ much from that matrix.
struct Iterations {
    without: f64,
    contact: f64,
    friction: f64,
}

impl ProblemSize {
    /// The problem size for this number of steps of this body. Collective.
    pub fn of<const D: usize, const S: usize>(
        session: &Session,
        body: &Body<D, S>,
        steps: u64,
        precision: FactorPrecision,
    ) -> Result<Self, Agreed> {
        let motions = motion_count(session, body);
        let contacts = &body.contacts;
        Ok(Self {
            dimension: D,
            order: body.mesh.order(),
            unknowns: body.mesh.total_nodes * D,
            inverse_quality: body.mesh.quality_summary(session).mean_inverse,
            ranks: session.ranks(),
            steps,
            interface: interface_nodes(session, &body.mesh)?.len() * D + motions,
            motions,
            contact: !contacts.is_empty(),
            condensed: (!contacts.is_empty() || body.only_cells_act())
                && !contacts.iter().any(|contact| contact.normal.needs_ghosts)
                && (!body.flows() || body.only_cells_act() || body.only_surface_acts())
                && motions <= MAX_CONDENSED_MOTIONS,
            friction: contacts.iter().any(|contact| contact.friction.is_some()),
            flows: body.flows(),
            precision: if body.flows() { FactorPrecision::Double } else { precision },
        })
    }

    fn by_dimension(self, in_plane: f64, in_space: f64) -> f64 {
        if self.dimension == 2 { in_plane } else { in_space }
    }

    /// A node and its neighbours: 7 nodes in 2D and 15 in 3D, with quadratic cells 11.5 and 28.75 in the mean.
    fn coupled_nodes(self) -> f64 {
        if self.order == 1 { self.by_dimension(7.0, 15.0) } else { self.by_dimension(11.5, 28.75) }
    }

    /// Bytes of the matrix in compressed rows.
    pub fn matrix_bytes(self) -> f64 {
        12.0 * self.unknowns as f64 * (self.coupled_nodes() * self.dimension as f64)
    }

    /// Iterations of a step with multigrid. The smoothers of multigrid reduce errors across flat cells slowly: the number of
    /// iterations grows in proportion to the mean of the inverse shape quality (measured with uniform and graded meshes whose cells
    /// are up to 16 times as long as thick).
    fn iterations(self, Iterations { without, contact, friction }: Iterations) -> f64 {
        // Cells that have yielded resist less than in the preconditioner's matrix, and bonds, which may hold the body, are not in it.
        let differs = self.friction || self.flows && !self.condensed;
        let regular = match (self.contact, differs) {
            (false, _) => without,
            (true, false) => contact,
            (true, true) => friction,
        };
        regular * (self.inverse_quality / self.by_dimension(REGULAR_TRIANGLES, REGULAR_TETRAHEDRA)).max(1.0)
    }

    /// The precision of factors: single where it is requested, or where it takes less time. In 3D two or three corrections
    /// reach the accuracy of one solve in double precision, in 2D four to seven (docs/speed.md).
    pub fn factor_precision(self) -> Precision {
        let is_faster = || {
            let time = |precision| self.seconds_of(self.factor(precision));
            self.dimension == 3
                && self.factor(Precision::Double).memory > CACHE_SIZE
                && time(Precision::Single) < time(Precision::Double)
        };
        match self.precision {
            FactorPrecision::Single if self.is_condensed() => Precision::Single,
            FactorPrecision::Auto if self.is_condensed() && is_faster() => Precision::Single,
            _ => Precision::Double,
        }
    }

    /// Whether a factor is shared by all ranks.
    fn is_shared(self) -> bool {
        self.interface <= MAX_INTERFACE_UNKNOWNS
    }

    /// Whether steps are condensed to the contact, if the matrix is factored.
    pub(super) fn is_condensed(self) -> bool {
        self.condensed && (self.ranks == 1 || self.is_shared())
    }

    /// Bytes over all ranks of what the assembly of a matrix and its order of elimination need beside it.
    pub fn assembly_bytes(self) -> f64 {
        ASSEMBLY * self.matrix_bytes()
    }

    /// Bytes over all ranks of the dense matrices of the motions of contact nodes, beside this preconditioner.
    pub fn contact_bytes(self, preconditioner: Preconditioner) -> f64 {
        let is_dense = preconditioner == Preconditioner::Cholesky && self.is_condensed();
        if is_dense { self.ranks as f64 * DENSE_ENTRY * (self.motions as f64).powi(2) } else { 0.0 }
    }

    /// Bytes over all ranks of what steps in which cells flow have besides: a matrix with the derivatives of the flow, factored and condensed
    /// as that of the step.
    pub fn flow_bytes(self, preconditioner: Preconditioner) -> f64 {
        let has_second = self.flows && preconditioner == Preconditioner::Cholesky && self.is_condensed();
        let matrix = self.matrix_bytes() + self.assembly_bytes();
        let second = matrix + self.cost(preconditioner).memory + self.contact_bytes(preconditioner);
        if has_second { second } else { 0.0 }
    }

    /// The same problem on one rank.
    fn on_one_rank(self) -> Self {
        Self { ranks: 1, ..self }
    }

    /// The cost of factors.
    fn factor(self, precision: Precision) -> Cost {
        let ranks = self.ranks as f64;
        let whole = self.factor_of(self.unknowns as f64, precision);
        if self.ranks == 1 {
            return whole;
        }
        if self.is_shared() {
            // Each rank factors its part and its share of the dense matrix of the interface, and reads both in each half of a solve.
            let subdomain = self.factor_of(self.unknowns as f64 / ranks, precision);
            let interface = self.interface as f64;
            return Cost {
                memory: ranks * subdomain.memory + 4.0 * interface.powi(2),
                set_up: subdomain.set_up + 1.5e-11 * interface.powi(3) / ranks,
                step: subdomain.step
                    + 1.0e-9 * interface.powi(2) / ranks
                    + interface * PANEL_MESSAGE_TIME
                    + STEP_MESSAGE_TIME,
            };
        }
        Cost { set_up: whole.set_up / ranks, step: MUMPS_FACTOR * whole.step / ranks, ..whole }
    }

    /// The cost of a factor of `n` unknowns on one rank.
    fn factor_of(self, n: f64, precision: Precision) -> Cost {
        let entries = self.by_dimension(7.0 * n * n.max(2.0).log2(), 28.0 * n.powf(4.0 / 3.0));
        let [memory, set_up, step] = match precision {
            Precision::Double => [
                8.0,
                self.by_dimension(10e-6 * n + 10e-9 * n.powf(1.5), 5e-6 * n + 0.9e-9 * n * n),
                self.by_dimension(1.8e-9, 1.2e-9),
            ],
            Precision::Single => [
                4.0,
                self.by_dimension(5e-6 * n + 3e-9 * n.powf(1.5), 5e-6 * n + 0.25e-9 * n * n),
                self.by_dimension(8.0e-9, 1.7e-9),
            ],
        };
        Cost { memory: memory * entries, set_up, step: step * entries }
    }

    /// The cost of this preconditioner.
    pub fn cost(self, preconditioner: Preconditioner) -> Cost {
        let n = self.unknowns as f64;
        let multigrid = |memory: f64, set_up: f64, iterations: Iterations, cycle: f64| {
            let iterations = self.iterations(iterations);
            let messages = if self.ranks > 1 { CYCLE_MESSAGE_TIME } else { 0.0 };
            let ranks = self.ranks as f64;
            Cost {
                memory: memory * self.matrix_bytes(),
                set_up: n * set_up / ranks + SET_UP_CYCLES * messages,
                step: iterations * (n * cycle / ranks + messages),
            }
        };
        match preconditioner {
            Preconditioner::Auto | Preconditioner::Cholesky => self.factor(self.factor_precision()),
            Preconditioner::Gamg => {
                let [set_up, cycle] = if self.order == 1 {
                    [self.by_dimension(7e-6, 22e-6), self.by_dimension(100e-9, 180e-9)]
                } else {
                    [self.by_dimension(7e-6, 11e-6), self.by_dimension(125e-9, 210e-9)]
                };
                let iterations = Iterations { without: 20.0, contact: 30.0, friction: 300.0 };
                multigrid(2.2, set_up, iterations, cycle)
            }
            Preconditioner::Boomeramg => {
                // The constants were measured with linear cells.
                let rows = self.coupled_nodes() / self.by_dimension(7.0, 15.0);
                let iterations = Iterations { without: 14.0, contact: 20.0, friction: 200.0 };
                let [set_up, cycle] = [self.by_dimension(1.5e-6, 5e-6), self.by_dimension(120e-9, 300e-9)];
                multigrid(3.5, rows * set_up, iterations, rows * cycle)
            }
        }
    }

    /// Seconds at this cost of set-up and of the steps that share one matrix.
    fn seconds_of(self, cost: Cost) -> f64 {
        cost.set_up + self.steps as f64 * cost.step
    }

    /// Seconds of set-up and of the steps that share one matrix.
    pub(super) fn seconds(self, preconditioner: Preconditioner) -> f64 {
        self.seconds_of(self.cost(preconditioner))
    }

    /// Whether this many ranks take no less time than one, with this preconditioner.
    pub(super) fn ranks_do_not_help(self, preconditioner: Preconditioner) -> bool {
        if self.ranks == 1 {
            return false;
        }
        let one = self.on_one_rank();
        let on_one = one.seconds(Preconditioner::Auto.choose(one).0);
        let other = OTHER_TIME * self.steps as f64 * self.unknowns as f64;
        self.seconds(preconditioner) + other / self.ranks as f64 >= on_one + other
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn friction_and_flow_add_dense_matrices_and_a_second_factor() {
        let block = ProblemSize {
            dimension: 3,
            order: 1,
            unknowns: 14_553,
            inverse_quality: 1.4,
            ranks: 1,
            steps: 10,
            interface: 1_323,
            motions: 1_323,
            contact: true,
            condensed: true,
            friction: true,
            flows: false,
            precision: FactorPrecision::Double,
        };
        let bytes = |problem: ProblemSize, preconditioner| {
            [problem.contact_bytes(preconditioner), problem.flow_bytes(preconditioner)]
        };
        assert_eq!(bytes(block, Preconditioner::Gamg), [0.0; 2]);
        let dense = 32.0 * 1_323.0 * 1_323.0;
        assert_eq!(bytes(block, Preconditioner::Cholesky), [dense, 0.0]);
        let flowing = ProblemSize { flows: true, ..block };
        let matrix = flowing.matrix_bytes() + flowing.assembly_bytes();
        let second = matrix + flowing.cost(Preconditioner::Cholesky).memory + dense;
        assert_eq!(bytes(flowing, Preconditioner::Cholesky)[1], second);
        assert_eq!(ProblemSize { ranks: 2, ..block }.contact_bytes(Preconditioner::Cholesky), 2.0 * dense);
    }

    #[test]
    fn a_large_factor_in_3d_costs_more_than_multigrid() {
        let problem = ProblemSize {
            dimension: 3,
            order: 1,
            unknowns: 1_000_000,
            inverse_quality: 1.3,
            ranks: 1,
            steps: 1,
            interface: 0,
            motions: 0,
            contact: true,
            condensed: true,
            friction: false,
            flows: false,
            precision: FactorPrecision::Double,
        };
        let [factor, multigrid] =
            [Preconditioner::Cholesky, Preconditioner::Gamg].map(|which| problem.cost(which));
        assert!(factor.memory > 5.0 * multigrid.memory && factor.set_up > 5.0 * multigrid.set_up);
    }

    #[test]
    fn a_second_rank_is_faster_if_its_work_takes_longer_than_messages() {
        let square = |cells: usize, ranks: usize| ProblemSize {
            dimension: 2,
            order: 1,
            unknowns: 2 * (cells + 1) * (cells + 1),
            inverse_quality: 1.2,
            ranks,
            interface: if ranks > 1 { 3 * cells } else { 0 },
            steps: 64,
            motions: 0,
            contact: true,
            condensed: true,
            friction: false,
            flows: false,
            precision: FactorPrecision::Auto,
        };
        let does_not_help = |cells, ranks| square(cells, ranks).ranks_do_not_help(Preconditioner::Cholesky);
        assert!(does_not_help(8, 2) && !does_not_help(8, 1), "messages take longer than steps");
        assert!([32, 128, 256, 512].iter().all(|&cells| !does_not_help(cells, 2)));
        let [one, two] = [1, 2].map(|ranks| square(256, ranks).cost(Preconditioner::Cholesky));
        assert!(two.step < 0.65 * one.step && two.memory < 1.1 * one.memory, "{one:?} {two:?}");
    }
}
