use super::{
    Blend, Curvature, ELASTIC, Effect, ElasticLaw, Energy, Evaluation, NUMERICAL, Outcome, Phases, Step,
    StressError, Term, linear,
};
use crate::{
    fem::space::{Batch, Integrity, Needs},
    laws::material::{ByMaterial, StrainElasticity},
    linear_algebra::{
        simd::Pack,
        tensor::{Mandel, add_scaled, dot, larger},
    },
};

/// Elastic stress with a shear modulus that is a formula of the strain: that of the converged displacement, or at the end of an implicit step
/// a linear part like that of [`Elasticity`](super::Elasticity), which the matrix contains, and what the law adds to it. Where the end of the
/// step is extrapolated, the stress is one whose work in the step is the change of the stored energy.
#[derive(Debug)]
pub struct NonlinearElasticity {
    laws: ByMaterial<StrainElasticity>,
    linear: ByMaterial<ElasticLaw>,
}

/// The strains of a step, given that where its equations hold: at its start, there, and at its end.
fn strains<const S: usize>(strain: &Mandel<S>, blend: Blend, rate: &Mandel<S>) -> [Mandel<S>; 3] {
    let start = add_scaled(strain, -blend.length, rate);
    [start, *strain, add_scaled(&start, blend.way(), rate)]
}

/// Adds to the stresses that of each cell.
fn add<const S: usize>(stresses: &mut Pack<S>, of: impl Fn(usize) -> Mandel<S>) {
    *stresses = Pack::from_lanes(|lane| add_scaled(&stresses.lane(lane), 1.0, &of(lane)));
}

impl NonlinearElasticity {
    /// With these laws.
    pub fn new<const S: usize>(laws: ByMaterial<StrainElasticity>) -> Self {
        let linear = laws.map(|law| ElasticLaw { tensor: law.linear::<S>(), with_history: false });
        Self { laws, linear }
    }
}

impl<const D: usize, const S: usize> Effect<D, S> for NonlinearElasticity {
    fn name(&self) -> &'static str {
        "nonlinear_elasticity"
    }

    fn phases(&self, at: Evaluation) -> Phases {
        let strain = Needs { strain: true, ..Needs::default() };
        let both = Needs { strain_rate: true, ..strain };
        let is_mean = matches!(at, Evaluation::End(blend) if blend.extrapolates());
        let is_explicit = at == Evaluation::Converged;
        Phases {
            start: Some(strain),
            end: if is_explicit { None } else { Some(both) },
            energy: Some(if is_explicit { both } else { strain }),
            stress: Some(if is_mean || is_explicit { both } else { strain }),
            error: Some(strain),
            is_monotone: true,
            ..Phases::default()
        }
    }

    fn term(&self) -> Term<'_> {
        Term::Elasticity(&self.linear)
    }

    fn evaluate(&mut self, at: Evaluation, _: Step, batch: &mut Batch<D, S>, outcome: &mut Outcome) {
        let Some(law) = self.laws.get(batch.material) else { return };
        let Evaluation::End(blend) = at else {
            let linear = law.linear::<S>();
            linear::add_stresses(&linear, 1.0, &batch.strain, &Integrity::default(), &mut batch.stress);
            if at == Evaluation::Converged {
                add(&mut batch.stress, |lane| law.stress(&batch.strain.lane(lane)));
            }
            return;
        };
        for lane in 0..batch.count {
            let strain = batch.strain.lane(lane);
            let [start, mean, end] = strains(&strain, blend, &batch.strain_rate.lane(lane));
            let strains = [&start, &mean, &end];
            let added = if blend.extrapolates() { law.mean_stress(strains) } else { law.stress(&strain) };
            let less = add_scaled(&batch.stress.lane(lane), -1.0, &added);
            batch.stress.set(lane, less);
            if let Some(tangents) = &mut outcome.tangents {
                let tangent =
                    if blend.extrapolates() { law.mean_tangent(strains) } else { law.tangent(&strain) };
                let (sum, _) = tangents.entry::<S>(batch.first_point + lane);
                let parts = tangent.as_flattened();
                sum.iter_mut().zip(parts).for_each(|(sum, part)| *sum += blend.length * part);
            }
        }
        outcome.has_flowed = true;
    }

    fn add_stress(&self, at: Evaluation, step: Step, batch: &mut Batch<D, S>) {
        let Some(law) = self.laws.get(batch.material) else { return };
        let linear = law.linear::<S>();
        add(&mut batch.stress, |lane| {
            let (strain, rate) = (batch.strain.lane(lane), batch.strain_rate.lane(lane));
            match at {
                Evaluation::Converged => law.whole_stress(&add_scaled(&strain, -step.length, &rate)),
                Evaluation::End(blend) if blend.extrapolates() => {
                    let [start, mean, end] = strains(&strain, blend, &rate);
                    add_scaled(&linear.apply(&strain), 1.0, &law.mean_stress([&start, &mean, &end]))
                }
                _ => law.whole_stress(&strain),
            }
        });
    }

    fn range_share(&self, batch: &Batch<D, S>) -> f64 {
        let Some(law) = self.laws.get(batch.material) else { return 0.0 };
        let shares = (0..batch.count).map(|lane| law.share_of_reference(&batch.strain.lane(lane)));
        shares.fold(0.0, larger)
    }

    fn can_cover(&self, multiple: f64) -> bool {
        self.laws.laws().all(|law| law.covering(multiple).is_some())
    }

    fn cover(&mut self, multiple: f64) {
        *self = Self::new::<S>(self.laws.map(|law| law.covering(multiple).unwrap_or_else(|| law.clone())));
    }

    fn add_energy(&self, at: Evaluation, step: Step, batch: &Batch<D, S>, energy: &mut Energy) {
        let Some(law) = self.laws.get(batch.material) else { return };
        let linear = law.linear::<S>();
        for lane in 0..batch.count {
            let (volume, strain) = (batch.cells.volume[lane], batch.strain.lane(lane));
            let stored = 0.5 * dot(&linear.apply(&strain), &strain) + law.energy(&strain);
            energy[ELASTIC] += volume * stored;
            if at == Evaluation::Converged {
                let change = batch.strain_rate.lane(lane).map(|rate| step.length * rate);
                let before = add_scaled(&strain, -1.0, &change);
                // What is stored in addition to the work of the stress at the start.
                let of_linear = 0.5 * dot(&linear.apply(&change), &change);
                let of_rest = law.energy_change([&before, &strain]) - dot(&law.stress(&before), &change);
                energy[NUMERICAL] += volume * (of_linear + of_rest);
            }
        }
    }

    fn add_step_energy(&self, _: Evaluation, step: Step, batch: &Batch<D, S>, energy: &mut Energy) {
        let Some(law) = self.laws.get(batch.material) else { return };
        let linear = law.linear::<S>();
        for lane in 0..batch.count {
            let [strain, before] = [batch.strain.lane(lane), batch.strain_before.lane(lane)];
            let change = add_scaled(&strain, -1.0, &before);
            let beside = add_scaled(&change, -step.length, &batch.strain_rate.lane(lane));
            // What is stored in addition to the work of the stress at the end.
            let of_linear = dot(&linear.apply(&strain), &beside) - 0.5 * dot(&change, &linear.apply(&change));
            let work = dot(&law.stress(&strain), &add_scaled(&change, -1.0, &beside));
            let of_rest = law.energy_change([&before, &strain]) - work;
            energy[NUMERICAL] += batch.cells.volume[lane] * (of_linear + of_rest);
        }
    }

    fn add_error(&self, _: Curvature, batch: &mut Batch<D, S>, error: &mut StressError) {
        let Some(law) = self.laws.get(batch.material) else { return };
        let whole = Integrity::default();
        error.size += linear::square(&law.linear::<S>(), batch.cells, &whole, &batch.strain);
    }
}
