//! Numbers of iterations, contact points and energies of a step.

use crate::{
    fem::effect::{Energy, Peaks, PointCount},
    parallel::session::Session,
};

/// The work of all attempts at a step, those that failed among them.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Work {
    /// Newton iterations.
    pub newton: usize,
    /// Krylov iterations.
    pub linear: usize,
}

/// Work and accuracy of a step.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StepOutcome {
    /// Newton iterations of all attempts, once the step is complete; 0 if a step is linear.
    pub newton_iterations: usize,
    /// Krylov iterations of all attempts, once it is complete.
    pub linear_iterations: usize,
    /// Contact points that changed their branch, over all ranks.
    pub active_changes: usize,
    /// Contact points by state, over all ranks.
    pub points: PointCount,
    /// Linear systems that were not positive definite and were solved by GMRES.
    pub indefinite_solves: usize,
    /// Largest scaled distance to the contact graphs.
    pub inclusion_residual: f64,
    /// Norm of the forces that the solution leaves unbalanced, as a share of the size of all forces; in N until the step is complete.
    pub residual: f64,
    /// Whether the solution lies beyond unstable states, into which laws that soften lead.
    pub fell: bool,
    /// The number of the fallback of Newton's method that solved it.
    pub fallback: usize,
    /// Number of different solutions found, if a search was requested; otherwise 0.
    pub solutions: usize,
    /// Whether some of them differ by far more than the accuracy of a solution.
    pub solutions_differ: bool,
    /// The name of the time at which the step ended, if the log reports it.
    pub landed_on: Option<&'static str>,
    /// Energies of the step, over all ranks.
    pub energy: Energy,
    /// Powers at its end in W, over all ranks, from which the next step has means.
    pub powers: Energy,
    /// Largest stress and strain at its end, over all ranks.
    pub peaks: Peaks,
}

impl StepOutcome {
    /// The outcome of a further solve, with what was found in this one.
    pub(super) fn followed_by(self, next: Self) -> Self {
        Self {
            indefinite_solves: self.indefinite_solves + next.indefinite_solves,
            fell: self.fell || next.fell,
            fallback: self.fallback.max(next.fallback),
            ..next
        }
    }
}

/// Sums and largest values over all ranks. Collective.
pub(super) fn over_ranks(session: &Session, energy: Energy, peaks: Peaks) -> (Energy, Peaks) {
    let [von_mises, strain] = session.largest([peaks.von_mises, peaks.strain]);
    (energy.map_values(|values| session.sum(values)), Peaks { von_mises, strain })
}
