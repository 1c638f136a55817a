use super::{Curvature, Effect, ElasticLaw, Energy, Form, Phases, Step, StressError, isotropic};
use crate::{
    material::{ByMaterial, Isotropic},
    space::{Batch, CellMatrix, Needs, Simplex},
    tensor::{add_scaled, dot},
};

/// Elastic stress of the displacement at the end of the step, `E e(u_n)` with `u_n = u~ + k' v_n`: `E e(u~)` is known, and
/// `k' E` is part of the matrix.
#[derive(Debug)]
pub struct ImplicitElasticity {
    law: ByMaterial<ElasticLaw>,
}

impl ImplicitElasticity {
    /// Elasticity of these materials.
    pub fn new(law: ByMaterial<ElasticLaw>) -> Self {
        Self { law }
    }
}

impl<const D: usize, const S: usize> Effect<D, S> for ImplicitElasticity {
    fn name(&self) -> &'static str {
        "elasticity"
    }

    fn phases(&self) -> Phases {
        let strain = Needs { strain: true, ..Needs::default() };
        Phases {
            matrix: true,
            explicit: Some(strain),
            energy: Some(strain),
            stress: Some(strain),
            error: Some(strain),
            weakens: false,
        }
    }

    fn is_everywhere(&self) -> bool {
        self.law.is_everywhere()
    }

    fn add_matrix(&self, material: usize, cell: &Simplex<D>, length: f64, matrix: &mut CellMatrix<D>) {
        if let Some(law) = self.law.get(material) {
            matrix.add_isotropic(cell, length * law.tensor.volumetric, length * law.tensor.shear);
        }
    }

    fn add_explicit(&mut self, _step: Step, batch: &mut Batch<D, S>, _energy: &mut Energy) {
        let Some(law) = self.law.get(batch.material) else { return };
        isotropic::add_stresses(&law.tensor, 1.0, &batch.strain, &batch.integrity, &mut batch.stress);
    }

    fn add_implicit_energy(&mut self, step: Step, batch: &mut Batch<D, S>, energy: &mut Energy) {
        let Some(law) = self.law.get(batch.material).filter(|law| !law.with_history) else { return };
        for lane in 0..batch.count {
            let strain = batch.strain.lane(lane);
            let change = add_scaled(&strain, -1.0, &batch.strain_before.lane(lane));
            let beside = add_scaled(&change, -step.length, &batch.strain_rate.lane(lane));
            let jump = 0.5 * dot(&change, &law.tensor.apply(&change));
            let work = dot(&law.tensor.apply(&strain), &beside);
            energy.numerical += batch.cells.volume[lane] * (work - jump);
        }
    }

    fn add_energy(&self, _step: Step, batch: &Batch<D, S>, energy: &mut Energy) {
        let Some(law) = self.law.get(batch.material).filter(|law| !law.with_history) else { return };
        energy.elastic += 0.5 * isotropic::square(&law.tensor, batch.cells, &batch.integrity, &batch.strain);
    }

    fn add_error(&self, _curvature: Curvature, batch: &mut Batch<D, S>, error: &mut StressError) {
        let Some(law) = self.law.get(batch.material).filter(|law| !law.with_history) else { return };
        error.size += isotropic::square(&law.tensor, batch.cells, &batch.integrity, &batch.strain);
    }

    fn form(&self) -> Option<Form> {
        Some(Form::Elasticity)
    }

    fn tensor(&self, material: usize) -> Option<Isotropic> {
        self.law.get(material).map(|law| law.tensor)
    }

    fn add_form(&self, batch: &mut Batch<D, S>) {
        let Some(law) = self.law.get(batch.material) else { return };
        isotropic::add_stresses(&law.tensor, -1.0, &batch.strain_rate, &batch.integrity, &mut batch.stress);
    }

    fn add_stress(&self, _step: Step, batch: &mut Batch<D, S>) {
        let Some(law) = self.law.get(batch.material) else { return };
        isotropic::add_stresses(&law.tensor, 1.0, &batch.strain, &batch.integrity, &mut batch.stress);
    }
}
