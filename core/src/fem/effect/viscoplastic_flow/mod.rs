mod explicit;
mod implicit;

use super::{
    Curvature, ELASTIC, Effect, Energy, EnergyKind, Evaluation, FlowProperties, HistoryStore, NUMERICAL,
    Outcome, Phases, Quantity, Role, Step, StressError, Term, cell_history::CellHistory, linear, quantity,
};
use crate::{
    fem::space::{Batch, Geometry, Integrity, Needs},
    laws::material::{ByMaterial, Flow, FlowLaw, equivalent_strain},
    linear_algebra::{
        simd::{LANES, Pack, sum},
        tensor::add_scaled,
    },
};

/// Absorbed by viscoplastic flow: dissipated, or stored by hardening.
pub const VISCOPLASTIC: EnergyKind = EnergyKind::new(
    3,
    Role::Dissipated,
    "viscoplastic_dissipation",
    "dissipated by viscoplastic flow since time 0, with the energy stored by hardening; falls where kinematic \
     hardening gives it back",
);

/// The stress `H` that flow leaves.
pub const STRESS_OF_FLOW: Quantity = quantity!("viscoplastic_history");

/// Viscoplastic flow, by the stress `H` that it leaves in the elastic stress `E e(u) + H`, one tensor for each cell that flows, and the
/// viscoplastic strain that hardening cells accumulate.
#[derive(Debug)]
pub struct ViscoplasticFlow<const S: usize> {
    laws: ByMaterial<FlowLaw>,
    /// For each material another copy of its law that depends on the temperature, which is evaluated cell by cell.
    warm: Vec<Option<FlowLaw>>,
    properties: FlowProperties,
    stress: CellHistory<S>,
    /// The equivalent viscoplastic strain: of cells that harden, or of all that flow, if it is written.
    accumulated: Option<CellHistory<1>>,
}

/// The equivalent viscoplastic strain.
const EQUIVALENT_STRAIN: Quantity = quantity!("equivalent_viscoplastic_strain");

/// Adds the equivalent of the strain by which a law without hardening has flowed in a step, if it is kept.
fn count<const S: usize>(
    law: &FlowLaw,
    number: usize,
    stress: &CellHistory<S>,
    accumulated: &mut Option<CellHistory<1>>,
) {
    let Some(accumulated) = accumulated.as_mut().filter(|_| !law.hardens()) else { return };
    let (Some([before, after]), Some((converged, trial))) =
        (stress.both(number), accumulated.both_mut(number))
    else {
        return;
    };
    for lane in 0..LANES {
        let flow = law.elasticity().solve(&add_scaled(&before.lane(lane), -1.0, &after.lane(lane)));
        trial.set(lane, [converged.lane(lane)[0] + equivalent_strain(&flow)]);
    }
}

/// The stresses beyond the back stresses, given those that flow leaves; `None` for laws without a back stress.
#[inline(always)]
fn beyond_back_stress<const S: usize>(law: &FlowLaw, stress: &Pack<S>, history: &Pack<S>) -> Option<Pack<S>> {
    let back = law.back_stress::<S>()?;
    Some(Pack::from_lanes(|lane| add_scaled(&stress.lane(lane), 1.0, &back.apply(&history.lane(lane)))))
}

impl<const S: usize> ViscoplasticFlow<S> {
    /// No history yet, for the cells whose material has a law.
    pub fn new<const D: usize>(laws: ByMaterial<FlowLaw>, geometry: &Geometry<D>) -> Self {
        let flows = |material: usize| laws.get(material).is_some();
        let hardens = |material: usize| laws.get(material).is_some_and(FlowLaw::hardens);
        let stress = CellHistory::new(STRESS_OF_FLOW, geometry, flows);
        let accumulated = laws
            .laws()
            .any(FlowLaw::hardens)
            .then(|| CellHistory::new(EQUIVALENT_STRAIN, geometry, hardens).without_error());
        let properties = FlowProperties {
            step_bound: laws.laws().map(|law| 2.0 / law.fastest_rate::<S>(1.0)).fold(f64::INFINITY, f64::min),
            has_power_law: laws.laws().any(FlowLaw::is_power_law),
            has_symmetric_tangent: laws.laws().all(FlowLaw::has_symmetric_tangent::<S>),
        };
        let warm = laws.filter_map(|law| law.sees_temperature().then(|| law.clone()));
        Self { laws, warm, properties, stress, accumulated }
    }
}

impl<const D: usize, const S: usize> Effect<D, S> for ViscoplasticFlow<S> {
    fn name(&self) -> &'static str {
        "viscoplasticity"
    }

    fn phases(&self, at: Evaluation) -> Phases {
        let strain = Needs { strain: true, ..Needs::default() };
        let both = Needs { strain_rate: true, ..strain };
        let is_explicit = at == Evaluation::Converged;
        Phases {
            start: Some(if is_explicit { both } else { Needs::default() }),
            end: (!is_explicit).then_some(strain),
            energy: Some(strain),
            stress: Some(Needs::default()),
            error: Some(strain),
            weakens: false,
            is_monotone: false,
            is_viscous: false,
        }
    }

    fn term(&self) -> Term<'_> {
        Term::Flow(self.properties)
    }

    fn evaluate(&mut self, at: Evaluation, step: Step, batch: &mut Batch<D, S>, outcome: &mut Outcome) {
        match at {
            Evaluation::Converged => self.advance_explicitly(step, batch, outcome),
            Evaluation::Start(_) => {
                let Some(history) = self.stress.converged(batch.number) else { return };
                linear::add_histories(history, &batch.integrity, &mut batch.stress);
            }
            Evaluation::End(blend) => self.advance_implicitly(blend, step, batch, outcome),
        }
    }

    fn add_elastic_stress(&self, batch: &mut Batch<D, S>) {
        let Some(history) = self.stress.converged(batch.number) else { return };
        linear::add_histories(history, &Integrity::default(), &mut batch.elastic_stress);
    }

    fn add_stress(&self, _: Evaluation, _: Step, batch: &mut Batch<D, S>) {
        let Some(history) = self.stress.converged(batch.number) else { return };
        linear::add_histories(history, &batch.integrity, &mut batch.stress);
    }

    fn add_energy(&self, _: Evaluation, _: Step, batch: &Batch<D, S>, energy: &mut Energy) {
        let Some(law) = self.laws.get(batch.material) else { return };
        let Some(history) = self.stress.converged(batch.number) else { return };
        let (strain, integrity) = (&batch.strain, &batch.integrity);
        energy[ELASTIC] +=
            0.5 * linear::inverse_square(law.elasticity(), batch.cells, integrity, strain, history);
    }

    fn add_step_energy(&self, at: Evaluation, step: Step, batch: &Batch<D, S>, energy: &mut Energy) {
        if let Evaluation::End(blend) = at {
            let [viscoplastic, numerical] = self.energies_of_implicit_flow(blend, step, batch);
            energy[VISCOPLASTIC] += sum(&viscoplastic);
            energy[NUMERICAL] += sum(&numerical);
        }
    }

    fn energy_of_flow(&self, at: Evaluation, step: Step, batch: &Batch<D, S>) -> Option<[f64; LANES]> {
        let Evaluation::End(blend) = at else { return None };
        Some(self.energies_of_implicit_flow(blend, step, batch)[0])
    }

    fn add_error(&self, curvature: Curvature, batch: &mut Batch<D, S>, error: &mut StressError) {
        let Some(law) = self.laws.get(batch.material) else { return };
        let Some(histories) = self.stress.last_three(batch.number) else { return };
        error.add_history(law.elasticity(), batch, curvature, histories);
    }

    fn keep_flow(&mut self, geometry: &Geometry<D>) {
        let flows = |material: usize| self.laws.get(material).is_some();
        self.accumulated = Some(CellHistory::new(EQUIVALENT_STRAIN, geometry, flows).without_error());
    }

    fn histories(&self) -> Vec<&dyn HistoryStore> {
        let accumulated = self.accumulated.as_ref().map(|accumulated| accumulated as &dyn HistoryStore);
        std::iter::once(&self.stress as &dyn HistoryStore).chain(accumulated).collect()
    }

    fn visit_histories(&mut self, visit: &mut dyn FnMut(&mut dyn HistoryStore)) {
        visit(&mut self.stress);
        if let Some(accumulated) = &mut self.accumulated {
            visit(accumulated);
        }
    }
}
