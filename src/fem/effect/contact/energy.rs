//! Energies that a contact stores, dissipates and exchanges with its obstacle, and its penetration.

use super::{
    Contact,
    point::{Point, Vectors::Body},
};
use crate::{
    error::Result,
    fem::effect::{EnergyKind, Role},
    linear_algebra::tensor::larger,
};

/// Dissipated by contact, or absorbed by contact memory.
pub const CONTACT: EnergyKind = EnergyKind::new(4, Role::Dissipated, "contact_dissipation");
/// Stored in contact (compliant foundations).
pub const STORED_IN_CONTACT: EnergyKind = EnergyKind::new(7, Role::Stored, "contact_energy");

impl<const D: usize> Contact<D> {
    /// Energy in J that a step of this length dissipated, its numerical part, and the work of the obstacle on the body, from
    /// velocities at the end of the step (with ghosts).
    ///
    /// With the penetrations `d`, the energy `e` of the law and a gap that grows by `g`, `k p v = (e(d_n) - e(d_{n-1})) + p g +
    /// (p (d_n - d_{n-1}) - e(d_n) + e(d_{n-1}))`: stored energy, work on the obstacle, numerical part. Friction `q` on an obstacle
    /// with the velocity `w` absorbs `k q . v = k q . (v - w) + k q . w`: dissipation, work on the obstacle. Where the gap grows by wear,
    /// `p` times this growth is dissipated.
    pub fn energy_of_step(&self, velocity: &[f64], length: f64) -> [f64; 3] {
        let mut sums = [0.0; 3];
        for point in &self.points {
            let v = point.normal_component(Body, velocity);
            let pressure = point.pressure_at(&self.law, Body, velocity);
            let work = length * pressure * v;
            let change = point.context.step_length * v;
            let after = point.context.penetration + change;
            let mismatch = length * v - change - point.blend_offset;
            let energies = self.law.energy(after).zip(self.law.energy(point.penetration_before));
            let stored = energies.map(|(after, before)| after - before);
            let before = if point.penetration_before.is_finite() { point.penetration_before } else { 0.0 };
            let numerical = match stored {
                None => 0.0,
                Some(stored) if pressure == 0.0 => stored,
                Some(stored) => stored - pressure * (after - before) - pressure * mismatch,
            };
            let stored = stored.unwrap_or(0.0);
            let given = if pressure == 0.0 { 0.0 } else { pressure * point.growth };
            sums[0] += point.weight * (work - stored + numerical - given);
            sums[1] += point.weight * numerical;
            sums[2] -= point.weight * given;
        }
        if let Some(friction) = &self.friction {
            sums[0] += length * friction.power(velocity);
            sums[2] += length * friction.driving_power();
        }
        sums
    }

    /// Largest penetration in m of points on this rank at `time`; minus infinity where none can touch the obstacle. A gap that
    /// is NaN is ignored: the first step refuses it.
    pub fn deepest(&self, time: f64, displacement: &[f64]) -> f64 {
        let depth = |point: &Point<D>| {
            let gap = self.gap_at(time, point);
            gap.map_or(f64::NEG_INFINITY, |gap| point.normal_component(Body, displacement) - gap)
        };
        self.points.iter().map(depth).fold(f64::NEG_INFINITY, larger)
    }

    /// Energy in J stored at `time`, from displacements with ghosts.
    pub fn stored_energy(&self, time: f64, displacement: &[f64]) -> Result<f64> {
        if self.law.energy(0.0).is_none() {
            return Ok(0.0);
        }
        let energy = |point: &Point<D>| {
            let gap = self.gap_at(time, point)?;
            let stored = self.law.energy(point.normal_component(Body, displacement) - gap);
            Ok(point.weight * stored.unwrap_or(0.0))
        };
        self.points.iter().map(energy).sum()
    }
}
