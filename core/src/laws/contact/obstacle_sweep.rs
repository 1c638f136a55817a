//! Whether an obstacle passes a point of the boundary within a step.
//!
//! Gaps are known at the ends of a step only. An obstacle that moves by more than its size in a step may be in front of a point at the
//! start and behind it at the end, where no ray along the normal meets it. As seen from the obstacle, the point moves from one place to
//! the other; the way between them is taken as straight. The obstacle has passed if the point leaves it on this way through a surface
//! that faces the same way as the boundary: then the obstacle is on the body's side. Where the point leaves through any other surface,
//! the obstacle was lifted, or has moved sideways.
//!
//! The prescribed motion of an obstacle is known at all times. Where it is not uniform within a step, the depth of the point is taken at
//! [`SAMPLES`] times inside of the step, too. The obstacle has come and gone if the point is outside of it at both ends and inside at one
//! of these times, deeper than in the obstacle at rest, and than the depths at the ends of this step and of its neighbours differ from each
//! other: then the steps do not resolve the motion. An obstacle that jumps as the step begins takes a point with it that it touches at the end: its depth right after the jump, less and less
//! until the end of the step, is none of these depths. A motion that they resolve may touch between their ends, with an error that is that of the scheme.

use super::obstacles::Gap;
use crate::{
    error::Result,
    linear_algebra::tensor::{Vector, add_scaled, larger, norm},
};

/// Cosine between the normals of boundary and obstacle above which the obstacle lies behind the point that leaves it.
const BEHIND: f64 = 0.05;
/// Lengths of this share of the way or of the coordinates are rounding.
const ROUNDING: f64 = 1e-9;
/// Times inside of a step at which the prescribed motion of an obstacle is looked at. Obstacles that come and go in less than a 32nd of a
/// step may be missed.
const SAMPLES: usize = 31;
/// Share of a step within which an obstacle that has moved to a point has jumped there.
const EARLY: f64 = 0.01;
/// The half-width for derivatives of the distance, as a share of the coordinates.
const WIDTH: f64 = 1e-6;

/// The way of a point of the boundary in a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sweep<const D: usize> {
    /// Start and end of the step in s.
    pub times: [f64; 2],
    /// Places at these times in m, without what a force has moved the obstacle.
    pub places: [Vector<D>; 2],
    /// Outward unit normal of the boundary.
    pub normal: Vector<D>,
    /// Size of the body in m, through which an obstacle passes that jumps farther.
    pub body_size: f64,
    /// Whether the gap is finite at the start and infinite at the end.
    pub loses_obstacle: bool,
}

impl Gap {
    /// Whether the obstacle passes a point in a step without a gap at its end that shows this. A gap that is given, without an
    /// obstacle, passes nothing.
    pub fn passes<const D: usize>(&self, sweep: &Sweep<D>) -> Result<bool> {
        let Sweep { times, places, normal, loses_obstacle, .. } = sweep;
        let Some(depth) = self.depth(times[1], &places[1]) else { return Ok(false) };
        if self.comes_and_goes(sweep, depth) {
            return Ok(true);
        }
        let has_other_side = self.has_other_side();
        let centres: [Vector<D>; 2] =
            times.map(|time| if has_other_side { self.centre(time) } else { [0.0; D] });
        let offsets: [Vector<D>; 2] = std::array::from_fn(|i| add_scaled(&places[i], -1.0, &centres[i]));
        let size = offsets.as_flattened().iter().fold(0.0, |most, x| larger(most, x.abs()));
        if depth > ROUNDING * size {
            return Ok(*loses_obstacle);
        }
        let way = add_scaled(&offsets[1], -1.0, &offsets[0]);
        let length = norm(&way);
        // Within its distance from the end, the point does not meet the obstacle. Half-spaces have no other side.
        if !has_other_side || -depth >= length {
            return Ok(false);
        }
        let back = way.map(|x| -x / length);
        // Where the end of the way lies at the surface, a ray from there depends on rounding.
        let ray = if -depth <= ROUNDING * size { 0.0 } else { self.at(times[1], &places[1], &back)? };
        if ray >= (1.0 - ROUNDING) * length {
            return Ok(false);
        }
        // Where the point leaves the obstacle, how fast the distance grows along the normal.
        let leaves = add_scaled(&places[1], ray, &back);
        let width = WIDTH * size;
        let at = |along: f64| self.depth(times[1], &add_scaled(&leaves, along, normal)).unwrap_or_default();
        Ok(at(-width) - at(width) > 2.0 * BEHIND * width)
    }

    /// Whether the prescribed motion takes the obstacle to a point and away again, unseen at the ends of the step, at the second of which
    /// the point has this depth in m, and of its neighbours.
    fn comes_and_goes<const D: usize>(&self, sweep: &Sweep<D>, depth_at_end: f64) -> bool {
        let Sweep { times: [start, end], places: [before, after], .. } = sweep;
        if !self.is_driven() {
            return false;
        }
        let place = |share: f64| std::array::from_fn(|i| before[i] + share * (after[i] - before[i]));
        let depth_at =
            |time: f64, share: f64| self.depth::<D>(time, &place(share)).unwrap_or(f64::NEG_INFINITY);
        let ends = [depth_at(*start, 0.0), depth_at_end];
        // Coordinates of one point may all be zero.
        let centres: [Vector<D>; 2] = [*start, *end].map(|time| self.centre(time));
        let places = [before, after].into_iter().chain(&centres).flatten();
        let rounding = ROUNDING * places.fold(sweep.body_size, |most, x| larger(most, x.abs()));
        if ends.iter().any(|end| *end > rounding) {
            return false;
        }
        // Without a turn, depths change by at most the way of the point as seen from the obstacle: most points stay outside.
        let offset =
            |share: f64| add_scaled(&place(share), -1.0, &self.centre(start + share * (end - start)));
        let at_start = offset(0.0);
        let depth = |share: f64| {
            let way = || norm(&add_scaled(&offset(share), -1.0, &at_start));
            let stays_outside = self.has_other_side() && ends[0] + way() <= 0.0;
            if stays_outside { ends[0] } else { depth_at(start + share * (end - start), share) }
        };
        // An obstacle that jumps as the step begins takes a point with it that it touches at the end.
        let jump = depth(EARLY) / (1.0 - EARLY);
        let takes_along = ends[1] >= -rounding && jump < sweep.body_size;
        let jump = if takes_along { jump.max(0.0) } else { 0.0 };
        let inside = (1..=SAMPLES).map(|at| at as f64 / (SAMPLES + 1) as f64);
        let depths = inside.clone().map(|share| depth(share) - (1.0 - share) * jump);
        let deepest = depths.fold(f64::NEG_INFINITY, f64::max);
        if deepest <= rounding {
            return false;
        }
        // The straight way between two places at a round obstacle lies inside of it even where it rests, wherever it is in the step.
        let at_rest = |time: f64| inside.clone().map(|share| depth_at(time, share)).fold(0.0, f64::max);
        let at_rest = at_rest(*start).min(at_rest(*end));
        // The place of the point in the neighbouring steps is not known; that of the obstacle is. A depth that is no number is ignored.
        let length = end - start;
        let around = [
            self.depth(start - length, before).unwrap_or(f64::NAN),
            self.depth(end + length, after).unwrap_or(f64::NAN),
        ];
        let known = ends.into_iter().chain(around);
        let [least, most] = known.fold([f64::INFINITY, f64::NEG_INFINITY], |[least, most], depth| {
            [least.min(depth), most.max(depth)]
        });
        deepest > rounding + (most - least) + at_rest
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::contact::obstacles::{
        Plane, Shape, Sphere,
        tests::{expression, numbers},
    };

    const DOWN: Vector<2> = [0.0, -1.0];

    /// A disc below y = 0 that moves by the given way in a second, and the same as a shape.
    fn discs(radius: f64, from: [f64; 2], way: [f64; 2]) -> [Gap; 2] {
        let centre = |i: usize| expression(&format!("{} + {}*t", from[i], way[i]));
        let centre = || vec![centre(0), centre(1)];
        let shape = Shape {
            distance: Some(expression(&format!("sqrt(x^2 + y^2) - {radius}"))),
            centre: centre(),
            ..Shape::default()
        };
        let disc = Sphere { centre: centre(), radius, hollow: false, rotation: None, axis: None };
        [Gap::Sphere(disc), Gap::Shape(shape)]
    }

    /// Whether the obstacle passes a point of a lower boundary that moves from one place to the other in a second.
    fn passes(gap: &Gap, places: [[f64; 2]; 2]) -> bool {
        let [before, after] =
            [0, 1].map(|i| gap.of_moved(i as f64, &places[0], &DOWN, places[0][1] - places[i][1]));
        let loses_obstacle = before.unwrap().is_finite() && after.unwrap() == f64::INFINITY;
        gap.passes(&Sweep { times: [0.0, 1.0], places, normal: DOWN, body_size: 1.0, loses_obstacle })
            .unwrap()
    }

    #[test]
    fn a_disc_that_jumps_over_a_point_passes_it() {
        let rest = |x: f64| [[x, 0.0]; 2];
        for disc in discs(0.2, [0.0, -0.3], [0.1, 1.0]) {
            assert!(passes(&disc, rest(0.03)) && passes(&disc, rest(0.15)), "{disc:?}");
            assert!(!passes(&disc, rest(0.4)), "beside it: {disc:?}");
        }
        for disc in discs(0.2, [0.0, -0.3], [0.0, 0.05]) {
            assert!(!passes(&disc, rest(0.0)), "not yet there: {disc:?}");
        }
        for disc in discs(0.2, [0.0, -0.3], [0.0, 0.25]) {
            assert!(!passes(&disc, rest(0.0)), "its gap is negative: {disc:?}");
        }
        for disc in discs(0.2, [0.0, -0.2], [0.0, -5.0]) {
            assert!(!passes(&disc, rest(0.0)), "lifted: {disc:?}");
        }
        for disc in discs(0.2, [-1.0, -0.15], [3.0, 0.0]) {
            assert!(!passes(&disc, rest(0.0)), "it rolls past: {disc:?}");
        }
        for disc in discs(0.2, [0.0, 0.5], [0.0, -2.0]) {
            assert!(!passes(&disc, rest(0.0)), "back to the right side: {disc:?}");
        }
    }

    #[test]
    fn an_obstacle_that_comes_and_goes_within_a_step_passes() {
        let driven = |height: &str| {
            let centre = || vec![expression("0"), expression(height)];
            let shape = Shape {
                distance: Some(expression("sqrt(x^2 + y^2) - 0.2")),
                centre: centre(),
                ..Shape::default()
            };
            let disc = Sphere { centre: centre(), radius: 0.2, hollow: false, rotation: None, axis: None };
            let point = vec![expression("0"), expression(&format!("{height} + 0.2"))];
            let plane = Plane { point, normal: numbers(&[0.0, 1.0]), rotation: None };
            [Gap::Sphere(disc), Gap::Shape(shape), Gap::Plane(plane)]
        };
        let rest = [[0.03, 0.0]; 2];
        for gap in driven("-0.3 + 0.25*sin(pi*t)^2") {
            assert!(passes(&gap, rest), "0.15 m deep at t = 0.5 s, and 0.1 m away at the ends: {gap:?}");
            assert!(!passes(&gap, [[0.03, 0.2]; 2]), "the point is above its highest place: {gap:?}");
        }
        let low = 0.0396f64.sqrt() - 0.2;
        for gap in &driven("-0.2 + 0*t")[..2] {
            assert!(!passes(gap, [[-0.02, low], [0.02, low]]), "a force moves it along the surface: {gap:?}");
        }
        for gap in driven("-0.3 + 0.25*exp(-(20*(t - 0.43))^2)") {
            assert!(passes(&gap, rest), "for a tenth of the step: {gap:?}");
        }
        for gap in driven("-0.3 + 0.05*sin(pi*t)^2") {
            assert!(!passes(&gap, rest), "it does not reach the point: {gap:?}");
        }
        for gap in driven("-0.199 - 0.01*(2*t - 1)^2") {
            assert!(!passes(&gap, rest), "steps that resolve its motion touch between their ends: {gap:?}");
        }
        for gap in driven("-0.2 + 0.01*step(t - 1e-9)") {
            assert!(!passes(&gap, [[0.0, 0.0], [0.0, 0.01]]), "a jump takes the point with it: {gap:?}");
        }
        for gap in driven("-0.2 + 0.01*step(t - 1e-9) + 0.02*sin(pi*t)^2") {
            assert!(passes(&gap, [[0.0, 0.0], [0.0, 0.01]]), "it goes on and comes back: {gap:?}");
        }
        let along = |i: usize| expression(["0.1*cos(37*pi/180)*t", "0.1*sin(37*pi/180)*t"][i]);
        let normal = vec![expression("-sin(37*pi/180)"), expression("cos(37*pi/180)")];
        let belt = Gap::Plane(Plane { point: vec![along(0), along(1)], normal, rotation: None });
        assert!(!passes(&belt, [[0.0, 0.0]; 2]), "it moves along itself");
        for gap in driven("-0.3 + 0.25*sin(pi*t/2)^2") {
            assert!(!passes(&gap, rest), "it is inside at the end, which the gap shows: {gap:?}");
        }
    }

    #[test]
    fn only_the_relative_motion_counts() {
        for disc in discs(0.2, [0.0, -0.3], [0.0, 7.0]) {
            assert!(!passes(&disc, [[0.0, 0.0], [0.0, 7.0]]), "both move: {disc:?}");
            assert!(passes(&disc, [[0.0, 0.0], [0.0, 6.0]]), "too slow: {disc:?}");
        }
        for disc in discs(0.2, [0.0, -0.3], [0.0, 0.0]) {
            assert!(passes(&disc, [[0.0, 0.0], [0.0, -3.0]]), "the body falls through: {disc:?}");
            assert!(!passes(&disc, [[0.0, 0.0], [0.0, -0.1]]), "the body touches: {disc:?}");
            assert!(!passes(&disc, [[0.0, 0.0], [0.0, -0.1 - 1e-15]]), "it touches by rounding: {disc:?}");
        }
    }

    #[test]
    fn a_plane_that_turns_over_a_point_passes_it_and_a_shell_too() {
        let turning = |rate: &str| {
            let normal = vec![expression(&format!("sin({rate}*t)")), expression(&format!("cos({rate}*t)"))];
            Gap::Plane(Plane { point: numbers(&[-1.0, -0.1]), normal, rotation: None })
        };
        assert!(passes(&turning("-2"), [[0.5, 0.0]; 2]), "the point is inside and faces away");
        assert!(!passes(&turning("2"), [[0.5, 0.0]; 2]), "turned away");
        let shell = |speed: &str| {
            let centre = vec![expression("0"), expression(speed)];
            Gap::Sphere(Sphere { centre, radius: 1.0, hollow: true, rotation: None, axis: None })
        };
        assert!(passes(&shell("-5*t"), [[0.0, -0.5]; 2]));
        assert!(!passes(&shell("0.1*t"), [[0.0, -0.5]; 2]));
    }

    #[test]
    fn the_gap_of_a_surface_that_was_pushed_back_shows_the_obstacle_behind_its_undeformed_place() {
        for disc in discs(0.2, [0.0, 0.1], [0.0, 0.3]) {
            let gap = |time: f64, moved: f64| disc.of_moved(time, &[0.0, 0.0], &DOWN, moved).unwrap();
            assert!((gap(0.0, 0.0) + 0.3).abs() < 1e-12, "the place is inside");
            assert_eq!(gap(1.0, 0.0), f64::INFINITY, "no surface is in front of the place");
            assert!((gap(1.0, -0.3) + 0.6).abs() < 1e-12, "the surface is 0.3 m behind: {disc:?}");
            assert!((gap(1.0, -0.7) + 0.6).abs() < 1e-12, "the surface is beyond the disc: {disc:?}");
        }
        let given = Gap::Distance(expression("1/t"));
        assert_eq!(given.of_moved(0.0, &[0.0, 0.0], &DOWN, -1.0).unwrap(), f64::INFINITY);
    }
}
