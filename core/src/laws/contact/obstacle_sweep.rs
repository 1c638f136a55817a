//! Whether an obstacle passes a point of the boundary within a step.
//!
//! Gaps are known at the ends of a step only. An obstacle that moves by more than its size in a step may be in front of a point at the
//! start and behind it at the end, where no ray along the normal meets it. As seen from the obstacle, the point moves from one place to
//! the other; the way between them is taken as straight. The obstacle has passed if the point leaves it on this way through a surface
//! that faces the same way as the boundary: then the obstacle is on the body's side. Where the point leaves through any other surface,
//! the obstacle was lifted, or has moved sideways.
//!
//! The prescribed motion of an obstacle is known at all times, as is a gap given by a formula. Where it is not uniform within a step, the
//! depth of the point is taken at [`SAMPLES`] times inside of the step, too, and where the obstacle moves far between them, so that it may
//! be deeper there, at times between those. The obstacle has come and gone if the point is outside of it at both ends and inside at one
//! of these times, unless it came through a surface that faces the same way as the boundary, or the steps resolve the motion: the depths at
//! the ends of the step and of a neighbour show this depth, up to a share of their differences. A motion that they resolve may touch between
//! their ends, with an error that is that of the scheme. A point that touches at an end is not missed there; it must be deeper than in the
//! obstacle at rest, and than these depths differ or bend from one step to the next, as under a roller that starts or stops. An obstacle that jumps as the step begins takes a point with it that it touches at the
//! end: its depth right after the jump, less and less until the end of the step, is none of these depths.

use super::obstacles::Gap;
use crate::{
    error::Result,
    laws::expression::Scalar,
    linear_algebra::tensor::{Vector, add_scaled, larger, norm},
};

/// Cosine between the normals of boundary and obstacle above which the obstacle lies behind the point that leaves it.
const BEHIND: f64 = 0.05;
/// Lengths of this share of the way or of the coordinates are rounding.
const ROUNDING: f64 = 1e-9;
/// Times inside of a step at which a prescribed motion is looked at. Gaps and planes that come and go in less than a 32nd of a step may be
/// missed.
const SAMPLES: usize = 31;
/// How often the time between two of them is halved where an obstacle moves far.
const MOST_HALVINGS: usize = 4;
/// How often the time before that at which a point is inside is halved to find when it enters.
const HALVINGS_TO_ENTRY: usize = 30;
/// The way of the obstacle between two times from which on it is far, as a share of the spacing of the points.
const FAR: f64 = 0.25;
/// The share of the differences of depths at the ends of steps up to which they show the depth between them: four steps in a period do.
const RESOLVED: f64 = 0.1;
/// The depth within a step over the second difference of the depths at the ends of steps up to which they show it: twice that of a parabola.
const BENT: f64 = 0.25;
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
    /// The unit normal along which the boundary sees the obstacle at the end.
    pub normal: Vector<D>,
    /// Its outward unit normal, which differs on edges and where it slides along the obstacle.
    pub outward: Vector<D>,
    /// Size of the body in m, through which an obstacle passes that jumps farther, and the distance to the next points.
    pub sizes: [f64; 2],
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
        let Sweep { times: [start, end], places: [before, after], sizes: [body_size, spacing], .. } = *sweep;
        if !self.is_driven() {
            return false;
        }
        let length = end - start;
        let place = |share: f64| std::array::from_fn(|i| before[i] + share * (after[i] - before[i]));
        let depth_at =
            |time: f64, share: f64| self.depth::<D>(time, &place(share)).unwrap_or(f64::NEG_INFINITY);
        let ends = [depth_at(start, 0.0), depth_at_end];
        // Coordinates of one point may all be zero.
        let centres: [Vector<D>; 2] = [start, end].map(|time| self.centre(time));
        let places = [before, after].into_iter().chain(centres).flatten();
        let rounding = ROUNDING * places.fold(body_size, |most, x| larger(most, x.abs()));
        // Without a turn, depths change by at most the way of the point as seen from the obstacle: most points stay outside.
        let offset = |share: f64| add_scaled(&place(share), -1.0, &self.centre(start + share * length));
        let way = |from: &Vector<D>, to: f64| norm(&add_scaled(&offset(to), -1.0, from));
        let (has_other_side, at_start) = (self.has_other_side(), offset(0.0));
        Course {
            depth: &|share| {
                let most = if has_other_side { ends[0] + way(&at_start, share) } else { f64::INFINITY };
                if most <= 0.0 { most } else { depth_at(start + share * length, share) }
            },
            way: &|[from, to]| if has_other_side { way(&offset(from), to) } else { 0.0 },
            ends,
            around: &|on| [depth_at(start - length, -on), depth_at(end + length, 1.0 + on)],
            left_behind: &|| depth_at(end, 0.0),
            // The straight way between two places at a round obstacle lies inside of it even where it rests, wherever it is in the step.
            at_rest: &|| {
                let at = |time: f64| inner_times().map(|share| depth_at(time, share)).fold(0.0, f64::max);
                at(start).min(at(end))
            },
            is_in_front: &|share| {
                let at = offset(share).iter().fold(0.0, |most, x| larger(most, x.abs()));
                let depth = |along: f64| {
                    let place = add_scaled(&place(share), along, &sweep.outward);
                    self.depth::<D>(start + share * length, &place).unwrap_or_default()
                };
                let width = WIDTH * at;
                depth(width) - depth(-width) > -2.0 * BEHIND * width
            },
            rounding,
            sizes: [body_size, spacing],
        }
        .comes_and_goes()
    }
}

/// A point in a step whose gap is given by a formula.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GivenGap<const D: usize> {
    /// Start and end of the step in s.
    pub times: [f64; 2],
    /// Where the formula is evaluated, in m.
    pub place: Vector<D>,
    /// The value of the formula in m at which the gap of the point is closed, at these times.
    pub closed: [f64; 2],
    /// Size of the body in m.
    pub body_size: f64,
}

impl<const D: usize> GivenGap<D> {
    /// Whether the gap of the point closes and opens again within the step, unseen at the ends of the step and of its neighbours.
    pub fn comes_and_goes(&self, gap: &Scalar) -> bool {
        gap.depends_on_time() && self.comes_and_goes_along(gap, (&|_| 0.0, 0.0))
    }

    /// The same where supports let body and obstacle approach each other, by a way in m at any time, and at most by the second number.
    pub fn comes_and_goes_along(&self, gap: &Scalar, (way, most): (&dyn Fn(f64) -> f64, f64)) -> bool {
        let Self { times: [start, end], place, closed, body_size } = self;
        let [before, after] = [closed[0] - way(*start), closed[1] - way(*end)];
        let least = gap.enclose_during(self.times, place).low;
        if least > larger(before, after) + most {
            return false;
        }
        let length = end - start;
        let depth_at = |time: f64, share: f64| {
            let depth = before + share * (after - before) + way(time) - gap.evaluate(time, place);
            if depth.is_nan() { f64::NEG_INFINITY } else { depth }
        };
        Course {
            depth: &|share| depth_at(start + share * length, share),
            way: &|_| 0.0,
            ends: [depth_at(*start, 0.0), depth_at(*end, 1.0)],
            around: &|on| [depth_at(start - length, -on), depth_at(end + length, 1.0 + on)],
            left_behind: &|| depth_at(*end, 0.0),
            at_rest: &|| 0.0,
            is_in_front: &|_| true,
            rounding: ROUNDING * larger(*body_size, larger(before.abs(), after.abs())),
            sizes: [*body_size, f64::INFINITY],
        }
        .comes_and_goes()
    }
}

/// The shares of a step that have passed at the times inside of it.
fn inner_times() -> impl Iterator<Item = f64> {
    (1..=SAMPLES).map(|at| at as f64 / (SAMPLES + 1) as f64)
}

/// The depth of a point in a step, in m, as a function of the share of the step that has passed.
struct Course<'a> {
    /// Inside of the step; where it is negative an upper bound suffices.
    depth: &'a dyn Fn(f64) -> f64,
    /// By how much it may change in between.
    way: &'a dyn Fn([f64; 2]) -> f64,
    ends: [f64; 2],
    /// At the start of the step before and at the end of the step after, as if both were as long, where the point went on by this share.
    around: &'a dyn Fn(f64) -> [f64; 2],
    /// At the end of the step if the point has stayed where it was.
    left_behind: &'a dyn Fn() -> f64,
    /// Largest depth on the way of the point if the obstacle rests.
    at_rest: &'a dyn Fn() -> f64,
    /// Whether the surface that the point meets there is not one behind it, through which the obstacle leaves the body's side.
    is_in_front: &'a dyn Fn(f64) -> bool,
    /// Depths that are rounding.
    rounding: f64,
    /// As those of a sweep.
    sizes: [f64; 2],
}

impl Course<'_> {
    fn comes_and_goes(&self) -> bool {
        let Self { ends, rounding, .. } = *self;
        if ends.iter().any(|end| *end > rounding) {
            return false;
        }
        let touches = ends.iter().any(|end| *end >= -rounding);
        let [share, deepest] = self.deepest(touches);
        if deepest <= rounding {
            return false;
        }
        // How the point goes on after it has touched is not known.
        let around = (self.around)(if touches { 0.0 } else { 1.0 });
        let beyond = deepest - rounding - (self.at_rest)();
        // A depth that is no number is ignored.
        let spread = |depths: &[f64]| {
            let most = depths.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            most - depths.iter().copied().fold(f64::INFINITY, f64::min)
        };
        if touches {
            // By the motion of the obstacle alone, in the step before, in this one and in the next.
            let [before, now, next] =
                [ends[0] - around[0], (self.left_behind)() - ends[0], around[1] - ends[1]];
            let bend = [now - before, next - now].into_iter().map(f64::abs).filter(|bend| bend.is_finite());
            let shown = BENT * bend.fold(0.0, f64::max);
            return beyond > spread(&[around[0], ends[0], ends[1], around[1]]).max(shown);
        }
        // Where one neighbour has a jump, the other one shows the course.
        let sides = [([around[0], ends[0], ends[1]], share), ([around[1], ends[1], ends[0]], 1.0 - share)];
        let known = sides.iter().filter(|(depths, _)| depths.iter().all(|depth| depth.is_finite()));
        let least = known.clone().map(|(depths, _)| spread(depths)).fold(f64::INFINITY, f64::min);
        let error = |([a, b, c], s): &([f64; 3], f64)| {
            let shown = 0.5 * s * (s - 1.0) * a + (1.0 - s * s) * b + 0.5 * s * (s + 1.0) * c;
            (beyond - shown).max(shown - deepest)
        };
        !known.map(error).any(|error| error <= RESOLVED * least) && (self.is_in_front)(self.entry(share))
    }

    /// A time at which the point enters the obstacle before it is inside at this one.
    fn entry(&self, inside: f64) -> f64 {
        let [mut before, mut after] = [0.0, inside];
        for _ in 0..HALVINGS_TO_ENTRY {
            let middle = 0.5 * (before + after);
            if (self.depth)(middle) > 0.0 {
                after = middle;
            } else {
                before = middle;
            }
        }
        after
    }

    /// The largest depth inside of the step and its time, without that of a jump at its start.
    fn deepest(&self, touches: bool) -> [f64; 2] {
        let Self { ends, rounding, sizes: [body_size, _], .. } = *self;
        let jump = if ends[1] >= -rounding { (self.depth)(EARLY) / (1.0 - EARLY) } else { 0.0 };
        let jump = if jump < body_size { jump.max(0.0) } else { 0.0 };
        let (mut best, mut last) = ([0.0, f64::NEG_INFINITY], [0.0, ends[0]]);
        for share in inner_times() {
            let next = [share, (self.depth)(share) - (1.0 - share) * jump];
            if !touches {
                best = self.deeper([last, next], best, MOST_HALVINGS);
            }
            if next[1] > best[1] {
                best = next;
            }
            last = next;
        }
        if touches { best } else { self.deeper([last, [1.0, ends[1]]], best, MOST_HALVINGS) }
    }

    /// The deepest of this time and those between two times where the obstacle moves far and may be deeper.
    fn deeper(&self, [from, to]: [[f64; 2]; 2], mut best: [f64; 2], halvings: usize) -> [f64; 2] {
        let way = (self.way)([from[0], to[0]]);
        let may_be = 0.5 * (from[1] + to[1] + way) > larger(best[1], self.rounding);
        let is_far = way > FAR * self.sizes[1];
        if halvings == 0 || !may_be || !is_far {
            return best;
        }
        let share = 0.5 * (from[0] + to[0]);
        let middle = [share, (self.depth)(share)];
        if middle[1] > best[1] {
            best = middle;
        }
        let best = self.deeper([from, middle], best, halvings - 1);
        self.deeper([middle, to], best, halvings - 1)
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
        gap.passes(&Sweep {
            times: [0.0, 1.0],
            places,
            normal: DOWN,
            outward: DOWN,
            sizes: [1.0, 0.1],
            loses_obstacle,
        })
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
            assert!(passes(&disc, rest(0.0)), "it runs past, 0.05 m deep: {disc:?}");
            assert!(!passes(&disc, [[0.0, 0.1]; 2]), "it runs past below: {disc:?}");
        }
        for disc in discs(0.2, [-1.0, -0.2], [3.0, 0.0]) {
            assert!(!passes(&disc, rest(0.0)), "it runs past and touches: {disc:?}");
        }
        for disc in discs(0.02, [-1.0, -0.01], [3.0, 0.0]) {
            assert!(passes(&disc, rest(-0.015)), "for a 90th of the step: {disc:?}");
        }
        for disc in discs(0.2, [-0.025, -0.1995], [0.05, 0.0]) {
            assert!(
                !passes(&disc, rest(0.0)),
                "steps that resolve its motion touch between their ends: {disc:?}"
            );
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
    fn a_roller_that_starts_or_stops_presses_the_points_under_it_all_the_time() {
        for way in ["0.002*max(t, 0)", "0.002*min(t, 1)"] {
            let centre = vec![expression(way), expression("-0.5")];
            let roller =
                Gap::Sphere(Sphere { centre, radius: 0.5, hollow: false, rotation: None, axis: None });
            let given = expression(&format!("(0.5*x - {way})^2"));
            for number in -4..=8 {
                let x = 5e-4 * f64::from(number);
                let high = |centre: f64| (0.25 - (x - centre) * (x - centre)).sqrt() - 0.5;
                assert!(!passes(&roller, [0.0, 0.002].map(|centre| [x, high(centre)])), "{way}, {x}");
                let closed = [0.0, 0.002].map(|centre| (x - centre) * (x - centre));
                let point = GivenGap { times: [0.0, 1.0], place: [2.0 * x, 0.0], closed, body_size: 1e-4 };
                assert!(!point.comes_and_goes(&given), "{way}, {x}");
            }
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
    #[test]
    fn a_given_gap_that_closes_and_opens_within_a_step_is_missed() {
        let closes = |gap: &str, closed: [f64; 2]| {
            let point = GivenGap { times: [0.0, 1.0], place: [0.5, 0.0], closed, body_size: 1.0 };
            point.comes_and_goes(&expression(gap))
        };
        assert!(closes("0.01 - 0.03*sin(pi*t)", [0.0; 2]), "20 mm deep, open by 10 mm at the ends");
        assert!(closes("0.01 - 0.03*sin(pi*t) + step(t - 1.5)", [0.0; 2]), "a jump in the step after it");
        assert!(
            closes("0.01 - 0.06*x*exp(-(20*(t - 0.43))^2)", [0.0; 2]),
            "20 mm deep for a tenth of the step"
        );
        assert!(!closes("0.01 - 0.03*sin(pi*t)", [-0.03; 2]), "the point is out of its reach");
        assert!(!closes("0.01 - 0.03*sin(pi*t/2)", [0.0; 2]), "it is closed at the end, which shows this");
        assert!(!closes("0.01 - 0.03*sin(pi*t)", [-0.02, 0.02]), "the point goes inside");
        assert!(
            !closes("-0.001 + 0.01*(2*t - 1)^2", [0.0; 2]),
            "steps that resolve its motion touch between their ends"
        );
        assert!(!closes("0.001 - 0.01*cos(pi*(t - 0.5)/2)", [-0.0085; 2]), "four steps in a period");
        assert!(
            closes("0.001 - 0.01*cos(pi*(t - 0.5)/1.2)", [-0.0085; 2]),
            "less than three steps in a period"
        );
        assert!(
            !closes("0.01 - x", [0.4; 2]) && !closes("1/t", [0.0; 2]) && !closes("sqrt(t - 2)", [0.0; 2])
        );
    }
}
