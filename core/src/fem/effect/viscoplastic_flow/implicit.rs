//! Flow at the end of a step: `H_n = H~ + k' G(s_n)` with `s_n = E e(u_n) + H_n`, solved in each cell by the law's return mapping.
//!
//! Of the flow `H_{n-1} - H~` that a two-step formula extrapolates a cell takes the share that [`FlowLaw::continue_flow`]
//! finds: what does not yield keeps `H_n = H_{n-1}`. A cell that did not flow in the step before starts with implicit Euler, as a run
//! does.

use super::{ViscoplasticFlow, beyond_back_stress, count};
use crate::{
    fem::{
        effect::{Blend, Outcome, Step},
        space::Batch,
    },
    laws::material::{Extrapolated, Flow, FlowLaw, Isotropic, Tangent},
    linear_algebra::{
        simd::{LANES, Pack},
        tensor::{Mandel, add_scaled, dot},
    },
};
use multiversion::multiversion;

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
        let Some((&converged, trial)) = self.stress.both_mut(batch.number) else { return };
        *trial = converged;
        let mut accumulated = self.accumulated.as_mut().filter(|_| law.hardens());
        let mut before = [0.0; LANES];
        if let Some((converged, trial)) = accumulated.as_mut().and_then(|all| all.both_mut(batch.number)) {
            *trial = *converged;
            [before] = converged.0;
        }
        let (elastic, yielding) = elastic_stresses(law, &batch.strain, &converged, &before);
        let Blend { length, earlier, .. } = blend;
        let mut warm = self.warm[batch.material].as_mut().zip(batch.temperature);
        for lane in (0..batch.count).filter(|&lane| yielding[lane]) {
            let (elastic, before) = (elastic.lane(lane), before[lane]);
            let law = match &mut warm {
                Some((law, temperatures)) => {
                    law.set_temperature(temperatures[lane]);
                    &**law
                }
                None => law,
            };
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
            let Some((found, symmetric)) = found else { continue };
            let release = law.elasticity().apply(&found.flow);
            let after = add_scaled(&converged.lane(lane), -1.0, &release);
            self.stress.set_trial(batch.number, lane, after);
            if let Some(accumulated) = &mut accumulated {
                accumulated.set_trial(batch.number, lane, [found.accumulated]);
            }
            add_to(&mut batch.stress, lane, 1.0, &release);
            add_to(&mut batch.elastic_stress, lane, -1.0, &release);
            outcome.has_flowed = true;
            if let Some(tangents) = &mut outcome.tangents {
                tangents.push(batch.first_point + lane, &tangent_change(law, &tangent, length), symmetric);
            }
        }
        count(law, batch.number, &self.stress, &mut self.accumulated);
    }

    /// The dissipation of flow in a solved step, and the numerical terms of the scheme, in each cell of a batch.
    pub(super) fn energies_of_implicit_flow<const D: usize>(
        &self,
        blend: Blend,
        step: Step,
        batch: &Batch<D, S>,
    ) -> [[f64; LANES]; 2] {
        let none = [[0.0; LANES]; 2];
        let Some(law) = self.laws.get(batch.material) else { return none };
        let Some(histories) = self.stress.both(batch.number) else { return none };
        let taken = Taken {
            elasticity: law.elasticity(),
            length: step.length,
            is_trapezoidal: blend.earlier != 0.0,
            least: if law.back_stress::<S>().is_some() { f64::NEG_INFINITY } else { 0.0 },
        };
        let strains = [&batch.strain_before, &batch.strain, &batch.strain_rate];
        let share = batch.integrity.shares();
        let weights = std::array::from_fn(|lane| share[lane] * batch.cells.volume[lane]);
        energies(&taken, strains, histories, &weights)
    }
}

/// What flow takes up in a step.
struct Taken<'a> {
    elasticity: &'a Isotropic,
    /// The length of the step in s.
    length: f64,
    /// Whether the dissipation is that of the trapezoidal rule, of second order as the formula is.
    is_trapezoidal: bool,
    /// The least that flow may take up: it gives back what kinematic hardening has stored.
    least: f64,
}

/// The energies that cells of these weights dissipate, and the terms of the scheme, given the strains before and after the step and its
/// rate, and converged and trial histories.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
fn energies<const S: usize>(
    taken: &Taken<'_>,
    [strain_before, strain, rate]: [&Pack<S>; 3],
    [converged, trial]: [&Pack<S>; 2],
    weights: &[f64; LANES],
) -> [[f64; LANES]; 2] {
    let Taken { elasticity, length, is_trapezoidal, least } = *taken;
    let [mut viscoplastic, mut numerical] = [[0.0; LANES]; 2];
    for lane in 0..LANES {
        let [history, after] = [converged.lane(lane), trial.lane(lane)];
        let [strain, before] = [strain.lane(lane), strain_before.lane(lane)];
        let change = add_scaled(&strain, -1.0, &before);
        let stress = add_scaled(&elasticity.apply(&strain), 1.0, &after);
        let before = add_scaled(&elasticity.apply(&before), 1.0, &history);
        let jump = add_scaled(&stress, -1.0, &before);
        let mismatch = add_scaled(&change, -length, &rate.lane(lane));
        let flow = elasticity.solve(&add_scaled(&history, -1.0, &after));
        let work = dot(&stress, &flow);
        // Not less than what it may be: the difference is a term of the scheme.
        let dissipated = if is_trapezoidal { 0.5 * (work + dot(&before, &flow)) } else { work }.max(least);
        viscoplastic[lane] = weights[lane] * dissipated;
        let own = dot(&stress, &mismatch) - 0.5 * elasticity.inverse_square(&jump) + (dissipated - work);
        numerical[lane] = weights[lane] * own;
    }
    [viscoplastic, numerical]
}

/// The stresses on which the law acts in a batch if nothing flowed, and where they may flow.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
fn elastic_stresses<const S: usize>(
    law: &FlowLaw,
    strain: &Pack<S>,
    history: &Pack<S>,
    accumulated: &[f64; LANES],
) -> (Pack<S>, [bool; LANES]) {
    let elasticity = *law.elasticity();
    let stresses =
        Pack::from_lanes(|lane| add_scaled(&elasticity.apply(&strain.lane(lane)), 1.0, &history.lane(lane)));
    let stresses = beyond_back_stress(law, &stresses, history).unwrap_or(stresses);
    (stresses, law.yielding(&stresses, accumulated))
}

/// Adds to the stress of a cell by its lane.
fn add_to<const S: usize>(stresses: &mut Pack<S>, lane: usize, factor: f64, added: &Mandel<S>) {
    let sum = add_scaled(&stresses.lane(lane), factor, added);
    stresses.set(lane, sum);
}

/// `(T - I) k' E`: the change by flow of the derivative of the stress with respect to the strain rate.
fn tangent_change<const S: usize>(law: &FlowLaw, tangent: &Tangent<S>, length: f64) -> Tangent<S> {
    // E is symmetric, so that it may be applied to the rows.
    let change = std::array::from_fn(|i| {
        let mut row = tangent[i];
        row[i] -= 1.0;
        law.elasticity().apply(&row).map(|value| length * value)
    });
    if law.back_stress::<S>().is_none() {
        return change;
    }
    // The stress falls by a part only of what the stress beyond the back stress does.
    let share = law.elasticity().over::<S>(&law.stiffness::<S>());
    let columns: Tangent<S> = std::array::from_fn(|j| share.apply(&change.map(|row: Mandel<S>| row[j])));
    std::array::from_fn(|i| columns.map(|column| column[i]))
}
