use super::{Effect, Energy, History, Phases, Step, cell_history::CellHistory};
use crate::{
    material::{ByMaterial, Isotropic, Viscoplasticity},
    space::{Batch, CellRun, Needs},
    tensor::{Mandel, add_scaled, dot},
};

/// The running sum `H_n = H_{n-1} + k G(s_{n-1})` of (24), one tensor for each cell that flows, and the viscoplastic strain
/// that hardening cells accumulate.
///
/// `s_{n-1} = E e(u_{n-2}) + H_{n-1}` is not stored: `u_{n-2} = u_{n-1} - k_{n-1} v_{n-1}`.
#[derive(Debug)]
pub struct ViscoplasticHistory<const S: usize> {
    laws: ByMaterial<Viscoplasticity>,
    stress: CellHistory<S>,
    accumulated: Option<CellHistory<1>>,
}

impl<const S: usize> ViscoplasticHistory<S> {
    /// No history yet, for the cells of these runs whose material has a law.
    pub fn new(laws: ByMaterial<Viscoplasticity>, runs: &[CellRun]) -> Self {
        let flows = |material: usize| laws.get(material).is_some();
        let hardens = |material: usize| laws.get(material).is_some_and(Viscoplasticity::hardens);
        let stress = CellHistory::new("viscoplastic_history", runs, flows);
        let accumulated = laws
            .laws()
            .any(Viscoplasticity::hardens)
            .then(|| CellHistory::new("equivalent_viscoplastic_strain", runs, hardens));
        Self { laws, stress, accumulated }
    }

    /// Advances a batch by the strain rates that `flow` gives for some cells of the batch from the first one on and their
    /// stresses.
    #[inline(always)]
    fn advance<const D: usize>(
        stress: &mut CellHistory<S>,
        elasticity: &Isotropic,
        step: Step,
        batch: &mut Batch<D, S>,
        energy: &mut Energy,
        mut flow: impl FnMut(usize, &[Mandel<S>]) -> [Mandel<S>; TOGETHER],
    ) {
        let (converged, trial) = stress.both(batch.number);
        for first in (0..converged.len()).step_by(TOGETHER) {
            let cells = first..converged.len().min(first + TOGETHER);
            let [mut lag, mut lagged] = [[[0.0; S]; TOGETHER]; 2];
            for (i, at) in cells.clone().enumerate() {
                lag[i] = elasticity.apply(&batch.strain_rate[at]);
                let upper = add_scaled(&elasticity.apply(&batch.strain[at]), 1.0, &converged[at]);
                lagged[i] = add_scaled(&upper, -step.previous_length, &lag[i]);
            }
            let flow = flow(first, &lagged[..cells.len()]);
            for (i, at) in cells.enumerate() {
                let release = elasticity.apply(&flow[i]);
                trial[at] = add_scaled(&converged[at], -step.length, &release);
                let share = batch.integrity.of(at);
                batch.stress[at] = add_scaled(&batch.stress[at], share, &trial[at]);
                let weight = share * batch.cells[at].volume * step.length;
                energy.viscoplastic += weight * dot(&lagged[i], &flow[i]);
                energy.numerical += weight
                    * (0.5 * step.length * dot(&release, &flow[i])
                        - step.previous_length * dot(&lag[i], &flow[i]));
            }
        }
    }
}

/// Cells whose flow is computed together.
const TOGETHER: usize = 8;

/// Strain rates of a law that knows one cell at a time, given its position among the stresses.
#[inline(always)]
fn one_by_one<const S: usize>(
    stresses: &[Mandel<S>],
    mut rate: impl FnMut(usize, &Mandel<S>) -> Mandel<S>,
) -> [Mandel<S>; TOGETHER] {
    let mut rates = [[0.0; S]; TOGETHER];
    stresses.iter().enumerate().for_each(|(i, stress)| rates[i] = rate(i, stress));
    rates
}

impl<const D: usize, const S: usize> Effect<D, S> for ViscoplasticHistory<S> {
    fn name(&self) -> &'static str {
        "viscoplasticity"
    }

    fn phases(&self) -> Phases {
        let strain = Needs { strain: true, ..Needs::default() };
        let both = Needs { strain_rate: true, ..strain };
        Phases {
            explicit: Some(both),
            energy: Some(strain),
            stress: Some(Needs::default()),
            ..Phases::default()
        }
    }

    fn is_everywhere(&self) -> bool {
        self.laws.is_everywhere()
    }

    fn add_elastic_stress(&self, batch: &mut Batch<D, S>) {
        for (stress, history) in batch.elastic_stress.iter_mut().zip(self.stress.converged(batch.number)) {
            *stress = add_scaled(stress, 1.0, history);
        }
    }

    fn add_explicit(&mut self, step: Step, batch: &mut Batch<D, S>, energy: &mut Energy) {
        let Some(law) = self.laws.get(batch.material) else { return };
        let (stress, elasticity) = (&mut self.stress, law.elasticity());
        match law {
            Viscoplasticity::Perzyna(law) => {
                Self::advance(stress, elasticity, step, batch, energy, |_, all| law.strain_rates(all));
            }
            Viscoplasticity::Maxwell(law) => {
                let flow = |_, all: &[_]| one_by_one(all, |_, s| law.strain_rate(s));
                Self::advance(stress, elasticity, step, batch, energy, flow);
            }
            Viscoplasticity::DruckerPrager(law) => {
                let flow = |_, all: &[_]| one_by_one(all, |_, s| law.strain_rate(s));
                Self::advance(stress, elasticity, step, batch, energy, flow);
            }
            Viscoplasticity::Hardening(law) => {
                let Some(accumulated) = &mut self.accumulated else { return };
                let (converged, trial) = accumulated.both(batch.number);
                Self::advance(stress, elasticity, step, batch, energy, |first, all| {
                    one_by_one(all, |i, s| {
                        let (rate, growth) = law.strain_rate(s, converged[first + i][0]);
                        trial[first + i][0] = converged[first + i][0] + step.length * growth;
                        rate
                    })
                });
            }
        }
    }

    fn add_energy(&self, _step: Step, batch: &Batch<D, S>, energy: &mut Energy) {
        let Some(law) = self.laws.get(batch.material) else { return };
        let elasticity = law.elasticity();
        for (at, history) in self.stress.converged(batch.number).iter().enumerate() {
            let stress = add_scaled(&elasticity.apply(&batch.strain[at]), 1.0, history);
            let volume = batch.integrity.of(at) * batch.cells[at].volume;
            energy.elastic += 0.5 * volume * elasticity.inverse_square(&stress);
        }
    }

    fn add_stress(&self, _step: Step, batch: &mut Batch<D, S>) {
        let stresses = batch.stress.iter_mut().zip(self.stress.converged(batch.number));
        for (at, (stress, history)) in stresses.enumerate() {
            *stress = add_scaled(stress, batch.integrity.of(at), history);
        }
    }

    fn flow_step_bound(&self) -> Option<f64> {
        self.laws.laws().map(|law| 2.0 / law.fastest_rate::<S>()).reduce(f64::min)
    }

    fn commit(&mut self) {
        self.stress.commit();
        self.accumulated.iter_mut().for_each(CellHistory::commit);
    }

    fn histories(&self) -> Vec<History<'_>> {
        let accumulated = self.accumulated.as_ref().map(CellHistory::history);
        std::iter::once(self.stress.history()).chain(accumulated).collect()
    }

    fn restore(&mut self, name: &str, values: &[f64]) {
        self.stress.restore(name, values);
        self.accumulated.iter_mut().for_each(|history| history.restore(name, values));
    }
}
