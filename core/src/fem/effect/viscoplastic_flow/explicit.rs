//! Flow at the start of a step: `H_n = H_{n-1} + k G(s_{n-1})`, the running sum of (24).
//!
//! `s_{n-1} = E e(u_{n-2}) + H_{n-1}` is not stored: `u_{n-2} = u_{n-1} - k_{n-1} v_{n-1}`.

use super::{VISCOPLASTIC, ViscoplasticFlow, beyond_back_stress, count};
use crate::{
    fem::{
        effect::{NUMERICAL, Outcome, Step},
        space::{Batch, Integrity, SimplexPack},
    },
    laws::material::{Flow, FlowLaw},
    linear_algebra::{
        simd::{LANES, Pack, sum},
        tensor::{add_scaled, dot},
    },
};
use multiversion::multiversion;

/// What advances the history of a batch.
struct Advance<'a, const D: usize, const S: usize> {
    law: &'a FlowLaw,
    /// Another copy of a law that depends on the temperature, with the temperatures in K of the cells.
    warm: Option<(&'a mut FlowLaw, &'a [f64; LANES])>,
    step: Step,
    cells: &'a SimplexPack<D>,
    strain: &'a Pack<S>,
    rate: &'a Pack<S>,
    integrity: &'a Integrity,
    /// Accumulated viscoplastic strain, and its growth, of laws that harden.
    accumulated: &'a [f64; LANES],
    growths: &'a mut [f64; LANES],
}

/// Advances the history and adds it to the stress. Gives the energies that the flow takes up in each cell, and that the scheme adds, and
/// the largest overstress under power laws.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
fn advance<const D: usize, const S: usize>(
    given: Advance<'_, D, S>,
    converged: &Pack<S>,
    trial: &mut Pack<S>,
    stress: &mut Pack<S>,
) -> ([f64; LANES], [f64; 2]) {
    let Advance { law, warm, step, cells, strain, rate, integrity, accumulated, growths } = given;
    let elasticity = *law.elasticity();
    let lagged = Pack::from_lanes(|lane| {
        let strain = add_scaled(&strain.lane(lane), -step.previous_length, &rate.lane(lane));
        add_scaled(&elasticity.apply(&strain), 1.0, &converged.lane(lane))
    });
    let share = integrity.shares();
    let beyond = beyond_back_stress(law, &lagged, converged);
    let driving = beyond.as_ref().unwrap_or(&lagged);
    let mut overstress = 0.0f64;
    if law.is_power_law() {
        for lane in 0..LANES {
            overstress = overstress.max(law.overstress(&driving.lane(lane), accumulated[lane]));
        }
    }
    let flow = match warm {
        None => law.rates(driving, accumulated, growths),
        Some((law, temperatures)) => Some(Pack::from_lanes(|lane| {
            law.set_temperature(temperatures[lane]);
            let (rate, growth) = law.rate(&driving.lane(lane), accumulated[lane]);
            growths[lane] = growth;
            rate
        })),
    };
    let Some(flow) = flow else {
        *trial = *converged;
        *stress = Pack::from_lanes(|lane| add_scaled(&stress.lane(lane), share[lane], &converged.lane(lane)));
        return ([0.0; LANES], [0.0, overstress]);
    };
    let [mut dissipated, mut numerical] = [[0.0; LANES]; 2];
    for lane in 0..LANES {
        let flow = flow.lane(lane);
        let release = elasticity.apply(&flow);
        let history = add_scaled(&converged.lane(lane), -step.length, &release);
        trial.set(lane, history);
        stress.set(lane, add_scaled(&stress.lane(lane), share[lane], &history));
        let lag = elasticity.apply(&rate.lane(lane));
        let weight = share[lane] * cells.volume[lane] * step.length;
        dissipated[lane] = weight * dot(&lagged.lane(lane), &flow);
        numerical[lane] =
            weight * (0.5 * step.length * dot(&release, &flow) - step.previous_length * dot(&lag, &flow));
    }
    (dissipated, [sum(&numerical), overstress])
}

impl<const S: usize> ViscoplasticFlow<S> {
    /// Advances the histories of a batch and adds them to its stress.
    pub(super) fn advance_explicitly<const D: usize>(
        &mut self,
        step: Step,
        batch: &mut Batch<D, S>,
        outcome: &mut Outcome,
    ) {
        let Some(law) = self.laws.get(batch.material) else { return };
        let Some((converged, trial)) = self.stress.both_mut(batch.number) else { return };
        let mut accumulated = self.accumulated.as_mut().filter(|_| law.hardens());
        let mut accumulated = accumulated.as_mut().and_then(|history| history.both_mut(batch.number));
        let mut growths = [0.0; LANES];
        let warm = self.warm[batch.material].as_mut().zip(batch.temperature);
        let given = Advance {
            law,
            warm,
            step,
            cells: batch.cells,
            strain: &batch.strain,
            rate: &batch.strain_rate,
            integrity: &batch.integrity,
            accumulated: accumulated.as_ref().map_or(&[0.0; LANES], |(Pack([before]), _)| before),
            growths: &mut growths,
        };
        let (dissipated, [numerical, overstress]) = advance(given, converged, trial, &mut batch.stress);
        if let Some((Pack([before]), Pack([after]))) = &mut accumulated {
            for lane in 0..LANES {
                after[lane] = before[lane] + step.length * growths[lane];
            }
        }
        count(law, batch.number, &self.stress, &mut self.accumulated);
        outcome.energy[VISCOPLASTIC] += sum(&dissipated);
        if let Some(flow) = &mut outcome.flow {
            let cells = &mut flow[batch.first_cell..][..batch.count];
            cells.iter_mut().zip(dissipated).for_each(|(sum, energy)| *sum += energy);
        }
        outcome.energy[NUMERICAL] += numerical;
        if overstress > 0.0 {
            outcome.fastest_flow = outcome.fastest_flow.max(law.fastest_rate::<S>(overstress));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        fem::{
            effect::{Effect, Evaluation, Moment},
            space::{
                Geometry, Needs, Nodal,
                samples::{number, row},
            },
        },
        laws::material::{ByMaterial, Elasticity, Hypothesis, Maxwell, Metric, Perzyna, Viscoplasticity},
    };

    const STEPS: [Step; 2] = [
        Step { time: 1.0, length: 0.25, previous_length: 0.125 },
        Step { time: 1.5, length: 0.5, previous_length: 0.25 },
    ];
    const ELASTICITY: Elasticity = Elasticity::linear(1000.0, 0.4);

    /// What two steps leave, of cells whose runs are cut as `material` has it: forces, histories, energies, cells that flow.
    /// Each history has the bits of a cell that is alone.
    fn two_steps<const D: usize, const S: usize>(
        law: &FlowLaw,
        material: fn(usize) -> usize,
    ) -> (Vec<f64>, Vec<f64>, [f64; 2], usize) {
        let mesh = row::<D>();
        let geometry = Geometry::with_materials(&mesh, material);
        let materials = 1 + geometry.runs.iter().map(|run| run.material).max().expect("cells");
        let laws = ByMaterial::new(vec![Some(law.clone()); materials]).expect("a law");
        let mut effect = ViscoplasticFlow::<S>::new(laws, &geometry);
        let values = |shift: usize| -> Vec<f64> {
            (0..mesh.nodes.len() * D).map(|i| 0.1 * number(i + shift) * number(1 + i / 20).powi(4)).collect()
        };
        let [u, v] = [values(0), values(40)];
        let nodal =
            Nodal { displacement: &u, previous_displacement: &u, velocity: &v, previous_velocity: &v };
        let needs = Needs { strain: true, strain_rate: true, ..Needs::default() };
        let (mut forces, mut outcome, mut flowing) = (vec![0.0; u.len()], Outcome::default(), 0);
        for step in STEPS {
            Batch::for_all(&mesh, &geometry, nodal, needs, |batch: &mut Batch<D, S>| {
                effect.evaluate(Evaluation::Converged, step, batch, &mut outcome);
                batch.scatter(&mesh, &mut forces);
                for lane in 0..batch.count {
                    let start = effect.stress.converged(batch.number).expect("a history").lane(lane);
                    let strain = add_scaled(
                        &batch.strain.lane(lane),
                        -step.previous_length,
                        &batch.strain_rate.lane(lane),
                    );
                    let stress = add_scaled(&law.elasticity().apply(&strain), 1.0, &start);
                    let before = effect.accumulated.as_ref().and_then(|a| a.converged(batch.number));
                    let before = before.map_or(0.0, |before| before.0[0][lane]);
                    let (rate, growth) = law.rate(&stress, before);
                    flowing += usize::from(rate != [0.0; S]);
                    let expected = add_scaled(&start, -step.length, &law.elasticity().apply(&rate));
                    let (_, trial) = effect.stress.both_mut(batch.number).expect("a history");
                    assert_eq!(trial.lane(lane), expected);
                    if let Some(accumulated) = &mut effect.accumulated {
                        let (_, trial) = accumulated.both_mut(batch.number).expect("a history");
                        assert_eq!(trial.lane(lane), [before + step.length * growth]);
                    }
                }
            });
            Effect::<D, S>::visit_histories(&mut effect, &mut |history| history.commit());
        }
        let histories = Effect::<D, S>::histories(&effect);
        let histories = histories
            .iter()
            .filter_map(|store| store.values(Moment::Last))
            .flat_map(|history| history.values.into_owned())
            .collect();
        (forces, histories, [outcome.energy[VISCOPLASTIC], outcome.energy[NUMERICAL]], flowing)
    }

    fn check<const D: usize, const S: usize>(hypothesis: Hypothesis) {
        let perzyna = Perzyna {
            relaxation: 100.0,
            yield_stress: 3.0,
            exponent: 1.0,
            hardening_modulus: None,
            kinematic_modulus: None,
            metric: Metric::Elasticity,
        };
        let laws = [
            Viscoplasticity::Perzyna(perzyna),
            Viscoplasticity::Perzyna(Perzyna { exponent: 2.5, ..perzyna }),
            Viscoplasticity::Perzyna(Perzyna { hardening_modulus: Some(50.0), ..perzyna }),
            Viscoplasticity::Maxwell(Maxwell { relaxation_time: 0.5, volumetric_relaxation_time: None }),
        ];
        for law in laws.map(|law| law.prepare(&ELASTICITY, hypothesis)) {
            let (forces, histories, energies, flowing) = two_steps::<D, S>(&law, |_| 0);
            let cells = 2 * row::<D>().cell_regions.len();
            let all = law.equivalent_stress(&[0.0; S]).is_none();
            assert!(flowing > cells / 4 && (flowing < cells) != all, "{flowing} of {cells}");
            let cut = two_steps::<D, S>(&law, |region| region);
            assert_eq!((forces, histories, flowing), (cut.0, cut.1, cut.3), "other packs, the same bits");
            for (one, other) in energies.iter().zip(&cut.2) {
                assert!((one - other).abs() <= 1e-13 * one.abs() && *one != 0.0, "{one} {other}");
            }
        }
    }

    #[test]
    fn cells_flow_alike_whatever_cells_share_their_pack() {
        check::<2, 3>(Hypothesis::PlaneStress);
        check::<2, 4>(Hypothesis::PlaneStrain);
        check::<3, 6>(Hypothesis::Space);
    }
}
