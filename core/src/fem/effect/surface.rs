use super::{Curvature, Energy, Evaluation, HistoryStore, Outcome, Step, StressError};
use crate::{fem::space::Nodal, linear_algebra::tensor::Vector};

/// The force of a surface effect at a node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceForce<const D: usize> {
    /// Position of the contact among those of the job.
    pub contact: usize,
    /// Local number of the node.
    pub node: u32,
    /// Weight of the point in m^(D-1): the force over it is the traction.
    pub weight: f64,
    /// Force on the body in N.
    pub force: Vector<D>,
}

/// An effect at nodes of boundaries whose force follows the displacement.
pub trait SurfaceEffect<const D: usize> {
    /// Its name in logs and `summary.json`.
    fn name(&self) -> &'static str;

    /// Whether its force may fall as the displacement grows.
    fn softens(&self) -> bool {
        false
    }

    /// The local numbers of the nodes where it has forces.
    fn nodes(&self) -> Vec<u32>;

    /// The nodes of this rank with directions along which it resists a motion of a body at rest.
    fn holding_directions(&self) -> Vec<(usize, Vector<D>)> {
        Vec::new()
    }

    /// Evaluates its law at this displacement (`D` values a node, with ghosts) and writes its trial history.
    ///
    /// With the converged state it adds its force in N at the nodes of this rank to `forces`. At the start of an implicit step it is given
    /// the converged displacement and adds nothing. At the end it adds minus its force, and the derivatives by the velocity, where
    /// the outcome takes them.
    fn evaluate(
        &mut self,
        at: Evaluation,
        step: Step,
        displacement: &[f64],
        forces: &mut [f64],
        outcome: &mut Outcome,
    );

    /// Adds its energies after the commit, given displacement and velocity of the converged state.
    fn add_energy(&self, at: Evaluation, step: Step, nodal: Nodal<'_>, energy: &mut Energy);

    /// Writes the trial history of an implicit step that was solved and not yet committed, and adds the energies that need the
    /// histories before and after it: what it dissipates, and the terms of the scheme. `nodal` has displacement and velocity at the end
    /// of the step and the displacement before it.
    fn add_step_energy(&mut self, at: Evaluation, step: Step, nodal: Nodal<'_>, energy: &mut Energy);

    /// Appends the forces of the last committed step, given displacement and velocity of the converged state.
    fn write_forces(&self, at: Evaluation, step: Step, nodal: Nodal<'_>, forces: &mut Vec<SurfaceForce<D>>);

    /// Adds the squares of the force at the end of a step that was solved and not yet committed, given the displacement there, and of
    /// the error that its trial history makes in the force, given the histories before.
    fn add_error(&self, curvature: Curvature, displacement: &[f64], error: &mut StressError);

    /// Adds to `forces` the force against nodal values `x` of the largest stiffness it can have.
    fn add_stiffness(&self, x: &[f64], forces: &mut [f64]);

    /// The histories that it keeps at nodes.
    fn histories(&self) -> Vec<&dyn HistoryStore>;

    /// Visits the same histories.
    fn visit_histories(&mut self, visit: &mut dyn FnMut(&mut dyn HistoryStore));
}
