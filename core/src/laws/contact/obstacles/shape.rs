//! An obstacle given by the distance of a place from its surface: an expression, or that from a triangulated surface.
//!
//! A surface of triangles is met at once where the ray crosses it clearly.

use super::signed_distance::{SLACK, SignedDistance};
use crate::{
    laws::{
        contact::{
            obstacle::{Obstacle, Prescribed, vector},
            obstacle_surface::TriangulatedSurface,
        },
        expression::Scalar,
        law::LawFault,
    },
    linear_algebra::tensor::{Vector, add_scaled, in_space, larger},
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::{path::PathBuf, sync::Arc};

/// An obstacle of any shape, given by its signed distance: by either `distance` or `surface`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("also" = "cylinder, cone, wedge, punch, stamp, die, tool"))]
pub struct Shape {
    /// The distance from the surface, positive outside of the obstacle and negative inside, as an expression in x, y, z relative to
    /// `centre`. A lower bound of the distance suffices: the expression must have the Lipschitz constant 1, as distances, their
    /// `min` (union) and their `max` (intersection) have.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("variables" = "x, y, z", "unit" = "m"), example = "sqrt(x^2 + z^2) - 0.1")]
    pub distance: Option<Scalar>,
    /// In 3D, an STL file (binary or ASCII) of the surface, relative to the job file, in place of `distance`. Corners nearer than
    /// a millionth of the largest coordinate are joined. The surface must be closed, its triangles counterclockwise as seen from outside of the obstacle, and its parts must not overlap. Coordinates are
    /// relative to `centre`. Each triangle is flat, so that the gap of a round tool is as exact as its triangulation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<PathBuf>", extend("format" = "path"), example = "../meshes/stamp.stl")]
    pub surface: Option<Surface>,
    /// The unit of length of `surface`. Absent: 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "m", "exclusiveMinimum" = 0), example = 1e-3)]
    pub scale: Option<f64>,
    /// The position of the origin of `distance` or `surface`, one component per axis: numbers, or expressions in t. Absent: the
    /// origin.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(extend("variables" = "t", "unit" = "m"), example = serde_json::json!([0.5, 0.0, "-1.01 + 0.1*t"]))]
    pub centre: Vec<Scalar>,
    /// Angular velocity of the rotation about the centre, counterclockwise; in 3D about `axis`, as seen against its direction: a
    /// number, or an expression in t. It affects friction only: the geometry does not rotate; it should be axisymmetric about the
    /// axis. Absent: 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("variables" = "t", "unit" = "rad/s"), example = "-2*t")]
    pub rotation: Option<Scalar>,
    /// Direction of the axis of rotation in 3D, a vector of any length. Required with `rotation` or `moment` in 3D, not allowed in 2D.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = [0.0, 1.0, 0.0])]
    pub axis: Option<Vec<f64>>,
}

/// The file of a triangulated surface, and its contents once it has been read.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Surface {
    /// The path of the file.
    pub file: PathBuf,
    #[serde(skip)]
    triangles: Option<Arc<TriangulatedSurface>>,
}

impl Obstacle for Shape {
    fn prescribed(&self) -> Prescribed<'_> {
        let (rotation, axis) = (self.rotation.as_ref(), self.axis.as_deref());
        Prescribed { centre: &self.centre, rotation, axis, ..Prescribed::default() }
    }

    fn own_faults(&self) -> Vec<LawFault> {
        let fault = match (&self.distance, &self.surface) {
            (None, None) => {
                let help = "add distance = \"..\", an expression, or surface = \"..\", an STL file";
                LawFault::at_value("", "this shape has neither `distance` nor `surface`", help)
            }
            (Some(_), Some(_)) => LawFault::at_key(
                "surface",
                "a shape has a distance or a surface, not both",
                "delete one of them",
            ),
            (Some(_), None) if self.scale.is_some() => {
                let help = "delete it, or write the unit into the expression";
                LawFault::at_key("scale", "only a `surface` has a scale", help)
            }
            _ => return Vec::new(),
        };
        vec![fault]
    }

    fn ray<const D: usize>(&self, time: f64, place: &Vector<D>, normal: &Vector<D>) -> f64 {
        self.ray_from([place, &vector(&self.centre, time)], normal)
    }

    fn depth<const D: usize>(&self, time: f64, place: &Vector<D>) -> f64 {
        -self.distance_at(&add_scaled(place, -1.0, &vector(&self.centre, time)))
    }

    fn is_smooth(&self) -> bool {
        false
    }

    fn remedy(&self) -> &'static str {
        "`distance` or `centre` is not finite, `distance` is not a signed distance (it changes by more than the distance between two \
         points), or parts of `surface` overlap: correct [contact.obstacle.shape]"
    }
}

impl Shape {
    fn triangles(&self) -> Option<&TriangulatedSurface> {
        self.surface.as_ref()?.triangles.as_deref()
    }

    /// Sets the surface to the contents of its STL file. An error says what is wrong with it.
    pub fn read_surface(&mut self, bytes: &[u8]) -> Result<(), String> {
        if let Some(surface) = &mut self.surface {
            let triangles = TriangulatedSurface::from_stl(bytes, self.scale.unwrap_or(1.0))?;
            surface.triangles = Some(Arc::new(triangles));
        }
        Ok(())
    }

    /// A hash of the surface that was read.
    pub fn surface_digest(&self) -> Option<u64> {
        Some(self.triangles()?.digest())
    }
}

impl SignedDistance for Shape {
    fn distance_at<const D: usize>(&self, offset: &Vector<D>) -> f64 {
        if let Some(distance) = &self.distance {
            return distance.evaluate(0.0, offset);
        }
        self.triangles().map_or(f64::NAN, |surface| surface.distance(&in_space(offset)))
    }

    /// The largest coordinate of the corners of the surface.
    fn extent(&self) -> f64 {
        self.triangles().map_or(0.0, TriangulatedSurface::extent)
    }

    fn rounding<const D: usize>(&self, offset: &Vector<D>) -> f64 {
        let values = self.distance.as_ref().map(|distance| distance.enclose(0.0, offset));
        let width = values.map_or(0.0, |values| values.high - values.low);
        // Infinite where it is not known to be defined.
        if width.is_finite() { width } else { 0.0 }
    }

    fn slack(&self, [near, size]: [f64; 2]) -> f64 {
        larger(SLACK[usize::from(self.surface.is_some())] * near, SLACK[0] * size)
    }

    fn straight<const D: usize>(&self, offset: &Vector<D>, normal: &Vector<D>, slack: f64) -> Option<f64> {
        self.triangles()?.along(&in_space(offset), &in_space(normal), slack)
    }
}

#[cfg(test)]
mod tests {
    use super::{super::signed_distance::Search, *};
    use crate::laws::{contact::obstacle_surface::tests, expression::Expression};
    use crate::linear_algebra::tensor::norm;
    use proptest::prelude::*;

    fn shape(distance: &str) -> Shape {
        let distance = Scalar::Expression(Expression::parse(distance).expect("an expression"));
        Shape { distance: Some(distance), ..Shape::default() }
    }

    const DOWN: Vector<2> = [0.0, -1.0];

    #[test]
    fn rays_meet_the_surface_they_reach_first() {
        let two = shape("min(y + 2, sqrt((x - 1)^2 + (y + 1)^2) - 0.5)");
        let reach = |x: f64, y: f64| two.ray(0.0, &[x, y], &DOWN);
        assert!((reach(0.0, 1.0) - 3.0).abs() < 1e-15, "{}", reach(0.0, 1.0));
        assert!((reach(1.0, 1.0) - 1.5).abs() < 1e-15, "{}", reach(1.0, 1.0));
        // Past the disc, at a hundredth of its radius.
        assert!((reach(0.495, 1.0) - 3.0).abs() < 1e-14, "{}", reach(0.495, 1.0));
        assert_eq!(two.ray(0.0, &[0.0, 1.0], &[0.0, 1.0]), f64::INFINITY);
        assert_eq!(two.ray(0.0, &[-3.0, 1.0], &[-1.0, 0.0]), f64::INFINITY, "parallel");
        assert!((reach(0.0, -2.25) + 0.25).abs() < 1e-15, "inside");
        assert_eq!(reach(0.0, -2.0), 0.0, "touching");
    }

    #[test]
    fn a_slanted_ray_is_as_long_as_its_slope_says() {
        let floor = shape("y");
        for degrees in [0.0f64, 30.0, 60.0, 85.0, 89.0] {
            let (sine, cosine) = degrees.to_radians().sin_cos();
            let found = floor.ray(0.0, &[3.0, 0.25], &[sine, -cosine]);
            assert!((found * cosine / 0.25 - 1.0).abs() < 1e-13, "{degrees}: {found}");
            let inside = floor.ray(0.0, &[3.0, -0.25], &[sine, -cosine]);
            assert!((inside * cosine / 0.25 + 1.0).abs() < 1e-13, "{degrees}: {inside}");
        }
    }

    #[test]
    fn triangles_far_larger_than_the_body_have_its_gap_also_where_it_touches() {
        // A tetrahedron below z = 0 with sides of 2 km, and its top turned about the x axis.
        let tilt: f64 = 0.3;
        let corners =
            [[-900.0, -700.0, 0.0], [1100.0, -600.0, 0.0], [-100.0, 1300.0, 0.0], [0.0, 0.0, -1000.0]];
        let turned =
            corners.map(|[x, y, z]| [x, tilt.cos() * y - tilt.sin() * z, tilt.sin() * y + tilt.cos() * z]);
        let triangles = vec![[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]];
        for (corners, top) in [(corners, [0.0, 0.0, 1.0]), (turned, [0.0, -tilt.sin(), tilt.cos()])] {
            let surface = TriangulatedSurface::new(&corners, triangles.clone()).expect("a surface");
            let surface = Surface { file: PathBuf::new(), triangles: Some(Arc::new(surface)) };
            let shape = Shape { surface: Some(surface), ..Shape::default() };
            for height in [0.0, 1e-9, 1e-4, 0.1, 2.0] {
                for number in 0..50 {
                    let x = f64::from(number) * 0.037 - 1.0;
                    let [y, z] = [0.7 - 0.9 * x, 0.0];
                    let on_top = [x, top[2] * y, -top[1] * y + z];
                    let place = add_scaled(&on_top, height, &top);
                    for slant in [0.0, 0.5] {
                        let toward = [slant * top[2], 0.0, 0.0];
                        let normal: Vector<3> = std::array::from_fn(|i| toward[i] - top[i]);
                        let length = crate::linear_algebra::tensor::norm(&normal);
                        let found = shape.ray(0.0, &place, &normal.map(|x| x / length));
                        let wanted = height * length;
                        assert!((found - wanted).abs() <= 1e-11, "{found} for {wanted} at {place:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn rays_along_the_edges_of_a_punch_meet_it_and_a_wall_beside_is_not_in_front() {
        // 0.3 m wide, which numbers of seven digits do not hold.
        let halves = [0.15, 0.15, 0.5];
        let expression = shape("max(max(abs(x) - 0.15, abs(y) - 0.15), abs(z) - 0.5)");
        let corners: Vec<Vector<3>> = (0..8usize)
            .map(|corner| std::array::from_fn(|i| halves[i] * if corner >> i & 1 == 0 { -1.0 } else { 1.0 }))
            .collect();
        let sides = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let triangles: Vec<[usize; 3]> =
            sides.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        let single: Vec<Vector<3>> =
            corners.iter().map(|corner| corner.map(|x| f64::from(x as f32))).collect();
        let punch = |corners: &[Vector<3>], triangles: Vec<[usize; 3]>| {
            let surface = TriangulatedSurface::new(corners, triangles).expect("a surface");
            let surface = Some(Surface { file: PathBuf::new(), triangles: Some(Arc::new(surface)) });
            Shape { surface, ..Shape::default() }
        };
        let inward = single.iter().map(|corner| corner.map(|x| 0.999_999_95 * x)).collect::<Vec<_>>();
        let punches = [expression, punch(&single, triangles.clone()), punch(&inward, triangles)];
        let up = [0.0, 0.0, 1.0];
        for punch in &punches {
            for [x, y] in
                [[0.15, 0.15], [-0.15, 0.15], [0.15, 0.02], [0.0, -0.15], [0.07, 0.0], [0.15 - 1e-10, 0.0]]
            {
                for height in [0.2, 1e-3, 0.0, -1e-8, -1e-4, -0.01] {
                    let found = punch.ray(0.0, &[x, y, -0.5 - height], &up);
                    assert!((found - height).abs() <= 3e-7, "{found} for {height} at {x}, {y}: {punch:?}");
                }
            }
            for x in [0.1501, 0.151, 0.2] {
                assert_eq!(punch.ray(0.0, &[x, 0.0, -0.6], &up), f64::INFINITY, "beside it: {punch:?}");
                assert_eq!(punch.ray(0.0, &[x, 0.0, -0.4], &up), f64::INFINITY, "beside it: {punch:?}");
            }
            let beside = punch.ray(0.0, &[0.15, 0.0, 0.2], &up);
            assert_eq!(beside, f64::INFINITY, "a wall: {punch:?}");
            assert!((punch.ray(0.0, &[0.15 - 1e-6, 0.0, -0.3], &up) + 0.2).abs() < 3e-8, "deep inside");
        }
        assert_eq!(shape("x").ray(0.0, &[0.0, 1.0], &DOWN), f64::INFINITY, "an endless wall");
    }

    #[test]
    fn what_is_no_distance_has_no_gap() {
        assert!(shape("x^2 + (y + 3)^2 - 1").ray(0.0, &[0.0, 0.0], &DOWN).is_nan(), "a square");
        assert!(shape("10*y").ray(0.0, &[0.0, 1.0], &DOWN).is_nan());
        assert!(shape("sqrt(x - 1)").ray(0.0, &[0.0, 1.0], &DOWN).is_nan());
        assert!(shape("-1/(0*x)").ray(0.0, &[0.0, 1.0], &DOWN).is_nan());
        assert!((shape("0.1*y").ray(0.0, &[0.0, 1.0], &DOWN) - 1.0).abs() < 1e-14, "less than the distance");
    }

    #[test]
    fn exact_distances_that_round_have_gaps_until_the_obstacle_touches_and_beyond() {
        let corner = "sqrt(max(abs(x) - 0.1, 0)^2 + max(abs(y - 0.3) - 0.2, 0)^2)";
        let inside = "min(max(abs(x) - 0.1, abs(y - 0.3) - 0.2), 0)";
        let space = "hypot(hypot(max(abs(x) - 0.1, 0), max(abs(y - 0.3) - 0.2, 0)), max(abs(z) - 0.7, 0))";
        let beside = "hypot(x - 0.3, y - 0.3) - 0.3";
        // All of them with their lowest place at y = 0, from below.
        let distances = [
            "-(y - 0.3) - 0.2 - 0.1".to_owned(),
            "abs(y - 0.3) - 0.2 - 0.1".into(),
            format!("{corner} + {inside} - 0.1"),
            format!("{space} + min(max({}, abs(z) - 0.7), 0) - 0.1", "abs(x) - 0.1, abs(y - 0.3) - 0.2"),
            "hypot(x - min(max(x, -0.2), 0.2), y - 0.3) - 0.3".into(),
            "hypot(x, y - 1000) - 1000".into(),
            "hypot(x, y - 1e6) - 1e6".into(),
            "sqrt(x^2 + z^2 + (y - 0.1)^2) - 0.1".into(),
            format!("min({corner} + {inside} - 0.1, {beside})"),
            format!("-ln(exp(-32*({corner} + {inside} - 0.1)) + exp(-32*({beside} + 9)))/32 + 0*z"),
            "-max(y, -1) - 0.25*max(0.1 - abs(y + 1), 0)^2/0.1".into(),
        ];
        for text in &distances {
            let [body, twice] = [text.clone(), format!("2*({text})")].map(|text| shape(&text));
            for height in (-60..=60).map(|number| f64::from(number) * 0.000_715_34 / 60.0) {
                for share in [1.0, 1e-3, 1e-7, 1e-11, 1e-15] {
                    for centre in [0.0, 0.500_715_34] {
                        let at = centre + share * height;
                        let low = at - share * height;
                        let centre = vec![Scalar::Number(0.5), Scalar::Number(at)];
                        let gap = |shape: &Shape, y: f64| {
                            let moved = Shape { centre: centre.clone(), ..shape.clone() };
                            moved.ray(0.0, &[0.5, y, 0.0], &[0.0, 1.0, 0.0])
                        };
                        let (wanted, found) = (at - low, gap(&body, low));
                        let rounding = 4.0 * body.rounding(&[0.0, low - at, 0.0]) + 1e-12;
                        assert!((found - wanted).abs() <= rounding, "{found:e} for {wanted:e}: {text}");
                        let found = gap(&twice, low - 0.01);
                        assert!(found.is_nan(), "{found:e}: twice {text}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_ray_through_a_block_of_triangles_is_met_at_once_and_at_its_edges_by_the_search() {
        let (corners, triangles) = tests::star(&[1.0; 42]);
        let ball = TriangulatedSurface::new(&corners, triangles).expect("a surface");
        let slack = 2.5e-7;
        // The first corner of the icosahedron, and above it.
        let [x, y, z] = corners[0];
        let toward = |place: [f64; 3]| ball.along(&place, &[-x, -y, -z], slack);
        assert!(
            (toward([2.0 * x, 2.0 * y, 2.0 * z]).expect("a corner that all faces turn outward") - 1.0).abs()
                < 1e-14
        );
        assert!((toward([0.5 * x, 0.5 * y, 0.5 * z]).expect("inside") + 0.5).abs() < 1e-14);
        assert_eq!(toward([-2.0 * x, -2.0 * y, -2.0 * z]), Some(f64::INFINITY), "behind");
        let beside: Vector<3> = [y, -x, 0.0].map(|component| component / x.hypot(y));
        assert_eq!(
            ball.along(&add_scaled(&corners[0], 3.0, &beside), &beside.map(|x| -x), slack),
            None,
            "its edge"
        );
        assert_eq!(toward([f64::NAN, 0.0, 0.0]), None);
    }

    proptest! {
        #[test]
        fn rays_to_a_ragged_surface_end_where_the_search_ends(
            radii in prop::collection::vec(0.4f64..1.6, 42),
            places in prop::collection::vec((prop::array::uniform3(-2.0f64..2.0), prop::array::uniform3(-1.0f64..1.0)), 8),
        ) {
            let (corners, triangles) = tests::star(&radii);
            let surface = TriangulatedSurface::new(&corners, triangles).expect("a surface");
            let surface = Surface { file: PathBuf::new(), triangles: Some(Arc::new(surface)) };
            let shape = Shape { surface: Some(surface), ..Shape::default() };
            let mut clear = 0;
            for (place, direction) in places {
                let length = norm(&direction);
                prop_assume!(length > 0.1);
                let direction = direction.map(|x| x / length);
                let Some(found) = shape.triangles().and_then(|s| s.along(&place, &direction, 2.5e-7)) else { continue };
                clear += 1;
                let Search { length: wanted, .. } = shape.search(&place, &direction, [2.0, 0.0]);
                // The search may step over an edge that the ray grazes.
                let is_first = found.abs() <= wanted.abs() + 1e-11 && (found < 0.0) == (wanted < 0.0);
                prop_assert!(is_first, "{} for {}", found, wanted);
                if found.is_finite() {
                    let there = shape.distance_at(&add_scaled(&place, found, &direction));
                    prop_assert!(there.abs() < 1e-11, "{} off the surface", there);
                }
            }
            prop_assert!(clear >= 3, "only {} of eight are clear", clear);
        }

        #[test]
        fn the_end_of_the_ray_is_the_first_zero(
            place in prop::array::uniform3(-3.0f64..3.0), direction in prop::array::uniform3(-1.0f64..1.0),
        ) {
            let length = crate::linear_algebra::tensor::norm(&direction);
            prop_assume!(length > 0.1);
            let normal = direction.map(|x| x / length);
            // A box with rounded edges, cut by a plane.
            let body = shape(
                "max(sqrt(max(abs(x) - 1, 0)^2 + max(abs(y) - 0.5, 0)^2 + max(abs(z) - 0.7, 0)^2) - 0.2, 0.6*x + 0.8*y - 0.3)",
            );
            let first = body.distance_at(&place);
            let reach = body.ray(0.0, &place, &normal);
            prop_assert!(!reach.is_nan());
            let at = |t: f64| body.distance_at(&add_scaled(&place, t, &normal));
            if reach.is_finite() {
                prop_assert!(at(reach).abs() < 1e-12, "{}", at(reach));
                prop_assert_eq!(reach < 0.0, first < 0.0);
            }
            let end = if reach.is_finite() { reach } else { 10.0 };
            for k in 1..50 {
                let value = at(end * f64::from(k) / 50.0 * (1.0 - 1e-9));
                prop_assert!(first * value >= -1e-12, "{value} before the end");
            }
        }
    }
}
