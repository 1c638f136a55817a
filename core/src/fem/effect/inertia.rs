use super::{Effect, Energy, EnergyKind, Evaluation, NUMERICAL, Outcome, Phases, Role, Step, Term, mass};
use crate::{
    fem::space::{Batch, Needs},
    laws::material::ByMaterial,
};

/// Kinetic energy.
pub const KINETIC: EnergyKind =
    EnergyKind::new(0, Role::Stored, "kinetic_energy", "kinetic energy of the body at the end of the step");

/// Inertia with consistent mass: `(1/k) M (v_n - v_{n-1})` in (25).
#[derive(Debug)]
pub struct Inertia {
    /// Density in kg/m^d.
    pub density: ByMaterial<f64>,
}

impl<const D: usize, const S: usize> Effect<D, S> for Inertia {
    fn name(&self) -> &'static str {
        "inertia"
    }

    fn phases(&self, _: Evaluation) -> Phases {
        let velocity = Needs { velocity: true, ..Needs::default() };
        let both = Needs { velocity_change: true, ..velocity };
        Phases { start: Some(velocity), energy: Some(both), ..Phases::default() }
    }

    fn term(&self) -> Term<'_> {
        Term::Mass(&self.density)
    }

    fn evaluate(&mut self, at: Evaluation, step: Step, batch: &mut Batch<D, S>, _: &mut Outcome) {
        let length = match at {
            Evaluation::Converged => step.length,
            Evaluation::Start(blend) | Evaluation::End(blend) => blend.length,
        };
        mass::add_to_batch(&self.density, 1.0 / length, batch);
    }

    fn add_energy(&self, _: Evaluation, _: Step, batch: &Batch<D, S>, energy: &mut Energy) {
        let Some(&density) = self.density.get(batch.material) else { return };
        energy[KINETIC] += 0.5 * mass::square(density, batch, &batch.velocity);
        energy[NUMERICAL] -= 0.5 * mass::square(density, batch, &batch.velocity_change);
    }
}
