use super::{Effect, Energy, Evaluation, Outcome, Phases, Step, VISCOUS};
use crate::{
    fem::space::{Batch, Needs},
    laws::material::{ByMaterial, RateViscosity, ViscosityFormula},
    linear_algebra::{
        simd::Pack,
        tensor::{add_scaled, dot, larger},
    },
};

/// What viscosities that are formulas of the strain rate add to the linear part of `A e(v_n)`, which
/// [`ViscousStress`](super::ViscousStress) contains; implicit under every scheme.
#[derive(Debug)]
pub struct NonlinearViscosity {
    formulas: ByMaterial<ViscosityFormula>,
    laws: ByMaterial<RateViscosity>,
}

impl NonlinearViscosity {
    /// With these formulas, which are not constant.
    pub fn new(formulas: ByMaterial<ViscosityFormula>) -> Self {
        Self { laws: formulas.map(ViscosityFormula::rest), formulas }
    }
}

impl<const D: usize, const S: usize> Effect<D, S> for NonlinearViscosity {
    fn name(&self) -> &'static str {
        "nonlinear_viscosity"
    }

    fn phases(&self, _: Evaluation) -> Phases {
        let rate = Some(Needs { strain_rate: true, ..Needs::default() });
        let phases = Phases { end: rate, energy: rate, stress: rate, ..Phases::default() };
        Phases { is_monotone: true, is_viscous: true, ..phases }
    }

    fn evaluate(&mut self, _: Evaluation, _: Step, batch: &mut Batch<D, S>, outcome: &mut Outcome) {
        let Some(law) = self.laws.get(batch.material) else { return };
        for lane in 0..batch.count {
            let rate = batch.strain_rate.lane(lane);
            let less = add_scaled(&batch.stress.lane(lane), -1.0, &law.stress(&rate));
            batch.stress.set(lane, less);
            if let Some(tangents) = &mut outcome.tangents {
                let (sum, _) = tangents.entry::<S>(batch.first_point + lane);
                sum.iter_mut().zip(law.tangent(&rate).as_flattened()).for_each(|(sum, part)| *sum += part);
            }
        }
        outcome.has_flowed = true;
    }

    fn add_stress(&self, _: Evaluation, _: Step, batch: &mut Batch<D, S>) {
        let Some(law) = self.laws.get(batch.material) else { return };
        let added = |lane| law.stress(&batch.strain_rate.lane(lane));
        batch.stress = Pack::from_lanes(|lane| add_scaled(&batch.stress.lane(lane), 1.0, &added(lane)));
    }

    fn can_cover(&self, multiple: f64) -> bool {
        self.formulas.laws().all(|formula| formula.covering(multiple).is_some())
    }

    fn cover(&mut self, multiple: f64) {
        self.laws = self.formulas.map(|formula| {
            formula
                .covering(multiple)
                .map_or_else(|| formula.rest(), |wide| wide.rest().within_reference(formula))
        });
    }

    fn range_share(&self, batch: &Batch<D, S>) -> f64 {
        let Some(law) = self.laws.get(batch.material) else { return 0.0 };
        let shares = (0..batch.count).map(|lane| law.share_of_reference(&batch.strain_rate.lane(lane)));
        shares.fold(0.0, larger)
    }

    fn add_energy(&self, _: Evaluation, step: Step, batch: &Batch<D, S>, energy: &mut Energy) {
        let Some(law) = self.laws.get(batch.material) else { return };
        for lane in 0..batch.count {
            let rate = batch.strain_rate.lane(lane);
            energy[VISCOUS] += step.length * batch.cells.volume[lane] * dot(&law.stress(&rate), &rate);
        }
    }
}
