use super::{Effect, Energy, Form, Phases, Step, isotropic};
use crate::{
    material::{ByMaterial, Isotropic},
    space::{Batch, CellMatrix, Integrity, Needs, Simplex},
};

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

    fn phases(&self) -> Phases {
        let rate = Needs { strain_rate: true, ..Needs::default() };
        Phases { matrix: true, energy: Some(rate), stress: Some(rate), ..Phases::default() }
    }

    fn is_everywhere(&self) -> bool {
        self.tensor.is_everywhere()
    }

    fn add_matrix(&self, material: usize, cell: &Simplex<D>, _step_length: f64, matrix: &mut CellMatrix<D>) {
        if let Some(tensor) = self.tensor.get(material) {
            matrix.add_isotropic(cell, tensor.volumetric, tensor.shear);
        }
    }

    fn add_energy(&self, step: Step, batch: &Batch<D, S>, energy: &mut Energy) {
        let Some(tensor) = self.tensor.get(batch.material) else { return };
        let whole = Integrity::default();
        energy.viscous += step.length * isotropic::square(tensor, batch.cells, &whole, &batch.strain_rate);
    }

    fn form(&self) -> Option<Form> {
        Some(Form::Viscosity)
    }

    fn tensor(&self, material: usize) -> Option<Isotropic> {
        self.tensor.get(material).copied()
    }

    fn add_form(&self, batch: &mut Batch<D, S>) {
        let Some(tensor) = self.tensor.get(batch.material) else { return };
        let whole = Integrity::default();
        isotropic::add_stresses(tensor, -1.0, &batch.strain_rate, &whole, &mut batch.stress);
    }

    fn viscosity_modulus(&self) -> Option<f64> {
        let smallest = self.tensor.laws().map(Isotropic::smallest_modulus::<S>).reduce(f64::min);
        if self.tensor.is_everywhere() { smallest } else { smallest.map(|modulus| modulus.min(0.0)) }
    }

    fn add_stress(&self, _step: Step, batch: &mut Batch<D, S>) {
        let Some(tensor) = self.tensor.get(batch.material) else { return };
        let whole = Integrity::default();
        isotropic::add_stresses(tensor, 1.0, &batch.strain_rate, &whole, &mut batch.stress);
    }
}
