//! A triangle of a surface in a tree of bounding boxes: its point nearest to a place, and its crossing with a line.

use crate::linear_algebra::tensor::{Vector, add_scaled, cross, dot, norm};
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

    /// The smallest and the largest coordinates.
    fn bounds(&self) -> [Vector<3>; 2] {
        let [a, b, c] = &self.corners;
        let low = std::array::from_fn(|i| a[i].min(b[i]).min(c[i]));
        [low, std::array::from_fn(|i| a[i].max(b[i]).max(c[i]))]
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

    /// Where a line crosses the plane of the triangle: how far the triangle reaches beyond that place, if the place lies within or at most
    /// a `slack` in m beside it; `None` if the line runs along the plane.
    fn crossing(&self, line: &Line, slack: f64) -> Option<Crossing> {
        let (sides, area) = (self.sides(), self.area());
        let size = norm(&area);
        let cosine = dot(&area, &line.direction) / size;
        // Not of triangles without area either.
        let is_across = cosine.abs() > ALONG;
        if !is_across {
            return None;
        }
        let place = dot(&add_scaled(&self.corners[0], -1.0, &line.from), &area) / (size * cosine);
        let at = add_scaled(&line.from, place, &line.direction);
        let inward = |k: usize| {
            let from = add_scaled(&at, -1.0, &self.corners[k]);
            dot(&cross(&sides[k], &from), &area) / (size * norm(&sides[k]))
        };
        let within = (0..3).map(inward).fold(f64::INFINITY, f64::min);
        let within = if within < -slack { f64::NEG_INFINITY } else { within };
        Some(Crossing { place, within, enters: cosine < 0.0 })
    }
}

impl RTreeObject for Triangle {
    type Envelope = AABB<Vector<3>>;

    fn envelope(&self) -> Self::Envelope {
        let [low, high] = self.bounds();
        AABB::from_corners(low, high)
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
            let bounds = match child {
                RTreeNode::Parent(node) => [node.envelope().lower(), node.envelope().upper()],
                RTreeNode::Leaf(triangle) => triangle.bounds(),
            };
            *entry = (to_box(&bounds, place), at);
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
fn to_box([low, high]: &[Vector<3>; 2], place: &Vector<3>) -> f64 {
    (0..3).map(|i| (low[i] - place[i]).max(place[i] - high[i]).max(0.0).powi(2)).sum()
}

/// Cosine between a line and the normal of a triangle below which the line runs along the triangle.
const ALONG: f64 = 0.1;
/// The most crossings that are compared.
const MOST_CROSSINGS: usize = 16;

/// Where a line crosses the plane of a triangle.
#[derive(Debug, Clone, Copy)]
struct Crossing {
    /// The place along the line, in lengths of its direction.
    place: f64,
    /// The distance in m from the nearest side of the triangle, negative beside the triangle, and infinite if it is too far beside it.
    within: f64,
    /// Whether the line comes from outside.
    enters: bool,
}

/// How a half line goes on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum First {
    /// It enters the obstacle at this place.
    Enters(f64),
    /// It leaves the obstacle at this place.
    Leaves(f64),
    /// It does not meet the surface.
    Misses,
    /// Rounding decides, or it runs along the surface: at an edge with faces that it enters and leaves, or at a small angle.
    Unclear,
}

/// A line with a direction of length 1.
#[derive(Debug)]
pub(super) struct Line {
    pub from: Vector<3>,
    pub direction: Vector<3>,
}

impl Line {
    /// What the line meets first from a place on it onward, where triangles nearer to it than a `slack` in m count.
    pub(super) fn first(&self, triangles: &RTree<Triangle>, [start, slack]: [f64; 2]) -> First {
        // A place beside the line is this much farther beside it in a face that is nearly parallel to it.
        let beside = slack / ALONG;
        let apart = 2.0 * beside / ALONG;
        let search = Along { line: self, least: start, most: &Cell::new(f64::INFINITY), slack: beside };
        let mut unclear_from = f64::INFINITY;
        let mut found = [Crossing { place: f64::INFINITY, within: 0.0, enters: false }; MOST_CROSSINGS];
        let mut number = 0;
        for triangle in triangles.locate_with_selection_function(&search) {
            let Some(crossing) = triangle.crossing(self, beside) else {
                let [near, far] = search.inside(&triangle.envelope());
                if near <= far {
                    unclear_from = unclear_from.min(near);
                }
                continue;
            };
            if crossing.within == f64::NEG_INFINITY || crossing.place < start {
                continue;
            }
            let nearest = search.most.get().min(crossing.place + apart);
            search.most.set(nearest);
            let mut kept = 0;
            for at in 0..number {
                if found[at].place <= nearest {
                    found[kept] = found[at];
                    kept += 1;
                }
            }
            number = kept;
            if crossing.place <= nearest {
                if number == MOST_CROSSINGS {
                    return First::Unclear;
                }
                found[number] = crossing;
                number += 1;
            }
        }
        let found = &found[..number];
        let Some(first) = found.iter().min_by(|a, b| a.place.total_cmp(&b.place)) else {
            return if unclear_from < f64::INFINITY { First::Unclear } else { First::Misses };
        };
        let is_crossed = found.len() > 1 || first.within >= 0.0;
        if unclear_from <= search.most.get()
            || !is_crossed
            || found.iter().any(|one| one.enters != first.enters)
        {
            return First::Unclear;
        }
        // At an edge, the face within which the line lies farthest.
        let place =
            found.iter().max_by(|a, b| a.within.total_cmp(&b.within)).map_or(f64::NAN, |one| one.place);
        if first.enters { First::Enters(place) } else { First::Leaves(place) }
    }
}

/// Boxes that a line meets, with a slack in m, from a place on it to one that comes nearer during the search.
struct Along<'a> {
    line: &'a Line,
    least: f64,
    most: &'a Cell<f64>,
    slack: f64,
}

impl Along<'_> {
    /// Between which places the line lies in a box; the first is behind the second if it does not meet the box.
    fn inside(&self, envelope: &AABB<Vector<3>>) -> [f64; 2] {
        let (low, high) = (envelope.lower(), envelope.upper());
        let (mut near, mut far) = (self.least, self.most.get());
        for (i, (from, direction)) in self.line.from.iter().zip(&self.line.direction).enumerate() {
            let (low, high) = (low[i] - self.slack, high[i] + self.slack);
            if *direction != 0.0 {
                let [one, other] = [low, high].map(|x| (x - from) / direction);
                near = near.max(one.min(other));
                far = far.min(one.max(other));
            } else if !(low..=high).contains(from) {
                return [f64::INFINITY, f64::NEG_INFINITY];
            }
        }
        [near, far]
    }
}

impl SelectionFunction<Triangle> for &Along<'_> {
    fn should_unpack_parent(&self, envelope: &AABB<Vector<3>>) -> bool {
        let [near, far] = self.inside(envelope);
        near <= far
    }
}
