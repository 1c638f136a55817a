//! The velocity of the material of an obstacle, relative to which friction acts.
//!
//! An obstacle is a rigid body. With the point `x` of a plane or the centre `x` of another obstacle, and a point `y` of its surface, the
//! velocity of its material at `y` is
//!
//! ```text
//! w = x' + omega x (y - x),    omega = rotation axis          of others; in 2D the axis is z
//!                              omega = rotation m + m x m'    of a plane with the unit normal m
//! ```
//!
//! The rotation of a plane about its normal does not move its surface, as that of a brake disc. A change of its normal tilts the
//! plane, with the smallest rotation that has this effect. `x'` and `m'` are computed by the formula with which the scheme computes
//! velocities from displacements: in a step of implicit Euler, `x' = (x_n - x_{n-1}) / k`, so that a sticking point moves exactly
//! as far as the obstacle. `rotation` is that by which, with the same formula, the angle `int rotation dt` grows, so that a wheel that rolls with
//! an acceleration does not slip. All other quantities are those at the end of the step, as is the gap.

use crate::{
    laws::{quadrature::rule, step::start_of},
    linear_algebra::tensor::{Vector, add_scaled, cross, in_space},
};

/// The formula of a scheme for the rate at the end of a step in terms of values at this time and at earlier times.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rate {
    /// End of the step in s.
    pub time: f64,
    /// Earlier times in s and weights in 1/s: the rate of `x` is the sum of `weight (x(time) - x(before))`. Times with zero weight
    /// are not used.
    pub before: [[f64; 2]; 2],
}

impl Rate {
    /// The formula of implicit Euler for a step of this length in s.
    pub fn euler(time: f64, length: f64) -> Self {
        Self { time, before: [[start_of(time, length), 1.0 / length], [0.0; 2]] }
    }

    pub(super) fn of<const D: usize>(&self, value: impl Fn(f64) -> Vector<D>) -> Vector<D> {
        let now = value(self.time);
        self.of_changes(|time| add_scaled(&now, -1.0, &value(time)))
    }

    /// The rate of a quantity, given its changes since earlier times.
    pub(super) fn of_changes<const D: usize>(&self, change_since: impl Fn(f64) -> Vector<D>) -> Vector<D> {
        let (mut rate, mut unit) = ([0.0; D], 0.0);
        for [time, weight] in self.before.into_iter().filter(|[_, weight]| *weight != 0.0) {
            rate = add_scaled(&rate, weight, &change_since(time));
            unit += weight * (self.time - time);
        }
        // The rate of the time itself is 1, whatever the rounding of the earlier times.
        rate.map(|rate| rate / unit)
    }

    /// The rate of the integral of a function of time, which may jump at the earlier times; NaN where the function is not finite at the end of
    /// the step, also if its integral is.
    pub(super) fn of_integral(&self, function: impl Fn(f64) -> f64) -> f64 {
        let [[recent, _], _] = self.before;
        let over = |part: [f64; 2]| rule(part).map(|[at, weight]| weight * function(at)).sum::<f64>();
        let since =
            |from: f64| if from < recent { over([from, recent]) } else { 0.0 } + over([recent, self.time]);
        let [rate] = self.of_changes(|time| [since(time)]);
        if function(self.time).is_finite() { rate } else { f64::NAN }
    }
}

/// The rigid motion of an obstacle at a time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObstacleMotion<const D: usize> {
    /// Velocity in m/s of the centre.
    pub(super) velocity: Vector<D>,
    pub(super) centre: Vector<D>,
    /// Angular velocity in rad/s.
    pub(super) angular_velocity: Vector<3>,
}

impl<const D: usize> ObstacleMotion<D> {
    /// Whether the motion is a translation.
    fn is_translation(&self) -> bool {
        self.angular_velocity == [0.0; 3]
    }

    /// Velocity in m/s of the material of the obstacle where the ray from `place` along the unit `normal` meets it, after `reach` m; if
    /// the ray does not meet it, at `place`.
    pub fn velocity_along(&self, place: &Vector<D>, normal: &Vector<D>, reach: f64) -> Vector<D> {
        if self.is_translation() {
            return self.velocity;
        }
        self.velocity_at(&add_scaled(place, if reach.is_finite() { reach } else { 0.0 }, normal))
    }

    /// Velocity in m/s of the material of the obstacle at a position.
    fn velocity_at(&self, place: &Vector<D>) -> Vector<D> {
        let arm = add_scaled(place, -1.0, &self.centre);
        add_scaled(&self.velocity, 1.0, &in_plane(&cross(&self.angular_velocity, &in_space(&arm))))
    }
}

/// An axis of rotation; in the plane, where none is given, z.
pub(super) fn axis_of(given: &[f64]) -> Vector<3> {
    if given.is_empty() { [0.0, 0.0, 1.0] } else { in_space(given) }
}

fn in_plane<const D: usize>(vector: &Vector<3>) -> Vector<D> {
    std::array::from_fn(|i| vector[i])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::{
        contact::obstacles::{
            Gap, Plane, Shape, Sphere,
            tests::{expression, numbers},
        },
        expression::Scalar,
    };

    const STEP: Rate = Rate { time: 0.5, before: [[0.25, 4.0], [0.0; 2]] };

    #[test]
    fn rates_are_those_of_the_schemes() {
        let [[start, weight], none] = Rate::euler(0.5, 0.25).before;
        assert!((start - 0.25).abs() < 1e-15 && weight == 4.0 && none[1] == 0.0);
        let parabola = |t: f64| [3.0 * t * t, 7.0];
        // 3 (0.5^2 - 0.25^2) / 0.25 = 2.25
        assert_eq!(STEP.of(parabola), [2.25, 0.0]);
        // Two steps of 0.25 s: (x_n - 4/3 x_{n-1} + 1/3 x_{n-2}) / (2/3 0.25), the slope 6 t of the parabola.
        let second = Rate { time: 0.5, before: [[0.25, 8.0], [0.0, -2.0]] };
        assert_eq!(second.of(parabola), [3.0, 0.0]);
        // Times without weight are not looked at.
        assert_eq!(STEP.of(|t| [if t == 0.0 { f64::NAN } else { t }]), [1.0]);
    }

    #[test]
    fn the_rate_of_an_integral_is_that_of_its_closed_form() {
        let second = Rate { time: 0.5, before: [[0.25, 8.0], [0.0, -2.0]] };
        for rate in [STEP, second, Rate::euler(10.0, 1e-3)] {
            let [expected] = rate.of(|t| [3.0 * t * t]);
            let found = rate.of_integral(|t| 6.0 * t);
            assert!((found - expected).abs() < 1e-10 * expected, "{found} {expected}");
        }
        assert!(STEP.of_integral(|t| 1.0 / (t - 0.5)).is_nan());
        // Steps of 0.2 s and 0.1 s with a jump between them, to 1 rad/s: the weights of bdf2 for such steps times 0.1 rad.
        let uneven = Rate { time: 0.3, before: [[0.2, 15.0], [0.0, -5.0 / 3.0]] };
        let [expected] = uneven.of(|t| [(t - 0.2).max(0.0)]);
        let found = uneven.of_integral(|t| f64::from(u8::from(t > 0.2)));
        assert!((found - expected).abs() < 1e-13, "{found} {expected}");
    }

    #[test]
    fn a_wheel_that_rolls_with_an_acceleration_rests_where_it_touches() {
        let wheel = Gap::Sphere(Sphere {
            centre: vec![expression("2*t^2"), Scalar::Number(0.5)],
            radius: 0.5,
            hollow: false,
            rotation: Some(expression("-8*t")),
            axis: None,
        });
        for rate in [STEP, Rate { time: 0.5, before: [[0.25, 8.0], [0.0, -2.0]] }] {
            let motion = wheel.motion::<2>(rate).unwrap();
            let [along, across] = motion.velocity_at(&[0.5, 0.0]);
            assert!(along.abs() < 1e-14 && across.abs() < 1e-14, "{along} {across}");
        }
    }

    #[test]
    fn a_belt_moves_along_itself_and_so_do_all_its_places() {
        let point = vec![expression("2*t"), Scalar::Number(-1.0)];
        let belt = Gap::Plane(Plane { point, normal: numbers(&[0.0, 3.0]), rotation: None });
        let motion = belt.motion::<2>(STEP).unwrap();
        assert!(belt.surface_may_move() && motion.is_translation());
        assert_eq!([motion.velocity_at(&[0.0, -1.0]), motion.velocity_at(&[9.0, -1.0])], [[2.0, 0.0]; 2]);
    }

    #[test]
    fn a_line_that_tilts_lifts_its_places_square_to_itself() {
        // Unit normal (-sin t, cos t): the line turns to the left by 1 rad/s about its point.
        let tilting = Gap::Plane(Plane {
            point: numbers(&[1.0, 2.0]),
            normal: vec![expression("-sin(t)"), expression("cos(t)")],
            rotation: None,
        });
        let fine = Rate::euler(0.5, 1e-6);
        let along = [0.5f64.cos(), 0.5f64.sin()];
        let found =
            tilting.motion::<2>(fine).unwrap().velocity_at(&[1.0 + 3.0 * along[0], 2.0 + 3.0 * along[1]]);
        assert!(
            (found[0] + 3.0 * along[1]).abs() < 1e-5 && (found[1] - 3.0 * along[0]).abs() < 1e-5,
            "{found:?}"
        );
    }

    #[test]
    fn a_disc_turns_to_the_left_about_its_normal_through_its_point() {
        let disc = Gap::Plane(Plane {
            point: numbers(&[1.0, 1.0, 0.0]),
            normal: numbers(&[0.0, 0.0, 5.0]),
            rotation: Some(expression("6*t")),
        });
        let motion = disc.motion::<3>(STEP).unwrap();
        assert!(disc.surface_may_move() && !motion.is_translation());
        // By 3 (0.5^2 - 0.25^2) rad in 0.25 s.
        let near =
            |found: Vector<3>, expected: Vector<3>| (0..3).all(|i| (found[i] - expected[i]).abs() < 1e-14);
        assert!(near(motion.velocity_at(&[1.5, 1.0, 0.0]), [0.0, 1.125, 0.0]));
        assert!(near(motion.velocity_at(&[1.0, 1.5, 0.0]), [-1.125, 0.0, 0.0]));
    }

    #[test]
    fn a_roller_that_rolls_rests_where_it_touches() {
        // To the right on a floor below, and so clockwise.
        let roller = |axis: &[f64], centre: Vec<Scalar>| {
            Gap::Sphere(Sphere {
                centre,
                radius: 0.5,
                hollow: false,
                rotation: Some(Scalar::Number(-4.0)),
                axis: Some(axis.to_vec()),
            })
        };
        let flat = roller(&[], vec![expression("2*t"), Scalar::Number(0.5)]).motion::<2>(STEP).unwrap();
        assert_eq!([flat.velocity_at(&[1.0, 0.0]), flat.velocity_at(&[1.0, 1.0])], [[0.0, 0.0], [4.0, 0.0]]);
        let ball =
            roller(&[0.0, -2.0, 0.0], vec![expression("2*t"), Scalar::Number(7.0), Scalar::Number(0.5)]);
        let ball = ball.motion::<3>(STEP).unwrap();
        assert_eq!(
            [ball.velocity_at(&[1.0, 7.0, 0.0]), ball.velocity_at(&[1.0, 7.0, 1.0])],
            [[0.0; 3], [4.0, 0.0, 0.0]]
        );
    }

    #[test]
    fn a_cylinder_given_by_its_distance_rolls() {
        let cylinder = Gap::Shape(Shape {
            distance: Some(expression("sqrt(x^2 + z^2) - 0.5")),
            centre: vec![expression("2*t"), Scalar::Number(0.0), Scalar::Number(0.5)],
            rotation: Some(Scalar::Number(4.0)),
            axis: Some(vec![0.0, 1.0, 0.0]),
            ..Shape::default()
        });
        assert!(cylinder.surface_may_move());
        let motion = cylinder.motion::<3>(STEP).unwrap();
        // A body above it, at its highest line: the surface moves at twice the velocity of the axis.
        let (above, down) = ([1.0, 7.0, 1.25], [0.0, 0.0, -1.0]);
        let reach = cylinder.at(STEP.time, &above, &down).unwrap();
        assert_eq!(motion.velocity_along(&above, &down, reach), [4.0, 0.0, 0.0]);
    }

    #[test]
    fn what_rests_drags_nothing_and_what_has_no_velocity_is_refused() {
        let floor =
            Gap::Plane(Plane { point: numbers(&[0.0, 0.0]), normal: numbers(&[0.0, 1.0]), rotation: None });
        assert!(!floor.surface_may_move() && !Gap::Distance(expression("0.1*t")).surface_may_move());
        assert_eq!(floor.motion::<2>(STEP).unwrap().velocity_at(&[3.0, 0.0]), [0.0, 0.0]);
        assert_eq!(
            Gap::Distance(expression("0.1*t")).motion::<2>(STEP).unwrap().velocity_at(&[3.0, 0.0]),
            [0.0, 0.0]
        );
        let bad = Gap::Sphere(Sphere {
            centre: numbers(&[0.0, 0.0]),
            radius: 1.0,
            hollow: false,
            rotation: Some(expression("1/(t - 0.5)")),
            axis: None,
        });
        let words = bad.motion::<2>(STEP).unwrap_err().to_string();
        assert!(words.contains("t = 0.5 s") && words.contains("[contact.obstacle]"), "{words}");
    }
}
