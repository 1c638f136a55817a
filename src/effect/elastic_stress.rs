use super::{Effect, Energy, Form, Phases, Step};
use crate::{
    material::{ByMaterial, Isotropic},
    space::{Batch, Needs},
    tensor::{add_scaled, dot},
};

/// Elastic stress of the displacement before the step: `E e(u_{n-1})` in (24).
#[derive(Debug)]
pub struct ElasticStress {
    /// What the elastic materials are.
    pub law: ByMaterial<ElasticLaw>,
}

/// An elastic material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ElasticLaw {
    /// The elastic tensor `E` in Pa.
    pub tensor: Isotropic,
    /// Whether a history adds to the elastic stress, which then accounts for its energy.
    pub with_history: bool,
}

impl<const D: usize, const S: usize> Effect<D, S> for ElasticStress {
    fn name(&self) -> &'static str {
        "elasticity"
    }

    fn phases(&self) -> Phases {
        let strain = Needs { strain: true, ..Needs::default() };
        let both = Needs { strain_rate: true, ..strain };
        Phases { explicit: Some(strain), energy: Some(both), stress: Some(both), ..Phases::default() }
    }

    fn is_everywhere(&self) -> bool {
        self.law.is_everywhere()
    }

    fn add_elastic_stress(&self, batch: &mut Batch<D, S>) {
        let Some(law) = self.law.get(batch.material) else { return };
        for (stress, strain) in batch.elastic_stress.iter_mut().zip(&batch.strain).take(batch.cells.len()) {
            *stress = add_scaled(stress, 1.0, &law.tensor.apply(strain));
        }
    }

    fn add_explicit(&mut self, _step: Step, batch: &mut Batch<D, S>, _energy: &mut Energy) {
        let Some(law) = self.law.get(batch.material) else { return };
        let stresses = batch.stress.iter_mut().zip(&batch.strain).take(batch.cells.len());
        for (at, (stress, strain)) in stresses.enumerate() {
            *stress = add_scaled(stress, batch.integrity.of(at), &law.tensor.apply(strain));
        }
    }

    fn add_energy(&self, step: Step, batch: &Batch<D, S>, energy: &mut Energy) {
        let Some(law) = self.law.get(batch.material) else { return };
        let strains = batch.strain.iter().zip(&batch.strain_rate);
        for (at, (cell, (strain, rate))) in batch.cells.iter().zip(strains).enumerate() {
            let volume = batch.integrity.of(at) * cell.volume;
            if !law.with_history {
                energy.elastic += 0.5 * volume * dot(strain, &law.tensor.apply(strain));
            }
            let lag = dot(rate, &law.tensor.apply(rate));
            energy.numerical += 0.5 * volume * step.length * step.length * lag;
        }
    }

    fn form(&self) -> Option<Form> {
        Some(Form::Elasticity)
    }

    fn tensor(&self, material: usize) -> Option<Isotropic> {
        self.law.get(material).map(|law| law.tensor)
    }

    fn add_form(&self, batch: &mut Batch<D, S>) {
        let Some(law) = self.law.get(batch.material) else { return };
        for (stress, rate) in batch.stress.iter_mut().zip(&batch.strain_rate).take(batch.cells.len()) {
            *stress = add_scaled(stress, -1.0, &law.tensor.apply(rate));
        }
    }

    fn add_stress(&self, step: Step, batch: &mut Batch<D, S>) {
        let Some(law) = self.law.get(batch.material) else { return };
        let strains = batch.strain.iter().zip(&batch.strain_rate).take(batch.cells.len());
        for (at, (stress, (strain, rate))) in batch.stress.iter_mut().zip(strains).enumerate() {
            let before = add_scaled(strain, -step.length, rate);
            *stress = add_scaled(stress, batch.integrity.of(at), &law.tensor.apply(&before));
        }
    }
}
