//! An obstacle that a force moves along a direction, or that a moment turns about its centre.
//!
//! With the displacement `x` of the obstacle along the direction `d`, the force `F` and the contact tractions, `m x'' = F + R`, where `R`
//! is the resultant of the tractions on the obstacle along `d`. In a step the displacement and the velocity `w` change as those of the
//! body: `x = x~ + k' w` and `m (w - w~) / k' = F + R`, with the blends `x~` and `w~` of earlier states and the length `k'` of the
//! scheme. `R` depends on `w`, through the gaps at the end of the step. The same holds for the angle, the angular velocity, the moment of
//! inertia and the moments about the centre.

use crate::{
    fem::effect::Blend,
    laws::{contact::ObstacleLoad, expression::Scalar},
    linear_algebra::tensor::{Vector, add_scaled, cross, norm},
};

/// A motion with one degree of freedom and the force, or the moment, that drives it.
#[derive(Debug)]
pub struct LoadedMotion {
    force: Scalar,
    mass: f64,
    /// Displacement in m (angle) and velocity in m/s (rad/s) after the last step, before it, and at the end of the current one.
    converged: [f64; 2],
    earlier: [f64; 2],
    trial: [f64; 2],
    /// By how much the resultant falls per displacement, in N/m, as found in the last step and in the current one; 0 before.
    stiffness: [f64; 2],
    blend: Blend,
}

/// An obstacle with the force and the moment that move it.
#[derive(Debug)]
pub struct LoadedObstacle<const D: usize> {
    translation: Option<(Vector<D>, LoadedMotion)>,
    rotation: Option<(Vector<3>, LoadedMotion)>,
}

impl<const D: usize> LoadedObstacle<D> {
    /// The obstacle at time 0; `axis` is the direction of its axis of rotation.
    pub fn new(load: &ObstacleLoad, axis: Vector<3>) -> Self {
        let direction: Vector<D> = std::array::from_fn(|i| load.direction.get(i).copied().unwrap_or(0.0));
        let translation = (!load.direction.is_empty()).then(|| {
            let motion = LoadedMotion::new(load.force.clone(), load.mass, load.velocity);
            (direction.map(|x| x / norm(&direction)), motion)
        });
        let rotation = load.moment.as_ref().map(|moment| {
            let motion = LoadedMotion::new(moment.clone(), load.moment_of_inertia, load.angular_velocity);
            (axis.map(|x| x / norm(&axis)), motion)
        });
        Self { translation, rotation }
    }

    /// The motions: along the direction, and about the axis.
    pub fn motions(&self) -> [Option<&LoadedMotion>; 2] {
        [
            self.translation.as_ref().map(|(_, motion)| motion),
            self.rotation.as_ref().map(|(_, motion)| motion),
        ]
    }

    /// The same to be changed.
    pub fn motions_mut(&mut self) -> [Option<&mut LoadedMotion>; 2] {
        [
            self.translation.as_mut().map(|(_, motion)| motion),
            self.rotation.as_mut().map(|(_, motion)| motion),
        ]
    }

    /// The component along the direction of a force on the obstacle, and that of its moment at this place relative to the centre.
    pub fn resultants(&self, force: &Vector<D>, arm: &Vector<D>) -> [f64; 2] {
        let in_space = |vector: &Vector<D>| -> Vector<3> {
            std::array::from_fn(|i| vector.get(i).copied().unwrap_or(0.0))
        };
        let along = self.translation.as_ref().map_or(0.0, |(direction, _)| dot(direction, force));
        let about = self.rotation.as_ref();
        [along, about.map_or(0.0, |(axis, _)| dot(axis, &cross(&in_space(arm), &in_space(force))))]
    }

    /// Commits the motion of the step.
    pub(super) fn commit(&mut self) {
        self.motions_mut().into_iter().flatten().for_each(LoadedMotion::commit);
    }

    /// Velocity in m/s at the end of the step.
    pub(super) fn velocity(&self) -> Vector<D> {
        self.translation
            .as_ref()
            .map_or([0.0; D], |(direction, motion)| direction.map(|x| motion.trial[1] * x))
    }

    /// Angular velocity in rad/s at the end of the step.
    pub(super) fn angular_velocity(&self) -> Vector<3> {
        self.rotation.as_ref().map_or([0.0; 3], |(axis, motion)| axis.map(|x| motion.trial[1] * x))
    }

    /// Whether a moment turns the obstacle.
    pub(super) fn turns(&self) -> bool {
        self.rotation.is_some()
    }

    /// Places as seen from the obstacle: after the last step.
    pub(super) fn seen_before(&self, place: &Vector<D>) -> Vector<D> {
        self.seen(place, |motion| motion.converged[0])
    }

    /// Places as seen from the obstacle: at the end of the current step.
    pub(super) fn seen_after(&self, place: &Vector<D>) -> Vector<D> {
        self.seen(place, |motion| motion.trial[0])
    }

    fn seen(&self, place: &Vector<D>, displacement: impl Fn(&LoadedMotion) -> f64) -> Vector<D> {
        let Some((direction, motion)) = &self.translation else { return *place };
        add_scaled(place, -displacement(motion), direction)
    }
}

fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    (0..N).map(|i| a[i] * b[i]).sum()
}

impl LoadedMotion {
    fn new(force: Scalar, mass: f64, velocity: f64) -> Self {
        let start = [0.0, velocity];
        let (converged, earlier, trial) = (start, start, start);
        Self { force, mass, converged, earlier, trial, stiffness: [0.0; 2], blend: Blend::euler(0.0) }
    }

    /// The force as a function of time.
    pub fn force(&self) -> &Scalar {
        &self.force
    }

    /// Displacement in m and velocity in m/s after the last step.
    pub fn motion(&self) -> [f64; 2] {
        self.converged
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

    /// The stiffness of the contact in N/m as the last step has found it, 0 before, for checkpoints.
    pub fn stiffness(&self) -> f64 {
        self.stiffness[0]
    }

    /// Sets what [`stiffness`](Self::stiffness) gave.
    pub fn restore_stiffness(&mut self, stiffness: f64) {
        self.stiffness = [stiffness; 2];
    }

    /// The slope of [`unbalanced`](Self::unbalanced) in N s/m that the last step has found, if it has.
    pub fn expected_slope(&self) -> Option<f64> {
        (self.stiffness[0] > 0.0).then(|| self.inertia() + self.blend.length * self.stiffness[0])
    }

    /// Keeps the slope in N s/m between the last two velocities of a step for the next one.
    pub fn keep_slope(&mut self, slope: f64) {
        let stiffness = (slope - self.inertia()) / self.blend.length;
        if stiffness > 0.0 && stiffness.is_finite() {
            self.stiffness[1] = stiffness;
        }
    }

    /// Starts a step; returns the velocity in m/s after the last one.
    pub fn start(&mut self, blend: Blend) -> f64 {
        self.blend = blend;
        self.stiffness[1] = self.stiffness[0];
        self.set_velocity(self.converged[1])
    }

    /// Sets the velocity in m/s at the end of the step.
    pub fn set_velocity(&mut self, velocity: f64) -> f64 {
        let start = self.blend.of(self.converged[0], self.earlier[0]);
        self.trial = [start + self.blend.length * velocity, velocity];
        velocity
    }

    /// `m (w - w~) / k' - F - R` in N at the end of a step at `time`, given the resultant `R` in N, and the largest of the terms.
    pub fn unbalanced(&self, time: f64, resultant: f64) -> [f64; 2] {
        let before = self.blend.of(self.converged[1], self.earlier[1]);
        let momentum = [self.trial[1], before].map(|velocity| self.mass * velocity / self.blend.length);
        let force = self.force.evaluate(time, &[]);
        let terms = [momentum[0], momentum[1], force, resultant];
        [
            momentum[0] - momentum[1] - force - resultant,
            terms.iter().fold(0.0, |most, term| f64::max(most, term.abs())),
        ]
    }

    /// `m / k'` in kg/s.
    pub fn inertia(&self) -> f64 {
        self.mass / self.blend.length
    }

    fn commit(&mut self) {
        (self.earlier, self.converged) = (self.converged, self.trial);
        self.stiffness[0] = self.stiffness[1];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let mut disc = LoadedObstacle::<2>::new(&load, [0.0, 0.0, 5.0]);
        // At its lowest point, half a metre below its centre.
        assert_eq!(disc.resultants(&[5.0, -7.0], &[0.0, -0.5]), [7.0, 2.5]);
        assert_eq!(
            (disc.velocity(), disc.angular_velocity(), disc.turns()),
            ([0.0, -1.0], [0.0, 0.0, -3.0], true)
        );
        let [falling, turning] = disc.motions_mut().map(|motion| motion.expect("both"));
        for motion in [falling, turning] {
            motion.start(Blend::euler(0.5));
            motion.set_velocity(2.0);
        }
        assert_eq!(disc.seen_after(&[1.0, 0.0]), [1.0, 1.0]);
        assert_eq!(disc.seen_before(&[1.0, 0.0]), [1.0, 0.0]);
        disc.commit();
        assert_eq!(disc.motions().map(|motion| motion.expect("both").motion()), [[1.0, 2.0]; 2]);
        let fixed = LoadedObstacle::<2>::new(&ObstacleLoad { direction: vec![], ..load }, [0.0, 0.0, 1.0]);
        assert_eq!((fixed.seen_after(&[1.0, 0.0]), fixed.velocity()), ([1.0, 0.0], [0.0, 0.0]));
    }

    #[test]
    fn the_slope_of_a_step_is_expected_in_the_next_one() {
        let mut obstacle = falling();
        obstacle.start(Blend::euler(0.5));
        assert_eq!(obstacle.expected_slope(), None);
        // 3 kg / 0.5 s and 8 N/m over 0.5 s.
        obstacle.keep_slope(10.0);
        assert_eq!(obstacle.expected_slope(), None, "the step may be repeated");
        obstacle.commit();
        obstacle.start(Blend::euler(0.25));
        assert_eq!(obstacle.expected_slope(), Some(12.0 + 2.0));
        obstacle.keep_slope(f64::NAN);
        obstacle.keep_slope(1.0);
        obstacle.commit();
        assert_eq!(obstacle.stiffness(), 8.0, "less than the inertia: not a slope");
        let mut other = falling();
        other.restore_stiffness(obstacle.stiffness());
        other.start(Blend::euler(0.25));
        assert_eq!(other.expected_slope(), Some(14.0));
    }

    #[test]
    fn steps_of_both_schemes_by_hand() {
        let mut obstacle = falling();
        assert_eq!(obstacle.start(Blend::euler(0.5)), 1.0);
        obstacle.set_velocity(2.0);
        // 3 kg (2 - 1) m/s / 0.5 s = 6 N.
        assert_eq!(obstacle.unbalanced(0.5, 0.0), [0.0, 12.0]);
        assert_eq!(obstacle.unbalanced(0.5, -2.0)[0], 2.0);
        obstacle.commit();
        assert_eq!(obstacle.motion(), [1.0, 2.0]);
        // The second-order formula: x~ = 4/3 1, w~ = 4/3 2 - 1/3 1 = 7/3, k' = 1/3 s; 3 m/s are 3 (3 - 7/3) / (1/3) = 6 N.
        obstacle.start(Blend { length: 1.0 / 3.0, recent: 4.0 / 3.0, earlier: -1.0 / 3.0 });
        obstacle.set_velocity(3.0);
        assert!(obstacle.unbalanced(1.0, 0.0)[0].abs() < 1e-13);
        obstacle.commit();
        assert!((obstacle.motion()[0] - 7.0 / 3.0).abs() < 1e-15);
        let mut other = falling();
        other.restore(obstacle.saved());
        assert_eq!(other.saved(), obstacle.saved());
    }
}
