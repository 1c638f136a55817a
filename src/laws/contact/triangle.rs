//! A triangle of a surface in a tree of bounding boxes: its point nearest to a place, and its crossing with a ray.

use crate::linear_algebra::tensor::{Vector, add_scaled, cross, dot};
use rstar::{AABB, ParentNode, RTree, RTreeNode, RTreeObject, SelectionFunction};
use std::cell::Cell;

/// A triangle, counterclockwise as seen from outside, and its number in its surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Triangle {
    pub corners: [Vector<3>; 3],
    pub number: u32,
}

/// Where on a triangle a point lies; the side with a number leads from the corner with that number to the next one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Part {
    Face,
    Side(usize),
    Corner(usize),
}

impl Triangle {
    /// The sides, as vectors in m.
    pub(super) fn sides(&self) -> [Vector<3>; 3] {
        let [a, b, c] = &self.corners;
        [[b, a], [c, b], [a, c]].map(|[to, from]| add_scaled(to, -1.0, from))
    }

    /// Twice the area in m2 along the outward normal.
    pub(super) fn area(&self) -> Vector<3> {
        let [first, _, last] = self.sides();
        cross(&last, &first)
    }

    /// The point with these shares of the corners.
    pub(super) fn point(&self, shares: &[f64; 3]) -> Vector<3> {
        std::array::from_fn(|i| (0..3).map(|k| shares[k] * self.corners[k][i]).sum())
    }

    /// The vector in m from the nearest point to a place, and where that point lies.
    pub(super) fn nearest(&self, place: &Vector<3>) -> (Vector<3>, Part) {
        let (sides, area) = (self.sides(), self.area());
        let from = self.corners.map(|corner| add_scaled(place, -1.0, &corner));
        let to_side = |k: usize| {
            let share = dot(&from[k], &sides[k]) / dot(&sides[k], &sides[k]);
            if share <= 0.0 {
                (from[k], Part::Corner(k))
            } else if share >= 1.0 {
                (from[(k + 1) % 3], Part::Corner((k + 1) % 3))
            } else {
                (add_scaled(&from[k], -share, &sides[k]), Part::Side(k))
            }
        };
        // The nearest point lies on a side beyond which the place lies; at triangles without area on any.
        let beyond = (0..3).filter(|k| dot(&cross(&sides[*k], &from[*k]), &area) <= 0.0);
        let length = |(vector, _): &(Vector<3>, Part)| dot(vector, vector);
        let nearest = beyond.map(to_side).min_by(|a, b| length(a).total_cmp(&length(b)));
        nearest.unwrap_or_else(|| {
            let height = dot(&from[0], &area) / dot(&area, &area);
            (area.map(|x| height * x), Part::Face)
        })
    }

    /// The distance along a ray, in lengths of its direction, to the plane of this triangle if the ray crosses the triangle, and whether
    /// the ray comes from outside (Moller and Trumbore 1997).
    fn crossing(&self, ray: &Ray) -> Option<(f64, bool)> {
        let [first, _, last] = self.sides();
        let second = last.map(|x| -x);
        let across = cross(&ray.direction, &second);
        let volume = dot(&first, &across);
        let from = add_scaled(&ray.from, -1.0, &self.corners[0]);
        let turned = cross(&from, &first);
        let [u, v, distance] =
            [dot(&from, &across), dot(&ray.direction, &turned), dot(&second, &turned)].map(|x| x / volume);
        // False where the ray is parallel to the triangle.
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance >= 0.0).then_some((distance, volume > 0.0))
    }
}

impl RTreeObject for Triangle {
    type Envelope = AABB<Vector<3>>;

    fn envelope(&self) -> Self::Envelope {
        AABB::from_points(&self.corners)
    }
}

/// Children of a node that are put in order together: nodes of trees that are loaded at once have no more of them in space.
const AT_ONCE: usize = 8;

/// Finds the triangle below a node of a tree that is nearest to a place, with the square of its distance in m2, unless the `best` one is as
/// near. The nearest boxes come first, so that few are opened.
pub(super) fn find_nearest<'a>(
    node: &'a ParentNode<Triangle>,
    place: &Vector<3>,
    best: &mut Option<(f64, &'a Triangle)>,
) {
    for children in node.children().chunks(AT_ONCE) {
        let mut order = [(f64::INFINITY, 0); AT_ONCE];
        for (at, (child, entry)) in children.iter().zip(&mut order).enumerate() {
            *entry = (to_box(&child.envelope(), place), at);
        }
        order.sort_unstable_by(|(a, _), (b, _)| a.total_cmp(b));
        for (distance, at) in order.into_iter().take(children.len()) {
            if best.is_some_and(|(least, _)| distance > least) {
                break;
            }
            match &children[at] {
                RTreeNode::Parent(node) => find_nearest(node, place, best),
                RTreeNode::Leaf(triangle) => {
                    let (vector, _) = triangle.nearest(place);
                    let square = dot(&vector, &vector);
                    if best.is_none_or(|(least, _)| square < least) {
                        *best = Some((square, triangle));
                    }
                }
            }
        }
    }
}

/// The square of the distance of a place from a box.
fn to_box(bounds: &AABB<Vector<3>>, place: &Vector<3>) -> f64 {
    let (low, high) = (bounds.lower(), bounds.upper());
    (0..3).map(|i| (low[i] - place[i]).max(place[i] - high[i]).max(0.0).powi(2)).sum()
}

/// A half line.
#[derive(Debug)]
pub(super) struct Ray {
    pub from: Vector<3>,
    pub direction: Vector<3>,
}

impl Ray {
    /// Whether the first triangle that the ray crosses is crossed from inside; not if it crosses another one from outside at the same place.
    pub(super) fn leaves(&self, triangles: &RTree<Triangle>) -> bool {
        let nearest = Cell::new(f64::INFINITY);
        let mut leaves = false;
        for triangle in triangles.locate_with_selection_function(Along { ray: self, most: &nearest }) {
            let Some((distance, enters)) = triangle.crossing(self) else { continue };
            if distance < nearest.get() {
                leaves = !enters;
                nearest.set(distance);
            } else if distance == nearest.get() {
                leaves &= !enters;
            }
        }
        leaves
    }
}

/// Boxes that a ray meets within a distance that decreases during the search.
struct Along<'a> {
    ray: &'a Ray,
    most: &'a Cell<f64>,
}

impl SelectionFunction<Triangle> for Along<'_> {
    fn should_unpack_parent(&self, envelope: &AABB<Vector<3>>) -> bool {
        let (low, high) = (envelope.lower(), envelope.upper());
        let (mut near, mut far) = (0.0f64, self.most.get());
        for (i, (from, direction)) in self.ray.from.iter().zip(&self.ray.direction).enumerate() {
            if *direction != 0.0 {
                let [one, other] = [low[i], high[i]].map(|x| (x - from) / direction);
                near = near.max(one.min(other));
                far = far.min(one.max(other));
            } else if !(low[i]..=high[i]).contains(from) {
                return false;
            }
        }
        // Rounding must not lose a triangle that lies in a face of its box.
        near <= far * (1.0 + 1e-12) + f64::MIN_POSITIVE
    }
}
