//! An obstacle given by the distance of a place from its surface: an expression, or that from a triangulated surface.
//!
//! The distance `f` is positive outside of the obstacle and negative inside, and changes by at most the way between two places. Along
//! the ray from a place outside, the obstacle is therefore at least `f` away: the search goes on by this length until the surface is
//! near, and its last part is halved (Hart, Sphere tracing, The Visual Computer 12, 1996). From a place inside, the search goes back.
//! A surface of triangles is met at once where the ray crosses it clearly.

use crate::{
    laws::{
        contact::{
            obstacle::{Obstacle, Prescribed, vector},
            obstacle_surface::TriangulatedSurface,
        },
        expression::Scalar,
        law::LawFault,
    },
    linear_algebra::tensor::{Vector, add_scaled, in_space, larger, norm},
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::{path::PathBuf, sync::Arc};

/// An obstacle of any shape, given by its signed distance: by either `distance` or `surface`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("also" = "cylinder, cone, wedge, torus, punch, stamp, die, tool"))]
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

/// Below this share of the first distance, the surface is near.
const NEAR: f64 = 1e-3;
/// The longest step near the surface, as a multiple of the distance.
const FASTEST: f64 = 20.0;
/// By how much more than the way a distance may change, relative to the way and to the coordinates: rounding.
const ROUNDING: [f64; 2] = [1e-9, 1e-13];
/// A distance of this share of the coordinates is rounding.
const ZERO: f64 = 1e-15;
/// A ray that is this multiple of its first distance long does not meet the obstacle.
const FARTHEST: f64 = 1e6;
/// The most steps of a search; a ray at less than half a degree to the surface takes more.
const MOST_STEPS: usize = 1000;
/// By which share of the coordinates a ray may miss an edge: by rounding, with an expression; by that of numbers of seven digits in the
/// file of a surface.
const SLACK: [f64; 2] = [1e-12, 2.5e-7];
/// The half-width for derivatives of the distance near the surface, as a multiple of this distance.
const WIDTH: f64 = 10.0;
/// Cosine between a ray and the normal of the surface below which the ray runs along the surface.
const PARALLEL: f64 = 0.1;
/// The depth, as a share of the coordinates, below which an edge has been pressed into the body, and the obstacle is not beside it.
const DEEPEST: f64 = 0.1;

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

    /// A ray along an edge of the obstacle meets it.
    fn ray<const D: usize>(&self, time: f64, place: &Vector<D>, normal: &Vector<D>) -> f64 {
        let centre = vector(&self.centre, time);
        let offset = &add_scaled(place, -1.0, &centre);
        let largest = |start: f64, of: &Vector<D>| of.iter().fold(start, |most, x| larger(most, x.abs()));
        let near = largest(self.extent(), offset);
        // Where body and obstacle nearly meet at the centre, rounding is that of the coordinates from which the place is computed.
        let size = largest(largest(near, place), &centre);
        let slack = larger(self.slack([near, size]), self.rounding(offset));
        let straight =
            self.triangles().and_then(|surface| surface.along(&in_space(offset), &in_space(normal), slack));
        if let Some(length) = straight {
            return length;
        }
        let Search { length, nearest } = self.search(offset, normal, [size, 0.0]);
        if length.is_nan() || nearest > slack {
            return length;
        }
        let touches = self.distance_at(offset).abs() <= slack;
        let slope = if touches { self.slope(offset, normal, slack) } else { 0.0 };
        // The ray meets a surface across it, or leads away from one.
        if slope > PARALLEL || length.is_finite() && (!touches || slope < -PARALLEL) {
            return length;
        }
        let Search { length: found, .. } = self.search(offset, normal, [size, slack]);
        // A wall beside the body is not in front of it.
        let deepest = larger(DEEPEST * near, 2.0 * slack);
        if touches && found < -deepest { f64::INFINITY } else { found + slack }
    }

    fn depth<const D: usize>(&self, time: f64, place: &Vector<D>) -> f64 {
        -self.distance_at(&add_scaled(place, -1.0, &vector(&self.centre, time)))
    }

    fn remedy(&self) -> &'static str {
        "`distance` or `centre` is not finite, `distance` is not a signed distance (it changes by more than the distance between two \
         points), or parts of `surface` overlap: correct [contact.obstacle.shape]"
    }
}

impl Shape {
    /// The distance in m at a place relative to the centre.
    fn distance_at<const D: usize>(&self, offset: &Vector<D>) -> f64 {
        if let Some(distance) = &self.distance {
            return distance.evaluate(0.0, offset);
        }
        self.triangles().map_or(f64::NAN, |surface| surface.distance(&in_space(offset)))
    }

    fn triangles(&self) -> Option<&TriangulatedSurface> {
        self.surface.as_ref()?.triangles.as_deref()
    }

    /// The largest coordinate of the corners of the surface, in m, by which distances from it are rounded; 0 for an expression.
    fn extent(&self) -> f64 {
        self.triangles().map_or(0.0, TriangulatedSurface::extent)
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

    /// The distance from the surface in m by which a ray may miss it, for places of this size in m relative to the centre and for any.
    fn slack(&self, [near, size]: [f64; 2]) -> f64 {
        larger(SLACK[usize::from(self.surface.is_some())] * near, SLACK[0] * size)
    }

    /// By how much two evaluations of the expression at a place may differ from each other through rounding, in m.
    fn rounding<const D: usize>(&self, offset: &Vector<D>) -> f64 {
        let values = self.distance.as_ref().map(|distance| distance.enclose(0.0, offset));
        let width = values.map_or(0.0, |values| values.high - values.low);
        // Infinite where it is not known to be defined.
        if width.is_finite() { width } else { 0.0 }
    }

    /// The cosine between a ray from a place at the surface and the normal of the surface.
    fn slope<const D: usize>(&self, offset: &Vector<D>, normal: &Vector<D>, slack: f64) -> f64 {
        let change = |direction: &Vector<D>| {
            let at = |length: f64| self.distance_at(&add_scaled(offset, length, direction));
            at(WIDTH * slack) - at(-WIDTH * slack)
        };
        let steepest: Vector<D> =
            std::array::from_fn(|i| change(&std::array::from_fn(|j| f64::from(u8::from(i == j)))));
        change(normal) / norm(&steepest)
    }

    /// Follows the ray to the surface that is a `slack` farther out than that of the obstacle, where coordinates have this `size`.
    fn search<const D: usize>(
        &self,
        offset: &Vector<D>,
        normal: &Vector<D>,
        [size, slack]: [f64; 2],
    ) -> Search {
        let first = self.distance_at(offset) - slack;
        let mut nearest = first.abs();
        if first.abs() <= ZERO * size {
            return Search { length: first, nearest };
        }
        // From inside, the search goes the other way, through distances of the other sign.
        let side = first.signum();
        let place = |length: f64| add_scaled(offset, side * length, normal);
        let at = |length: f64| side * (self.distance_at(&place(length)) - slack);
        let (mut here, mut value, mut step) = (0.0, first.abs(), first.abs());
        for _ in 0..MOST_STEPS {
            let next = here + step;
            let there = at(next);
            let most = step * (1.0 + ROUNDING[0]) + ROUNDING[1] * (size + next);
            let change = (there - value).abs();
            // What rounds more than coordinates, as hypot(x, y + 1000) - 1000, is found where it matters.
            let is_distance =
                change <= most || change <= most + self.rounding(&place(here)) + self.rounding(&place(next));
            if !is_distance {
                return Search { length: f64::NAN, nearest };
            }
            if there <= 0.0 {
                let length = side * zero_between(at, [here, value], [next, there], ZERO * size);
                return Search { length, nearest };
            }
            nearest = nearest.min(there);
            if next > FARTHEST * first.abs() {
                break;
            }
            if there <= ZERO * size {
                return Search { length: side * next, nearest };
            }
            let slope = (there - value) / step;
            (here, value) = (next, there);
            // Near the surface, beyond it.
            let is_near = value < NEAR * first.abs() && slope < 0.0;
            step = value * if is_near { (2.0 / -slope).min(FASTEST) } else { 1.0 };
        }
        let length = if side < 0.0 {
            self.seen_from_outside(offset, normal, ([size, slack], here))
        } else {
            f64::INFINITY
        };
        Search { length, nearest }
    }

    /// The length of the ray from a place inside near a surface that is parallel to it, along which a search takes too many steps: from
    /// outside, back to the place. The surface is farther than `least`.
    fn seen_from_outside<const D: usize>(
        &self,
        offset: &Vector<D>,
        normal: &Vector<D>,
        ([size, slack], least): ([f64; 2], f64),
    ) -> f64 {
        let mut length = least;
        while length < FARTHEST * size {
            length *= 2.0;
            let start = add_scaled(offset, -length, normal);
            if self.distance_at(&start) > slack {
                let found = self.search(&start, normal, [larger(size, length), slack]).length;
                // The place is inside, if only by rounding.
                return if found.is_finite() { (found - length).min(0.0) } else { f64::INFINITY };
            }
        }
        f64::INFINITY
    }
}

/// What a search has found.
#[derive(Debug, Clone, Copy)]
struct Search {
    /// Length of the ray in m, as that of [`Obstacle::ray`].
    length: f64,
    /// The smallest distance in m from the surface at the places of the search before its end.
    nearest: f64,
}

/// The zero of a function that is positive at the first and not at the second place, where its value is at most `small`. On every
/// second step the interval is halved; the others go to the zero of the chord, which is that of a flat surface.
fn zero_between(
    function: impl Fn(f64) -> f64,
    mut positive: [f64; 2],
    mut other: [f64; 2],
    small: f64,
) -> f64 {
    let mut is_chord = true;
    while -other[1] > small {
        let middle = 0.5 * (positive[0] + other[0]);
        if middle <= positive[0] || middle >= other[0] {
            break;
        }
        let chord = positive[0] + (other[0] - positive[0]) * positive[1] / (positive[1] - other[1]);
        let is_inside = positive[0] < chord && chord < other[0];
        let next = if is_chord && is_inside { chord } else { middle };
        let value = function(next);
        if value.is_nan() || value.abs() <= small {
            return if value.is_nan() { value } else { next };
        }
        let side = if value > 0.0 { &mut positive } else { &mut other };
        *side = [next, value];
        is_chord = !is_chord;
    }
    other[0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::{contact::obstacle_surface::tests, expression::Expression};
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
