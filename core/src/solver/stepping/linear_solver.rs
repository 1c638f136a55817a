//! Krylov methods and preconditioners for the constant matrix.

use super::substructuring::SharedFactor;
use crate::{
    error::Result,
    linear_algebra::petsc::{HAS_HYPRE, HAS_MUMPS, Ksp, Precision, require, set_default_option},
    mesh::Mesh,
    parallel::session::Session,
};

pub(super) use crate::job::Solver as SolverSettings;
pub use crate::job::{FactorPrecision, FrictionIteration, Method, Preconditioner};

/// The problem sizes that determine the choice of a preconditioner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProblemSize {
    /// Dimension of the space.
    pub dimension: usize,
    /// Order of the shape functions.
    pub order: usize,
    /// Velocity components over all ranks.
    pub unknowns: usize,
    /// The mean of the inverse shape quality of the cells.
    pub inverse_quality: f64,
    /// Processes.
    pub ranks: usize,
    /// Number of steps that share one matrix, as far as it is known.
    pub steps: u64,
    /// Unknowns of the interface between subdomains and of the contact, for which ranks share a dense matrix; not used on one rank.
    pub interface: usize,
    /// Motions of contact nodes on which laws act, over all ranks.
    pub motions: usize,
    /// Whether there is contact.
    pub contact: bool,
    /// Whether a factor condenses steps to the contact: there is contact, at nodes that are not too many, and without contact nothing
    /// but flow makes steps nonlinear.
    pub condensed: bool,
    /// Whether there is friction.
    pub friction: bool,
    /// Whether cells flow at the end of a step.
    pub flows: bool,
    /// The requested precision of factors; double where cells flow at the end of a step.
    pub precision: FactorPrecision,
}

/// Size in bytes above which factors are made on request only.
const LARGEST_FACTOR: f64 = 4e9;
/// The mean inverse of the shape quality from which cells count as flat: they are about three times as long as thick.
const FLAT: f64 = 3.0;
/// Krylov iterations after which a linear solve fails.
pub(super) const LINEAR_ITERATIONS: usize = 2_000;

impl Preconditioner {
    /// Replaces `Auto` by the faster choice for this problem, and returns the reason.
    pub fn resolve(self, problem: ProblemSize) -> (Self, String) {
        let (chosen, mut reason) = self.choose(problem);
        if chosen == Self::Cholesky && problem.factor_precision() == Precision::Single {
            reason += "; factors in single precision";
        }
        if problem.ranks_do_not_help(chosen) {
            reason += &format!("; {} ranks are estimated to be no faster than 1", problem.ranks);
        }
        (chosen, reason)
    }

    /// The choice, and the reason.
    pub(super) fn choose(self, problem: ProblemSize) -> (Self, String) {
        if self != Self::Auto {
            return (self, "set by [solver] preconditioner".into());
        }
        let memory = problem.cost(Self::Cholesky).memory / problem.ranks as f64;
        if memory > LARGEST_FACTOR {
            return (Self::Gamg, format!("a factor would need about {:.0} GB on each rank", memory / 1e9));
        }
        let [factored, multigrid] = [Self::Cholesky, Self::Gamg].map(|which| problem.seconds(which));
        let chosen = if factored <= multigrid { Self::Cholesky } else { Self::Gamg };
        let reason = format!(
            "estimated time of {} step{} with one matrix: {} with a factorisation, {} with multigrid",
            problem.steps,
            if problem.steps == 1 { "" } else { "s" },
            seconds(factored),
            seconds(multigrid)
        );
        (chosen, reason)
    }

    /// The factor, not yet computed, of matrices with this number of unknowns of each node, if that is the choice and ranks can share it.
    /// Collective.
    pub(super) fn shared_factor<const D: usize>(
        self,
        session: &Session,
        mesh: &Mesh<D>,
        unknowns: usize,
    ) -> Result<Option<SharedFactor>> {
        match self {
            Self::Auto | Self::Cholesky => SharedFactor::new(session, mesh, unknowns),
            Self::Gamg | Self::Boomeramg => Ok(None),
        }
    }

    /// Number of iterations that take as long as rebuilding it for the motions that contact leaves free, where it is not restricted to these;
    /// in 3D rebuilding never pays (measured, see docs/contact-preconditioner.md).
    pub(super) fn refresh_threshold(self, dimension: usize) -> usize {
        match self {
            _ if dimension == 3 => usize::MAX,
            Self::Auto | Self::Cholesky => 5,
            Self::Gamg | Self::Boomeramg => 40,
        }
    }

    /// Its name in job files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Cholesky => "cholesky",
            Self::Gamg => "gamg",
            Self::Boomeramg => "boomeramg",
        }
    }

    /// Sets the method and the preconditioner; PETSc options of the user have priority.
    ///
    /// Ranks share a factor, whose results repeat each bit, unless their interface is too large for it: MUMPS sums in the order in
    /// which messages arrive, so that results of two runs differ in the last bits. The faster triple product for the coarse matrices
    /// of GAMG also sums in the order of arrival, as soon as a rank has two neighbours, and is not used then.
    ///
    /// `factor` is the one that ranks share, if their interface allows it.
    pub(super) fn configure(
        self,
        [dimension, order, ranks]: [usize; 3],
        inverse_quality: f64,
        factor: Option<&SharedFactor>,
        ksp: &mut Ksp,
    ) -> Result<()> {
        ksp.set_method("cg")?;
        match self {
            Self::Auto | Self::Cholesky => {
                if let Some(factor) = factor {
                    return ksp.precondition_by(Box::new(factor.unfactored()));
                }
                require(
                    HAS_MUMPS,
                    "[solver] preconditioner = \"cholesky\" with this many unknowns between subdomains",
                    "MUMPS",
                    "use \"gamg\", or fewer ranks",
                )?;
                ksp.set_preconditioner("cholesky", Some("mumps"))
            }
            Self::Gamg => {
                if ranks > 2 {
                    set_default_option("matptap_via", "allatonce")?;
                }
                set_smoother("")?;
                let threshold = aggregation_threshold(dimension, inverse_quality);
                if order == 1 {
                    ksp.set_preconditioner("gamg", None)?;
                    return set_aggregation("", threshold);
                }
                ksp.precondition_on_two_levels()?;
                set_smoother("mg_coarse_")?;
                set_aggregation("mg_coarse_", threshold)
            }
            Self::Boomeramg => {
                require(HAS_HYPRE, "[solver] preconditioner = \"boomeramg\"", "hypre", "use \"gamg\"")?;
                ksp.set_preconditioner("hypre", None)?;
                set_default_option("pc_hypre_type", "boomeramg")?;
                set_default_option("pc_hypre_boomeramg_strong_threshold", "0.5")?;
                set_default_option("pc_hypre_boomeramg_coarsen_type", "HMIS")?;
                set_default_option("pc_hypre_boomeramg_interp_type", "ext+i")?;
                set_default_option("pc_hypre_boomeramg_P_max", "4")?;
                set_default_option("pc_hypre_boomeramg_relax_type_all", "Chebyshev")
            }
        }
    }
}

/// Sets the smoother of the levels of multigrid with this prefix of its options.
fn set_smoother(prefix: &str) -> Result<()> {
    for (name, value) in [("ksp_type", "chebyshev"), ("ksp_max_it", "2"), ("pc_type", "jacobi")] {
        set_default_option(&format!("{prefix}mg_levels_{name}"), value)?;
    }
    Ok(())
}

/// The coupling of two nodes, relative to their own stiffness, from which they may be in one aggregate, on the finest level and on coarser
/// ones. Couplings across a jump of the stiffness by a factor of 10 or more are weaker than 0.05, and aggregates across it would double the iterations.
/// Those across flat cells are weaker, too: aggregates along lines would make coarse matrices large, in space as large as the matrix itself.
fn aggregation_threshold(dimension: usize, inverse_quality: f64) -> &'static str {
    match dimension {
        _ if inverse_quality > FLAT => "0.01",
        2 => "0.05",
        _ => "0.05,0.02",
    }
}

/// Sets how algebraic multigrid with this prefix of its options aggregates nodes.
fn set_aggregation(prefix: &str, threshold: &str) -> Result<()> {
    for (name, value) in [("threshold", threshold), ("agg_nsmooths", "1"), ("reuse_interpolation", "true")] {
        set_default_option(&format!("{prefix}pc_gamg_{name}"), value)?;
    }
    Ok(())
}

fn seconds(time: f64) -> String {
    let digits = if time < 0.1 { 3 } else { usize::from(time < 10.0) };
    format!("{time:.digits$} s")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn problem(dimension: usize, unknowns: usize, ranks: usize, steps: u64) -> ProblemSize {
        let precision = FactorPrecision::Auto;
        let interface = match (ranks, dimension) {
            (1, _) => 0,
            (_, 2) => 3 * (unknowns as f64).sqrt() as usize,
            _ => 3 * (unknowns as f64).powf(2.0 / 3.0) as usize,
        };
        ProblemSize {
            dimension,
            order: 1,
            unknowns,
            inverse_quality: 1.2,
            ranks,
            interface,
            steps,
            motions: 0,
            contact: true,
            condensed: true,
            friction: false,
            flows: false,
            precision,
        }
    }

    fn precision_of(problem: ProblemSize) -> Precision {
        problem.factor_precision()
    }

    fn chosen(problem: ProblemSize) -> Preconditioner {
        Preconditioner::Auto.resolve(problem).0
    }

    #[test]
    fn factors_are_chosen_if_many_steps_share_them() {
        assert_eq!(chosen(problem(2, 500_000, 1, 64)), Preconditioner::Cholesky);
        assert_eq!(chosen(problem(3, 100_000, 1, 1000)), Preconditioner::Cholesky);
        assert_eq!(chosen(problem(3, 100_000, 1, 1)), Preconditioner::Gamg);
        assert_eq!(chosen(problem(3, 1_000_000, 1, 1_000_000)), Preconditioner::Gamg);
    }

    #[test]
    fn factors_in_space_are_in_single_precision_where_few_steps_share_them() {
        assert_eq!(precision_of(problem(3, 100_000, 1, 16)), Precision::Single);
        assert_eq!(precision_of(problem(3, 100_000, 1, 1000)), Precision::Double);
        assert_eq!(precision_of(problem(3, 1_000, 1, 1)), Precision::Double, "the factor fits the cache");
        assert_eq!(precision_of(problem(2, 500_000, 1, 1)), Precision::Double);
        assert_eq!(
            precision_of(ProblemSize { contact: false, condensed: false, ..problem(3, 100_000, 1, 1) }),
            Precision::Double
        );
        let requested =
            |steps| ProblemSize { precision: FactorPrecision::Single, ..problem(2, 1_000, 1, steps) };
        assert_eq!(precision_of(requested(1000)), Precision::Single);
        let (_, why) = Preconditioner::Cholesky.resolve(requested(1));
        assert!(why.ends_with("; factors in single precision"), "{why}");
    }

    #[test]
    fn flat_cells_are_expensive_for_multigrid() {
        let one_step = problem(3, 100_000, 1, 1);
        let flat = ProblemSize { inverse_quality: 20.0, ..one_step };
        assert_eq!([chosen(one_step), chosen(flat)], [Preconditioner::Gamg, Preconditioner::Cholesky]);
        let [regular, slow] = [one_step, flat].map(|problem| problem.cost(Preconditioner::Gamg));
        assert!(slow.step > 10.0 * regular.step && slow.set_up == regular.set_up, "{regular:?} {slow:?}");
    }

    #[test]
    fn friction_is_expensive_for_multigrid() {
        let sliding = problem(3, 100_000, 1, 4);
        assert_eq!(chosen(ProblemSize { friction: true, ..sliding }), Preconditioner::Cholesky);
    }

    #[test]
    fn ranks_share_a_factor_where_their_interface_is_small() {
        for unknowns in [40_000, 500_000] {
            assert_eq!(chosen(problem(2, unknowns, 2, 64)), Preconditioner::Cholesky);
        }
        assert_eq!(precision_of(problem(3, 100_000, 2, 16)), Precision::Single);
        let large_interface = ProblemSize { interface: 20_000, ..problem(2, 500_000, 2, 64) };
        assert!(problem(2, 500_000, 2, 64).is_condensed() && !large_interface.is_condensed());
        for steps in [1, 8, 1000] {
            assert_eq!(chosen(problem(2, 300, 7, steps)), Preconditioner::Cholesky);
        }
        let (_, why) = Preconditioner::Auto.resolve(problem(2, 100, 7, 64));
        assert!(why.ends_with("; 7 ranks are estimated to be no faster than 1"), "{why}");
        let (chosen, why) = Preconditioner::Gamg.resolve(problem(3, 9, 1, 1));
        assert_eq!((chosen, &*why), (Preconditioner::Gamg, "set by [solver] preconditioner"));
    }
}
