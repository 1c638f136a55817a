//! Flow at the start of a step: `H_n = H_{n-1} + k G(s_{n-1})`, the running sum of (24).
//!
//! `s_{n-1} = E e(u_{n-2}) + H_{n-1}` is not stored: `u_{n-2} = u_{n-1} - k_{n-1} v_{n-1}`.

use super::ViscoplasticFlow;
use crate::{
    effect::{Energy, Step},
    lanes::{LANES, Pack, sum},
    material::{Isotropic, Viscoplasticity},
    space::{Batch, Integrity, SimplexPack},
    tensor::{Mandel, add_scaled, dot},
};
use multiversion::multiversion;

/// What advances the history of a batch.
struct Advance<'a, const D: usize, const S: usize> {
    elasticity: Isotropic,
    step: Step,
    cells: &'a SimplexPack<D>,
    strain: &'a Pack<S>,
    rate: &'a Pack<S>,
    integrity: &'a Integrity,
}

/// Advances the history and adds it to the stress. `flow` gives the strain rates of the cells from their stresses, or nothing if
/// none flows. Gives the energies that the flow takes up and that the scheme adds.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
fn advance<const D: usize, const S: usize>(
    given: Advance<'_, D, S>,
    (converged, trial): (&Pack<S>, &mut Pack<S>),
    stress: &mut Pack<S>,
    flow: impl FnOnce(&Pack<S>) -> Option<Pack<S>>,
) -> [f64; 2] {
    let Advance { elasticity, step, cells, strain, rate, integrity } = given;
    let lagged = Pack::from_lanes(|lane| {
        let strain = add_scaled(&strain.lane(lane), -step.previous_length, &rate.lane(lane));
        add_scaled(&elasticity.apply(&strain), 1.0, &converged.lane(lane))
    });
    let share = integrity.shares();
    let Some(flow) = flow(&lagged) else {
        *trial = *converged;
        *stress = Pack::from_lanes(|lane| add_scaled(&stress.lane(lane), share[lane], &converged.lane(lane)));
        return [0.0; 2];
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
    [sum(&dissipated), sum(&numerical)]
}

/// Strain rates of a law that knows one cell at a time.
#[inline(always)]
fn one_by_one<const S: usize>(
    stresses: &Pack<S>,
    mut rate: impl FnMut(usize, &Mandel<S>) -> Mandel<S>,
) -> Option<Pack<S>> {
    Some(Pack::from_lanes(|lane| rate(lane, &stresses.lane(lane))))
}

impl<const S: usize> ViscoplasticFlow<S> {
    /// Advances the histories of a batch and adds them to its stress; gives the fastest relaxation in 1/s of power laws at the stresses
    /// that occur, 0 without any.
    pub(super) fn advance_explicitly<const D: usize>(
        &mut self,
        step: Step,
        batch: &mut Batch<D, S>,
        energy: &mut Energy,
    ) -> f64 {
        let Some(law) = self.laws.get(batch.material) else { return 0.0 };
        let Some(histories) = self.stress.both(batch.number) else { return 0.0 };
        let given = Advance {
            elasticity: *law.elasticity(),
            step,
            cells: batch.cells,
            strain: &batch.strain,
            rate: &batch.strain_rate,
            integrity: &batch.integrity,
        };
        let stress = &mut batch.stress;
        let mut overstress = 0.0f64;
        let [dissipated, numerical] = match law {
            Viscoplasticity::Perzyna(law) if law.exponent == 1.0 => {
                advance(given, histories, stress, |all: &_| law.strain_rates(all))
            }
            Viscoplasticity::Perzyna(law) => advance(given, histories, stress, |all: &Pack<S>| {
                for lane in 0..LANES {
                    overstress = overstress.max(law.overstress(&all.lane(lane)));
                }
                law.strain_rates(all)
            }),
            Viscoplasticity::Maxwell(law) => {
                advance(given, histories, stress, |all: &_| one_by_one(all, |_, s| law.strain_rate(s)))
            }
            Viscoplasticity::DruckerPrager(law) => {
                advance(given, histories, stress, |all: &_| one_by_one(all, |_, s| law.strain_rate(s)))
            }
            Viscoplasticity::Hardening(law) => {
                let accumulated = self.accumulated.as_mut().and_then(|a| a.both(batch.number));
                let Some((Pack([before]), Pack([after]))) = accumulated else { return 0.0 };
                advance(given, histories, stress, |all: &_| {
                    one_by_one(all, |lane, s| {
                        if law.perzyna.exponent != 1.0 {
                            overstress = overstress.max(law.overstress(s, before[lane]));
                        }
                        let (rate, growth) = law.strain_rate(s, before[lane]);
                        after[lane] = before[lane] + step.length * growth;
                        rate
                    })
                })
            }
        };
        energy.viscoplastic += dissipated;
        energy.numerical += numerical;
        if overstress > 0.0 { law.fastest_rate::<S>(overstress) } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        effect::Effect,
        material::{ByMaterial, Elasticity, Hardening, Hypothesis, Maxwell, Metric, Perzyna},
        space::{
            Geometry, Needs, Nodal,
            samples::{number, row},
        },
    };

    const STEPS: [Step; 2] = [
        Step { time: 1.0, length: 0.25, previous_length: 0.125 },
        Step { time: 1.5, length: 0.5, previous_length: 0.25 },
    ];
    const ELASTICITY: Elasticity = Elasticity { youngs_modulus: 1000.0, poisson_ratio: 0.4 };

    /// The flow of a law in a cell, and the growth of the accumulated strain.
    fn flow<const S: usize>(law: &Viscoplasticity, s: &Mandel<S>, accumulated: f64) -> (Mandel<S>, f64) {
        match law {
            Viscoplasticity::Perzyna(law) => (law.strain_rate(s), 0.0),
            Viscoplasticity::Maxwell(law) => (law.strain_rate(s), 0.0),
            Viscoplasticity::DruckerPrager(law) => (law.strain_rate(s), 0.0),
            Viscoplasticity::Hardening(law) => law.strain_rate(s, accumulated),
        }
    }

    /// What two steps leave, of cells whose runs are cut as `material` has it: forces, histories, energies, cells that flow.
    /// Each history has the bits of a cell that is alone.
    fn two_steps<const D: usize, const S: usize>(
        law: Viscoplasticity,
        material: fn(usize) -> usize,
    ) -> (Vec<f64>, Vec<f64>, [f64; 2], usize) {
        let mesh = row::<D>();
        let geometry = Geometry::with_materials(&mesh, material);
        let materials = 1 + geometry.runs.iter().map(|run| run.material).max().expect("cells");
        let laws = ByMaterial::new(vec![Some(law); materials]).expect("a law");
        let mut effect = ViscoplasticFlow::<S>::new(laws, &geometry.runs, false);
        let values = |shift: usize| -> Vec<f64> {
            (0..mesh.nodes.len() * D).map(|i| 0.1 * number(i + shift) * number(1 + i / 20).powi(4)).collect()
        };
        let [u, v] = [values(0), values(40)];
        let nodal =
            Nodal { displacement: &u, previous_displacement: &u, velocity: &v, previous_velocity: &v };
        let needs = Needs { strain: true, strain_rate: true, ..Needs::default() };
        let (mut forces, mut energy, mut flowing) = (vec![0.0; u.len()], Energy::default(), 0);
        for step in STEPS {
            Batch::for_all(&mesh, &geometry, nodal, needs, |batch: &mut Batch<D, S>| {
                effect.add_explicit(step, batch, &mut energy);
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
                    let (rate, growth) = flow(&law, &stress, before);
                    flowing += usize::from(rate != [0.0; S]);
                    let expected = add_scaled(&start, -step.length, &law.elasticity().apply(&rate));
                    let (_, trial) = effect.stress.both(batch.number).expect("a history");
                    assert_eq!(trial.lane(lane), expected);
                    if let Some(accumulated) = &mut effect.accumulated {
                        let (_, trial) = accumulated.both(batch.number).expect("a history");
                        assert_eq!(trial.lane(lane), [before + step.length * growth]);
                    }
                }
            });
            Effect::<D, S>::commit(&mut effect);
        }
        let histories = Effect::<D, S>::histories(&effect);
        let histories = histories.iter().flat_map(|history| history.values.to_vec()).collect();
        (forces, histories, [energy.viscoplastic, energy.numerical], flowing)
    }

    fn check<const D: usize, const S: usize>(hypothesis: Hypothesis) {
        let elasticity = ELASTICITY.tensor(hypothesis);
        let perzyna = Perzyna {
            relaxation: 100.0,
            yield_stress: 3.0,
            exponent: 1.0,
            elasticity,
            metric: Metric::Elasticity,
        };
        let laws = [
            Viscoplasticity::Perzyna(perzyna),
            Viscoplasticity::Perzyna(Perzyna { exponent: 2.5, ..perzyna }),
            Viscoplasticity::Hardening(Hardening { perzyna, modulus: 50.0 }),
            Viscoplasticity::Maxwell(Maxwell::new(ELASTICITY, hypothesis, 0.5, None)),
        ];
        for law in laws {
            let (forces, histories, energies, flowing) = two_steps::<D, S>(law, |_| 0);
            let cells = 2 * row::<D>().cell_regions.len();
            let all = matches!(law, Viscoplasticity::Maxwell(_));
            assert!(flowing > cells / 4 && (flowing < cells) != all, "{flowing} of {cells}");
            let cut = two_steps::<D, S>(law, |region| region);
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
