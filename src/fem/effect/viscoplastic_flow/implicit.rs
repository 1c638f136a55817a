//! Flow at the end of a step: `H_n = H~ + k' G(s_n)` with `s_n = E e(u_n) + H_n`, solved in each cell by the law's return mapping.
//!
//! Of the flow `H_{n-1} - H~` that a two-step formula extrapolates a cell takes the share that [`FlowLaw::continue_flow`]
//! finds: what does not yield keeps `H_n = H_{n-1}`. A cell that did not flow in the step before starts with implicit Euler, as a run
//! does.

use super::{VISCOPLASTIC, ViscoplasticFlow};
use crate::{
    fem::{
        effect::{Blend, Energy, NUMERICAL, Outcome, Step},
        space::Batch,
    },
    laws::material::{Extrapolated, Flow, FlowLaw, Tangent},
    linear_algebra::{
        simd::Pack,
        tensor::{Mandel, add_scaled, dot},
    },
};

impl<const S: usize> ViscoplasticFlow<S> {
    /// Lets each cell of the batch flow and takes what flow releases from its stresses.
    pub(super) fn advance_implicitly<const D: usize>(
        &mut self,
        blend: Blend,
        step: Step,
        batch: &mut Batch<D, S>,
        outcome: &mut Outcome,
    ) {
        let Some(law) = self.laws.get(batch.material) else { return };
        let Some(&converged) = self.stress.converged(batch.number) else { return };
        let Blend { length, earlier, .. } = blend;
        let mut accumulated = self.accumulated.as_mut().filter(|_| law.hardens());
        for lane in 0..batch.count {
            let history = converged.lane(lane);
            let elastic = add_scaled(&law.elasticity().apply(&batch.strain.lane(lane)), 1.0, &history);
            let before = accumulated.as_ref().and_then(|a| a.converged(batch.number));
            let before = before.map_or(0.0, |before| before.0[0][lane]);
            let change = if earlier == 0.0 { [0.0; S] } else { self.stress.last_change(batch.number, lane) };
            let mut tangent = [[0.0; S]; S];
            let wanted = outcome.tangents.is_some().then_some(&mut tangent);
            let found = if change == [0.0; S] {
                law.return_stress(&elastic, step.length, before, wanted).map(|found| (found, true))
            } else {
                let flow = law.elasticity().solve(&change.map(|change| earlier * change));
                let [growth] = accumulated.as_ref().map_or([0.0], |a| a.last_change(batch.number, lane));
                let last = Extrapolated { flow, growth: -earlier * growth };
                law.continue_flow(&elastic, &last, length, before, wanted)
            };
            let (mut after, mut total) = (history, before);
            if let Some((found, symmetric)) = &found {
                let release = law.elasticity().apply(&found.flow);
                after = add_scaled(&history, -1.0, &release);
                total = found.accumulated;
                add_to(&mut batch.stress, lane, 1.0, &release);
                add_to(&mut batch.elastic_stress, lane, -1.0, &release);
                outcome.has_flowed = true;
                if let Some(tangents) = &mut outcome.tangents {
                    tangents.push(batch.first + lane, &tangent_change(law, &tangent, length), *symmetric);
                }
            }
            self.stress.set_trial(batch.number, lane, after);
            if let Some(accumulated) = &mut accumulated {
                accumulated.set_trial(batch.number, lane, [total]);
            }
        }
    }

    /// Adds the dissipation of flow in a solved step, and the numerical terms of the scheme.
    pub(super) fn add_energy_of_implicit_flow<const D: usize>(
        &self,
        blend: Blend,
        step: Step,
        batch: &Batch<D, S>,
        energy: &mut Energy,
    ) {
        let Some(elasticity) = self.laws.get(batch.material).map(FlowLaw::elasticity) else { return };
        let Some([converged, trial]) = self.stress.both(batch.number) else { return };
        let (share, two_steps) = (batch.integrity.shares(), blend.earlier != 0.0);
        for lane in 0..batch.count {
            let [history, after] = [converged.lane(lane), trial.lane(lane)];
            let [strain, before] = [batch.strain.lane(lane), batch.strain_before.lane(lane)];
            let change = add_scaled(&strain, -1.0, &before);
            let stress = add_scaled(&elasticity.apply(&strain), 1.0, &after);
            let before = add_scaled(&elasticity.apply(&before), 1.0, &history);
            let jump = add_scaled(&stress, -1.0, &before);
            let mismatch = add_scaled(&change, -step.length, &batch.strain_rate.lane(lane));
            let (mut taken, mut dissipated) = (0.0, 0.0);
            if after != history {
                let flow = elasticity.solve(&add_scaled(&history, -1.0, &after));
                taken = dot(&stress, &flow);
                // Trapezoidal, of second order as the formula is. Never negative: the difference is a term of the scheme.
                dissipated = if two_steps { 0.5 * (taken + dot(&before, &flow)) } else { taken }.max(0.0);
            }
            let share = share[lane] * batch.cells.volume[lane];
            energy[VISCOPLASTIC] += share * dissipated;
            let own = dot(&stress, &mismatch) - 0.5 * elasticity.inverse_square(&jump) + (dissipated - taken);
            energy[NUMERICAL] += share * own;
        }
    }
}

/// Adds to the stress of a cell by its lane.
fn add_to<const S: usize>(stresses: &mut Pack<S>, lane: usize, factor: f64, added: &Mandel<S>) {
    let sum = add_scaled(&stresses.lane(lane), factor, added);
    stresses.set(lane, sum);
}

/// `(T - I) k' E`: the change by flow of the derivative of the stress with respect to the strain rate.
fn tangent_change<const S: usize>(law: &FlowLaw, tangent: &Tangent<S>, length: f64) -> Tangent<S> {
    // E is symmetric, so that it may be applied to the rows.
    std::array::from_fn(|i| {
        let mut row = tangent[i];
        row[i] -= 1.0;
        law.elasticity().apply(&row).map(|value| length * value)
    })
}
