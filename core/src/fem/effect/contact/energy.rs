//! Energies that a contact stores, dissipates and exchanges with its obstacle, and its penetration.

use super::{
    Contact,
    point::{Point, Vectors::Body},
};
use crate::{
    error::Result,
    fem::effect::{EnergyKind, Role},
    laws::contact::{NodeContext, NormalResponse},
    linear_algebra::tensor::larger,
};

/// Dissipated by contact, or absorbed by contact memory.
pub const CONTACT: EnergyKind = EnergyKind::new(
    4,
    Role::Dissipated,
    "contact_dissipation",
    "dissipated by contact and friction since time 0, with an error of the time scheme in steps in which a rigid \
     obstacle closes or opens; it decreases where foundations return energy (contact memory, `symmetry = \"even\"` in \
     separation)",
);
/// Stored in contact (compliant foundations).
pub const STORED_IN_CONTACT: EnergyKind =
    EnergyKind::new(7, Role::Stored, "contact_energy", "energy stored by contact laws");

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
    /// friction there. Where bodies slide, a point is deeper or less deep because what it faces was found anew: the work on this jump is a
    /// term of the scheme. Of a contact that follows its obstacle, `numerical` contains minus the stored energy at the start of the step,
    /// in place of the change `e(d_n) - e(d_{n-1})`; that at the end is to be added.
    pub fn energy_of_step(&self, velocity: &[f64], length: f64) -> ContactEnergy {
        let mut sum = ContactEnergy { numerical: -self.stored_before, ..ContactEnergy::default() };
        let (law, is_of_two_steps) = (&self.normal.law, self.blend.earlier != 0.0);
        for point in &self.normal.points {
            let v = point.normal_component(Body, velocity);
            let pressure = point.pressure_at(law, Body, velocity);
            let of_supports = point.weight * pressure * point.held_velocity(velocity);
            if !law.depends_on_displacement() {
                sum.dissipated_power += point.weight * pressure * v;
                sum.driving_power += of_supports;
                continue;
            }
            let mean =
                if is_of_two_steps { 0.5 * (pressure + pressure_before(law, point)) } else { pressure };
            let change = point.context.step_length * v;
            let eroded = point.worn[0] - point.worn[1] - point.continued_wear;
            let after = point.context.penetration + change - eroded;
            // Without an obstacle at the start, or at the end, nothing is exchanged there.
            let times = |pressure: f64, way: f64| {
                if pressure == 0.0 || !way.is_finite() { 0.0 } else { pressure * way }
            };
            let before = if point.penetration_before.is_finite() { point.penetration_before } else { 0.0 };
            let energies = law.energy(after).zip(law.energy(point.penetration_before));
            let found_deeper = found_deeper(law, point);
            let lost = match energies {
                Some(_) => lost_at_wall(law, pressure, [point.penetration_before - found_deeper, after]),
                // As the work on an obstacle that moves.
                None => {
                    let pressure = if point.growth == 0.0 { pressure } else { mean };
                    times(pressure, after - (before - found_deeper))
                }
            };
            let stored = energies.filter(|_| !self.follows_surface).map_or(0.0, |energies| {
                point.weight * (energies.0 - energies.1) + (point.weight - point.weight_before) * energies.1
            });
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
            let damped = damping_power(law, point, [after, (after - before) / length], is_of_two_steps);
            sum.dissipated_power += point.weight * damped;
            sum.numerical += stored + point.weight * (dissipated + given + length * (damped - pressure * v));
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
            let point = self.facing(point, time, displacement);
            let [along, gap] = self.obstacle.position_at(time, displacement, &point)?;
            let stored = self.normal.law.energy(along - gap);
            Ok(point.weight * stored.unwrap_or(0.0))
        };
        self.normal.points.iter().map(energy).sum()
    }
}

/// By how much a point is deeper in m at the start of a step because what it faces was found anew. A point that follows an obstacle and
/// pressed on a rigid one was at its surface.
fn found_deeper<const D: usize>(law: &NormalResponse, point: &Point<D>) -> f64 {
    let before = point.penetration_before;
    if point.undeformed().is_none() || !before.is_finite() {
        return point.found_deeper;
    }
    let [wall, stored] = law.wall().unwrap_or_default();
    let was = if pressure_before(law, point) > stored { wall } else { before.min(wall) };
    before - was
}

/// Pressure in Pa at a point before the step.
fn pressure_before<const D: usize>(law: &NormalResponse, point: &Point<D>) -> f64 {
    let is_stored = point.unknown.has_pressure() && law.damping() > 0.0;
    if law.has_vertical_parts() || is_stored {
        return point.pressure_before;
    }
    let penetration = point.penetration_before;
    law.pressure(
        0.0,
        NodeContext { penetration, depth_before: penetration.max(0.0), ..NodeContext::AT_THE_GAP },
    )
}

/// What a rigid obstacle behind a law that stores energy dissipates of the work of this pressure in Pa in J/m^(D-1), where the
/// penetration in m changes from the first to the second value: that inside of it, beyond what the law stores.
fn lost_at_wall(law: &NormalResponse, pressure: f64, penetrations: [f64; 2]) -> f64 {
    let Some([wall, stored]) = law.wall() else { return 0.0 };
    let [before, after] = penetrations.map(|penetration| larger(penetration - wall, 0.0));
    if pressure > stored { (pressure - stored) * (after - before) } else { 0.0 }
}

/// Power in W/m^(D-1) that the dashpot at a point dissipates at the end of the step, at this penetration in m, which has grown by
/// this mean rate in m/s; the formula of the step may be one of two steps.
fn damping_power<const D: usize>(
    law: &NormalResponse,
    point: &Point<D>,
    [after, growth]: [f64; 2],
    of_two_steps: bool,
) -> f64 {
    if law.damping() == 0.0 || !growth.is_finite() {
        return 0.0;
    }
    let rate = if of_two_steps {
        (after.max(0.0) - point.context.depth_before) / point.context.step_length
    } else {
        growth
    };
    law.damping_pressure(after, point.context) * rate
}
