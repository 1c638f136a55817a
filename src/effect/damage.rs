use super::{Curvature, Effect, Energy, History, Phases, Step, StressError, cell_history::CellHistory};
use crate::{
    lanes::{LANES, Pack},
    material::{self, ByMaterial},
    space::{Batch, CellRun, Needs},
};

/// Isotropic damage `d`, one number for each cell that may be damaged: the elastic and viscoplastic stress counts by the
/// share `1 - d`, viscous stress in full.
///
/// `d_n` follows from `d_{n-1}` and the energy `Y_{n-1}` of `S_{n-1} = E e(u_{n-1}) + H_{n-1}`, so that the loss of elastic
/// energy in the step is exactly `(d_n - d_{n-1}) Y_{n-1}`, the dissipation; all other terms of the elastic energy count by
/// `1 - d_n`.
#[derive(Debug)]
pub struct Damage {
    laws: ByMaterial<material::Damage>,
    damage: CellHistory<1>,
}

impl Damage {
    /// Sound cells, for the runs whose material has a law.
    pub fn new(laws: ByMaterial<material::Damage>, runs: &[CellRun]) -> Self {
        let damage = CellHistory::new("damage", runs, |material| laws.get(material).is_some());
        Self { laws, damage }
    }
}

/// What damage leaves.
fn left(damage: &[f64; LANES]) -> [f64; LANES] {
    damage.map(|damage| 1.0 - damage)
}

impl<const D: usize, const S: usize> Effect<D, S> for Damage {
    fn name(&self) -> &'static str {
        "damage"
    }

    fn phases(&self) -> Phases {
        let stress = Needs { strain: true, elastic_stress: true, ..Needs::default() };
        Phases { explicit: Some(stress), error: Some(stress), weakens: true, ..Phases::default() }
    }

    fn is_everywhere(&self) -> bool {
        self.laws.is_everywhere()
    }

    fn add_explicit(&mut self, step: Step, batch: &mut Batch<D, S>, energy: &mut Energy) {
        let Some(law) = self.laws.get(batch.material) else { return };
        let Some((Pack([before]), Pack([after]))) = self.damage.both(batch.number) else { return };
        for lane in 0..batch.count {
            let release_rate = law.release_rate(&batch.elastic_stress.lane(lane));
            after[lane] = law.advance(before[lane], release_rate, step.length);
            energy.damage += batch.cells.volume[lane] * release_rate * (after[lane] - before[lane]);
        }
        batch.integrity.weaken(left(after));
    }

    fn weaken(&self, batch: &mut Batch<D, S>) {
        if let Some(Pack([damage])) = self.damage.converged(batch.number) {
            batch.integrity.weaken(left(damage));
        }
    }

    /// An error `e` of the damage is one of `e` times the stress of the sound cell.
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

    fn keep_earlier(&mut self) {
        self.damage.keep_earlier("previous_damage");
    }

    fn commit(&mut self) {
        self.damage.commit();
    }

    fn histories(&self) -> Vec<History<'_>> {
        vec![self.damage.history()]
    }

    fn earlier_histories(&self) -> Vec<History<'_>> {
        self.damage.earlier_history().into_iter().collect()
    }

    fn restore(&mut self, name: &str, values: &[f64]) {
        self.damage.restore(name, values);
    }
}
