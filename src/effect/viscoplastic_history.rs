use super::{Effect, Energy, History, Phases, Step};
use crate::{
    material::{ByMaterial, Perzyna},
    space::{Batch, CellRun, Needs},
    tensor::{Mandel, add_scaled, dot},
};
use std::borrow::Cow;

/// The running sum `H_n = H_{n-1} + k G(s_{n-1})` of (24), one tensor for each cell that flows, converged and trial.
///
/// `s_{n-1} = E e(u_{n-2}) + H_{n-1}` is not stored: `u_{n-2} = u_{n-1} - k_{n-1} v_{n-1}`.
#[derive(Debug)]
pub struct ViscoplasticHistory<const S: usize> {
    laws: ByMaterial<Perzyna>,
    /// Each run of cells with the position of its first history; runs without a law have none.
    runs: Vec<(CellRun, usize)>,
    converged: Vec<Mandel<S>>,
    trial: Vec<Mandel<S>>,
}

impl<const S: usize> ViscoplasticHistory<S> {
    /// No history yet, for the cells of these runs whose material has a law.
    pub fn new(laws: ByMaterial<Perzyna>, runs: &[CellRun]) -> Self {
        let mut kept = 0;
        let runs = runs
            .iter()
            .map(|run| {
                let start = kept;
                kept += if laws.get(run.material).is_some() { run.count } else { 0 };
                (*run, start)
            })
            .collect();
        Self { laws, runs, converged: vec![[0.0; S]; kept], trial: vec![[0.0; S]; kept] }
    }

    /// Local number of the first cell, position of its history and number of cells, for the runs with a law.
    fn places(&self) -> impl Iterator<Item = (usize, usize, usize)> {
        let kept = self.runs.iter().filter(|(run, _)| self.laws.get(run.material).is_some());
        kept.map(|(run, start)| (run.first, *start, run.count))
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

    fn is_everywhere(&self) -> bool {
        self.laws.is_everywhere()
    }

    fn add_explicit(&mut self, step: Step, batch: &mut Batch<D, S>, energy: &mut Energy) {
        let Some(law) = self.laws.get(batch.material) else { return };
        let elasticity = &law.elasticity;
        let start = self.runs[batch.number].1;
        let range = start..start + batch.cells.len();
        let histories = self.converged[range.clone()].iter().zip(&mut self.trial[range]);
        for (at, (converged, trial)) in histories.enumerate() {
            let lag = elasticity.apply(&batch.strain_rate[at]);
            let upper = add_scaled(&elasticity.apply(&batch.strain[at]), 1.0, converged);
            let lagged = add_scaled(&upper, -step.previous_length, &lag);
            let flow = law.strain_rate(&lagged);
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
        let Some(law) = self.laws.get(batch.material) else { return };
        let histories = &self.converged[self.runs[batch.number].1..];
        for (at, cell) in batch.cells.iter().enumerate() {
            let stress = add_scaled(&law.elasticity.apply(&batch.strain[at]), 1.0, &histories[at]);
            energy.elastic += 0.5 * cell.volume * law.elasticity.inverse_square(&stress);
        }
    }

    fn add_stress(&self, _step: Step, batch: &mut Batch<D, S>) {
        if self.laws.get(batch.material).is_none() {
            return;
        }
        let histories = &self.converged[self.runs[batch.number].1..];
        for at in 0..batch.cells.len() {
            batch.stress[at] = add_scaled(&batch.stress[at], 1.0, &histories[at]);
        }
    }

    fn flow_step_bound(&self) -> Option<f64> {
        let bound = |law: &Perzyna| 4.0 * law.relaxation / law.elasticity.largest_modulus::<S>();
        self.laws.laws().map(bound).reduce(f64::min)
    }

    fn commit(&mut self) {
        std::mem::swap(&mut self.converged, &mut self.trial);
    }

    fn histories(&self) -> Vec<History<'_>> {
        let values = if self.laws.is_everywhere() {
            Cow::Borrowed(self.converged.as_flattened())
        } else {
            let cells = self.runs.last().map_or(0, |(run, _)| run.first + run.count);
            let mut all = vec![[0.0; S]; cells];
            for (cell, start, count) in self.places() {
                all[cell..cell + count].copy_from_slice(&self.converged[start..start + count]);
            }
            Cow::Owned(all.into_flattened())
        };
        let bytes = 2 * size_of_val(&self.converged[..]);
        vec![History { name: "viscoplastic_history", width: S, values, bytes }]
    }

    fn restore(&mut self, _name: &str, values: &[f64]) {
        let mut converged = std::mem::take(&mut self.converged);
        for (cell, start, count) in self.places() {
            converged[start..start + count]
                .as_flattened_mut()
                .copy_from_slice(&values[cell * S..][..count * S]);
        }
        self.converged = converged;
    }
}
