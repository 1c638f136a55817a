use super::{Curvature, Effect, Energy, Form, Phases, Step, StressError, isotropic};
use crate::{
    lanes::Pack,
    material::{ByMaterial, Isotropic},
    space::{Batch, Integrity, Needs},
    tensor::add_scaled,
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
        Phases {
            explicit: Some(strain),
            energy: Some(both),
            stress: Some(both),
            error: Some(strain),
            ..Phases::default()
        }
    }

    fn is_everywhere(&self) -> bool {
        self.law.is_everywhere()
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

    fn add_energy(&self, step: Step, batch: &Batch<D, S>, energy: &mut Energy) {
        let Some(law) = self.law.get(batch.material) else { return };
        let square = |strains| isotropic::square(&law.tensor, batch.cells, &batch.integrity, strains);
        if !law.with_history {
            energy.elastic += 0.5 * square(&batch.strain);
        }
        energy.numerical += 0.5 * step.length * step.length * square(&batch.strain_rate);
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
        let before = Pack::from_lanes(|lane| {
            add_scaled(&batch.strain.lane(lane), -step.length, &batch.strain_rate.lane(lane))
        });
        isotropic::add_stresses(&law.tensor, 1.0, &before, &batch.integrity, &mut batch.stress);
    }
}
