//! The potential of a curve over the penetration, by quadrature.

use super::Curve;
use crate::laws::contact::normal_law::{NodeContext, Response};
use crate::laws::contact::penetration_law::StoringGraph;
use crate::laws::expression::REACH;
use crate::laws::quadrature::means;

/// Integrals are exact up to this share of that of the absolute value, about the rounding of values.
const EXACT: f64 = 1e-13;
/// Functions whose coefficients of Legendre polynomials have fallen below this share of them are integrated within `EXACT` by ten points.
const SMOOTH: f64 = 1e-9;
/// Largest rounding errors of a function as a share of it, and the share of the error of a part that both of its halves then have at least.
const NOISE: f64 = 1e-6;
const STEADY: f64 = 1.0 / 16.0;
/// Ways longer than this share of the penetration have a mean that is a difference of potentials without loss of digits.
const LONG: f64 = 0.05;
/// Length of the first part in m, and ratio of the lengths of parts.
const NEAREST: f64 = 1e-12;
const GROWTH: f64 = 4.0;
/// Changes of the pressure in a step below this share are rounding errors in its derivative.
const SMALL: f64 = 1e-6;
/// Halvings of a part, and those at whose ends potentials are kept.
const DEPTH: usize = 10;
const KEPT_DEPTH: usize = 6;

/// A part of an integral: its ends, its integral by ten points, and those of its halves.
struct Part {
    ends: [f64; 2],
    whole: f64,
    halves: [f64; 2],
}

impl Part {
    fn middle(&self) -> f64 {
        0.5 * (self.ends[0] + self.ends[1])
    }

    fn sum(&self) -> f64 {
        self.halves[0] + self.halves[1]
    }

    fn error(&self) -> f64 {
        (self.sum() - self.whole).abs()
    }
}

/// A smooth function that is integrated by halves until they agree within rounding errors.
struct Halved<'a> {
    function: &'a dyn Fn(f64) -> f64,
    /// The size of the sum that errors are compared with.
    size: f64,
}

impl Halved<'_> {
    fn part(&self, ends: [f64; 2], whole: f64) -> Part {
        let middle = 0.5 * (ends[0] + ends[1]);
        let half = |[a, b]: [f64; 2]| means(self.function, [a, b])[0] * (b - a);
        Part { ends, whole, halves: [half([ends[0], middle]), half([middle, ends[1]])] }
    }

    /// The integral over a part that is halved this often at most; visits in their order the places where parts are halved.
    fn integral(&self, part: &Part, depth: usize, visit: &mut dyn FnMut(f64)) -> f64 {
        let (middle, error) = (part.middle(), part.error());
        if depth == 0 || error <= EXACT * self.size || error.is_nan() {
            return part.sum();
        }
        let parts = [
            self.part([part.ends[0], middle], part.halves[0]),
            self.part([middle, part.ends[1]], part.halves[1]),
        ];
        // What is left on both sides alike is rounding errors of the function.
        if error <= NOISE * self.size && parts.iter().all(|half| half.error() > STEADY * error) {
            return parts[0].sum() + parts[1].sum();
        }
        let before = self.integral(&parts[0], depth - 1, visit);
        visit(middle);
        before + self.integral(&parts[1], depth - 1, visit)
    }
}

/// The integral of a smooth function over a range, as a part of a sum of the size `scale`, by this many halvings at most; visits in their
/// order the places where the range is halved.
fn integral(
    function: &dyn Fn(f64) -> f64,
    ends: [f64; 2],
    (scale, depth): (f64, usize),
    visit: &mut dyn FnMut(f64),
) -> f64 {
    let ([mean, size, last], length) = (means(function, ends), ends[1] - ends[0]);
    if last <= SMOOTH * size {
        return mean * length;
    }
    let halved = Halved { function, size: scale.max(size * length.abs()) };
    halved.integral(&halved.part(ends, mean * length), depth, visit)
}

/// A curve over the penetration in m, with its potential.
#[derive(Debug, Clone, PartialEq)]
pub struct StoringCurve {
    curve: Curve,
    /// Penetrations in m with the potential in J/m² there, in order: the corners, zero, and points between them.
    knots: Vec<[f64; 2]>,
}

/// Points between two corners, at distances that grow from the end that is nearer to the obstacle, so that no scale is missed.
fn between(low: f64, high: f64) -> impl Iterator<Item = f64> {
    let [from, to] = if low.abs() < high.abs() { [low, high] } else { [high, low] };
    let nearest = NEAREST.max(f64::EPSILON * from.abs());
    let ends = std::iter::successors(Some(nearest), |reach| Some(GROWTH * reach));
    ends.take_while(move |reach| *reach < high - low).map(move |reach| from + reach.copysign(to - from))
}

impl StoringCurve {
    /// With the potential of this curve; otherwise message and advice.
    pub fn new(curve: Curve) -> Result<Self, [String; 2]> {
        let far = curve.on_branch(0, -REACH)[0];
        if far.abs() > EXACT * curve.reach[1].max(curve.on_branch(0, 0.0)[0].abs()) {
            return Err([
                format!(
                    "the pressure far from the obstacle is {far} Pa, but a boundary without contact has none"
                ),
                "let it vanish where the gap is open, for example by max(d, 0) in place of d".into(),
            ]);
        }
        let mut ends: Vec<f64> =
            curve.corners.iter().map(|corner| corner[0]).chain([-REACH, 0.0, REACH]).collect();
        ends.sort_by(f64::total_cmp);
        let inner = ends.windows(2).flat_map(|pair| between(pair[0], pair[1]));
        let mut at: Vec<f64> = ends.iter().copied().chain(inner).collect();
        at.sort_by(f64::total_cmp);
        at.dedup();
        let (apart, close): (Vec<f64>, Vec<f64>) = at.into_iter().partition(|at| *at < 0.0);
        let storing = Self { curve, knots: Vec::new() };
        let outwards = |at: &mut dyn Iterator<Item = f64>| -> Vec<[f64; 2]> {
            let (mut knots, mut last) = (Vec::new(), [0.0; 2]);
            for to in at {
                for to in storing.ends_between(last, to).into_iter().chain([to]) {
                    last = [to, storing.potential_from(last, to)];
                    if !last[1].is_finite() {
                        return knots;
                    }
                    knots.push(last);
                }
            }
            knots
        };
        let mut knots = outwards(&mut apart.into_iter().rev());
        knots.reverse();
        knots.extend(outwards(&mut close.into_iter()));
        Ok(Self { knots, ..storing })
    }

    /// The pressure in Pa between a knot and a penetration in m without a corner between.
    fn pressure_between(&self, [knot, penetration]: [f64; 2]) -> impl Fn(f64) -> f64 {
        let branch = self.curve.branch(0.5 * (knot + penetration), NodeContext::AT_THE_GAP);
        move |at| self.curve.pressure_on_branch(branch, at)
    }

    /// Where potentials are to be kept between a knot and such a penetration, in order: a curve that waves is integrated over a short way.
    fn ends_between(&self, [knot, potential]: [f64; 2], penetration: f64) -> Vec<f64> {
        let ends = [knot, penetration];
        let mut kept = Vec::new();
        let keep = &mut |at| kept.push(at);
        integral(&self.pressure_between(ends), ends, (potential.abs(), KEPT_DEPTH), keep);
        kept
    }

    /// The potential in J/m² at such a penetration from that at the knot.
    fn potential_from(&self, [knot, potential]: [f64; 2], penetration: f64) -> f64 {
        let ends = [knot, penetration];
        let most = (potential.abs(), DEPTH - KEPT_DEPTH);
        potential + integral(&self.pressure_between(ends), ends, most, &mut |_| ())
    }
}

impl StoringGraph for StoringCurve {
    type Graph = Curve;

    fn graph(&self) -> &Curve {
        &self.curve
    }

    fn is_free_at(&self, penetration: f64) -> bool {
        let branch = self.curve.branch(penetration, NodeContext::AT_THE_GAP);
        self.curve.on_branch(branch, penetration) == [0.0; 2]
    }

    fn potential(&self, penetration: f64) -> f64 {
        if penetration == f64::NEG_INFINITY {
            return self.knots[0][1];
        }
        // From the knot on the side of the obstacle.
        let after = self.knots.partition_point(|knot| knot[0] <= penetration);
        self.potential_from(self.knots[if penetration < 0.0 { after } else { after - 1 }], penetration)
    }

    fn mean(&self, before: f64, after: f64) -> [f64; 2] {
        let advance = after - before;
        if !advance.is_finite() {
            // There was no obstacle along the normal, or there is none.
            return [0.0; 2];
        }
        let (low, high) = (before.min(after), before.max(after));
        let branch = self.curve.branch(low, NodeContext::AT_THE_GAP);
        let end = self.curve.corners.get(branch).map_or(f64::INFINITY, |corner| corner[0]);
        // A curve that waves is integrated once, between its knots; over a short way the difference of potentials is rounding errors.
        let is_long = high - low > LONG * low.abs().max(high.abs());
        let kept = self.knots.partition_point(|knot| knot[0] <= low);
        if end < high || (is_long && self.knots.get(kept + 1).is_some_and(|knot| knot[0] < high)) {
            let mean = (self.potential(high) - self.potential(low)) / (high - low);
            let own = self.curve.pressure(after, NodeContext::AT_THE_GAP);
            return [mean, (own - mean) / advance];
        }
        let at = |share: f64| before + share * advance;
        let pressure = |share: f64| self.curve.pressure_on_branch(branch, at(share));
        let mean = integral(&pressure, [0.0, 1.0], (0.0, DEPTH), &mut |_| ());
        let own = self.curve.pressure_on_branch(branch, after);
        let change = own - mean;
        if change.abs() > SMALL * own.abs().max(mean.abs()) {
            return [mean, change / advance];
        }
        // An integral, too, has no rounding of a difference; the function is nearly constant.
        let [slope, ..] = means(|share| share * self.curve.on_branch(branch, at(share))[1], [0.0, 1.0]);
        [mean, slope]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::expression::{Formula, Variable};

    fn storing(text: &str) -> StoringCurve {
        let formula = Formula::parse(text).expect("a formula");
        StoringCurve::new(Curve::new(formula, Variable::D).expect("a graph")).expect("a potential")
    }

    #[test]
    fn potentials_are_integrals_from_the_obstacle_on_every_scale() {
        type Case = (&'static str, fn(f64) -> f64);
        let cases: [Case; 3] = [
            ("if(d < 0, 0, 1e3*d)", |d| 500.0 * d.max(0.0).powi(2)),
            ("if(d < 2e-6, 0, 5)", |d| 5.0 * (d - 2e-6).max(0.0)),
            ("exp(1e3*min(d, 0.01))", |d| {
                (1e3 * d.min(0.01)).exp_m1() / 1e3 + 10f64.exp() * (d - 0.01).max(0.0)
            }),
        ];
        for (text, potential) in cases {
            let curve = storing(text);
            for d in [-1e20, -0.3, -1e-5, -1e-15, 0.0, 1e-14, 1e-9, 2e-6, 3e-6, 1e-3, 0.01, 7.0, 1e12] {
                let [found, expected] = [curve.potential(d), potential(d)];
                assert!(
                    (found - expected).abs() <= 1e-12 * expected.abs(),
                    "{text} at {d}: {found}, {expected}"
                );
            }
            assert_eq!(curve.potential(f64::NEG_INFINITY), curve.potential(-REACH), "{text}");
        }
    }

    #[test]
    fn potentials_of_a_curve_that_waves_are_integrated_over_short_ways() {
        let curve = storing("if(d < 0, 0, 18*(0.3*sin(2e4*d) + 4e3*d))");
        let expected = |d: f64| 18.0 * (0.3 * (1.0 - (2e4 * d).cos()) / 2e4 + 2e3 * d * d);
        for d in [1e-6, 1e-4, 3e-3, 0.0123] {
            let found = curve.potential(d);
            assert!((found - expected(d)).abs() <= 1e-12 * expected(d), "{d}: {found}, {}", expected(d));
            let knot = curve.knots.partition_point(|knot| knot[0] <= d) - 1;
            assert!(curve.knots[knot + 1][0] - curve.knots[knot][0] < 1e-3, "{d}");
        }
    }

    #[test]
    fn means_are_ratios_of_potentials_and_none_where_an_obstacle_is_met_or_lost_along_the_normal() {
        let curve = storing("if(d < 0, 0, 1e3*d)");
        for [before, after] in [[1e-3, 3e-3], [-1e-3, 1e-3], [4e-3, -2e-3]] {
            let [mean, _] = curve.mean(before, after);
            let expected = (curve.potential(after) - curve.potential(before)) / (after - before);
            assert!((mean - expected).abs() <= 1e-12, "{before}, {after}: {mean}, {expected}");
        }
        let apart = f64::NEG_INFINITY;
        for [before, after] in [[apart, apart], [apart, 0.1], [0.1, apart]] {
            assert_eq!(curve.mean(before, after), [0.0; 2], "{before}, {after}");
        }
    }
}
