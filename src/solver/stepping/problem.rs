//! A step to be solved: its data.

use super::{
    equations::{Floor, StepMatrix},
    flow::FlowStart,
};
use crate::{
    error::{Error, Result},
    fem::{body::Body, effect::Step, state::State},
    linear_algebra::petsc::DistributedVector,
    parallel::session::Session,
};

/// A step whose right-hand side is known and whose contacts are prepared.
pub(super) struct StepProblem<'a, const D: usize, const S: usize> {
    /// All ranks.
    pub session: &'a Session,
    /// The body; the solution changes the pressures of its contacts.
    pub body: &'a mut Body<D, S>,
    /// The converged state from which the step starts.
    pub state: &'a State,
    /// Its velocity in the unknowns of the step.
    pub converged: &'a DistributedVector,
    pub step: Step,
    /// The right-hand side in N.
    pub forces: &'a DistributedVector,
    /// The size of the forces in N, by which the accuracy of the step is measured.
    pub scale: f64,
    /// The residual norm in N due to rounding errors of the forces.
    pub rounding: f64,
    /// The displacement from which the step starts, if stresses are those at the end of the step.
    pub flow_start: Option<FlowStart<'a>>,
}

/// The equations `K v + C(v) = b` of Newton's method: for the whole body, or for its contact nodes alone.
#[derive(Clone, Copy)]
pub(super) struct System<'a> {
    /// `K`.
    pub matrix: &'a dyn StepMatrix,
    /// `b` in N.
    pub right_hand_side: &'a DistributedVector,
    /// The residual norm in N at which the equations count as solved.
    pub tolerance: f64,
    /// The residual that rounding errors leave.
    pub floor: Floor,
    /// The velocity of the converged state.
    pub converged: &'a DistributedVector,
    /// The parameters of each contact's graphs, along the normal and of friction: equal to the resistance of the body to motions of
    /// its surface alone, and along the normal at least twice the steepest descent. With smaller parameters the residual is so steep
    /// where points change their branch that line searches fail.
    pub scales: &'a [[f64; 2]],
}

impl<const D: usize, const S: usize> StepProblem<'_, D, S> {
    /// The message that the step failed, with the reason and a remedy.
    pub(super) fn failed(&self, why: &str, remedy: &str) -> Error {
        let Step { time, length, .. } = self.step;
        Error::Failed(format!("step to t = {time:.6e} s (length {length:.3e} s) failed: {why}; {remedy}"))
    }
}

impl System<'_> {
    /// Writes `b - K v`. Collective.
    pub(super) fn write_residual(
        &self,
        velocity: &DistributedVector,
        residual: &mut DistributedVector,
    ) -> Result<()> {
        self.matrix.multiply(velocity, residual)?;
        residual.scale(-1.0)?;
        residual.add_scaled(1.0, self.right_hand_side)
    }
}

/// A remedy if a solver does not converge.
pub(super) const REMEDY: &str =
    "try a smaller [time] step, a looser [solver] tolerance, or another [solver] preconditioner";

/// The same where laws soften: shorter steps help only if something resists fast motions.
pub(super) const SOFTENING_REMEDY: &str = "give the body a density or a viscosity and try a smaller [time] step, refine the mesh where these forces fall, \
     or lower the `strength` of bonds";

/// The same for friction that weakens where the surface has no mass: the velocity jumps, the more the shorter the steps.
pub(super) const MASSLESS_REMEDY: &str = "friction that weakens makes the velocity of a surface without mass jump, the more the \
     shorter the steps: leave its mass there (`redistribute_mass = false`, under bdf2 or implicit_euler) or give the material a viscosity";
