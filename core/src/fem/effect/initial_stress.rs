use super::{
    Curvature, ELASTIC, Effect, Energy, Evaluation, NUMERICAL, Outcome, Phases, Step, StressError, linear,
};
use crate::{
    fem::space::{Batch, Integrity, Needs},
    laws::material::{ByMaterial, Isotropic},
    linear_algebra::{
        simd::Pack,
        tensor::{add_scaled, dot},
    },
};

/// A prescribed stress of elastic cells at displacement zero, `s0` in `E e(u) + s0`. Cells that flow start from it as their history.
///
/// The elastic energy is `1/2 (E e + s0) : E^-1 (E e + s0)`: that of the strain, which elasticity accounts for, and the rest.
#[derive(Debug)]
pub struct InitialStress<const S: usize> {
    elasticity: ByMaterial<Isotropic>,
    /// One for each batch; `None` where the material has no such stress.
    stress: Vec<Option<Pack<S>>>,
}

impl<const S: usize> InitialStress<S> {
    /// The stress of each batch, with the elastic tensors of the materials that have it.
    pub fn new(elasticity: ByMaterial<Isotropic>, stress: Vec<Option<Pack<S>>>) -> Self {
        Self { elasticity, stress }
    }

    fn of<const D: usize>(&self, batch: &Batch<D, S>) -> Option<(&Isotropic, &Pack<S>)> {
        Some((self.elasticity.get(batch.material)?, self.stress[batch.number].as_ref()?))
    }

    /// Twice the energy beside that of the strain.
    fn square<const D: usize>(&self, batch: &Batch<D, S>) -> f64 {
        let Some((law, stress)) = self.of(batch) else { return 0.0 };
        let (cells, integrity) = (batch.cells, &batch.integrity);
        linear::inverse_square(law, cells, integrity, &batch.strain, stress)
            - linear::square(law, cells, integrity, &batch.strain)
    }
}

impl<const D: usize, const S: usize> Effect<D, S> for InitialStress<S> {
    fn name(&self) -> &'static str {
        "initial_stress"
    }

    fn phases(&self, _: Evaluation) -> Phases {
        let strain = Some(Needs { strain: true, ..Needs::default() });
        let nothing = Some(Needs::default());
        Phases { start: nothing, energy: strain, stress: nothing, error: strain, ..Phases::default() }
    }

    fn evaluate(&mut self, _: Evaluation, _: Step, batch: &mut Batch<D, S>, _: &mut Outcome) {
        let Some((_, stress)) = self.of(batch) else { return };
        linear::add_histories(stress, &batch.integrity, &mut batch.stress);
    }

    fn add_elastic_stress(&self, batch: &mut Batch<D, S>) {
        let Some((_, stress)) = self.of(batch) else { return };
        linear::add_histories(stress, &Integrity::default(), &mut batch.elastic_stress);
    }

    fn add_stress(&self, _: Evaluation, _: Step, batch: &mut Batch<D, S>) {
        let Some((_, stress)) = self.of(batch) else { return };
        linear::add_histories(stress, &batch.integrity, &mut batch.stress);
    }

    fn add_energy(&self, _: Evaluation, _: Step, batch: &Batch<D, S>, energy: &mut Energy) {
        energy[ELASTIC] += 0.5 * self.square(batch);
    }

    fn add_step_energy(&self, _: Evaluation, step: Step, batch: &Batch<D, S>, energy: &mut Energy) {
        let Some((_, stress)) = self.of(batch) else { return };
        let share = batch.integrity.shares();
        for lane in 0..batch.count {
            let change = add_scaled(&batch.strain.lane(lane), -1.0, &batch.strain_before.lane(lane));
            let beside = add_scaled(&change, -step.length, &batch.strain_rate.lane(lane));
            energy[NUMERICAL] += share[lane] * batch.cells.volume[lane] * dot(&stress.lane(lane), &beside);
        }
    }

    fn add_error(&self, _: Curvature, batch: &mut Batch<D, S>, error: &mut StressError) {
        error.size += self.square(batch);
    }
}
