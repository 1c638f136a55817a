use super::{Effect, Energy, History, Phases, Step, cell_history::CellHistory, isotropic};
use crate::{
    lanes::{LANES, Pack},
    material::{ByMaterial, Isotropic, Viscoplasticity},
    space::{Batch, CellRun, Integrity, Needs, SimplexPack},
    tensor::{Mandel, add_scaled, dot},
};
use multiversion::multiversion;

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
}

/// What advances the history of a batch.
struct Advance<'a, const D: usize, const S: usize> {
    elasticity: Isotropic,
    step: Step,
    cells: &'a [SimplexPack<D>],
    strains: &'a [Pack<S>],
    rates: &'a [Pack<S>],
    integrity: &'a Integrity,
}

/// Advances histories and adds them to stresses. `flow` gives the strain rates of the cells of a pack from its position and their
/// stresses, or nothing if none flows. Gives the energies that the flow takes up and that the scheme adds.
#[multiversion(targets("x86_64+avx2"))]
fn advance<const D: usize, const S: usize>(
    given: Advance<'_, D, S>,
    (converged, trial): (&[Pack<S>], &mut [Pack<S>]),
    stresses: &mut [Pack<S>],
    mut flow: impl FnMut(usize, &Pack<S>) -> Option<Pack<S>>,
) -> [f64; 2] {
    let Advance { elasticity, step, cells, strains, rates, integrity } = given;
    let [mut dissipated, mut numerical] = [[0.0; LANES]; 2];
    let histories = converged.iter().zip(trial).zip(stresses);
    for (pack, ((converged, trial), stress)) in histories.enumerate() {
        let (strain, rate) = (&strains[pack], &rates[pack]);
        let lagged = Pack::from_lanes(|lane| {
            let strain = add_scaled(&strain.lane(lane), -step.previous_length, &rate.lane(lane));
            add_scaled(&elasticity.apply(&strain), 1.0, &converged.lane(lane))
        });
        *trial = *converged;
        let share = integrity.of(pack);
        if let Some(flow) = flow(pack, &lagged) {
            let release = Pack::from_lanes(|lane| elasticity.apply(&flow.lane(lane)));
            *trial =
                Pack::from_lanes(|lane| add_scaled(&converged.lane(lane), -step.length, &release.lane(lane)));
            for lane in 0..LANES {
                let flow = flow.lane(lane);
                let lag = elasticity.apply(&rate.lane(lane));
                let weight = share[lane] * cells[pack].volume[lane] * step.length;
                dissipated[lane] += weight * dot(&lagged.lane(lane), &flow);
                numerical[lane] += weight
                    * (0.5 * step.length * dot(&release.lane(lane), &flow)
                        - step.previous_length * dot(&lag, &flow));
            }
        }
        *stress = Pack::from_lanes(|lane| add_scaled(&stress.lane(lane), share[lane], &trial.lane(lane)));
    }
    [dissipated, numerical].map(|sums| sums.iter().sum())
}

/// Strain rates of a law that knows one cell at a time.
#[inline(always)]
fn one_by_one<const S: usize>(
    stresses: &Pack<S>,
    mut rate: impl FnMut(usize, &Mandel<S>) -> Mandel<S>,
) -> Option<Pack<S>> {
    Some(Pack::from_lanes(|lane| rate(lane, &stresses.lane(lane))))
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
        let converged = self.stress.converged(batch.number);
        isotropic::add_histories(converged, &Integrity::default(), &mut batch.elastic_stress);
    }

    fn add_explicit(&mut self, step: Step, batch: &mut Batch<D, S>, energy: &mut Energy) {
        let Some(law) = self.laws.get(batch.material) else { return };
        self.stress.prefetch(batch.number + 1);
        let given = Advance {
            elasticity: *law.elasticity(),
            step,
            cells: batch.cells,
            strains: &batch.strain,
            rates: &batch.strain_rate,
            integrity: &batch.integrity,
        };
        let (histories, stresses) = (self.stress.both(batch.number), &mut batch.stress[..]);
        let [dissipated, numerical] = match law {
            Viscoplasticity::Perzyna(law) => {
                advance(given, histories, stresses, |_, all: &_| law.strain_rates(all))
            }
            Viscoplasticity::Maxwell(law) => {
                advance(given, histories, stresses, |_, all: &_| one_by_one(all, |_, s| law.strain_rate(s)))
            }
            Viscoplasticity::DruckerPrager(law) => {
                advance(given, histories, stresses, |_, all: &_| one_by_one(all, |_, s| law.strain_rate(s)))
            }
            Viscoplasticity::Hardening(law) => {
                let Some(accumulated) = &mut self.accumulated else { return };
                let (converged, trial) = accumulated.both(batch.number);
                advance(given, histories, stresses, |pack, all: &_| {
                    one_by_one(all, |lane, s| {
                        let before = converged[pack].0[0][lane];
                        let (rate, growth) = law.strain_rate(s, before);
                        trial[pack].0[0][lane] = before + step.length * growth;
                        rate
                    })
                })
            }
        };
        energy.viscoplastic += dissipated;
        energy.numerical += numerical;
    }

    fn add_energy(&self, _step: Step, batch: &Batch<D, S>, energy: &mut Energy) {
        let Some(law) = self.laws.get(batch.material) else { return };
        let (strains, histories) = (&batch.strain, self.stress.converged(batch.number));
        energy.elastic += 0.5
            * isotropic::inverse_square(law.elasticity(), batch.cells, &batch.integrity, strains, histories);
    }

    fn add_stress(&self, _step: Step, batch: &mut Batch<D, S>) {
        isotropic::add_histories(self.stress.converged(batch.number), &batch.integrity, &mut batch.stress);
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
