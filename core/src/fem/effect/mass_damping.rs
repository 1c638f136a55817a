use super::{Effect, Energy, Evaluation, Phases, Step, Term, VISCOUS, mass};
use crate::{
    fem::space::{Batch, Needs},
    laws::material::ByMaterial,
};

/// Forces `-drag v` per volume that damp the velocity, implicit; with the consistent matrix of the mass. What it dissipates counts as
/// viscous.
#[derive(Debug)]
pub struct MassDamping {
    /// Force per volume and velocity in kg/(m^d s).
    pub drag: ByMaterial<f64>,
}

impl<const D: usize, const S: usize> Effect<D, S> for MassDamping {
    fn name(&self) -> &'static str {
        "mass_damping"
    }

    fn phases(&self, _: Evaluation) -> Phases {
        Phases { energy: Some(Needs { velocity: true, ..Needs::default() }), ..Phases::default() }
    }

    fn term(&self) -> Term<'_> {
        Term::Drag(&self.drag)
    }

    fn add_energy(&self, _: Evaluation, step: Step, batch: &Batch<D, S>, energy: &mut Energy) {
        let Some(&drag) = self.drag.get(batch.material) else { return };
        energy[VISCOUS] += step.length * mass::square(drag, batch, &batch.velocity);
    }
}
