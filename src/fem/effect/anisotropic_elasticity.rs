use super::{
    Curvature, ELASTIC, Effect, Energy, Evaluation, NUMERICAL, Outcome, Phases, Step, StressError, Term,
    anisotropic::{add_stresses, square},
};
use crate::{
    fem::space::{Batch, Needs},
    laws::material::{Anisotropic, ByMaterial},
    linear_algebra::{
        simd::Pack,
        tensor::{add_scaled, dot},
    },
};

/// Elastic stress of materials that are not isotropic, as that of [`Elasticity`](super::Elasticity); nothing weakens them.
#[derive(Debug)]
pub struct AnisotropicElasticity {
    /// The elastic tensors in Pa.
    pub law: ByMaterial<Anisotropic>,
}

impl<const D: usize, const S: usize> Effect<D, S> for AnisotropicElasticity {
    fn name(&self) -> &'static str {
        "anisotropic_elasticity"
    }

    fn phases(&self, at: Evaluation) -> Phases {
        let strain = Needs { strain: true, ..Needs::default() };
        let after = Needs { strain_rate: at == Evaluation::Converged, ..strain };
        Phases {
            start: Some(strain),
            energy: Some(after),
            stress: Some(after),
            error: Some(strain),
            ..Phases::default()
        }
    }

    fn term(&self) -> Term<'_> {
        Term::Anisotropic(&self.law)
    }

    fn evaluate(&mut self, _: Evaluation, _: Step, batch: &mut Batch<D, S>, _: &mut Outcome) {
        let Some(tensor) = self.law.get(batch.material) else { return };
        add_stresses(tensor, 1.0, &batch.strain, &mut batch.stress);
    }

    fn add_elastic_stress(&self, batch: &mut Batch<D, S>) {
        let Some(tensor) = self.law.get(batch.material) else { return };
        add_stresses(tensor, 1.0, &batch.strain, &mut batch.elastic_stress);
    }

    fn add_stress(&self, at: Evaluation, step: Step, batch: &mut Batch<D, S>) {
        let Some(tensor) = self.law.get(batch.material) else { return };
        let before = |lane| add_scaled(&batch.strain.lane(lane), -step.length, &batch.strain_rate.lane(lane));
        let is_lagged = at == Evaluation::Converged;
        let strain = if is_lagged { Pack::from_lanes(before) } else { batch.strain };
        add_stresses(tensor, 1.0, &strain, &mut batch.stress);
    }

    fn add_energy(&self, at: Evaluation, step: Step, batch: &Batch<D, S>, energy: &mut Energy) {
        let Some(tensor) = self.law.get(batch.material) else { return };
        energy[ELASTIC] += 0.5 * square(tensor, batch, |lane| batch.strain.lane(lane));
        if at == Evaluation::Converged {
            let rates = square(tensor, batch, |lane| batch.strain_rate.lane(lane));
            energy[NUMERICAL] += 0.5 * step.length * step.length * rates;
        }
    }

    fn add_step_energy(&self, _: Evaluation, step: Step, batch: &Batch<D, S>, energy: &mut Energy) {
        let Some(tensor) = self.law.get(batch.material) else { return };
        for lane in 0..batch.count {
            let strain = batch.strain.lane(lane);
            let change = add_scaled(&strain, -1.0, &batch.strain_before.lane(lane));
            let beside = add_scaled(&change, -step.length, &batch.strain_rate.lane(lane));
            let jump = 0.5 * dot(&change, &tensor.apply(&change));
            let work = dot(&tensor.apply(&strain), &beside);
            energy[NUMERICAL] += batch.cells.volume[lane] * (work - jump);
        }
    }

    fn add_error(&self, _: Curvature, batch: &mut Batch<D, S>, error: &mut StressError) {
        let Some(tensor) = self.law.get(batch.material) else { return };
        error.size += square(tensor, batch, |lane| batch.strain.lane(lane));
    }
}
