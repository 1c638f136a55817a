use super::{Effect, Energy, EnergyKind, Evaluation, Phases, Role, Step, Term, linear};
use crate::{
    fem::space::{Batch, Integrity, Needs},
    laws::material::{ByMaterial, Isotropic},
};

/// Dissipated by viscosity.
pub const VISCOUS: EnergyKind = EnergyKind::new(2, Role::Dissipated, "viscous_dissipation");

/// Viscous stress `A e(v_n)` in (25), implicit.
#[derive(Debug)]
pub struct ViscousStress {
    /// The viscosity tensor `A` in Pa s.
    pub tensor: ByMaterial<Isotropic>,
}

impl<const D: usize, const S: usize> Effect<D, S> for ViscousStress {
    fn name(&self) -> &'static str {
        "viscosity"
    }

    fn phases(&self, _: Evaluation) -> Phases {
        let rate = Needs { strain_rate: true, ..Needs::default() };
        Phases { energy: Some(rate), stress: Some(rate), ..Phases::default() }
    }

    fn term(&self) -> Term<'_> {
        Term::Viscosity(&self.tensor)
    }

    fn add_stress(&self, _: Evaluation, _: Step, batch: &mut Batch<D, S>) {
        let Some(tensor) = self.tensor.get(batch.material) else { return };
        let whole = Integrity::default();
        linear::add_stresses(tensor, 1.0, &batch.strain_rate, &whole, &mut batch.stress);
    }

    fn add_energy(&self, _: Evaluation, step: Step, batch: &Batch<D, S>, energy: &mut Energy) {
        let Some(tensor) = self.tensor.get(batch.material) else { return };
        let whole = Integrity::default();
        energy[VISCOUS] += step.length * linear::square(tensor, batch.cells, &whole, &batch.strain_rate);
    }
}
