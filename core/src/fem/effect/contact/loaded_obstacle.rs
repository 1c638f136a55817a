//! The obstacle of a contact, which a force may move along a direction, and a moment may turn about its centre.
//!
//! With the displacement `x` of the obstacle along the direction `d`, the force `F` and the contact tractions, `m x'' = F + R`, where `R`
//! is the resultant of the tractions on the obstacle along `d`. In a step the displacement and the velocity `w` change as those of the
//! body: `x = x~ + k' w` and `m (w - w~) / k' = F + R`, with the blends `x~` and `w~` of earlier states and the length `k'` of the
//! scheme. `w` is an unknown of Newton's method, as are the velocities of the body. The same holds for the angle, the angular velocity, the
//! moment of inertia and the moments about the centre.
//!
//! Where the equations of a step hold at its midpoint, `m (w_m - w_{n-1}) / (k / 2) = F + R` and `x_n = x_{n-1} + k w_m`; the velocity is
//! extrapolated, `w_n = 2 w_m - w_{n-1}`, except that of an obstacle without mass.
//!
//! Energy: with the inertia force `I = m (w - w~) / k'` of the step, `I = F + R`, and
//! `d(1/2 m w^2) = F~ dx + R~ dx + numerical`, `numerical = d(1/2 m w^2) - I dx + (F - F~) dx + (R - R~) dx`, where `F~` and `R~` are the
//! forces of the step or, for a formula of second order, their means over it. `R~ dx` is minus the work of the obstacle on the body.

use super::point::{Point, Vectors::Body};
use crate::{
    error::Result,
    fem::effect::{Blend, Curvature, Energy, EnergyKind, Role, WORK},
    laws::{
        contact::{Gap, ObstacleLoad, Rate},
        expression::Scalar,
    },
    linear_algebra::tensor::{Vector, add_scaled, cross, in_space, norm},
};

/// Kinetic energy of the obstacles that forces and moments move.
pub const OBSTACLE_KINETIC: EnergyKind = EnergyKind::new(
    11,
    Role::Stored,
    "obstacle_kinetic_energy",
    "kinetic energy of obstacles that forces and moments move (`obstacle_load`), of their translation and rotation",
);
/// Work of the forces and moments on obstacles.
pub const OBSTACLE_WORK: EnergyKind = EnergyKind::new(
    12,
    Role::Work,
    "obstacle_work",
    "work of these forces and moments on the obstacles since time 0",
);
/// Terms of the time scheme in the motions of obstacles.
pub const OBSTACLE_NUMERICAL: EnergyKind = EnergyKind::new(
    13,
    Role::Numerical,
    "obstacle_numerical_dissipation",
    "dissipated by the time scheme in the motion of these obstacles since time 0; negative if the scheme produces energy",
);

/// The distance between two places of an obstacle, relative to its size, of which the difference of gaps is taken.
const NEAR: f64 = 1e-5;

/// A degree of freedom of an obstacle, in the order of lists of its motions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Freedom {
    /// Along its direction.
    Translation,
    /// About its axis.
    Rotation,
}

impl Freedom {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Translation, Self::Rotation];
}

/// A motion with one degree of freedom and the force, or the moment, that drives it.
#[derive(Debug)]
pub struct LoadedMotion {
    /// The force as a function of time.
    pub force: Scalar,
    mass: f64,
    /// Displacement in m (angle) and velocity in m/s (rad/s) after the last step, and before it.
    pub converged: [f64; 2],
    /// The same at the start of the run.
    start: [f64; 2],
    earlier: [f64; 2],
    /// Displacement at the end of the current step, and the velocity in its equations.
    trial: [f64; 2],
    /// Resultant in N (N m) of the contact tractions in the last step and in the current one.
    resultant: [f64; 2],
    blend: Blend,
    /// The force in N where the equations of the current step hold, and the velocity in m/s from which it starts.
    pub driving: f64,
    first: f64,
}

/// The obstacle of a contact, with the force and the moment that move it, if there are any.
#[derive(Debug)]
pub struct Obstacle<const D: usize> {
    /// Distance to the obstacle along the normal.
    pub gap: Gap,
    /// Whether the unknowns of the points are relative to its motion.
    pub follows: bool,
    /// Its motion along the direction and about the axis, where a force and a moment cause them: one for each [`Freedom`].
    pub motions: [Option<LoadedMotion>; 2],
    /// Unit vectors, each of a motion that there is.
    direction: Vector<D>,
    axis: Vector<3>,
    /// The formula of its velocity in the current step.
    pub(super) rate: Rate,
    /// If a moment turns it: for each point, the place that touches it relative to the centre, where the equations of the step hold.
    arms: Vec<Vector<D>>,
}

impl<const D: usize> Obstacle<D> {
    /// The obstacle at time 0, which no force moves.
    pub(super) fn new(gap: Gap) -> Self {
        let (motions, rate) = ([None, None], Rate::euler(0.0, 1.0));
        Self { gap, follows: true, motions, direction: [0.0; D], axis: [0.0; 3], rate, arms: Vec::new() }
    }

    /// Lets a force and a moment move it.
    pub fn set_load(&mut self, load: &ObstacleLoad) {
        let direction: Vector<D> = std::array::from_fn(|i| load.direction.get(i).copied().unwrap_or(0.0));
        let axis = self.gap.axis();
        self.direction = direction.map(|x| x / norm(&direction));
        self.axis = axis.map(|x| x / norm(&axis));
        let moves = !load.direction.is_empty();
        self.motions = [
            moves.then(|| LoadedMotion::new(load.force.clone(), load.mass, load.velocity)),
            load.moment.as_ref().map(|moment| {
                LoadedMotion::new(moment.clone(), load.moment_of_inertia, load.angular_velocity)
            }),
        ];
    }

    /// Whether forces or moments move it.
    pub fn is_driven(&self) -> bool {
        self.moves() || self.turns()
    }

    /// Whether its surface may move.
    pub fn surface_may_move(&self) -> bool {
        self.is_driven() || self.gap.surface_may_move()
    }

    /// Sets the velocities to those from which the step starts.
    pub fn restart(&mut self) {
        self.motions.iter_mut().flatten().for_each(LoadedMotion::restart);
    }

    /// The velocity in m/s of the material at this place relative to the centre for each motion at 1 m/s (1 rad/s). The component of a
    /// force along it is the force along the direction, and its moment about the axis.
    pub(super) fn velocities_at(&self, arm: &Vector<D>) -> [Option<Vector<D>>; 2] {
        let turned = || {
            let velocity = cross(&self.axis, &in_space(arm));
            std::array::from_fn(|i| velocity[i])
        };
        [self.moves().then_some(self.direction), self.turns().then(turned)]
    }

    /// By how much its velocity along its direction in m/s differs from that at the start of the step.
    pub(super) fn change(&self) -> f64 {
        self.motions[0].as_ref().map_or(0.0, LoadedMotion::change)
    }

    /// Commits the motion of the step.
    pub fn commit(&mut self) {
        self.motions.iter_mut().flatten().for_each(LoadedMotion::commit);
    }

    /// The velocity in m/s of its material at this place relative to the centre, in the equations of the step.
    pub(super) fn velocity_at(&self, arm: &Vector<D>) -> Vector<D> {
        let mut velocity = [0.0; D];
        for (motion, along) in self.motions.iter().zip(self.velocities_at(arm)) {
            if let (Some(motion), Some(along)) = (motion, along) {
                velocity = add_scaled(&velocity, motion.velocity(), &along);
            }
        }
        velocity
    }

    /// The direction along which a force moves it and the length in s that multiplies its velocity in the displacement of a step.
    pub(super) fn translation(&self) -> Option<(&Vector<D>, f64)> {
        self.motions[0].as_ref().map(|motion| (&self.direction, motion.blend.way()))
    }

    /// The velocity in m/s of its material at this place relative to the centre by its rotation alone.
    pub(super) fn turning_velocity(&self, arm: &Vector<D>) -> Vector<D> {
        let [_, turned] = self.velocities_at(arm);
        let speed = self.motions[1].as_ref().map_or(0.0, LoadedMotion::velocity);
        turned.map_or([0.0; D], |velocity| velocity.map(|v| speed * v))
    }

    /// Whether a force moves the obstacle.
    pub(super) fn moves(&self) -> bool {
        self.motions[0].is_some()
    }

    /// Whether a moment turns the obstacle.
    pub(super) fn turns(&self) -> bool {
        self.motions[1].is_some()
    }

    /// Places as seen from the obstacle: after the last step.
    pub fn seen_before(&self, place: &Vector<D>) -> Vector<D> {
        self.seen(place, |motion| motion.converged[0])
    }

    /// Places as seen from the obstacle: before the last step.
    pub(super) fn seen_earlier(&self, place: &Vector<D>) -> Vector<D> {
        self.seen(place, |motion| motion.earlier[0])
    }

    /// Places as seen from the obstacle: at the end of the current step.
    pub(super) fn seen_after(&self, place: &Vector<D>) -> Vector<D> {
        self.seen(place, |motion| motion.trial[0])
    }

    fn seen(&self, place: &Vector<D>, displacement: impl Fn(&LoadedMotion) -> f64) -> Vector<D> {
        let Some(motion) = &self.motions[0] else { return *place };
        add_scaled(place, -displacement(motion), &self.direction)
    }

    /// The displacement in m of a point along the normal at `time`, and its gap there, where the obstacle is after the last step, and
    /// with the wear until then; from nodal displacements of the body.
    pub(super) fn position_at(&self, time: f64, displacement: &[f64], point: &Point<D>) -> Result<[f64; 2]> {
        let (place, worn) = (&point.place, point.worn[0]);
        let along = point.normal_component(Body, displacement);
        let seen = self.seen_before(place);
        Ok([along, self.gap_of(point, time, &seen, along - worn)? + worn])
    }

    /// The gap in m of a point whose surface has `moved` along the normal and that an obstacle which forces move sees at `seen`.
    pub(super) fn gap_of(&self, point: &Point<D>, time: f64, seen: &Vector<D>, moved: f64) -> Result<f64> {
        Ok(point.stretch * self.ray(point, time, (seen, moved))? + point.distance)
    }

    /// The length in m of the ray to the obstacle along the normal of a point that has `moved` along it. That of a point which slides any
    /// distance begins where the point is: elsewhere on its line may be the inside of an obstacle from which its surface looks away.
    fn ray(&self, point: &Point<D>, time: f64, (seen, moved): (&Vector<D>, f64)) -> Result<f64> {
        let normal = &point.normal;
        match point.undeformed() {
            Some(_) => Ok(moved + self.gap.at(time, &add_scaled(seen, moved, normal), normal)?),
            None => self.gap.of_moved(time, seen, normal, moved),
        }
    }

    /// The gap in m of a point of the undeformed surface without wear from an obstacle that it sees at `seen`, after the point has moved.
    pub(super) fn reach_from(&self, point: &Point<D>, seen: &Vector<D>) -> Result<f64> {
        self.ray(point, self.rate.time, (seen, point.moved))
    }

    /// The velocity at which the gap of a point at the end of the step grows with that of a translation.
    pub(super) fn growth(&self, point: &Point<D>) -> Result<f64> {
        let Some((direction, way)) = self.translation() else { return Ok(0.0) };
        let away = norm(&add_scaled(&point.place, -1.0, &self.gap.centre(self.rate.time)));
        let distance = NEAR * away.max(point.reach.abs());
        Ok(self.growth_along(point, direction, distance)? * way / point.context.step_length)
    }

    /// By how much the gap of a point grows, relative to a short `distance` in m by which the obstacle moves to and fro along a direction.
    pub(super) fn growth_along(&self, point: &Point<D>, direction: &Vector<D>, distance: f64) -> Result<f64> {
        let seen = self.seen_after(&point.place);
        let reach = |way: f64| self.reach_from(point, &add_scaled(&seen, -way, direction));
        Ok((reach(distance)? - reach(-distance)?) / (2.0 * distance))
    }

    /// Sets the places at which the rays along the normals of the points meet it if a moment turns it, relative to its centre; zero where
    /// they do not meet it. Where laws take means over the step, those in its middle.
    pub(super) fn set_arms(&mut self, points: &[Point<D>]) {
        if !self.turns() {
            return;
        }
        let [[start, _], _] = self.rate.before;
        let [centre, before] = [self.rate.time, start].map(|time| self.gap.centre(time));
        let mut arms = std::mem::take(&mut self.arms);
        arms.clear();
        arms.extend(points.iter().map(|point| {
            if point.reach == f64::INFINITY {
                return [0.0; D];
            }
            let after = arm(point, &self.seen_after(&point.place), point.reach, &centre);
            if point.context.mean_from.is_none() {
                return after;
            }
            let start = arm(point, &self.seen_before(&point.place), point.reach - point.growth, &before);
            std::array::from_fn(|i| 0.5 * (start[i] + after[i]))
        }));
        self.arms = arms;
    }

    /// The velocity of its material at a point, by the number of the point, for a motion at 1 m/s (1 rad/s).
    pub(super) fn carrying(&self, freedom: Freedom, at: usize) -> Vector<D> {
        self.velocities_at(&self.arm(at))[freedom as usize].unwrap_or([0.0; D])
    }

    /// The place that touches it relative to the centre, by the number of the point; zero if no moment turns it.
    pub(super) fn arm(&self, at: usize) -> Vector<D> {
        self.arms.get(at).copied().unwrap_or([0.0; D])
    }

    /// The change of the velocity of the obstacle's material at a point with the velocity of its translation, in a step in which it also
    /// turns: the ray along the normal meets it at another place.
    pub(super) fn sweep(&self, at: usize, point: &Point<D>) -> Result<Vector<D>> {
        let (Some((direction, way)), true) = (self.translation(), point.reach < f64::INFINITY) else {
            return Ok([0.0; D]);
        };
        let slope = self.growth_along(point, direction, NEAR * norm(&self.arms[at]))?;
        let rate = add_scaled(&direction.map(|x| -x), slope, &point.normal);
        let share = if point.context.mean_from.is_none() { way } else { 0.5 * way };
        let velocity = self.turning_velocity(&rate);
        Ok(if slope.is_finite() { velocity.map(|v| share * v) } else { [0.0; D] })
    }
}

impl LoadedMotion {
    fn new(force: Scalar, mass: f64, velocity: f64) -> Self {
        let start = [0.0, velocity];
        let (converged, earlier, trial) = (start, start, start);
        let resultant = [0.0; 2];
        Self {
            force,
            mass,
            converged,
            start,
            earlier,
            trial,
            resultant,
            blend: Blend::euler(0.0),
            driving: 0.0,
            first: velocity,
        }
    }

    /// Displacement in m and velocity in m/s where the equations of the last step held.
    pub fn balanced(&self) -> [f64; 2] {
        let [displacement, velocity] = self.trial;
        [displacement - (self.blend.way() - self.blend.length) * velocity, velocity]
    }

    /// The way in m (rad) in the step just solved, before it is committed.
    pub fn way(&self) -> f64 {
        (self.end()[0] - self.converged[0]).abs()
    }

    /// Displacement and velocity, each at the end of the step, after the last one, before it, and at the start of the run.
    pub fn last_values(&self) -> [[f64; 4]; 2] {
        [0, 1].map(|kind| [self.trial[kind], self.converged[kind], self.earlier[kind], self.start[kind]])
    }

    /// Displacement and velocity after the last step and before it, for checkpoints.
    pub fn saved(&self) -> [f64; 4] {
        let [[x, w], [y, v]] = [self.converged, self.earlier];
        [x, w, y, v]
    }

    /// Sets what [`saved`](Self::saved) gave.
    pub fn restore(&mut self, [x, w, y, v]: [f64; 4]) {
        (self.converged, self.earlier, self.trial) = ([x, w], [y, v], [x, w]);
    }

    /// The resultant in N of the contact tractions in the last step, 0 before, for checkpoints.
    pub fn resultant(&self) -> f64 {
        self.resultant[0]
    }

    /// Sets what [`resultant`](Self::resultant) gave.
    pub fn restore_resultant(&mut self, resultant: f64) {
        self.resultant = [resultant; 2];
    }

    /// Starts a step whose equations hold at `time` in s, from the last velocity or, if the ratio of the length of the step to that of the last
    /// one is given, from that extrapolated.
    pub fn start(&mut self, blend: Blend, time: f64, ratio: Option<f64>) {
        self.blend = blend;
        self.driving = self.force.evaluate(time, &[]);
        let [now, before] = [self.converged[1], self.earlier[1]];
        self.first = now + ratio.unwrap_or(0.0) * (now - before);
        self.restart();
    }

    /// Sets the velocity from which the step starts.
    pub fn restart(&mut self) {
        self.set_velocity(self.first);
    }

    /// The velocity in m/s in the equations of the step.
    pub fn velocity(&self) -> f64 {
        self.trial[1]
    }

    /// By how much it differs from that from which the step starts.
    pub fn change(&self) -> f64 {
        self.trial[1] - self.first
    }

    /// The change of the velocity in m/s to that without contact; infinite or NaN without mass.
    pub fn change_to_free(&self) -> f64 {
        let [_, before] = self.momentum_rates();
        (before + self.driving) / self.inertia() - self.trial[1]
    }

    /// Sets the velocity in m/s in the equations of the step.
    pub fn set_velocity(&mut self, velocity: f64) {
        let start = self.blend.of(self.converged[0], self.earlier[0]);
        self.trial = [start + self.blend.way() * velocity, velocity];
    }

    /// `m (w - w~) / k' - F - R` in N, given the resultant `R` in N, and the largest of the terms.
    pub fn unbalanced(&mut self, resultant: f64) -> [f64; 2] {
        self.resultant[1] = resultant;
        let momentum = self.momentum_rates();
        let force = self.driving;
        let terms = [momentum[0], momentum[1], force, resultant];
        [
            momentum[0] - momentum[1] - force - resultant,
            terms.iter().fold(0.0, |most, term| f64::max(most, term.abs())),
        ]
    }

    /// `m w / k'` and `m w~ / k'` in N.
    fn momentum_rates(&self) -> [f64; 2] {
        let before = self.blend.of(self.converged[1], self.earlier[1]);
        [self.trial[1], before].map(|velocity| self.mass * velocity / self.blend.length)
    }

    /// `m / k'` in kg/s.
    pub fn inertia(&self) -> f64 {
        self.mass / self.blend.length
    }

    /// Displacement and velocity at the end of the step.
    fn end(&self) -> [f64; 2] {
        let [displacement, velocity] = self.trial;
        // Without mass the velocity may jump.
        [displacement, if self.mass > 0.0 { self.blend.end(self.converged[1], velocity) } else { velocity }]
    }

    /// Kinetic energy in J after the last step.
    pub fn kinetic_energy(&self) -> f64 {
        0.5 * self.mass * self.converged[1] * self.converged[1]
    }

    /// Energies of the solved step before it is committed, given the time in s of its start; the work of the contact tractions counts as
    /// work.
    pub fn energy_of_step(&self, start: f64) -> Energy {
        let [displacement, velocity] = self.end();
        let (way, kinetic) = (displacement - self.converged[0], 0.5 * self.mass * velocity * velocity);
        let [momentum, before] = self.momentum_rates();
        let [resultant_before, resultant] = self.resultant;
        let force = self.driving;
        let [mean_force, mean_resultant] = if self.blend.earlier == 0.0 {
            [force, resultant]
        } else {
            [0.5 * (force + self.force.evaluate(start, &[])), 0.5 * (resultant + resultant_before)]
        };
        let open = (force - mean_force) + (resultant - mean_resultant) - (momentum - before);
        Energy::from([
            (OBSTACLE_KINETIC, kinetic),
            (OBSTACLE_WORK, mean_force * way),
            (WORK, mean_resultant * way),
            (OBSTACLE_NUMERICAL, kinetic - self.kinetic_energy() + open * way),
        ])
    }

    /// Squares of the error of the velocity in a solved step and of the velocity itself, both times the mass, in J.
    pub fn velocity_error(&self, curvature: Curvature) -> [f64; 2] {
        let [_, velocity] = self.trial;
        let error = curvature.error([velocity, self.converged[1], self.earlier[1]]);
        [error, velocity].map(|velocity| self.mass * velocity * velocity)
    }

    fn commit(&mut self) {
        (self.earlier, self.converged) = (self.converged, self.end());
        self.resultant[0] = self.resultant[1];
    }
}

/// The place at which the ray of a point meets the obstacle relative to its centre.
fn arm<const D: usize>(point: &Point<D>, seen: &Vector<D>, reach: f64, centre: &Vector<D>) -> Vector<D> {
    add_scaled(&add_scaled(seen, reach, &point.normal), -1.0, centre)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fem::effect::Step;

    fn falling() -> LoadedMotion {
        LoadedMotion::new(Scalar::Number(6.0), 3.0, 1.0)
    }

    #[test]
    fn a_disc_that_falls_and_turns_is_loaded_by_forces_and_their_moments() {
        let load = ObstacleLoad {
            direction: vec![0.0, -2.0],
            velocity: 1.0,
            moment: Some(Scalar::Number(0.0)),
            angular_velocity: -3.0,
            ..ObstacleLoad::default()
        };
        let mut disc = Obstacle::<2>::new(Gap::Distance(Scalar::Number(0.0)));
        disc.set_load(&load);
        // At its lowest point, half a metre below its centre.
        let velocities = disc.velocities_at(&[0.0, -0.5]).map(|velocity| velocity.expect("both"));
        assert_eq!(velocities, [[0.0, -1.0], [0.5, 0.0]]);
        assert_eq!((disc.velocity_at(&[0.0, -0.5]), disc.turns()), ([-1.5, -1.0], true));
        let [falling, turning] = disc.motions.each_mut().map(|motion| motion.as_mut().expect("both"));
        for motion in [falling, turning] {
            motion.start(Blend::euler(0.5), 0.5, None);
            motion.set_velocity(2.0);
        }
        assert_eq!(disc.seen_after(&[1.0, 0.0]), [1.0, 1.0]);
        assert_eq!(disc.seen_before(&[1.0, 0.0]), [1.0, 0.0]);
        disc.commit();
        assert_eq!(
            disc.motions.each_ref().map(|motion| motion.as_ref().expect("both").converged),
            [[1.0, 2.0]; 2]
        );
        disc.set_load(&ObstacleLoad { direction: vec![], ..load });
        assert_eq!((disc.seen_after(&[1.0, 0.0]), disc.moves()), ([1.0, 0.0], false));
    }

    #[test]
    fn a_step_starts_from_an_extrapolated_velocity_and_may_be_free() {
        let mut obstacle = falling();
        obstacle.restore([0.0, 2.0, 0.0, 1.5]);
        obstacle.start(Blend::euler(0.5), 0.5, Some(2.0));
        assert_eq!((obstacle.velocity(), obstacle.driving), (3.0, 6.0));
        // 2 m/s + 6 N / 3 kg 0.5 s = 3 m/s.
        assert_eq!(obstacle.change_to_free(), 0.0);
        obstacle.set_velocity(7.0);
        assert_eq!(obstacle.change(), 4.0);
        obstacle.restart();
        assert_eq!(obstacle.velocity(), 3.0);
        obstacle.start(Blend::euler(0.5), 0.5, None);
        assert_eq!(obstacle.velocity(), 2.0);
    }

    #[test]
    fn steps_of_both_schemes_by_hand() {
        let mut obstacle = falling();
        obstacle.start(Blend::euler(0.5), 0.5, None);
        obstacle.set_velocity(2.0);
        // 3 kg (2 - 1) m/s / 0.5 s = 6 N.
        assert_eq!(obstacle.unbalanced(0.0), [0.0, 12.0]);
        assert_eq!(obstacle.unbalanced(-2.0)[0], 2.0);
        obstacle.commit();
        assert_eq!(obstacle.converged, [1.0, 2.0]);
        // The second-order formula: x~ = 4/3 1, w~ = 4/3 2 - 1/3 1 = 7/3, k' = 1/3 s; 3 m/s are 3 (3 - 7/3) / (1/3) = 6 N.
        obstacle.start(
            Blend { recent: 4.0 / 3.0, earlier: -1.0 / 3.0, ..Blend::euler(1.0 / 3.0) },
            1.0,
            None,
        );
        obstacle.set_velocity(3.0);
        assert!(obstacle.unbalanced(0.0)[0].abs() < 1e-13);
        obstacle.commit();
        assert!((obstacle.converged[0] - 7.0 / 3.0).abs() < 1e-15);
        let mut other = falling();
        other.restore(obstacle.saved());
        assert_eq!(other.saved(), obstacle.saved());
    }

    #[test]
    fn a_step_through_its_midpoint_loses_no_energy_and_others_lose_what_they_state() {
        let mut obstacle = falling();
        // 3 kg from 1 m/s under 6 N + 3 N for 0.5 s: 2.5 m/s, 0.875 m on the way.
        obstacle.start(Blend::midpoint(0.5), 1.0, None);
        obstacle.set_velocity(1.75);
        assert_eq!(obstacle.unbalanced(3.0)[0], 0.0);
        let energy = obstacle.energy_of_step(f64::NAN);
        let values = [OBSTACLE_KINETIC, OBSTACLE_WORK, WORK, OBSTACLE_NUMERICAL].map(|kind| energy[kind]);
        assert_eq!(values, [9.375, 5.25, 2.625, 0.0]);
        obstacle.commit();
        assert_eq!((obstacle.converged, obstacle.resultant()), ([0.875, 2.5], 3.0));
        assert_eq!(obstacle.balanced(), [0.4375, 1.75], "at the midpoint");
        // Implicit Euler to 4 m/s: 3 kg 1.5 m/s / 0.5 s = 9 N over 2 m; 1/2 3 kg (1.5 m/s)^2 are lost.
        obstacle.start(Blend::euler(0.5), 1.0, None);
        obstacle.set_velocity(4.0);
        assert_eq!(obstacle.unbalanced(3.0)[0], 0.0);
        let energy = obstacle.energy_of_step(f64::NAN);
        let values = [OBSTACLE_KINETIC, OBSTACLE_WORK, WORK, OBSTACLE_NUMERICAL].map(|kind| energy[kind]);
        assert_eq!(values, [24.0, 12.0, 6.0, -3.375]);
        assert_eq!(obstacle.balanced(), [2.875, 4.0], "at the end");
        // The second-order formula takes means of forces over the step.
        obstacle.start(Blend { recent: 4.0 / 3.0, earlier: -1.0 / 3.0, ..Blend::euler(0.5) }, 1.0, None);
        obstacle.set_velocity(4.0);
        obstacle.unbalanced(7.0);
        let way = obstacle.trial[0] - obstacle.converged[0];
        let energy = obstacle.energy_of_step(0.5);
        assert!(
            (energy[WORK] - 5.0 * way).abs() < 1e-14 && (energy[OBSTACLE_WORK] - 6.0 * way).abs() < 1e-14
        );
        // One without mass has the velocity of the midpoint.
        let mut light = LoadedMotion { mass: 0.0, ..falling() };
        light.start(Blend::midpoint(0.5), 1.0, None);
        light.set_velocity(1.75);
        light.commit();
        assert_eq!(light.converged, [0.875, 1.75]);
    }

    #[test]
    fn velocities_off_the_straight_line_are_errors() {
        let mut obstacle = falling();
        obstacle.restore([0.0, 2.0, 0.0, 1.0]);
        obstacle.start(Blend::euler(0.5), 1.0, None);
        obstacle.set_velocity(7.0);
        let step = Step { time: 1.0, length: 0.5, previous_length: 0.5 };
        // Half of 7 - (2 + 1) m/s, 3 kg.
        assert_eq!(obstacle.velocity_error(Curvature::of(step)), [12.0, 147.0]);
    }
}
