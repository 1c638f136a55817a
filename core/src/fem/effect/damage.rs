use super::{
    Curvature, Effect, Energy, EnergyKind, Evaluation, HistoryStore, NUMERICAL, Outcome, Phases, Role, Step,
    StressError, cell_history::CellHistory, evolution::IrreversibleStep, quantity,
};
use crate::{
    fem::space::{Batch, Geometry, Needs},
    laws::material::{self, ByMaterial, Elastic},
    linear_algebra::{
        simd::{LANES, Pack},
        tensor::{Mandel, add_scaled},
    },
};

/// Dissipated by damage.
pub const DAMAGE: EnergyKind =
    EnergyKind::new(8, Role::Dissipated, "damage_dissipation", "dissipated by damage since time 0");

/// Isotropic damage `d`, one number for each cell whose material has the law: the elastic and viscoplastic stress is multiplied by
/// `1 - d`, viscous stress is not.
///
/// With laws evaluated at the converged state `d_n` follows from `d_{n-1}` and the energy `Y_{n-1}` of
/// `S_{n-1} = E e(u_{n-1}) + H_{n-1}`, so that the loss of elastic energy in the step is exactly `(d_n - d_{n-1}) Y_{n-1}`, the
/// dissipation; all other terms of the elastic energy are multiplied by `1 - d_n`.
///
/// In an implicit step `d_n` follows from `Y_n`, and the stress is `(1 - d_n) S_n` with `S_n` as flow leaves it. The dissipation is
/// `(d_n - d_{n-1}) (Y_{n-1} + Y_n) / 2`.
#[derive(Debug)]
pub struct Damage {
    laws: ByMaterial<Elastic<material::Damage>>,
    damage: CellHistory<1>,
}

impl Damage {
    /// Undamaged cells, for the cells whose material has a law.
    pub fn new<const D: usize>(laws: ByMaterial<Elastic<material::Damage>>, geometry: &Geometry<D>) -> Self {
        let damage = CellHistory::new(quantity!("damage"), geometry, |material| laws.get(material).is_some());
        Self { laws, damage }
    }

    /// Damages the cells of a batch by the converged stress, and weakens the batch.
    fn advance_explicitly<const D: usize, const S: usize>(
        &mut self,
        step: Step,
        batch: &mut Batch<D, S>,
        energy: &mut Energy,
    ) {
        let Some(law) = self.laws.get(batch.material) else { return };
        let Some((Pack([before]), Pack([after]))) = self.damage.both_mut(batch.number) else { return };
        for lane in 0..batch.count {
            let release_rate = law.release_rate(&batch.elastic_stress.lane(lane));
            after[lane] = law.advance(before[lane], release_rate, step.length);
            energy[DAMAGE] += batch.cells.volume[lane] * release_rate * (after[lane] - before[lane]);
        }
        batch.integrity.weaken(left(after));
    }

    /// Damages the cells of a batch by the undamaged stress at the end of a step, subtracts the damaged fraction from their stress, and
    /// weakens the batch.
    fn advance_implicitly<const D: usize, const S: usize>(
        &mut self,
        evolution: IrreversibleStep,
        batch: &mut Batch<D, S>,
        outcome: &mut Outcome,
    ) {
        let Some(law) = self.laws.get(batch.material) else { return };
        let Some(&Pack([before])) = self.damage.converged(batch.number) else { return };
        let mut left = [1.0; LANES];
        for lane in 0..batch.count {
            let sound = batch.elastic_stress.lane(lane);
            let release_rate = law.release_rate(&sound);
            let [last] = self.damage.last_change(batch.number, lane);
            let relax = |start, length| law.relax(start, release_rate, length);
            let [damage, slope] = evolution.advance(before[lane], last, relax);
            self.damage.set_trial(batch.number, lane, [damage]);
            left[lane] = 1.0 - damage;
            if damage == 0.0 {
                continue;
            }
            batch.stress.set(lane, add_scaled(&batch.stress.lane(lane), damage, &sound));
            if let Some(tangents) = &mut outcome.tangents {
                let slope = tangents.softening() * slope;
                let growth = Growth { damage, slope, length: evolution.blend.length };
                let (tangent, flows) = tangents.entry::<S>(batch.first_point + lane);
                weaken_tangent(law, growth, &sound, tangent);
                if flows && slope != 0.0 {
                    tangents.skew = true;
                }
            }
        }
        batch.integrity.weaken(left);
        outcome.has_flowed |= left != [1.0; LANES];
    }
}

/// Damage of a cell at the end of an implicit step.
#[derive(Clone, Copy)]
struct Growth {
    damage: f64,
    /// Its derivative by the energy release rate, in m^d/J.
    slope: f64,
    /// `k'` of the step in s.
    length: f64,
}

/// Updates the derivative of a cell's stress by its strain rate, less `k' E`, for a stress `(1 - d) S`:
/// `(1 - d) C - dd/dY S (x) C^T E^-1 S` with the derivative `C` of the undamaged stress `S`.
fn weaken_tangent<const S: usize>(
    law: &Elastic<material::Damage>,
    Growth { damage, slope, length }: Growth,
    sound: &Mandel<S>,
    beyond: &mut [f64],
) {
    let strain = law.elasticity.solve(sound);
    let mut gradient = [0.0; S];
    for (row, strain) in beyond.chunks_exact_mut(S).zip(&strain) {
        for (gradient, value) in gradient.iter_mut().zip(&*row) {
            *gradient += strain * value;
        }
    }
    // What the constant matrix has: k' E, applied to E^-1 S.
    gradient = add_scaled(&gradient, length, sound);
    for (i, row) in beyond.chunks_exact_mut(S).enumerate() {
        let mut unit = [0.0; S];
        unit[i] = length;
        let elastic = law.elasticity.apply(&unit);
        for j in 0..S {
            row[j] -= damage * (row[j] + elastic[j]) + slope * sound[i] * gradient[j];
        }
    }
}

/// The fractions that damaged cells carry.
fn left(damage: &[f64; LANES]) -> [f64; LANES] {
    damage.map(|damage| 1.0 - damage)
}

impl<const D: usize, const S: usize> Effect<D, S> for Damage {
    fn name(&self) -> &'static str {
        "damage"
    }

    fn phases(&self, at: Evaluation) -> Phases {
        let stress = Needs { strain: true, elastic_stress: true, ..Needs::default() };
        let is_explicit = at == Evaluation::Converged;
        Phases {
            start: is_explicit.then_some(stress),
            end: (!is_explicit).then_some(stress),
            error: Some(stress),
            weakens: true,
            ..Phases::default()
        }
    }

    fn evaluate(&mut self, at: Evaluation, step: Step, batch: &mut Batch<D, S>, outcome: &mut Outcome) {
        match at {
            Evaluation::Converged => self.advance_explicitly(step, batch, &mut outcome.energy),
            Evaluation::Start(_) => {}
            Evaluation::End(blend) => {
                self.advance_implicitly(IrreversibleStep { blend, length: step.length }, batch, outcome);
            }
        }
    }

    fn add_step_energy(&self, _: Evaluation, _: Step, batch: &Batch<D, S>, energy: &mut Energy) {
        let Some(law) = self.laws.get(batch.material) else { return };
        let Some([Pack([before]), Pack([after])]) = self.damage.both(batch.number) else { return };
        for lane in 0..batch.count {
            let stresses = [&batch.elastic_stress_before, &batch.elastic_stress];
            let [first, last] = stresses.map(|stress| law.release_rate(&stress.lane(lane)));
            let growth = batch.cells.volume[lane] * (after[lane] - before[lane]);
            energy[DAMAGE] += 0.5 * growth * (first + last);
            energy[NUMERICAL] += 0.5 * growth * (last - first);
        }
    }

    fn weaken(&self, batch: &mut Batch<D, S>) {
        if let Some(Pack([damage])) = self.damage.converged(batch.number) {
            batch.integrity.weaken(left(damage));
        }
    }

    /// An error `e` of the damage is an error of the stress of `e` times the undamaged stress.
    fn add_error(&self, curvature: Curvature, batch: &mut Batch<D, S>, error: &mut StressError) {
        let Some(law) = self.laws.get(batch.material) else { return };
        let Some([Pack([now]), Pack([before]), Pack([earlier])]) = self.damage.last_three(batch.number)
        else {
            return;
        };
        for lane in 0..batch.count {
            let off = curvature.error([now[lane], before[lane], earlier[lane]]);
            let twice = 2.0 * law.release_rate(&batch.elastic_stress.lane(lane));
            error.error += batch.cells.volume[lane] * off * off * twice;
        }
        batch.integrity.weaken(left(now));
    }

    fn histories(&self) -> Vec<&dyn HistoryStore> {
        vec![&self.damage]
    }

    fn visit_histories(&mut self, visit: &mut dyn FnMut(&mut dyn HistoryStore)) {
        visit(&mut self.damage);
    }
}
