use super::{
    Blend, Curvature, Effect, Energy, History, Phases, Step, StressError, Tangents,
    cell_history::CellHistory, isotropic,
};
use crate::{
    lanes::Pack,
    material::{ByMaterial, Extrapolated, Returned, Tangent, Viscoplasticity},
    space::{Batch, CellRun, Needs},
    tensor::{Mandel, add_scaled, dot},
};

/// Viscoplastic flow at the end of the step: `H_n = H~ + k' G(s_n)` with `s_n = E e(u_n) + H_n`, solved in each cell by the
/// law's return mapping, and the viscoplastic strain that hardening cells accumulate. Of the flow `H_{n-1} - H~` that a two-step
/// formula extrapolates a cell takes the share that [`Viscoplasticity::continue_flow`] finds: what does not yield keeps
/// `H_n = H_{n-1}`. A cell that did not flow in the step before starts with implicit Euler, as a run does.
#[derive(Debug)]
pub struct ViscoplasticFlow<const S: usize> {
    laws: ByMaterial<Viscoplasticity>,
    stress: CellHistory<S>,
    accumulated: Option<CellHistory<1>>,
    blend: Blend,
    step_length: f64,
}

impl<const S: usize> ViscoplasticFlow<S> {
    /// No history yet, for the cells of these runs whose material has a law; `two_steps` are kept if the scheme blends.
    pub fn new(laws: ByMaterial<Viscoplasticity>, runs: &[CellRun], two_steps: bool) -> Self {
        let flows = |material: usize| laws.get(material).is_some();
        let hardens = |material: usize| laws.get(material).is_some_and(Viscoplasticity::hardens);
        let mut stress = CellHistory::new("viscoplastic_history", runs, flows);
        let mut accumulated = laws
            .laws()
            .any(Viscoplasticity::hardens)
            .then(|| CellHistory::new("equivalent_viscoplastic_strain", runs, hardens));
        if two_steps {
            stress.keep_earlier("previous_viscoplastic_history");
            accumulated.iter_mut().for_each(|a| a.keep_earlier("previous_equivalent_viscoplastic_strain"));
        }
        Self { laws, stress, accumulated, blend: Blend::euler(0.0), step_length: 0.0 }
    }

    /// Lets each cell of the batch flow; `visit` gets the cell's lane, its law, the stress without flow and what flow made of
    /// it.
    #[inline(always)]
    fn advance<const D: usize>(
        &mut self,
        batch: &mut Batch<D, S>,
        mut tangents: Option<&mut Tangents>,
        mut visit: impl FnMut(&mut Batch<D, S>, usize, &Viscoplasticity, &Mandel<S>, Option<&Returned<S>>),
    ) {
        let Some(law) = self.laws.get(batch.material) else { return };
        let Some(&converged) = self.stress.converged(batch.number) else { return };
        let Blend { length, earlier, .. } = self.blend;
        let mut accumulated = self.accumulated.as_mut().filter(|_| law.hardens());
        for lane in 0..batch.count {
            let history = converged.lane(lane);
            let elastic = add_scaled(&law.elasticity().apply(&batch.strain.lane(lane)), 1.0, &history);
            let before = accumulated.as_ref().and_then(|a| a.converged(batch.number));
            let before = before.map_or(0.0, |before| before.0[0][lane]);
            let change = if earlier == 0.0 { [0.0; S] } else { self.stress.last_change(batch.number, lane) };
            let mut tangent = [[0.0; S]; S];
            let wanted = tangents.is_some().then_some(&mut tangent);
            let found = if change == [0.0; S] {
                law.return_stress(&elastic, self.step_length, before, wanted).map(|found| (found, true))
            } else {
                let flow = law.elasticity().solve(&change.map(|change| earlier * change));
                let [growth] = accumulated.as_ref().map_or([0.0], |a| a.last_change(batch.number, lane));
                let last = Extrapolated { flow, growth: -earlier * growth };
                law.continue_flow(&elastic, &last, length, before, wanted)
            };
            let (mut after, mut total) = (history, before);
            if let Some((found, symmetric)) = &found {
                after = add_scaled(&history, -1.0, &law.elasticity().apply(&found.flow));
                total = found.accumulated;
                if let Some(tangents) = &mut tangents {
                    tangents.push(batch.first + lane, &loss(law, &tangent, length), *symmetric);
                }
            }
            self.stress.set_trial(batch.number, lane, after);
            if let Some(accumulated) = &mut accumulated {
                accumulated.set_trial(batch.number, lane, [total]);
            }
            visit(batch, lane, law, &elastic, found.as_ref().map(|(found, _)| found));
        }
    }
}

/// Adds to the stress of a cell by its lane.
fn add_to<const S: usize>(stresses: &mut Pack<S>, lane: usize, added: &Mandel<S>) {
    let sum = add_scaled(&stresses.lane(lane), 1.0, added);
    stresses.set(lane, sum);
}

/// `(T - I) k' E`: what flow takes from the derivative of the stress by the strain rate.
fn loss<const S: usize>(law: &Viscoplasticity, tangent: &Tangent<S>, length: f64) -> Tangent<S> {
    // E is symmetric, so that it may be applied to the rows.
    std::array::from_fn(|i| {
        let mut row = tangent[i];
        row[i] -= 1.0;
        law.elasticity().apply(&row).map(|value| length * value)
    })
}

impl<const D: usize, const S: usize> Effect<D, S> for ViscoplasticFlow<S> {
    fn name(&self) -> &'static str {
        "viscoplasticity"
    }

    fn phases(&self) -> Phases {
        let strain = Needs { strain: true, ..Needs::default() };
        let none = Needs::default();
        Phases {
            explicit: Some(none),
            energy: Some(strain),
            stress: Some(none),
            error: Some(strain),
            ..Phases::default()
        }
    }

    fn is_everywhere(&self) -> bool {
        self.laws.is_everywhere()
    }

    fn begin(&mut self, blend: Blend, length: f64) {
        (self.blend, self.step_length) = (blend, length);
    }

    fn add_explicit(&mut self, _step: Step, batch: &mut Batch<D, S>, _energy: &mut Energy) {
        let Some(history) = self.stress.converged(batch.number) else { return };
        isotropic::add_histories(history, &batch.integrity, &mut batch.stress);
    }

    fn flows(&self) -> bool {
        true
    }

    fn add_flow(&mut self, batch: &mut Batch<D, S>, tangents: Option<&mut Tangents>) -> bool {
        let mut any = false;
        self.advance(batch, tangents, |batch, lane, law, _, found| {
            if let Some(found) = found {
                add_to(&mut batch.stress, lane, &law.elasticity().apply(&found.flow));
                any = true;
            }
        });
        any
    }

    fn has_symmetric_tangent(&self) -> bool {
        self.laws.laws().all(Viscoplasticity::has_symmetric_tangent::<S>)
    }

    fn add_implicit_energy(&mut self, step: Step, batch: &mut Batch<D, S>, energy: &mut Energy) {
        let Some(&converged) = self.stress.converged(batch.number) else { return };
        let two_steps = self.blend.earlier != 0.0;
        self.advance(batch, None, |batch, lane, law, elastic, found| {
            let elasticity = law.elasticity();
            let stress = found.map_or(*elastic, |found| found.stress);
            let before = batch.strain_before.lane(lane);
            let change = add_scaled(&batch.strain.lane(lane), -1.0, &before);
            let before = add_scaled(&elasticity.apply(&before), 1.0, &converged.lane(lane));
            let jump = add_scaled(&stress, -1.0, &before);
            let beside = add_scaled(&change, -step.length, &batch.strain_rate.lane(lane));
            let volume = batch.cells.volume[lane];
            let taken = found.map_or(0.0, |found| dot(&stress, &found.flow));
            // Of second order with the formula. What it extrapolates beyond the rest of the stress gives back, and is its own.
            let with = |found: &Returned<S>| 0.5 * (taken + dot(&before, &found.flow));
            let dissipated = found.filter(|_| two_steps).map_or(taken, with).max(0.0);
            energy.viscoplastic += volume * dissipated;
            let own = dot(&stress, &beside) - 0.5 * elasticity.inverse_square(&jump) + (dissipated - taken);
            energy.numerical += volume * own;
        });
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
        error.add_flow(&self.laws, &self.stress, curvature, batch);
    }

    fn keep_earlier(&mut self) {
        self.stress.keep_earlier("previous_viscoplastic_history");
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
