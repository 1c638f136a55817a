use super::{
    Curvature, Effect, ElasticLaw, ElasticTensor, Energy, EnergyKind, Evaluation, NUMERICAL, Outcome, Phases,
    Role, Step, StressError, Term, linear,
};
use crate::{
    fem::space::{Batch, Integrity, Needs},
    laws::material::{ByMaterial, Isotropic},
    linear_algebra::{
        simd::Pack,
        tensor::{add_scaled, dot},
    },
};

/// Elastic energy.
pub const ELASTIC: EnergyKind = EnergyKind::new(
    1,
    Role::Stored,
    "elastic_energy",
    "energy stored by elasticity and in springs of supports",
);

/// Elastic stress `E e(u)`: of the converged displacement, `E e(u_{n-1})` in (24), or of that at the end of the step, `u_n = u~ + k' v_n`,
/// where `E e(u~)` is known at the start of the step and `k' E` is part of the matrix.
#[derive(Debug)]
pub struct Elasticity<T = Isotropic> {
    /// The elastic materials.
    pub law: ByMaterial<ElasticLaw<T>>,
}

impl<T: ElasticTensor, const D: usize, const S: usize> Effect<D, S> for Elasticity<T> {
    fn name(&self) -> &'static str {
        T::ELASTICITY
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
        T::term(&self.law)
    }

    fn evaluate(&mut self, _: Evaluation, _: Step, batch: &mut Batch<D, S>, _: &mut Outcome) {
        let Some(law) = self.law.get(batch.material) else { return };
        linear::add_stresses(&law.tensor, 1.0, &batch.strain, &batch.integrity, &mut batch.stress);
    }

    fn add_elastic_stress(&self, batch: &mut Batch<D, S>) {
        let Some(law) = self.law.get(batch.material) else { return };
        let sound = Integrity::default();
        linear::add_stresses(&law.tensor, 1.0, &batch.strain, &sound, &mut batch.elastic_stress);
    }

    fn add_stress(&self, at: Evaluation, step: Step, batch: &mut Batch<D, S>) {
        let Some(law) = self.law.get(batch.material) else { return };
        let before = |lane| add_scaled(&batch.strain.lane(lane), -step.length, &batch.strain_rate.lane(lane));
        let is_lagged = at == Evaluation::Converged;
        let strain = if is_lagged { Pack::from_lanes(before) } else { batch.strain };
        linear::add_stresses(&law.tensor, 1.0, &strain, &batch.integrity, &mut batch.stress);
    }

    fn add_energy(&self, at: Evaluation, step: Step, batch: &Batch<D, S>, energy: &mut Energy) {
        let Some(law) = self.law.get(batch.material) else { return };
        let square = |strains| linear::square(&law.tensor, batch.cells, &batch.integrity, strains);
        if !law.with_history {
            energy[ELASTIC] += 0.5 * square(&batch.strain);
        }
        if at == Evaluation::Converged {
            energy[NUMERICAL] += 0.5 * step.length * step.length * square(&batch.strain_rate);
        }
    }

    fn add_step_energy(&self, _: Evaluation, step: Step, batch: &Batch<D, S>, energy: &mut Energy) {
        let Some(law) = self.law.get(batch.material).filter(|law| !law.with_history) else { return };
        let share = batch.integrity.shares();
        for lane in 0..batch.count {
            let strain = batch.strain.lane(lane);
            let change = add_scaled(&strain, -1.0, &batch.strain_before.lane(lane));
            let beside = add_scaled(&change, -step.length, &batch.strain_rate.lane(lane));
            let jump = 0.5 * dot(&change, &law.tensor.stress(&change));
            let work = dot(&law.tensor.stress(&strain), &beside);
            energy[NUMERICAL] += share[lane] * batch.cells.volume[lane] * (work - jump);
        }
    }

    fn add_error(&self, _: Curvature, batch: &mut Batch<D, S>, error: &mut StressError) {
        let Some(law) = self.law.get(batch.material).filter(|law| !law.with_history) else { return };
        error.size += linear::square(&law.tensor, batch.cells, &batch.integrity, &batch.strain);
    }
}
