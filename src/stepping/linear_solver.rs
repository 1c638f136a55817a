//! Which Krylov method and preconditioner solve with the constant matrix.

use crate::{
    error::Result,
    petsc::{HAS_HYPRE, HAS_MUMPS, Ksp, require, set_default_option},
};

/// The preconditioner a job asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Preconditioner {
    /// Chosen by size.
    Auto,
    /// Cholesky factorisation.
    Cholesky,
    /// PETSc's smoothed aggregation multigrid with the rigid motions.
    Gamg,
    /// hypre's BoomerAMG.
    Boomeramg,
}

/// What solves a step with contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// Newton's method on the contact graphs.
    Newton,
    /// PETSc's solver for variational inequalities, where contacts are nothing but bounds on velocity components.
    VariationalInequality,
}

/// How friction bounds that follow the contact pressure find it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrictionIteration {
    /// Within Newton's method.
    Newton,
    /// Around Newton's method, which sees given bounds.
    FixedPoint,
}

/// How the equations of a step are solved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SolverSettings {
    /// Residual norm relative to the norm of the right-hand side.
    pub tolerance: f64,
    /// Largest scaled distance to a contact graph.
    pub inclusion_tolerance: f64,
    /// The method for steps with contact.
    pub method: Method,
    /// The preconditioner.
    pub preconditioner: Preconditioner,
    /// Newton iterations after which a step has failed.
    pub newton_iterations: usize,
    /// Steps that one matrix is for, as far as is known.
    pub steps: u64,
    /// How friction bounds find the pressure that they follow.
    pub friction: FrictionIteration,
}

/// What a preconditioner has to serve.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Service {
    /// Dimension of the space.
    pub dimension: usize,
    /// Velocity components over all ranks.
    pub unknowns: usize,
    /// Processes.
    pub ranks: usize,
    /// Steps that one matrix is for, as far as is known.
    pub steps: u64,
}

/// Steps that pay for a factorisation of a large matrix.
const MANY_STEPS: u64 = 10;
/// Most unknowns for which a factorisation is faster than multigrid, for few and for many steps.
const DIRECT_2D: [usize; 2] = [20_000, 600_000];
const DIRECT_3D: [usize; 2] = [6_000, 110_000];
/// Most unknowns whose matrix every rank factors for itself.
const REDUNDANT: usize = 50_000;
/// Krylov iterations after which a linear solve has failed.
pub(super) const LINEAR_ITERATIONS: usize = 2_000;

impl Service {
    fn largest_factored(self) -> usize {
        let [few, many] = if self.dimension == 2 { DIRECT_2D } else { DIRECT_3D };
        let most = if self.steps >= MANY_STEPS { many } else { few };
        if self.ranks > 1 { most.min(REDUNDANT) } else { most }
    }
}

impl Preconditioner {
    /// Replaces `Auto` by the choice for this service.
    pub fn resolve(self, service: Service) -> Self {
        match self {
            Self::Auto if service.unknowns <= service.largest_factored() => Self::Cholesky,
            Self::Auto => Self::Gamg,
            chosen => chosen,
        }
    }

    /// Why [`resolve`](Self::resolve) chooses what it does, in words.
    pub fn reason(self, service: Service) -> String {
        if self != Self::Auto {
            return "[solver] preconditioner asks for it".into();
        }
        let Service { dimension, ranks, steps, .. } = service;
        let most = service.largest_factored();
        let steps = if steps >= MANY_STEPS {
            format!("{MANY_STEPS} steps or more")
        } else {
            format!("fewer than {MANY_STEPS} steps")
        };
        let ranks = if ranks > 1 { "several ranks, each of which factors all of it" } else { "one rank" };
        let which = if service.unknowns <= most { "up to" } else { "multigrid is; up to" };
        format!(
            "{which} {most} velocity components in {dimension}D a factorisation is faster, with {steps} a matrix on {ranks}"
        )
    }

    /// Whether every rank factors the whole matrix for itself.
    pub fn is_redundant(self, ranks: usize, unknowns: usize) -> bool {
        matches!(self, Self::Auto | Self::Cholesky) && ranks > 1 && unknowns <= REDUNDANT
    }

    /// Iterations that cost as much as making it anew; in 3D that never pays (measured, see docs/contact-preconditioner.md).
    pub(super) fn patience(self, dimension: usize) -> usize {
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

    /// Sets the method and the preconditioner; PETSc options that the user gave stay.
    ///
    /// Cholesky of a small matrix is done by CHOLMOD on every rank at once: MUMPS on several ranks sums in the order in
    /// which messages arrive, so that no two runs agree to the last bit. It serves where the matrix is too large for that.
    /// So does the faster way to GAMG's coarse matrices as soon as a rank has two neighbours.
    pub(super) fn configure(self, ksp: &mut Ksp, ranks: usize, unknowns: usize) -> Result<()> {
        ksp.set_method("cg")?;
        match self {
            Self::Auto | Self::Cholesky if ranks == 1 => ksp.set_preconditioner("cholesky", Some("cholmod")),
            Self::Auto | Self::Cholesky if self.is_redundant(ranks, unknowns) => {
                ksp.set_preconditioner("redundant", None)?;
                set_default_option("redundant_ksp_type", "preonly")?;
                set_default_option("redundant_pc_type", "cholesky")?;
                set_default_option("redundant_pc_factor_mat_solver_type", "cholmod")
            }
            Self::Auto | Self::Cholesky => {
                require(
                    HAS_MUMPS,
                    "[solver] preconditioner = \"cholesky\" of so many unknowns on several ranks",
                    "MUMPS",
                    "use \"gamg\", or one rank",
                )?;
                ksp.set_preconditioner("cholesky", Some("mumps"))
            }
            Self::Gamg => {
                ksp.set_preconditioner("gamg", None)?;
                if ranks > 2 {
                    set_default_option("matptap_via", "allatonce")?;
                }
                set_default_option("pc_gamg_threshold", "0.01")?;
                set_default_option("pc_gamg_agg_nsmooths", "1")?;
                set_default_option("pc_gamg_reuse_interpolation", "true")?;
                set_default_option("mg_levels_ksp_type", "chebyshev")?;
                set_default_option("mg_levels_ksp_max_it", "2")?;
                set_default_option("mg_levels_pc_type", "jacobi")
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_steps_on_one_rank_pay_for_larger_factors() {
        let chosen = |unknowns, ranks, steps| {
            Preconditioner::Auto.resolve(Service { dimension: 2, unknowns, ranks, steps })
        };
        assert_eq!(chosen(500_000, 1, 64), Preconditioner::Cholesky);
        assert_eq!(chosen(500_000, 1, 2), Preconditioner::Gamg);
        assert_eq!(chosen(500_000, 2, 64), Preconditioner::Gamg);
        assert_eq!(chosen(40_000, 2, 64), Preconditioner::Cholesky);
        let asked = Service { dimension: 3, unknowns: 9, ranks: 1, steps: 1 };
        assert_eq!(Preconditioner::Gamg.resolve(asked), Preconditioner::Gamg);
    }
}
