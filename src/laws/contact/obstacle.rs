//! The distance of a point of the contact boundary from its obstacle.
//!
//! Deformations are small: the gap is the distance from the undeformed position `x` of a point along the outward normal `n`, and is
//! compared with the normal displacement. The obstacle itself may move arbitrarily far. With `d = x - centre` and the unit normal
//! `m` of the obstacle,
//!
//! ```text
//! plane    (point - x) . m / (n . m)           if n . m < 0
//! sphere   -d . n - sqrt((d . n)^2 - |d|^2 + radius^2)
//! hollow   -d . n + sqrt((d . n)^2 - |d|^2 + radius^2)
//! ```
//!
//! That of a shape is the length of the ray to its surface, see [`Shape`].
//!
//! The gap is negative where the point is inside the obstacle, and infinite where the ray along the normal does not meet the
//! obstacle, so that there is no contact. Where an obstacle has pushed the surface back so far that it lies wholly behind the
//! undeformed position, the ray begins at the displaced one.

use super::obstacle_shape::{Shape, vector};
use crate::{
    error::{Error, Result},
    laws::expression::Scalar,
    linear_algebra::tensor::{Vector, add_scaled, dot, norm},
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Cosine between boundary and plane below which the ray counts as parallel to the plane.
const PARALLEL: f64 = 1e-6;

/// A rigid obstacle that may move. Friction acts on the velocity relative to the obstacle, averaged over a step. The gap is the
/// distance from the undeformed position of a boundary point to the obstacle along the outward normal of the undeformed boundary;
/// if this ray does not meet the obstacle, there is no contact.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(rename = "Obstacle")]
pub enum Gap {
    /// The gap in m itself, as a function of time and undeformed coordinates.
    #[serde(skip)]
    Distance(Scalar),
    /// A half-space bounded by a plane; in 2D a half-plane bounded by a line.
    Plane(Plane),
    /// A sphere, in 2D a disc.
    Sphere(Sphere),
    /// Any shape, given by the distance from its surface, such as a cylinder, a cone or a punch with round edges, or by a
    /// triangulated surface.
    Shape(Shape),
}

/// A plane that bounds an obstacle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Plane {
    /// A point of the plane, one component per axis: numbers, or expressions in t. Motion of this point along the plane is a
    /// tangential motion of the obstacle's surface, such as that of a belt.
    #[schemars(extend("variables" = "t", "unit" = "m"), example = serde_json::json!([0.0, "-0.01 + 0.1*t"]))]
    pub point: Vec<Scalar>,
    /// The normal of the plane, which points out of the obstacle toward the body, of any length: numbers, or expressions in t.
    #[schemars(extend("variables" = "t"), example = [0.0, 1.0])]
    pub normal: Vec<Scalar>,
    /// Angular velocity, in 3D, of the rotation of the plane about its normal through `point`, counterclockwise as seen from the
    /// body: a number, or an expression in t. It affects friction only. Absent: 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("variables" = "t", "unit" = "rad/s"), example = 10.0)]
    pub rotation: Option<Scalar>,
}

/// A sphere as an obstacle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sphere {
    /// The centre, one component per axis: numbers, or expressions in t.
    #[schemars(extend("variables" = "t", "unit" = "m"), example = serde_json::json!([0.5, "-1.01 + 0.1*t"]))]
    pub centre: Vec<Scalar>,
    /// The radius.
    #[schemars(extend("unit" = "m", "exclusiveMinimum" = 0), example = 1.0)]
    pub radius: f64,
    /// Whether the obstacle is the space outside the sphere, with the body inside the sphere.
    #[serde(default)]
    pub hollow: bool,
    /// Angular velocity of the rotation about the centre, counterclockwise; in 3D about `axis`, as seen against its direction: a
    /// number, or an expression in t. It affects friction only. Absent: 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("variables" = "t", "unit" = "rad/s"), example = "-2*t")]
    pub rotation: Option<Scalar>,
    /// Direction of the axis of rotation in 3D, a vector of any length. Required with `rotation` or `moment` in 3D, not allowed in 2D.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = [0.0, 1.0, 0.0])]
    pub axis: Option<Vec<f64>>,
}

impl Default for Gap {
    fn default() -> Self {
        Self::Distance(Scalar::default())
    }
}

impl Gap {
    /// Gap in m at `time` of the point with the undeformed position `place`, along its unit `normal`; infinite if its ray does
    /// not meet the obstacle.
    pub fn at<const D: usize>(&self, time: f64, place: &Vector<D>, normal: &Vector<D>) -> Result<f64> {
        self.number(self.measure(time, place, normal), time, place)
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
    pub(super) fn number<const D: usize>(&self, gap: f64, time: f64, place: &Vector<D>) -> Result<f64> {
        if gap > f64::NEG_INFINITY {
            return Ok(gap);
        }
        let cause = match self {
            Self::Distance(_) => "correct the expression of the gap in the job",
            Self::Plane(_) => {
                "the plane's normal vanishes or a component is not finite: correct [contact.obstacle.plane]"
            }
            Self::Sphere(_) => "a component of the centre is not finite: correct [contact.obstacle.sphere]",
            Self::Shape(_) => {
                "`distance` or `centre` is not finite, `distance` is not a signed distance (it changes by more than the distance \
                 between two points), or parts of `surface` overlap: correct [contact.obstacle.shape]"
            }
        };
        Err(Error::Failed(format!(
            "contact: the gap is {gap} at t = {time} s, position {place:?} m; {cause}"
        )))
    }

    /// The expressions that may depend on time.
    pub fn expressions(&self) -> Vec<&[Scalar]> {
        match self {
            Self::Distance(gap) => vec![std::slice::from_ref(gap)],
            Self::Plane(Plane { point, normal, rotation }) => vec![point, normal, rotation.as_slice()],
            Self::Sphere(Sphere { centre, rotation, .. }) | Self::Shape(Shape { centre, rotation, .. }) => {
                vec![centre, rotation.as_slice()]
            }
        }
    }

    /// Depth in m of a point inside the obstacle at `time`, negative outside; `None` if only the gap is given.
    pub fn depth<const D: usize>(&self, time: f64, place: &Vector<D>) -> Option<f64> {
        match self {
            Self::Distance(_) => None,
            Self::Plane(Plane { point, normal, .. }) => {
                let (point, facing) = (vector::<D>(point, time), vector::<D>(normal, time));
                Some(dot(&add_scaled(&point, -1.0, place), &facing) / norm(&facing))
            }
            Self::Sphere(Sphere { centre, radius, hollow, .. }) => {
                let away = norm(&add_scaled(place, -1.0, &vector::<D>(centre, time)));
                Some(if *hollow { away - radius } else { radius - away })
            }
            Self::Shape(shape) => Some(-shape.distance_at(&shape.offset(time, place))),
        }
    }

    /// The gap; NaN where the obstacle is undefined.
    fn measure<const D: usize>(&self, time: f64, place: &Vector<D>, normal: &Vector<D>) -> f64 {
        match self {
            Self::Distance(gap) => gap.evaluate(time, place),
            Self::Plane(Plane { point, normal: facing, .. }) => {
                let (point, facing) = (vector::<D>(point, time), vector::<D>(facing, time));
                let length = norm(&facing);
                let toward: Vector<D> = std::array::from_fn(|i| point[i] - place[i]);
                let (height, cosine) = (dot(&toward, &facing) / length, dot(normal, &facing) / length);
                if height.is_finite() && cosine >= -PARALLEL { f64::INFINITY } else { height / cosine }
            }
            Self::Sphere(Sphere { centre, radius, hollow, .. }) => {
                let centre = vector::<D>(centre, time);
                let offset: Vector<D> = std::array::from_fn(|i| place[i] - centre[i]);
                to_sphere(&offset, normal, *radius, *hollow)
            }
            Self::Shape(shape) => shape.along(&shape.offset(time, place), normal),
        }
    }
}

/// The length of a ray from a place relative to the centre to a sphere; negative from inside of the obstacle.
pub(super) fn to_sphere<const D: usize>(
    offset: &Vector<D>,
    normal: &Vector<D>,
    radius: f64,
    hollow: bool,
) -> f64 {
    let along = dot(offset, normal);
    // Distance of the centre from the ray, rather than a difference of squares, keeps all digits near the surface.
    let across: Vector<D> = std::array::from_fn(|i| offset[i] - along * normal[i]);
    let half = (radius - norm(&across)) * (radius + norm(&across));
    let outside = norm(offset) >= radius;
    match (hollow, outside) {
        _ if half.is_nan() => f64::NAN,
        // The ray passes by, or leads away from the obstacle.
        _ if half < 0.0 => f64::INFINITY,
        (false, true) if along >= 0.0 => f64::INFINITY,
        (true, true) if along <= 0.0 => f64::INFINITY,
        (false, _) => -along - half.sqrt(),
        (true, _) => -along + half.sqrt(),
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
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
