use super::{Effect, Energy, History, Phases, Step};
use crate::{
    material::Perzyna,
    space::{Batch, Needs},
    tensor::{Mandel, add_scaled, dot},
};

/// The running sum `H_n = H_{n-1} + k G(s_{n-1})` of (24), one tensor a cell, converged and trial.
///
/// `s_{n-1} = E e(u_{n-2}) + H_{n-1}` is not stored: `u_{n-2} = u_{n-1} - k_{n-1} v_{n-1}`.
#[derive(Debug)]
pub struct ViscoplasticHistory<const S: usize> {
    law: Perzyna,
    converged: Vec<Mandel<S>>,
    trial: Vec<Mandel<S>>,
}

impl<const S: usize> ViscoplasticHistory<S> {
    /// No history yet, for this many cells.
    pub fn new(law: Perzyna, cells: usize) -> Self {
        Self { law, converged: vec![[0.0; S]; cells], trial: vec![[0.0; S]; cells] }
    }
}

impl<const D: usize, const S: usize> Effect<D, S> for ViscoplasticHistory<S> {
    fn name(&self) -> &'static str {
        "viscoplasticity"
    }

    fn phases(&self) -> Phases {
        let strain = Needs { strain: true, ..Needs::default() };
        let both = Needs { strain_rate: true, ..strain };
        Phases { matrix: false, explicit: Some(both), energy: Some(strain), stress: Some(Needs::default()) }
    }

    fn add_explicit(&mut self, step: Step, batch: &mut Batch<D, S>, energy: &mut Energy) {
        let elasticity = &self.law.elasticity;
        let range = batch.first..batch.first + batch.cells.len();
        let histories = self.converged[range.clone()].iter().zip(&mut self.trial[range]);
        for (at, (converged, trial)) in histories.enumerate() {
            let lag = elasticity.apply(&batch.strain_rate[at]);
            let upper = add_scaled(&elasticity.apply(&batch.strain[at]), 1.0, converged);
            let lagged = add_scaled(&upper, -step.previous_length, &lag);
            let flow = self.law.strain_rate(&lagged);
            let release = elasticity.apply(&flow);
            *trial = add_scaled(converged, -step.length, &release);
            batch.stress[at] = add_scaled(&batch.stress[at], 1.0, trial);
            let weight = batch.cells[at].volume * step.length;
            energy.viscoplastic += weight * dot(&lagged, &flow);
            energy.numerical +=
                weight * (0.5 * step.length * dot(&release, &flow) - step.previous_length * dot(&lag, &flow));
        }
    }

    fn add_energy(&self, _step: Step, batch: &Batch<D, S>, energy: &mut Energy) {
        for (at, cell) in batch.cells.iter().enumerate() {
            let history = &self.converged[batch.first + at];
            let stress = add_scaled(&self.law.elasticity.apply(&batch.strain[at]), 1.0, history);
            energy.elastic += 0.5 * cell.volume * self.law.elasticity.inverse_square(&stress);
        }
    }

    fn add_stress(&self, _step: Step, batch: &mut Batch<D, S>) {
        for at in 0..batch.cells.len() {
            batch.stress[at] = add_scaled(&batch.stress[at], 1.0, &self.converged[batch.first + at]);
        }
    }

    fn flow_step_bound(&self) -> Option<f64> {
        Some(4.0 * self.law.relaxation / self.law.elasticity.largest_modulus::<S>())
    }

    fn commit(&mut self) {
        std::mem::swap(&mut self.converged, &mut self.trial);
    }

    fn history(&self) -> Option<History<'_>> {
        Some(History { name: "viscoplastic_history", width: S, values: self.converged.as_flattened() })
    }

    fn restore(&mut self, values: &[f64]) {
        self.converged.as_flattened_mut().copy_from_slice(values);
    }
}
