use super::{Blend, Curvature, Energy, History, Step, StressError, Tangents};

/// Nodal fields of the converged state with ghosts, `D` values a node.
#[derive(Debug, Clone, Copy)]
pub struct SurfaceState<'a> {
    /// Displacement in m.
    pub displacement: &'a [f64],
    /// Velocity in m/s.
    pub velocity: &'a [f64],
}

/// An implicit step that was solved and not yet committed: nodal fields, `D` values a node, with ghosts.
#[derive(Debug, Clone, Copy)]
pub struct SurfaceStep<'a> {
    /// Displacement before the step in m.
    pub before: &'a [f64],
    /// Displacement at its end in m.
    pub after: &'a [f64],
    /// Velocity at its end in m/s.
    pub velocity: &'a [f64],
}

/// An effect at nodes of boundaries. Its force follows the displacement before the step or, in implicit steps, that at the end.
pub trait SurfaceEffect<const D: usize> {
    /// Its name in logs and `summary.json`.
    fn name(&self) -> &'static str;

    /// Adds its force in N at the nodes of this rank, from the converged state; may write its trial history. Adds what it
    /// dissipates in the step, if that is known now.
    fn add_explicit(&mut self, step: Step, state: SurfaceState<'_>, forces: &mut [f64], energy: &mut Energy);

    /// Whether its force follows the displacement at the end of steps.
    fn is_implicit(&self) -> bool;

    /// Whether its force may fall as the displacement grows.
    fn softens(&self) -> bool {
        false
    }

    /// Takes in how an implicit step of this length in s starts, and the displacement before it.
    fn begin(&mut self, blend: Blend, length: f64, displacement: &[f64]);

    /// Finds its history at the end of an implicit step with this displacement and writes it as the trial history.
    fn advance(&mut self, displacement: &[f64]);

    /// Adds minus its force in N at the end of an implicit step with the displacement that it was last advanced to and, where they are
    /// wanted, the derivatives by the velocity.
    fn add_forces(&self, displacement: &[f64], tangents: Option<&mut Tangents>, forces: &mut [f64]);

    /// Adds the energies of an implicit step that need the histories before and after it: what it dissipates, and the terms of
    /// the scheme.
    fn add_implicit_energy(&self, step: Step, ends: SurfaceStep<'_>, energy: &mut Energy);

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
