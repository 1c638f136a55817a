//! Planes of facets, clipping of segments and triangles, quadrature and shape functions.

use super::facet::Facet;
use crate::linear_algebra::tensor::Vector;

/// Coordinates in m in the plane of a facet; in two dimensions the second one is 0.
pub(super) type Point = [f64; 2];

/// The corners at the ends of the sides of a facet; in two dimensions there is only the first.
const SIDES: [(usize, usize); 3] = [(0, 1), (1, 2), (2, 0)];

/// Points in \[-1, 1\] and weights of the Gauss-Legendre rule of degree 5.
const SEGMENT_RULE: [(f64, f64); 3] =
    [(-0.774_596_669_241_483_4, 5.0 / 9.0), (0.0, 8.0 / 9.0), (0.774_596_669_241_483_4, 5.0 / 9.0)];

/// The rule of degree 4 with 6 points on a triangle (Dunavant 1985, Int. J. Numer. Methods Eng. 21,
/// 1129-1148): the two equal barycentric coordinates of three points, and the weight of each as a share of
/// the area.
const TRIANGLE_RULE: [(f64, f64); 2] = [
    (0.445_948_490_915_964_9, 0.223_381_589_678_011_47),
    (0.091_576_213_509_770_74, 0.109_951_743_655_321_87),
];

pub(super) fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

pub(super) fn subtract<const N: usize>(a: &[f64; N], b: &[f64; N]) -> [f64; N] {
    std::array::from_fn(|i| a[i] - b[i])
}

fn cross(a: Point, b: Point) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

/// The plane of a facet (a line in two dimensions), with the origin in the middle of the facet.
#[derive(Debug)]
pub(super) struct Plane<const D: usize> {
    pub(super) origin: Vector<D>,
    /// Orthonormal; the second one is 0 in two dimensions.
    pub(super) tangents: [Vector<D>; 2],
    pub(super) normal: Vector<D>,
}

impl<const D: usize> Plane<D> {
    /// The plane of a facet. Its corners are counterclockwise in the coordinates of the plane (ascending in
    /// two dimensions).
    pub(super) fn new(facet: &Facet<D>) -> Self {
        let corners = &facet.corners;
        let origin = std::array::from_fn(|i| corners.iter().map(|corner| corner[i]).sum::<f64>() / D as f64);
        let mut tangents = [[0.0; D]; 2];
        for k in 0..D - 1 {
            let mut tangent = subtract(&corners[k + 1], &corners[0]);
            // The second pass removes what rounding leaves of the components along the other directions.
            for _ in 0..2 {
                for other in [facet.normal, tangents[0]] {
                    let component = dot(&tangent, &other);
                    tangent = std::array::from_fn(|i| tangent[i] - component * other[i]);
                }
                let length = dot(&tangent, &tangent).sqrt();
                tangent = tangent.map(|x| x / length);
            }
            tangents[k] = tangent;
        }
        Self { origin, tangents, normal: facet.normal }
    }

    /// The projection of a place along the normal, and the signed distance in m of the place from the plane.
    pub(super) fn project(&self, place: &Vector<D>) -> (Point, f64) {
        let offset = subtract(place, &self.origin);
        (self.tangents.map(|tangent| dot(&tangent, &offset)), dot(&self.normal, &offset))
    }
}

/// The length in m of a segment, or the area in m^2 and the centroid of a convex counterclockwise polygon. An
/// empty polygon measures 0.
pub(super) fn measure_and_centroid<const D: usize>(polygon: &[Point]) -> (f64, Point) {
    let Some(&first) = polygon.first() else { return (0.0, [0.0; 2]) };
    if D == 2 {
        let last = polygon[1];
        return (last[0] - first[0], [0.5 * (first[0] + last[0]), 0.0]);
    }
    let (mut area, mut moment) = (0.0, [0.0; 2]);
    for pair in polygon[1..].windows(2) {
        let (a, b) = (subtract(&pair[0], &first), subtract(&pair[1], &first));
        let part = 0.5 * cross(a, b);
        area += part;
        moment = std::array::from_fn(|i| moment[i] + part * (a[i] + b[i]) / 3.0);
    }
    if area == 0.0 {
        return (0.0, first);
    }
    (area, std::array::from_fn(|i| first[i] + moment[i] / area))
}

/// The way in m to a place from the nearest one of a convex polygon with corners in the order of [`measure_and_centroid`]; 0 within it.
pub(super) fn way_from<const D: usize>(polygon: &[Point], place: Point) -> Point {
    let sides = || polygon.iter().zip(polygon.iter().cycle().skip(1));
    let is_left = |(a, b): (&Point, &Point)| cross(subtract(b, a), subtract(&place, a)) >= 0.0;
    if D == 3 && sides().all(is_left) {
        return [0.0; 2];
    }
    let from_side = |(a, b): (&Point, &Point)| {
        let (side, way) = (subtract(b, a), subtract(&place, a));
        let square = dot(&side, &side);
        let along = if square > 0.0 { (dot(&side, &way) / square).clamp(0.0, 1.0) } else { 0.0 };
        std::array::from_fn(|i| way[i] - along * side[i])
    };
    sides().map(from_side).fold([f64::INFINITY; 2], shorter)
}

/// The shorter one of two vectors.
pub fn shorter<const N: usize>(a: [f64; N], b: [f64; N]) -> [f64; N] {
    if dot(&b, &b) < dot(&a, &a) { b } else { a }
}

/// The corners in the order of [`measure_and_centroid`]: ascending in two dimensions, counterclockwise in
/// three.
pub(super) fn oriented<const D: usize>(mut corners: [Point; D]) -> [Point; D] {
    if measure_and_centroid::<D>(&corners).0 < 0.0 {
        corners.reverse();
    }
    corners
}

/// The intersection of two segments or of two convex counterclockwise polygons; empty where they do not meet.
/// For polygons each side of `window` cuts off what is on its right (Sutherland and Hodgman 1974, Commun. ACM
/// 17, 32-42). Rounding moves corners by a few units in the last place of the coordinates: it may leave or
/// remove slivers of that width, but does not make the result wrong otherwise.
pub(super) fn clip<const D: usize>(subject: &[Point], window: &[Point]) -> Vec<Point> {
    if subject.is_empty() || window.is_empty() {
        return Vec::new();
    }
    if D == 2 {
        let (low, high) = (subject[0][0].max(window[0][0]), subject[1][0].min(window[1][0]));
        return if low < high { vec![[low, 0.0], [high, 0.0]] } else { Vec::new() };
    }
    let mut polygon = subject.to_vec();
    let mut rest = Vec::with_capacity(subject.len() + window.len());
    for (i, start) in window.iter().enumerate() {
        let side = subtract(&window[(i + 1) % window.len()], start);
        let left = |place: &Point| cross(side, subtract(place, start));
        rest.clear();
        for (k, place) in polygon.iter().enumerate() {
            let next = &polygon[(k + 1) % polygon.len()];
            let (here, there) = (left(place), left(next));
            if here >= 0.0 {
                rest.push(*place);
            }
            if (here < 0.0 && there > 0.0) || (here > 0.0 && there < 0.0) {
                let share = here / (here - there);
                rest.push(std::array::from_fn(|i| place[i] + share * (next[i] - place[i])));
            }
        }
        std::mem::swap(&mut polygon, &mut rest);
    }
    if polygon.len() < 3 {
        polygon.clear();
    }
    polygon
}

/// Points and weights in m^(D-1) of a rule on a segment or a convex polygon, exact for polynomials of degree
/// 4.
pub(super) fn quadrature<const D: usize>(polygon: &[Point]) -> Vec<(Point, f64)> {
    if D == 2 {
        let half = 0.5 * (polygon[1][0] - polygon[0][0]);
        let middle = 0.5 * (polygon[1][0] + polygon[0][0]);
        return SEGMENT_RULE.map(|(t, weight)| ([middle + half * t, 0.0], half * weight)).to_vec();
    }
    let mut points = Vec::with_capacity(6 * (polygon.len() - 2));
    for pair in polygon[1..].windows(2) {
        let corners = [polygon[0], pair[0], pair[1]];
        let area = measure_and_centroid::<3>(&corners).0;
        for (share, weight) in TRIANGLE_RULE {
            for k in 0..3 {
                let [a, b, c] = [corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]];
                let place = std::array::from_fn(|i| a[i] + share * (b[i] - a[i]) + share * (c[i] - a[i]));
                points.push((place, area * weight));
            }
        }
    }
    points
}

/// The shape functions of a facet on a plane, about a place there: values at the place, and differences from
/// them. To keep the differences apart from the values saves their digits where the part of interest is
/// small.
#[derive(Debug)]
pub(super) struct Shape<const D: usize> {
    quadratic: bool,
    /// Barycentric coordinates at the place.
    coordinates: [f64; D],
    /// Gradients of the barycentric coordinates in 1/m.
    gradients: [Point; D],
}

impl<const D: usize> Shape<D> {
    /// The functions of a facet with these projected corners about `place`.
    pub(super) fn new(quadratic: bool, corners: &[Point; D], place: Point) -> Self {
        let gradients: [Point; D] = std::array::from_fn(|i| {
            let from = corners[(i + 1) % D];
            if D == 2 {
                return [1.0 / (corners[i][0] - from[0]), 0.0];
            }
            let side = subtract(&corners[(i + 2) % D], &from);
            let double_area = cross(side, subtract(&corners[i], &from));
            [-side[1] / double_area, side[0] / double_area]
        });
        let coordinates =
            std::array::from_fn(|i| dot(&gradients[i], &subtract(&place, &corners[(i + 1) % D])));
        Self { quadratic, coordinates, gradients }
    }

    /// A linear function with these values at the corners: its value at the place and its gradient.
    pub(super) fn linear(&self, corners: &[f64; D]) -> (f64, Point) {
        let gradient = std::array::from_fn(|k| (0..D).map(|i| corners[i] * self.gradients[i][k]).sum());
        (dot(corners, &self.coordinates), gradient)
    }

    /// The values at the place, in the order of [`Facet::nodes`]; 0 beyond the nodes of the facet.
    pub(super) fn values(&self) -> [f64; 6] {
        let at = &self.coordinates;
        let mut values = [0.0; 6];
        for i in 0..D {
            values[i] = if self.quadratic { at[i] * (2.0 * at[i] - 1.0) } else { at[i] };
        }
        if self.quadratic {
            for (k, &(i, j)) in sides::<D>().iter().enumerate() {
                values[D + k] = 4.0 * at[i] * at[j];
            }
        }
        values
    }

    /// The values at an offset in m from the place minus those at the place.
    pub(super) fn differences(&self, offset: Point) -> [f64; 6] {
        let at = &self.coordinates;
        let by = self.gradients.map(|gradient| dot(&gradient, &offset));
        let mut differences = [0.0; 6];
        for i in 0..D {
            differences[i] = if self.quadratic { by[i] * (4.0 * at[i] - 1.0 + 2.0 * by[i]) } else { by[i] };
        }
        if self.quadratic {
            for (k, &(i, j)) in sides::<D>().iter().enumerate() {
                differences[D + k] = 4.0 * (at[i] * by[j] + by[i] * at[j] + by[i] * by[j]);
            }
        }
        differences
    }
}

/// The corners at the ends of each side that has a node in its middle on quadratic facets.
pub(super) fn sides<const D: usize>() -> &'static [(usize, usize)] {
    &SIDES[..if D == 2 { 1 } else { 3 }]
}
