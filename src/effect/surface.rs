use super::{Curvature, Energy, History, Step, StressError};

/// Nodal fields of the converged state with ghosts, `D` values a node.
#[derive(Debug, Clone, Copy)]
pub struct SurfaceState<'a> {
    /// Displacement in m.
    pub displacement: &'a [f64],
    /// Velocity in m/s.
    pub velocity: &'a [f64],
}

/// An effect at nodes of boundaries, explicit in time: it acts on the equations by force alone.
pub trait SurfaceEffect<const D: usize> {
    /// Its name in logs and `summary.json`.
    fn name(&self) -> &'static str;

    /// Adds its force in N at the nodes of this rank, from the converged state; may write its trial history. Adds what it
    /// dissipates in the step, if that is known now.
    fn add_explicit(&mut self, step: Step, state: SurfaceState<'_>, forces: &mut [f64], energy: &mut Energy);

    /// Adds its energies after the step was committed.
    fn add_energy(&self, step: Step, state: SurfaceState<'_>, energy: &mut Energy);

    /// Adds the force at the end of a step that was solved and not yet committed, given the displacement there, and the error that
    /// its trial history makes in it, beside those before: see [`super::Effect::add_error`].
    fn add_error(&self, curvature: Curvature, state: SurfaceState<'_>, error: &mut StressError);

    /// Keeps the histories before the last step from now on that [`SurfaceEffect::add_error`] needs.
    fn keep_earlier(&mut self);

    /// Whether its force follows the displacement, which bounds the step.
    fn is_elastic(&self) -> bool {
        false
    }

    /// Adds to `forces` the force against nodal values `x` of the largest stiffness it can have.
    fn add_stiffness(&self, _x: &[f64], _forces: &mut [f64]) {}

    /// Makes the trial history the converged one.
    fn commit(&mut self) {}

    /// The converged histories that it keeps at nodes.
    fn histories(&self) -> Vec<History<'_>> {
        Vec::new()
    }

    /// Histories before the last step that it keeps.
    fn earlier_histories(&self) -> Vec<History<'_>> {
        Vec::new()
    }

    /// Takes a saved history of this name over, laid out as [`SurfaceEffect::histories`] gives it.
    fn restore(&mut self, _name: &str, _values: &[f64]) {}
}
