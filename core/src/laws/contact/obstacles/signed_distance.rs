//! Rays to the surface of an obstacle of which the distance from a place to its surface is known.
//!
//! The distance `f` is positive outside of the obstacle and negative inside, and changes by at most the way between two places. Along
//! the ray from a place outside, the obstacle is therefore at least `f` away: the search goes on by this length until the surface is
//! near, and its last part is halved (Hart, Sphere tracing, The Visual Computer 12, 1996). From a place inside, the search goes back.

use crate::linear_algebra::tensor::{Vector, add_scaled, larger, norm};

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
pub(super) const SLACK: [f64; 2] = [1e-12, 2.5e-7];
/// The half-width for derivatives of the distance near the surface, as a multiple of this distance.
const WIDTH: f64 = 10.0;
/// Cosine between a ray and the normal of the surface below which the ray runs along the surface.
const PARALLEL: f64 = 0.1;
/// The depth, as a share of the coordinates, below which an edge has been pressed into the body, and the obstacle is not beside it.
const DEEPEST: f64 = 0.1;

/// An obstacle given by the distance from its surface. The defaults are those of a formula that rounds no more than coordinates do.
pub(super) trait SignedDistance {
    /// The distance in m at a place relative to the centre.
    fn distance_at<const D: usize>(&self, offset: &Vector<D>) -> f64;

    /// The size in m of the obstacle, by which distances from it are rounded; 0 if it is not known.
    fn extent(&self) -> f64 {
        0.0
    }

    /// By how much two evaluations of the distance at a place may differ from each other through rounding, in m.
    fn rounding<const D: usize>(&self, _offset: &Vector<D>) -> f64 {
        0.0
    }

    /// The distance from the surface in m by which a ray may miss it, for places of this size in m relative to the centre and for any.
    fn slack(&self, [near, size]: [f64; 2]) -> f64 {
        SLACK[0] * larger(near, size)
    }

    /// The length of a ray if it is known without a search.
    fn straight<const D: usize>(&self, _offset: &Vector<D>, _normal: &Vector<D>, _slack: f64) -> Option<f64> {
        None
    }

    /// The length in m of the ray from a place along the unit `normal`, with the centre of the obstacle, as [`Obstacle::ray`]. A ray along
    /// an edge of the obstacle meets it.
    ///
    /// [`Obstacle::ray`]: super::super::obstacle::Obstacle::ray
    fn ray_from<const D: usize>(&self, [place, centre]: [&Vector<D>; 2], normal: &Vector<D>) -> f64 {
        let offset = &add_scaled(place, -1.0, centre);
        let largest = |start: f64, of: &Vector<D>| of.iter().fold(start, |most, x| larger(most, x.abs()));
        let near = largest(self.extent(), offset);
        // Where body and obstacle nearly meet at the centre, rounding is that of the coordinates from which the place is computed.
        let size = largest(largest(near, place), centre);
        let slack = larger(self.slack([near, size]), self.rounding(offset));
        if let Some(length) = self.straight(offset, normal, slack) {
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
pub(super) struct Search {
    /// Length of the ray in m, as that of [`SignedDistance::ray_from`].
    pub length: f64,
    /// The smallest distance in m from the surface at the places of the search before its end.
    pub nearest: f64,
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
