//! The distance of a point of the contact boundary from its obstacle.
//!
//! Deformations are small: the gap is the distance from the undeformed position `x` of a point along the outward normal `n`, and is
//! compared with the normal displacement. The obstacle itself may move arbitrarily far. Each obstacle has a file in the folder
//! `obstacles` and an entry in the list of this file.
//!
//! The gap is negative where the point is inside the obstacle, and infinite where the ray along the normal does not meet the
//! obstacle, so that there is no contact. Where an obstacle has pushed the surface back so far that it lies wholly behind the
//! undeformed position, the ray begins at the displaced one.

mod plane;
mod shape;
mod signed_distance;
mod sphere;
mod torus;

pub use plane::Plane;
pub use shape::Shape;
pub use sphere::Sphere;
pub use torus::Torus;

use super::{
    obstacle::{Obstacle, Prescribed, obstacles, vector},
    obstacle_motion::{ObstacleMotion, Rate, axis_of},
};
use crate::{
    error::{Error, Result},
    laws::{expression::Scalar, law::LawFault},
    linear_algebra::tensor::{Vector, add_scaled, norm},
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

obstacles! {
    /// A half-space bounded by a plane; in 2D a half-plane bounded by a line.
    Plane = "plane",
    /// A sphere, in 2D a disc.
    Sphere = "sphere",
    /// A ring with a round cross-section, in 3D.
    Torus = "torus",
    /// Any shape, given by the distance from its surface, such as a cylinder, a cone or a punch with round edges, or by a
    /// triangulated surface.
    Shape = "shape",
}

/// The half-width for derivatives of the depth, as a share of it and of the coordinates.
const WIDTH: f64 = 1e-5;
/// By how much the slope of the depth may differ from 1 where the surface has a normal.
const NO_NORMAL: f64 = 0.01;
/// The slope of a bound of the depth below which it shows no direction.
const FLAT: f64 = 0.05;

impl Default for Gap {
    fn default() -> Self {
        Self::Distance(Scalar::default())
    }
}

impl Gap {
    /// Gap in m at `time` of the point with the undeformed position `place`, along its unit `normal`; infinite if its ray does
    /// not meet the obstacle.
    pub fn at<const D: usize>(&self, time: f64, place: &Vector<D>, normal: &Vector<D>) -> Result<f64> {
        self.number(self.ray(time, place, normal), time, place)
    }

    /// The gap of a point whose surface has `moved` along the normal, in m. An obstacle that has pushed the surface back may lie wholly
    /// behind the undeformed position; the ray then begins at the moved one.
    pub fn of_moved<const D: usize>(
        &self,
        time: f64,
        place: &Vector<D>,
        normal: &Vector<D>,
        moved: f64,
    ) -> Result<f64> {
        let gap = self.at(time, place, normal)?;
        if gap < f64::INFINITY || moved >= 0.0 || matches!(self, Self::Distance(_)) {
            return Ok(gap);
        }
        Ok(moved + self.at(time, &add_scaled(place, moved, normal), normal)?)
    }

    /// The length of a ray, unless it is no number.
    fn number<const D: usize>(&self, gap: f64, time: f64, place: &Vector<D>) -> Result<f64> {
        if gap > f64::NEG_INFINITY {
            return Ok(gap);
        }
        let cause = each_obstacle!(self, _ => "correct the expression of the gap in the job", obstacle => obstacle.remedy());
        Err(Error::Failed(format!(
            "contact: the gap is {gap} at t = {time} s, position {place:?} m; {cause}"
        )))
    }

    /// The expressions that may depend on time.
    pub fn expressions(&self) -> Vec<&[Scalar]> {
        if let Self::Distance(gap) = self {
            return vec![std::slice::from_ref(gap)];
        }
        let Prescribed { centre, facing, rotation, .. } = self.prescribed();
        vec![centre, facing, rotation.map_or(&[], std::slice::from_ref)]
    }

    /// A key of the obstacle, relative to the table of the contact.
    fn key(&self, key: &str) -> String {
        format!("obstacle.{}.{key}", self.name())
    }

    /// The vectors of the obstacle in m and without a unit, each with its key relative to the table of the contact.
    pub fn vectors(&self) -> [(String, &[Scalar]); 2] {
        let Prescribed { centre, facing, .. } = self.prescribed();
        let place = each_obstacle!(self, _ => "", obstacle => obstacle.place_key());
        [(self.key(place), centre), (self.key("normal"), facing)]
    }

    /// The direction of the axis of rotation as given, with its key.
    pub fn given_axis(&self) -> Option<(String, &[f64])> {
        self.prescribed().axis.map(|axis| (self.key("axis"), axis))
    }

    /// The key of the rotation, if it is given.
    pub fn rotation_key(&self) -> Option<String> {
        self.prescribed().rotation.map(|_| self.key("rotation"))
    }

    /// The faults of the obstacle's own keys, which are those of the table of the contact.
    pub(super) fn own_faults(&self) -> Vec<LawFault> {
        let own = each_obstacle!(self, _ => Vec::new(), obstacle => obstacle.own_faults());
        let mut faults: Vec<LawFault> =
            own.into_iter().map(|fault| fault.within(self.name()).within("obstacle")).collect();
        if let Some((key, axis)) = self.given_axis()
            && !axis.is_empty()
            && axis.iter().all(|&x| x == 0.0)
        {
            let help = "give the direction of the axis";
            faults.push(LawFault::at_value(key, "the axis is the zero vector", help));
        }
        let [_, (key, normal)] = self.vectors();
        if !normal.is_empty() && normal.iter().all(|x| *x == Scalar::default()) {
            let help = "give the normal that points out of the obstacle toward the body";
            faults.push(LawFault::at_value(key, "the normal is the zero vector", help));
        }
        faults
    }

    /// The motion of the obstacle; none without an obstacle.
    fn prescribed(&self) -> Prescribed<'_> {
        each_obstacle!(self, _ => Prescribed::default(), obstacle => obstacle.prescribed())
    }

    /// Depth in m of a point inside the obstacle at `time`, negative outside; `None` if only the gap is given.
    pub fn depth<const D: usize>(&self, time: f64, place: &Vector<D>) -> Option<f64> {
        each_obstacle!(self, _ => None, obstacle => Some(obstacle.depth(time, place)))
    }

    /// The direction from a place to the obstacle at `time`, a unit vector against the normal of its surface where it is nearest; none
    /// where it has none there, as in the middle of a sphere, or where two parts of it are equally near.
    pub fn direction_of_nearest<const D: usize>(&self, place: &Vector<D>, time: f64) -> Option<Vector<D>> {
        let (direction, slope) = self.steepest(place, time)?;
        ((slope - 1.0).abs() < NO_NORMAL).then_some(direction)
    }

    /// The same where the depth may be a bound of it: the direction in which it grows most.
    pub fn direction_of_depth<const D: usize>(&self, place: &Vector<D>, time: f64) -> Option<Vector<D>> {
        let (direction, slope) = self.steepest(place, time)?;
        (slope > FLAT).then_some(direction)
    }

    /// The unit vector along which the depth at a place grows most at `time`, and its slope along it.
    fn steepest<const D: usize>(&self, place: &Vector<D>, time: f64) -> Option<(Vector<D>, f64)> {
        let depth = |place: &Vector<D>| self.depth(time, place).filter(|depth| depth.is_finite());
        let nearest = depth(place)?;
        let width = WIDTH * place.iter().fold(nearest.abs(), |most, x| most.max(x.abs()));
        let mut direction = [0.0; D];
        for (i, component) in direction.iter_mut().enumerate() {
            let at =
                |length: f64| depth(&std::array::from_fn(|j| place[j] + if i == j { length } else { 0.0 }));
            *component = (at(width)? - at(-width)?) / (2.0 * width);
        }
        let slope = norm(&direction);
        (slope > 0.0).then(|| (direction.map(|x| x / slope), slope))
    }

    /// The length of a ray, see [`Obstacle::ray`]; a given gap is that of any ray.
    fn ray<const D: usize>(&self, time: f64, place: &Vector<D>, normal: &Vector<D>) -> f64 {
        each_obstacle!(self, gap => gap.evaluate(time, place), obstacle => obstacle.ray(time, place, normal))
    }

    /// See [`Obstacle::has_other_side`]; false without an obstacle.
    pub(super) fn has_other_side(&self) -> bool {
        each_obstacle!(self, _ => false, obstacle => obstacle.has_other_side())
    }

    /// Whether the surface of the obstacle may have a velocity; false for a given gap, whose change is not a motion of a surface.
    pub fn surface_may_move(&self) -> bool {
        let rotation = self.prescribed().rotation;
        self.is_driven() || rotation.is_some_and(|rotation| *rotation != Scalar::default())
    }

    /// Whether the place of the surface depends on the time.
    pub fn is_driven(&self) -> bool {
        let Prescribed { centre, facing, .. } = self.prescribed();
        centre.iter().chain(facing).any(Scalar::depends_on_time)
    }

    /// Whether its prescribed motion may change the direction in which a place sees it.
    pub fn turns_as_seen(&self) -> bool {
        let Prescribed { centre, facing, .. } = self.prescribed();
        let moves = if facing.is_empty() { centre } else { facing };
        moves.iter().any(Scalar::depends_on_time)
    }

    /// Whether the direction of the normal is continuous along the surface; false without an obstacle.
    pub fn is_smooth(&self) -> bool {
        each_obstacle!(self, _ => false, obstacle => obstacle.is_smooth())
    }

    /// See [`Obstacle::is_spatial`]; false without an obstacle.
    pub(super) fn is_spatial(&self) -> bool {
        each_obstacle!(self, _ => false, obstacle => obstacle.is_spatial())
    }

    /// The centre in m at `time`, the point of a plane; the origin without an obstacle.
    pub fn centre<const D: usize>(&self, time: f64) -> Vector<D> {
        vector(self.prescribed().centre, time)
    }

    /// The direction of the axis of rotation; in the plane z.
    pub fn axis(&self) -> Vector<3> {
        axis_of(self.prescribed().axis.unwrap_or_default())
    }

    /// The motion of the obstacle at the end of a step; zero without an obstacle.
    pub fn motion<const D: usize>(&self, rate: Rate) -> Result<ObstacleMotion<D>> {
        let angular_velocity =
            each_obstacle!(self, _ => [0.0; 3], obstacle => obstacle.angular_velocity(&rate));
        let (velocity, centre) = (rate.of(|time| self.centre(time)), self.centre(rate.time));
        let motion = ObstacleMotion { velocity, centre, angular_velocity };
        if motion.velocity.iter().chain(&motion.angular_velocity).all(|x| x.is_finite()) {
            return Ok(motion);
        }
        Err(Error::Failed(format!(
            "contact: the obstacle moves at {:?} m/s and turns at {:?} rad/s at t = {} s; correct [contact.obstacle]",
            motion.velocity, motion.angular_velocity, rate.time
        )))
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::{plane::PARALLEL, *};
    use crate::linear_algebra::tensor::dot;
    use proptest::prelude::*;

    pub fn numbers(values: &[f64]) -> Vec<Scalar> {
        values.iter().map(|&value| Scalar::Number(value)).collect()
    }

    pub fn expression(text: &str) -> Scalar {
        Scalar::Expression(crate::laws::expression::Expression::parse(text).unwrap())
    }

    fn plane(point: Vec<Scalar>, normal: Vec<Scalar>) -> Gap {
        Gap::Plane(Plane { point, normal, rotation: None })
    }

    fn sphere(centre: Vec<Scalar>, radius: f64, hollow: bool) -> Gap {
        Gap::Sphere(Sphere { centre, radius, hollow, rotation: None, axis: None })
    }

    fn shape(distance: &str, centre: Vec<Scalar>) -> Gap {
        Gap::Shape(Shape { distance: Some(expression(distance)), centre, ..Shape::default() })
    }

    fn floor(height: f64) -> Gap {
        plane(numbers(&[7.0, height]), numbers(&[0.0, 3.0]))
    }

    fn disc(centre: [f64; 2], hollow: bool) -> Gap {
        sphere(numbers(&centre), 2.0, hollow)
    }

    const DOWN: Vector<2> = [0.0, -1.0];

    #[test]
    fn a_floor_is_as_far_below_as_it_lies() {
        assert_eq!(floor(-0.5).at(0.0, &[1.0, 0.25], &DOWN).unwrap(), 0.75);
        assert_eq!(floor(0.5).at(0.0, &[1.0, 0.25], &DOWN).unwrap(), -0.25);
        // Along a normal at 60 degrees the way to the floor is twice as long.
        let slanted = [0.75f64.sqrt(), -0.5];
        assert!((floor(-0.5).at(0.0, &[1.0, 0.0], &slanted).unwrap() - 1.0).abs() < 1e-15);
    }

    #[test]
    fn faults_have_the_key_of_the_obstacle() {
        let without_normal = plane(numbers(&[0.0, 0.0]), numbers(&[0.0, 0.0]));
        let round =
            Sphere { centre: vec![], radius: 1.0, hollow: false, rotation: None, axis: Some(vec![0.0; 3]) };
        let obstacles =
            [without_normal, Gap::Sphere(round), Gap::Shape(Shape::default()), disc([0.0, 0.0], true)];
        let keys: Vec<String> = obstacles.iter().flat_map(Gap::own_faults).map(|fault| fault.key).collect();
        assert_eq!(keys, ["obstacle.plane.normal", "obstacle.sphere.axis", "obstacle.shape"]);
    }

    #[test]
    fn boundaries_that_face_away_or_stand_square_to_a_floor_never_touch_it() {
        for normal in [[0.0, 1.0], [1.0, 0.0], [1.0, -1e-9], [0.6, 0.8]] {
            assert_eq!(floor(-0.5).at(0.0, &[1.0, 0.0], &normal).unwrap(), f64::INFINITY, "{normal:?}");
        }
    }

    #[test]
    fn obstacles_move_with_time() {
        let rising = plane(vec![Scalar::default(), expression("-1 + t")], numbers(&[0.0, 1.0]));
        assert_eq!(rising.at(0.25, &[0.0, 0.0], &DOWN).unwrap(), 0.75);
        let turning = plane(numbers(&[0.0, -1.0]), vec![expression("-t"), Scalar::Number(1.0)]);
        assert_eq!(turning.at(1.0, &[0.5, 0.0], &DOWN).unwrap(), 0.5);
    }

    #[test]
    fn a_disc_below_is_felt_where_the_ray_meets_it() {
        let below = disc([0.0, -3.0], false);
        assert_eq!(below.at(0.0, &[0.0, 0.0], &DOWN).unwrap(), 1.0);
        let beside = below.at(0.0, &[1.2, 0.0], &DOWN).unwrap();
        assert!((beside - 1.4).abs() < 1e-15, "{beside}");
        assert_eq!(below.at(0.0, &[2.1, 0.0], &DOWN).unwrap(), f64::INFINITY, "it passes by");
        assert_eq!(below.at(0.0, &[0.0, 0.0], &[0.0, 1.0]).unwrap(), f64::INFINITY, "it is behind");
        assert_eq!(below.at(0.0, &[0.0, -1.5], &DOWN).unwrap(), -0.5, "the point is inside");
        assert_eq!(below.at(0.0, &[0.0, -1.0], &DOWN).unwrap(), 0.0, "the point touches");
        assert_eq!(below.at(0.0, &[2.0, 0.0], &DOWN).unwrap(), 3.0, "the ray grazes");
    }

    #[test]
    fn a_hollow_disc_is_touched_from_inside() {
        let around = disc([0.0, 0.0], true);
        assert_eq!(around.at(0.0, &[0.0, -0.5], &DOWN).unwrap(), 1.5);
        assert_eq!(around.at(0.0, &[0.0, -2.5], &DOWN).unwrap(), -0.5, "the point is in the shell");
        assert_eq!(around.at(0.0, &[0.0, 2.5], &DOWN).unwrap(), f64::INFINITY, "the shell is on this side");
        assert_eq!(around.at(0.0, &[3.0, 0.0], &DOWN).unwrap(), f64::INFINITY);
    }

    #[test]
    fn a_disc_given_by_its_distance_is_a_disc() {
        let moves = || vec![expression("0.5*t"), Scalar::Number(-3.0)];
        let (disc, given) = (sphere(moves(), 2.0, false), shape("sqrt(x^2 + y^2) - 2", moves()));
        assert_eq!(given.expressions(), disc.expressions());
        for place in [[0.0, 0.0], [0.7, 0.0], [2.4, 0.0], [2.6, 0.0], [0.5, -1.5]] {
            let [a, b] = [&disc, &given].map(|gap| gap.at(1.0, &place, &DOWN).unwrap());
            assert!(a == b || (a - b).abs() < 1e-14, "{place:?}: {a} and {b}");
            let [a, b] = [&disc, &given].map(|gap| gap.depth(1.0, &place).unwrap());
            assert!((a - b).abs() < 1e-15, "{place:?}: {a} and {b}");
        }
    }

    #[test]
    fn depths_are_distances_to_the_surface_from_inside() {
        let depths = |place| {
            [floor(-0.5), disc([1.0, 0.0], false), disc([1.0, 0.0], true)].map(|gap| gap.depth(0.0, &place))
        };
        assert_eq!(depths([1.0, -1.5]), [Some(1.0), Some(0.5), Some(-0.5)]);
        assert_eq!(depths([4.0, 0.0]), [Some(-0.5), Some(-1.0), Some(1.0)]);
        assert_eq!(Gap::default().depth(0.0, &[0.0, 0.0]), None);
    }

    #[test]
    fn gaps_that_are_no_numbers_fail_with_time_and_place() {
        let bad = [
            Gap::Distance(expression("sqrt(0.5 - t)")),
            Gap::Distance(expression("-1/(t - 1)^2")),
            plane(numbers(&[0.0, 0.0]), vec![Scalar::default(), expression("t - 1")]),
            plane(vec![Scalar::default(), expression("sqrt(t - 2)")], numbers(&[0.0, 1.0])),
            plane(vec![Scalar::default(), expression("1/(t - 1)")], numbers(&[0.0, -1.0])),
            sphere(vec![expression("sqrt(0.5 - t)")], 1.0, false),
            shape("x^2 + (y + 3)^2 - 1", vec![]),
            shape("y", vec![expression("sqrt(0.5 - t)")]),
        ];
        for gap in bad {
            let error = gap.at(1.0, &[0.25, 0.0], &DOWN).unwrap_err().to_string();
            assert!(error.contains("t = 1 s") && error.contains("[0.25, 0.0]"), "{gap:?}: {error}");
        }
        assert_eq!(Gap::Distance(expression("1/t")).at(0.0, &[0.0, 0.0], &DOWN).unwrap(), f64::INFINITY);
    }

    #[test]
    fn the_nearest_obstacle_lies_against_the_normal_of_its_surface() {
        let close = |found: Option<Vector<2>>, expected: [f64; 2]| {
            let found = found.expect("a direction");
            assert!((0..2).all(|i| (found[i] - expected[i]).abs() < 1e-9), "{found:?}, not {expected:?}");
        };
        close(floor(-0.5).direction_of_nearest(&[1.0, 0.25], 0.0), [0.0, -1.0]);
        close(disc([3.0, -4.0], false).direction_of_nearest(&[0.0, 0.0], 0.0), [0.6, -0.8]);
        close(disc([0.3, -0.4], true).direction_of_nearest(&[0.0, 0.0], 0.0), [-0.6, 0.8]);
        let rolling = sphere(vec![expression("t - 3"), Scalar::Number(-4.0)], 2.0, false);
        close(rolling.direction_of_nearest(&[0.0, 0.0], 0.0), [-0.6, -0.8]);
        close(rolling.direction_of_nearest(&[0.0, 0.0], 3.0), [0.0, -1.0]);
        let channel = shape("min(x, y)", vec![]);
        assert_eq!(channel.direction_of_nearest(&[1.0, 1.0], 0.0), None);
        close(channel.direction_of_nearest(&[1.0, 0.5], 0.0), [0.0, -1.0]);
        assert_eq!(disc([0.0, 0.0], true).direction_of_nearest(&[0.0, 0.0], 0.0), None);
    }

    #[test]
    fn a_bound_of_the_distance_shows_the_normal_of_the_surface() {
        let half = shape("0.5*(sqrt(x^2 + y^2) - 2)", vec![]);
        let place = [1.2, 1.6];
        assert_eq!(half.direction_of_nearest(&place, 0.0), None);
        let found: Vector<2> = half.direction_of_depth(&place, 0.0).expect("a direction");
        assert!((found[0] + 0.6).abs() < 1e-9 && (found[1] + 0.8).abs() < 1e-9, "{found:?}");
        assert_eq!(disc([0.0, 0.0], true).direction_of_depth(&[0.0, 0.0], 0.0), None);
    }

    proptest! {
        #[test]
        fn the_end_of_the_gap_lies_on_the_sphere(
            place in prop::array::uniform3(-3.0f64..3.0), direction in prop::array::uniform3(-1.0f64..1.0),
            radius in 0.1f64..4.0, hollow in any::<bool>(),
        ) {
            prop_assume!(norm(&direction) > 0.1);
            let normal = direction.map(|x| x / norm(&direction));
            let centre = [0.3, -0.2, 0.1];
            let gap = sphere(numbers(&centre), radius, hollow).at(0.0, &place, &normal).unwrap();
            prop_assume!(gap.is_finite());
            let end: Vector<3> = std::array::from_fn(|i| place[i] + gap * normal[i] - centre[i]);
            prop_assert!((norm(&end) - radius).abs() < 1e-12 * (1.0 + gap.abs()));
            let offset: Vector<3> = std::array::from_fn(|i| place[i] - centre[i]);
            prop_assert_eq!(gap < 0.0, (norm(&offset) < radius) != hollow);
            // Beyond the gap the obstacle begins.
            prop_assert_eq!(dot(&end, &normal) > 0.0, hollow);
        }

        #[test]
        fn the_end_of_the_gap_lies_on_the_plane(
            place in prop::array::uniform3(-3.0f64..3.0), direction in prop::array::uniform3(-1.0f64..1.0),
            facing in prop::array::uniform3(-1.0f64..1.0),
        ) {
            prop_assume!(norm(&direction) > 0.1 && norm(&facing) > 0.1);
            let normal = direction.map(|x| x / norm(&direction));
            let point = [0.3, -0.2, 0.1];
            let gap = plane(numbers(&point), numbers(&facing)).at(0.0, &place, &normal).unwrap();
            prop_assert_eq!(gap.is_infinite(), dot(&normal, &facing) / norm(&facing) >= -PARALLEL);
            prop_assume!(gap.abs() < 1e3);
            let end: Vector<3> = std::array::from_fn(|i| place[i] + gap * normal[i] - point[i]);
            prop_assert!(dot(&end, &facing).abs() < 1e-11 * (1.0 + gap.abs()));
        }
    }
}
