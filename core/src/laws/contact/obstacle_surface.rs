//! A triangulated surface that bounds an obstacle.

use super::{
    stl,
    triangle::{First, Line, Part, Triangle, find_nearest},
};
use crate::linear_algebra::tensor::{Vector, add_scaled, dot, norm};
use rstar::RTree;
use std::collections::HashMap;

/// The most triangles of a surface.
const MOST_TRIANGLES: usize = 1 << 22;
/// Places of a triangle, as shares of its corners; a ray from one of them may pass between two triangles by rounding.
const INSIDE: [[f64; 3]; 3] = [[0.34, 0.33, 0.33], [0.5, 0.3, 0.2], [0.2, 0.27, 0.53]];
/// The distance from a triangle, as a share of its longest side, at which the surface must be outside of itself.
const BESIDE: f64 = 1e-6;
/// Rounding of coordinates, as a share of the largest one.
const ROUNDING: f64 = 1e-13;

/// A closed surface of triangles, which are counterclockwise as seen from outside of the obstacle.
#[derive(Debug)]
pub(super) struct TriangulatedSurface {
    triangles: RTree<Triangle>,
    normals: Vec<NormalsOfParts>,
    digest: u64,
    extent: f64,
}

impl PartialEq for TriangulatedSurface {
    fn eq(&self, other: &Self) -> bool {
        self.digest == other.digest
    }
}

impl TriangulatedSurface {
    /// The surface in an STL file with these bytes, ASCII or binary, whose unit of length is `scale` m. An error says what is wrong
    /// with the surface.
    pub(super) fn from_stl(bytes: &[u8], scale: f64) -> Result<Self, String> {
        let (mut corners, triangles) = stl::read(bytes)?;
        corners.as_flattened_mut().iter_mut().for_each(|x| *x *= scale);
        Self::new(&corners, triangles)
    }

    /// The surface with these corners in m and triangles of corners.
    pub(super) fn new(corners: &[Vector<3>], mut triangles: Vec<[usize; 3]>) -> Result<Self, String> {
        if let Some(bad) = corners.iter().find(|corner| corner.iter().any(|x| !x.is_finite())) {
            return Err(format!("a corner has coordinates that are not finite: {bad:?}"));
        }
        // Triangles without area, which some programs write, do not change the surface.
        triangles.retain(|[a, b, c]| a != b && b != c && c != a);
        if triangles.is_empty() || triangles.len() > MOST_TRIANGLES {
            return Err(format!(
                "it has {} triangles; a surface needs 4 to {MOST_TRIANGLES} triangles",
                triangles.len()
            ));
        }
        check_closed(corners, &triangles)?;
        let digest = digest(corners, &triangles);
        let extent = corners.as_flattened().iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        // There are fewer triangles than 2^32.
        let with_corners = triangles.iter().enumerate().map(|(number, triangle)| Triangle {
            corners: triangle.map(|corner| corners[corner]),
            number: number as u32,
        });
        let with_corners: Vec<_> = with_corners.collect();
        let normals = normals_of_parts(&triangles, &with_corners);
        let surface = Self { triangles: RTree::bulk_load(with_corners), normals, digest, extent };
        surface.check_intersections()?;
        Ok(surface)
    }

    /// A hash of the corners of all triangles.
    pub(super) fn digest(&self) -> u64 {
        self.digest
    }

    /// The largest coordinate of a corner in m.
    pub(super) fn extent(&self) -> f64 {
        self.extent
    }

    /// The distance in m of a place from the surface, negative inside of the obstacle.
    pub(super) fn distance(&self, place: &Vector<3>) -> f64 {
        if place.iter().any(|x| !x.is_finite()) {
            return f64::NAN;
        }
        let mut best = None;
        find_nearest(self.triangles.root(), place, &mut best);
        let Some((_, triangle)) = best else { return f64::NAN };
        let (outward, part) = triangle.nearest(place);
        let of_parts = &self.normals[triangle.number as usize];
        let normal = match part {
            Part::Face => triangle.area(),
            Part::Side(side) => of_parts.sides[side],
            Part::Corner(corner) => of_parts.corners[corner],
        };
        if dot(&outward, &normal) < 0.0 { -norm(&outward) } else { norm(&outward) }
    }

    /// How far the obstacle is from a place along a direction of length 1, in m: negative for a place inside, infinite where it is not in
    /// front of the place. `None` where a `slack` in m decides, or the surface is nearly parallel to the direction.
    pub(super) fn along(&self, place: &Vector<3>, direction: &Vector<3>, slack: f64) -> Option<f64> {
        if place.iter().chain(direction).any(|x| !x.is_finite()) {
            return None;
        }
        let line = Line { from: *place, direction: *direction };
        match line.first(&self.triangles, [-slack, slack]) {
            First::Enters(length) => Some(length),
            First::Misses => Some(f64::INFINITY),
            // From inside, the place at which the line has entered.
            First::Leaves(length) if length > slack => {
                let back = Line { from: *place, direction: direction.map(|x| -x) };
                match back.first(&self.triangles, [0.0, slack]) {
                    First::Leaves(depth) => Some(-depth),
                    _ => None,
                }
            }
            First::Leaves(_) | First::Unclear => None,
        }
    }

    /// Refuses parts of the surface that lie inside of others: the distance from such a surface jumps.
    fn check_intersections(&self) -> Result<(), String> {
        let buried = |triangle: &&Triangle| INSIDE.iter().all(|place| self.is_buried(triangle, place));
        match self.triangles.iter().filter(buried).min_by_key(|triangle| triangle.number) {
            None => Ok(()),
            Some(buried) => Err(format!(
                "its triangle at {:?} m lies inside another part of the obstacle; unite parts that overlap, and order the \
                 corners of all triangles counterclockwise as seen from outside",
                buried.point(&[1.0 / 3.0; 3])
            )),
        }
    }

    /// Whether the ray outward from a place of a triangle leaves the obstacle before it enters it.
    fn is_buried(&self, triangle: &Triangle, place: &[f64; 3]) -> bool {
        let direction = unit(&triangle.area());
        let size = triangle.sides().iter().map(norm).fold(0.0, f64::max);
        let from = add_scaled(&triangle.point(place), BESIDE * size, &direction);
        let line = Line { from, direction };
        direction != [0.0; 3]
            && matches!(line.first(&self.triangles, [0.0, ROUNDING * self.extent]), First::Leaves(_))
    }
}

/// The outward normals at the sides and corners of a triangle, of any length: a place whose nearest point lies there is outside where the
/// vector to it has a positive component along the normal (Baerentzen and Aanaes 2005).
#[derive(Debug)]
struct NormalsOfParts {
    sides: [Vector<3>; 3],
    corners: [Vector<3>; 3],
}

/// At sides the sum of the unit normals of both triangles; at corners that of all triangles, weighted by their angles there.
fn normals_of_parts(triangles: &[[usize; 3]], with_corners: &[Triangle]) -> Vec<NormalsOfParts> {
    let (mut at_sides, mut at_corners) = (HashMap::new(), HashMap::new());
    let side = |triangle: &[usize; 3], k: usize| {
        let (from, to) = (triangle[k], triangle[(k + 1) % 3]);
        [from.min(to), from.max(to)]
    };
    for (triangle, with_corners) in triangles.iter().zip(with_corners) {
        let normal = unit(&with_corners.area());
        let sides = with_corners.sides().map(|side| unit(&side));
        for k in 0..3 {
            let angle = (-dot(&sides[k], &sides[(k + 2) % 3])).clamp(-1.0, 1.0).acos();
            let at_side = at_sides.entry(side(triangle, k)).or_insert([0.0; 3]);
            *at_side = add_scaled(at_side, 1.0, &normal);
            let at_corner = at_corners.entry(triangle[k]).or_insert([0.0; 3]);
            *at_corner = add_scaled(at_corner, angle, &normal);
        }
    }
    let of_parts = |triangle: &[usize; 3]| NormalsOfParts {
        sides: std::array::from_fn(|k| at_sides[&side(triangle, k)]),
        corners: triangle.map(|corner| at_corners[&corner]),
    };
    triangles.iter().map(of_parts).collect()
}

/// The vector divided by its length; zero if it has none.
fn unit(vector: &Vector<3>) -> Vector<3> {
    let length = norm(vector);
    if length > 0.0 { vector.map(|x| x / length) } else { [0.0; 3] }
}

/// Refuses a surface with an edge that does not join two triangles of the same orientation.
fn check_closed(corners: &[Vector<3>], triangles: &[[usize; 3]]) -> Result<(), String> {
    let mut edges: HashMap<[usize; 2], [u32; 2]> = HashMap::new();
    for &[a, b, c] in triangles {
        for [from, to] in [[a, b], [b, c], [c, a]] {
            edges.entry([from.min(to), from.max(to)]).or_default()[usize::from(from > to)] += 1;
        }
    }
    let bad = edges.iter().filter(|(_, counts)| **counts != [1, 1]);
    let Some((&[from, to], counts)) = bad.clone().min_by_key(|(edge, _)| **edge) else { return Ok(()) };
    let fault = match counts.iter().sum::<u32>() {
        1 => "belongs to one triangle only: the surface is not closed",
        2 => "joins two triangles of opposite orientation",
        _ => "joins more than two triangles",
    };
    Err(format!(
        "the edge from {:?} to {:?} m {fault} ({} such edges)",
        corners[from],
        corners[to],
        bad.count()
    ))
}

/// A hash of the corners of all triangles.
fn digest(corners: &[Vector<3>], triangles: &[[usize; 3]]) -> u64 {
    let mut hash = xxhash_rust::xxh3::Xxh3::new();
    for x in triangles.iter().flatten().flat_map(|&corner| corners[corner]) {
        hash.update(&x.to_bits().to_le_bytes());
    }
    hash.digest()
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::linear_algebra::tensor::{add_scaled, cross, dot, larger, norm};
    use proptest::prelude::*;

    /// The box between two corners; `inward` turns all triangles around.
    fn block([low, high]: [Vector<3>; 2], inward: bool) -> (Vec<Vector<3>>, Vec<[usize; 3]>) {
        let corners = (0..8usize)
            .map(|corner| {
                std::array::from_fn(|axis| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] })
            })
            .collect();
        let sides = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let split = |[a, b, c, d]: [usize; 4]| [[a, b, c], [a, c, d]];
        let turned = |[a, b, c]: [usize; 3]| if inward { [a, c, b] } else { [a, b, c] };
        (corners, sides.into_iter().flat_map(split).map(turned).collect())
    }

    fn surface(
        (corners, triangles): (Vec<Vector<3>>, Vec<[usize; 3]>),
    ) -> Result<TriangulatedSurface, String> {
        TriangulatedSurface::new(&corners, triangles)
    }

    const CUBE: [Vector<3>; 2] = [[-1.0; 3], [1.0; 3]];

    fn both(boxes: [[Vector<3>; 2]; 2]) -> Result<TriangulatedSurface, String> {
        let [(mut corners, mut triangles), (others, more)] = boxes.map(|ends| block(ends, false));
        triangles.extend(more.into_iter().map(|triangle| triangle.map(|corner| corner + corners.len())));
        corners.extend(others);
        TriangulatedSurface::new(&corners, triangles)
    }

    #[test]
    fn boxes_that_overlap_are_refused_and_others_are_not() {
        assert!(
            both([CUBE, [[0.5, -0.5, 0.9], [0.8, 0.5, 2.0]]]).unwrap_err().contains("inside another part")
        );
        assert!(both([CUBE, [[0.5, -0.5, -0.5], [0.8, 0.5, 0.5]]]).is_err(), "one in the other");
        let apart = both([CUBE, [[0.5, -0.5, 1.1], [0.8, 0.5, 2.0]]]).unwrap();
        assert!((apart.distance(&[0.6, 0.0, 1.04]) - 0.04).abs() < 1e-15);
        assert!((apart.distance(&[0.6, 0.0, 1.08]) - 0.02).abs() < 1e-15);
    }

    #[test]
    fn surfaces_that_bound_nothing_are_refused() {
        let (corners, triangles) = block(CUBE, false);
        let said = |triangles: Vec<[usize; 3]>| TriangulatedSurface::new(&corners, triangles).unwrap_err();
        assert!(said(Vec::new()).contains("0 triangles"));
        assert!(
            said(triangles[1..].to_vec()).contains("not closed (3 such edges)"),
            "{}",
            said(triangles[1..].to_vec())
        );
        let mut turned = triangles.clone();
        turned[3].swap(0, 1);
        assert!(said(turned).contains("opposite orientation (3 such edges)"));
        let twice = [triangles.clone(), triangles.clone()].concat();
        assert!(said(twice).contains("more than two triangles"));
        let mut far = corners.clone();
        far[5][1] = f64::NAN;
        assert!(TriangulatedSurface::new(&far, triangles.clone()).unwrap_err().contains("NaN"));
        let mut degenerate = triangles;
        degenerate.push([3, 3, 1]);
        assert!(TriangulatedSurface::new(&corners, degenerate).is_ok());
    }

    #[test]
    fn files_are_read_in_the_unit_they_are_written_in() {
        let (corners, triangles) = block([[0.0; 3], [2.0, 3.0, 4.0]], false);
        let [text, binary] = stl::tests::written(&corners, &triangles);
        let files =
            [binary.as_slice(), &text].map(|bytes| TriangulatedSurface::from_stl(bytes, 1e-3).unwrap());
        assert_eq!(files[0], files[1]);
        assert!((files[0].distance(&[1e-3, 1e-3, 5e-3]) - 1e-3).abs() < 1e-18);
        assert_ne!(files[0], TriangulatedSurface::from_stl(&binary, 1.0).unwrap());
        for bad in [&binary[..300], &binary[..50], b"", b"solid x\nfacet normal 0 0", b"[mesh]\nfile = 1"] {
            assert!(TriangulatedSurface::from_stl(bad, 1.0).is_err(), "{} bytes", bad.len());
        }
    }

    /// The distance from a box, by its formula.
    fn to_box(place: &Vector<3>, [low, high]: [Vector<3>; 2]) -> f64 {
        let beyond: Vector<3> = std::array::from_fn(|i| larger(low[i] - place[i], place[i] - high[i]));
        let most = beyond.iter().fold(f64::NEG_INFINITY, |most, x| larger(most, *x));
        if most <= 0.0 { most } else { norm(&beyond.map(|x| larger(x, 0.0))) }
    }

    proptest! {
        #[test]
        fn the_distance_from_a_box_is_known(place in prop::array::uniform3(-3.0f64..3.0), inward in any::<bool>()) {
            let ends = [[-1.0, -0.5, -2.0], [0.7, 1.5, 1.0]];
            let found = surface(block(ends, inward)).unwrap().distance(&place);
            let known = if inward { -to_box(&place, ends) } else { to_box(&place, ends) };
            prop_assert!((found - known).abs() < 1e-14, "{found} and {known}");
        }

        #[test]
        fn the_distance_from_a_ragged_surface_is_that_from_the_nearest_of_its_triangles(
            radii in prop::collection::vec(0.4f64..1.6, 42), place in prop::array::uniform3(-2.0f64..2.0),
        ) {
            let (corners, triangles) = star(&radii);
            let found = surface((corners.clone(), triangles.clone())).unwrap().distance(&place);
            let nearest = triangles.iter().map(|t| to_triangle(&place, t.map(|i| corners[i]))).fold(f64::INFINITY, f64::min);
            prop_assert!((found.abs() - nearest).abs() < 1e-13, "{found} and {nearest}");
            // The solid angles of all triangles sum to 4 pi inside, 0 outside.
            let angle: f64 = triangles.iter().map(|t| solid_angle(&place, t.map(|i| corners[i]))).sum();
            prop_assert_eq!(found < 0.0, angle > 6.0, "{} at {:?}", found, place);
        }
    }

    /// An icosahedron with divided faces, whose corners have these distances from the origin.
    pub(in crate::laws::contact) fn star(radii: &[f64]) -> (Vec<Vector<3>>, Vec<[usize; 3]>) {
        let golden = (1.0 + 5f64.sqrt()) / 2.0;
        let mut corners: Vec<Vector<3>> = Vec::new();
        for axis in 0..3 {
            for [one, other] in [[1.0, golden], [-1.0, golden], [1.0, -golden], [-1.0, -golden]] {
                let mut corner = [0.0; 3];
                (corner[axis], corner[(axis + 1) % 3]) = (one, other);
                corners.push(corner);
            }
        }
        let near = |a: &Vector<3>, b: &Vector<3>| (norm(&add_scaled(a, -1.0, b)) - 2.0).abs() < 1e-9;
        let mut triangles = Vec::new();
        for a in 0..12 {
            for b in a + 1..12 {
                for c in b + 1..12 {
                    let [x, y, z] = [a, b, c].map(|i| corners[i]);
                    if near(&x, &y) && near(&y, &z) && near(&z, &x) {
                        let turn = dot(&x, &cross(&y, &z));
                        triangles.push(if turn > 0.0 { [a, b, c] } else { [a, c, b] });
                    }
                }
            }
        }
        let mut middles = HashMap::new();
        let mut divided = Vec::new();
        for [a, b, c] in triangles {
            let [x, y, z] = [[a, b], [b, c], [c, a]].map(|[from, to]| {
                *middles.entry([from.min(to), from.max(to)]).or_insert_with(|| {
                    corners.push(std::array::from_fn(|i| corners[from][i] + corners[to][i]));
                    corners.len() - 1
                })
            });
            divided.extend([[a, x, z], [b, y, x], [c, z, y], [x, y, z]]);
        }
        for (corner, radius) in corners.iter_mut().zip(radii) {
            *corner = corner.map(|x| x * radius / norm(corner));
        }
        (corners, divided)
    }

    /// The distance from a triangle: that of the plane, if the foot lies in the triangle, or of an edge.
    fn to_triangle(place: &Vector<3>, [a, b, c]: [Vector<3>; 3]) -> f64 {
        let minus = |a: &Vector<3>, b: &Vector<3>| add_scaled(a, -1.0, b);
        let normal = cross(&minus(&b, &a), &minus(&c, &a));
        let inside = [[a, b], [b, c], [c, a]]
            .iter()
            .all(|[from, to]| dot(&cross(&minus(to, from), &minus(place, from)), &normal) >= 0.0);
        if inside {
            return (dot(&minus(place, &a), &normal) / norm(&normal)).abs();
        }
        let to_edge = |[from, to]: [Vector<3>; 2]| {
            let side = minus(&to, &from);
            let share = (dot(&minus(place, &from), &side) / dot(&side, &side)).clamp(0.0, 1.0);
            norm(&minus(place, &add_scaled(&from, share, &side)))
        };
        [[a, b], [b, c], [c, a]].map(to_edge).into_iter().fold(f64::INFINITY, f64::min)
    }

    /// The signed solid angle of a triangle as seen from a place (Van Oosterom and Strackee 1983).
    fn solid_angle(place: &Vector<3>, corners: [Vector<3>; 3]) -> f64 {
        let [a, b, c] = corners.map(|corner| add_scaled(&corner, -1.0, place));
        let lengths = [norm(&a), norm(&b), norm(&c)];
        let above = dot(&a, &cross(&b, &c));
        let below = lengths.iter().product::<f64>()
            + dot(&a, &b) * lengths[2]
            + dot(&b, &c) * lengths[0]
            + dot(&c, &a) * lengths[1];
        2.0 * above.atan2(below)
    }
}
