use super::{Curvature, Effect, Energy, Form, Phases, Step, StressError, isotropic};
use crate::{
    material::{ByMaterial, Isotropic},
    simd::Pack,
    space::{Batch, CellMatrix, Integrity, Needs, Simplex},
    tensor::{add_scaled, dot},
};

/// Elastic stress `E e(u)`: of the displacement before the step, `E e(u_{n-1})` in (24), or of that at its end, `u_n = u~ + k' v_n`, where
/// `E e(u~)` is known at the start of the step and `k' E` is part of the matrix.
#[derive(Debug)]
pub struct Elasticity {
    law: ByMaterial<ElasticLaw>,
    is_implicit: bool,
}

/// An elastic material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ElasticLaw {
    /// The elastic tensor `E` in Pa.
    pub tensor: Isotropic,
    /// Whether a history adds to the elastic stress, which then accounts for its energy.
    pub with_history: bool,
}

impl Elasticity {
    /// Elasticity of these materials, at the end of steps or before them.
    pub fn new(law: ByMaterial<ElasticLaw>, is_implicit: bool) -> Self {
        Self { law, is_implicit }
    }
}

impl<const D: usize, const S: usize> Effect<D, S> for Elasticity {
    fn name(&self) -> &'static str {
        "elasticity"
    }

    fn phases(&self) -> Phases {
        let strain = Needs { strain: true, ..Needs::default() };
        let after = Needs { strain_rate: !self.is_implicit, ..strain };
        Phases {
            matrix: self.is_implicit,
            explicit: Some(strain),
            energy: Some(after),
            stress: Some(after),
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

    fn add_elastic_stress(&self, batch: &mut Batch<D, S>) {
        let Some(law) = self.law.get(batch.material) else { return };
        let sound = Integrity::default();
        isotropic::add_stresses(&law.tensor, 1.0, &batch.strain, &sound, &mut batch.elastic_stress);
    }

    fn add_explicit(&mut self, _step: Step, batch: &mut Batch<D, S>, _energy: &mut Energy) {
        let Some(law) = self.law.get(batch.material) else { return };
        isotropic::add_stresses(&law.tensor, 1.0, &batch.strain, &batch.integrity, &mut batch.stress);
    }

    fn add_implicit_energy(&mut self, step: Step, batch: &mut Batch<D, S>, energy: &mut Energy) {
        let Some(law) = self.law.get(batch.material).filter(|law| !law.with_history) else { return };
        let share = batch.integrity.shares();
        for lane in 0..batch.count {
            let strain = batch.strain.lane(lane);
            let change = add_scaled(&strain, -1.0, &batch.strain_before.lane(lane));
            let beside = add_scaled(&change, -step.length, &batch.strain_rate.lane(lane));
            let jump = 0.5 * dot(&change, &law.tensor.apply(&change));
            let work = dot(&law.tensor.apply(&strain), &beside);
            energy.numerical += share[lane] * batch.cells.volume[lane] * (work - jump);
        }
    }

    fn add_energy(&self, step: Step, batch: &Batch<D, S>, energy: &mut Energy) {
        let Some(law) = self.law.get(batch.material) else { return };
        let square = |strains| isotropic::square(&law.tensor, batch.cells, &batch.integrity, strains);
        if !law.with_history {
            energy.elastic += 0.5 * square(&batch.strain);
        }
        if !self.is_implicit {
            energy.numerical += 0.5 * step.length * step.length * square(&batch.strain_rate);
        }
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

    fn add_stress(&self, step: Step, batch: &mut Batch<D, S>) {
        let Some(law) = self.law.get(batch.material) else { return };
        let before = |lane| add_scaled(&batch.strain.lane(lane), -step.length, &batch.strain_rate.lane(lane));
        let strain = if self.is_implicit { batch.strain } else { Pack::from_lanes(before) };
        isotropic::add_stresses(&law.tensor, 1.0, &strain, &batch.integrity, &mut batch.stress);
    }
}
