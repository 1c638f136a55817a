use super::{energy::Energy, tangents::Tangents};

/// What effects give when they are evaluated, beside stress and force.
#[derive(Debug, Default)]
pub struct Outcome<'a> {
    /// Energies of the step that are known already.
    pub energy: Energy,
    /// The fastest relaxation of power laws in 1/s at the converged state.
    pub fastest_flow: f64,
    /// Whether flow or damage changed the stress at the end of the step.
    pub has_flowed: bool,
    /// Takes the energy in J that flow takes up in each cell in the step, where it is wanted.
    pub flow: Option<&'a mut [f64]>,
    /// Takes the derivatives at the end of the step, where they are wanted.
    pub tangents: Option<&'a mut Tangents>,
}
