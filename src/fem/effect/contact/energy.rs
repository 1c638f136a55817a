//! Energies that a contact stores, dissipates and exchanges with its obstacle, and its penetration.

use super::{
    Contact,
    point::{Point, Vectors::Body},
};
use crate::{
    error::Result,
    fem::effect::{EnergyKind, Role},
};

/// Dissipated by contact, or absorbed by contact memory.
pub const CONTACT: EnergyKind = EnergyKind::new(4, Role::Dissipated, "contact_dissipation");
/// Stored in contact (compliant foundations).
pub const STORED_IN_CONTACT: EnergyKind = EnergyKind::new(7, Role::Stored, "contact_energy");

/// Energies of a contact in a step, in J, and powers at its end, in W.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ContactEnergy {
    /// Dissipated in impacts on rigid obstacles and by wear.
    pub dissipated: f64,
    /// Terms of the time scheme.
    pub numerical: f64,
    /// Work of the pressures of moving obstacles on the body, and of supports against pressures where they hold the normal.
    pub work: f64,
    /// Power that friction, laws of the velocity and dashpots of laws of the penetration dissipate.
    pub dissipated_power: f64,
    /// Power of the friction of moving obstacles on the body, and of supports against friction and laws of the velocity.
    pub driving_power: f64,
}

impl<const D: usize> Contact<D> {
    /// The energies of a step of this length, from velocities at its end (with ghosts). Under a formula of second order pressures are
    /// means over the step where the obstacle moves or wear grows.
    ///
    /// The pressure takes up `k p v`. With the penetrations `d`, the energy `e` of the law, a gap that grows by `g` and wear by `h`,
    /// `k p v + numerical = (e(d_n) - e(d_{n-1})) + p g + p h`: stored energy, work on the obstacle, dissipation. Where the law stores
    /// nothing, as a rigid obstacle, `p (d_n - d_{n-1})` is dissipated. Friction `q` on an obstacle with the velocity `w` absorbs
    /// `q . v = q . (v - w) + q . w`: dissipation, work on the obstacle. Where supports prescribe a part of `v`, they do the work of pressure and
    /// friction there.
    pub fn energy_of_step(&self, velocity: &[f64], length: f64) -> ContactEnergy {
        let mut sum = ContactEnergy::default();
        let is_of_two_steps = self.blend.earlier != 0.0;
        for point in &self.normal.points {
            let v = point.normal_component(Body, velocity);
            let pressure = point.pressure_at(&self.normal.law, Body, velocity);
            let of_supports = point.weight * pressure * point.held_velocity(velocity);
            if !self.normal.law.depends_on_displacement() {
                sum.dissipated_power += point.weight * pressure * v;
                sum.driving_power += of_supports;
                continue;
            }
            let mean = if is_of_two_steps {
                0.5 * (pressure + self.normal.pressure_before(point))
            } else {
                pressure
            };
            let change = point.context.step_length * v;
            let eroded = point.worn[0] - point.worn[1] - point.continued_wear;
            let after = point.context.penetration + change - eroded;
            // Without an obstacle at the start, or at the end, nothing is exchanged there.
            let times = |pressure: f64, way: f64| {
                if pressure == 0.0 || !way.is_finite() { 0.0 } else { pressure * way }
            };
            let before = if point.penetration_before.is_finite() { point.penetration_before } else { 0.0 };
            let energies =
                self.normal.law.energy(after).zip(self.normal.law.energy(point.penetration_before));
            let (stored, lost) = match energies {
                Some(energies) => (
                    energies.0 - energies.1,
                    self.normal.lost_at_wall(pressure, [point.penetration_before, after]),
                ),
                None => (0.0, times(pressure, after - before)),
            };
            // The growth of the wear that this step has seen, which is no longer stored.
            let worn = if self.wear.is_some() {
                (change + point.blend_offset) - point.growth - (after - before)
            } else {
                0.0
            };
            let dissipated = lost + times(mean, worn);
            let given = times(mean, point.growth);
            sum.dissipated += point.weight * dissipated;
            sum.work += length * of_supports - point.weight * given;
            let damped = self.normal.damping_power(point, after, (after - before) / length, is_of_two_steps);
            sum.dissipated_power += point.weight * damped;
            sum.numerical += point.weight * (stored + dissipated + given + length * (damped - pressure * v));
        }
        if let Some(friction) = &self.friction {
            sum.dissipated_power += friction.power(velocity);
            sum.driving_power += friction.driving_power(velocity);
        }
        sum
    }

    /// Energy in J stored at `time`, from displacements with ghosts.
    pub fn stored_energy(&self, time: f64, displacement: &[f64]) -> Result<f64> {
        if self.normal.law.energy(0.0).is_none() {
            return Ok(0.0);
        }
        let energy = |point: &Point<D>| {
            let [along, gap] = self.obstacle.position_at(time, displacement, point)?;
            let stored = self.normal.law.energy(along - gap);
            Ok(point.weight * stored.unwrap_or(0.0))
        };
        self.normal.points.iter().map(energy).sum()
    }
}
