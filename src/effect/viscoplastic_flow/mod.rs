mod explicit;
mod implicit;

use super::{
    Blend, Curvature, Effect, Energy, History, Phases, Step, StressError, Tangents,
    cell_history::CellHistory, isotropic,
};
use crate::{
    material::{ByMaterial, Flow, FlowLaw},
    space::{Batch, CellRun, Integrity, Needs},
};

/// Viscoplastic flow, by the stress `H` that it leaves in the elastic stress `E e(u) + H`, one tensor for each cell that flows, and the
/// viscoplastic strain that hardening cells accumulate.
#[derive(Debug)]
pub struct ViscoplasticFlow<const S: usize> {
    laws: ByMaterial<FlowLaw>,
    stress: CellHistory<S>,
    accumulated: Option<CellHistory<1>>,
    update: Update,
}

/// Where in a step cells flow.
#[derive(Debug)]
enum Update {
    /// At its start; with power laws, the fastest relaxation in 1/s at the stresses met since it was asked for.
    Explicit { fastest: Option<f64> },
    /// At its end: how the step starts, and its length in s.
    Implicit { blend: Blend, length: f64 },
}

impl<const S: usize> ViscoplasticFlow<S> {
    /// No history yet, for the cells of these runs whose material has a law, which flow at the end of steps or at their start.
    pub fn new(laws: ByMaterial<FlowLaw>, runs: &[CellRun], is_implicit: bool) -> Self {
        let flows = |material: usize| laws.get(material).is_some();
        let hardens = |material: usize| laws.get(material).is_some_and(FlowLaw::hardens);
        let stress = CellHistory::new("viscoplastic_history", runs, flows);
        let accumulated = laws
            .laws()
            .any(FlowLaw::hardens)
            .then(|| CellHistory::new("equivalent_viscoplastic_strain", runs, hardens));
        let update = if is_implicit {
            Update::Implicit { blend: Blend::euler(0.0), length: 0.0 }
        } else {
            Update::Explicit { fastest: laws.laws().any(FlowLaw::is_power_law).then_some(0.0) }
        };
        Self { laws, stress, accumulated, update }
    }

    fn is_implicit(&self) -> bool {
        matches!(self.update, Update::Implicit { .. })
    }
}

impl<const D: usize, const S: usize> Effect<D, S> for ViscoplasticFlow<S> {
    fn name(&self) -> &'static str {
        "viscoplasticity"
    }

    fn phases(&self) -> Phases {
        let strain = Needs { strain: true, ..Needs::default() };
        let start = Needs { strain_rate: true, ..strain };
        Phases {
            explicit: Some(if self.is_implicit() { Needs::default() } else { start }),
            energy: Some(strain),
            stress: Some(Needs::default()),
            error: Some(strain),
            ..Phases::default()
        }
    }

    fn is_everywhere(&self) -> bool {
        self.laws.is_everywhere()
    }

    fn add_elastic_stress(&self, batch: &mut Batch<D, S>) {
        let Some(history) = self.stress.converged(batch.number) else { return };
        isotropic::add_histories(history, &Integrity::default(), &mut batch.elastic_stress);
    }

    fn add_explicit(&mut self, step: Step, batch: &mut Batch<D, S>, energy: &mut Energy) {
        if self.is_implicit() {
            let Some(history) = self.stress.converged(batch.number) else { return };
            return isotropic::add_histories(history, &batch.integrity, &mut batch.stress);
        }
        let rate = self.advance_explicitly(step, batch, energy);
        if let Update::Explicit { fastest: Some(fastest) } = &mut self.update {
            *fastest = fastest.max(rate);
        }
    }

    fn begin(&mut self, blend: Blend, length: f64) {
        self.update = Update::Implicit { blend, length };
    }

    fn flows(&self) -> bool {
        self.is_implicit()
    }

    fn add_flow(&mut self, batch: &mut Batch<D, S>, tangents: Option<&mut Tangents>) -> bool {
        let Update::Implicit { blend, length } = self.update else { return false };
        self.advance_implicitly((blend, length), batch, tangents)
    }

    fn has_symmetric_tangent(&self) -> bool {
        self.laws.laws().all(FlowLaw::has_symmetric_tangent::<S>)
    }

    fn add_implicit_energy(&mut self, step: Step, batch: &mut Batch<D, S>, energy: &mut Energy) {
        if let Update::Implicit { blend, .. } = self.update {
            self.add_energy_of_implicit_flow((blend, step), batch, energy);
        }
    }

    fn add_energy(&self, _step: Step, batch: &Batch<D, S>, energy: &mut Energy) {
        let Some(law) = self.laws.get(batch.material) else { return };
        let Some(history) = self.stress.converged(batch.number) else { return };
        let (strain, integrity) = (&batch.strain, &batch.integrity);
        energy.elastic +=
            0.5 * isotropic::inverse_square(law.elasticity(), batch.cells, integrity, strain, history);
    }

    fn add_stress(&self, _step: Step, batch: &mut Batch<D, S>) {
        let Some(history) = self.stress.converged(batch.number) else { return };
        isotropic::add_histories(history, &batch.integrity, &mut batch.stress);
    }

    fn add_error(&self, curvature: Curvature, batch: &mut Batch<D, S>, error: &mut StressError) {
        let Some(law) = self.laws.get(batch.material) else { return };
        let Some(histories) = self.stress.last_three(batch.number) else { return };
        let cells = (batch.cells, &batch.integrity);
        error.add_history(law.elasticity(), cells, &batch.strain, curvature, histories);
    }

    fn keep_earlier(&mut self) {
        self.stress.keep_earlier("previous_viscoplastic_history");
        if self.is_implicit() {
            let accumulated = self.accumulated.iter_mut();
            accumulated.for_each(|a| a.keep_earlier("previous_equivalent_viscoplastic_strain"));
        }
    }

    fn flow_step_bound(&self) -> Option<f64> {
        let bounds = self.laws.laws().map(|law| 2.0 / law.fastest_rate::<S>(1.0));
        bounds.reduce(f64::min).filter(|_| !self.is_implicit())
    }

    fn has_power_law(&self) -> bool {
        matches!(self.update, Update::Explicit { fastest: Some(_) })
    }

    fn take_fastest_flow(&mut self) -> Option<f64> {
        let Update::Explicit { fastest } = &mut self.update else { return None };
        fastest.as_mut().map(std::mem::take)
    }

    fn commit(&mut self) {
        self.stress.commit();
        self.accumulated.iter_mut().for_each(CellHistory::commit);
    }

    fn histories(&self) -> Vec<History<'_>> {
        let accumulated = self.accumulated.as_ref().map(CellHistory::history);
        std::iter::once(self.stress.history()).chain(accumulated).collect()
    }

    fn earlier_histories(&self) -> Vec<History<'_>> {
        let accumulated = self.accumulated.as_ref().and_then(CellHistory::earlier_history);
        self.stress.earlier_history().into_iter().chain(accumulated).collect()
    }

    fn restore(&mut self, name: &str, values: &[f64]) {
        self.stress.restore(name, values);
        self.accumulated.iter_mut().for_each(|history| history.restore(name, values));
    }
}
