use super::{Effect, Energy, Form, Phases, Step};
use crate::{
    material::Viscosity,
    space::{Batch, CellMatrix, Needs, Simplex},
    tensor::{add_scaled, dot},
};

/// Viscous stress `A e(v_n)` in (25), implicit.
#[derive(Debug)]
pub struct ViscousStress {
    /// The viscosity tensor `A` in Pa s.
    pub tensor: Viscosity,
}

impl<const D: usize, const S: usize> Effect<D, S> for ViscousStress {
    fn name(&self) -> &'static str {
        "viscosity"
    }

    fn phases(&self) -> Phases {
        let rate = Needs { strain_rate: true, ..Needs::default() };
        Phases { matrix: true, explicit: None, energy: Some(rate), stress: Some(rate) }
    }

    fn add_matrix(&self, _cell: usize, geometry: &Simplex<D>, _step_length: f64, matrix: &mut CellMatrix<D>) {
        matrix.add_isotropic(geometry, self.tensor.volumetric, self.tensor.shear);
    }

    fn add_energy(&self, step: Step, batch: &Batch<D, S>, energy: &mut Energy) {
        for (cell, rate) in batch.cells.iter().zip(&batch.strain_rate) {
            energy.viscous += step.length * cell.volume * dot(rate, &self.tensor.apply(rate));
        }
    }

    fn form(&self) -> Option<Form> {
        Some(Form::Viscosity)
    }

    fn add_form(&self, batch: &mut Batch<D, S>) {
        for (stress, rate) in batch.stress.iter_mut().zip(&batch.strain_rate).take(batch.cells.len()) {
            *stress = add_scaled(stress, -1.0, &self.tensor.apply(rate));
        }
    }

    fn viscosity_modulus(&self) -> Option<f64> {
        Some(self.tensor.smallest_modulus::<S>())
    }

    fn add_stress(&self, _step: Step, batch: &mut Batch<D, S>) {
        for (stress, rate) in batch.stress.iter_mut().zip(&batch.strain_rate).take(batch.cells.len()) {
            *stress = add_scaled(stress, 1.0, &self.tensor.apply(rate));
        }
    }
}
