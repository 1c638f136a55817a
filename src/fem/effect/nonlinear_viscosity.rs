use super::{Effect, Energy, Evaluation, Outcome, Phases, Step, VISCOUS};
use crate::{
    fem::space::{Batch, Needs},
    laws::material::{ByMaterial, RateViscosity},
    linear_algebra::{
        simd::Pack,
        tensor::{add_scaled, dot, larger},
    },
};

/// What viscosities that are formulas of the strain rate add to the linear part of `A e(v_n)`, which
/// [`ViscousStress`](super::ViscousStress) contains; implicit under every scheme.
#[derive(Debug)]
pub struct NonlinearViscosity {
    /// The laws.
    pub laws: ByMaterial<RateViscosity>,
}

impl<const D: usize, const S: usize> Effect<D, S> for NonlinearViscosity {
    fn name(&self) -> &'static str {
        "nonlinear_viscosity"
    }

    fn phases(&self, _: Evaluation) -> Phases {
        let rate = Some(Needs { strain_rate: true, ..Needs::default() });
        Phases { end: rate, energy: rate, stress: rate, is_monotone: true, ..Phases::default() }
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

    fn rate_share(&self, batch: &Batch<D, S>) -> f64 {
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
