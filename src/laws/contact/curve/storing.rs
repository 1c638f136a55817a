//! The potential of a curve over the penetration, by quadrature.

use super::Curve;
use crate::laws::contact::normal_law::{NodeContext, Response};
use crate::laws::contact::penetration_law::StoringGraph;
use crate::laws::expression::REACH;
use crate::laws::quadrature::means;

/// Integrals are exact up to this share of that of the absolute value, about the rounding of values.
const EXACT: f64 = 1e-13;
/// Length of the first part in m, and ratio of the lengths of parts.
const NEAREST: f64 = 1e-12;
const GROWTH: f64 = 4.0;
/// Changes of the pressure in a step below this share are rounding errors in its derivative.
const SMALL: f64 = 1e-6;
/// Halvings of a part, and those at whose ends potentials are kept.
const DEPTH: usize = 10;
const KEPT_DEPTH: usize = 6;

/// The integral of a smooth function from `a` to `b`, and that of its absolute value, by ten points.
fn gauss(function: &dyn Fn(f64) -> f64, a: f64, b: f64) -> [f64; 2] {
    let [mean, size] = means(function, [a, b]);
    [mean * (b - a), size * (b - a).abs()]
}

/// A smooth function that is integrated by halves until they agree within `slack`.
struct Halved<'a> {
    function: &'a dyn Fn(f64) -> f64,
    slack: f64,
}

impl<'a> Halved<'a> {
    /// From `a` to `b`, as a part of a sum of the size `scale`; with the integral by ten points.
    fn of(function: &'a dyn Fn(f64) -> f64, [a, b]: [f64; 2], scale: f64) -> (Self, f64) {
        let [sum, size] = gauss(function, a, b);
        (Self { function, slack: EXACT * size.max(scale) }, sum)
    }

    /// The integral over a part with the integral `whole` by ten points, which is halved this often at most; visits in their order the places
    /// where parts are halved.
    fn integral(&self, [a, b]: [f64; 2], whole: f64, depth: usize, visit: &mut dyn FnMut(f64)) -> f64 {
        let middle = 0.5 * (a + b);
        let halves = [gauss(self.function, a, middle), gauss(self.function, middle, b)].map(|[sum, _]| sum);
        let sum = halves[0] + halves[1];
        let error = (sum - whole).abs();
        if depth == 0 || error <= self.slack || error.is_nan() {
            return sum;
        }
        let before = self.integral([a, middle], halves[0], depth - 1, visit);
        visit(middle);
        before + self.integral([middle, b], halves[1], depth - 1, visit)
    }
}

/// The integral of a smooth function from `a` to `b`, as a part of a sum of the size `scale`, by this many halvings at most.
fn integral(function: &dyn Fn(f64) -> f64, ends: [f64; 2], (scale, depth): (f64, usize)) -> f64 {
    let (halved, whole) = Halved::of(function, ends, scale);
    halved.integral(ends, whole, depth, &mut |_| ())
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
        let pressure = self.pressure_between(ends);
        let (halved, whole) = Halved::of(&pressure, ends, potential.abs());
        let mut kept = Vec::new();
        halved.integral(ends, whole, KEPT_DEPTH, &mut |at| kept.push(at));
        kept
    }

    /// The potential in J/m² at such a penetration from that at the knot.
    fn potential_from(&self, [knot, potential]: [f64; 2], penetration: f64) -> f64 {
        let ends = [knot, penetration];
        potential + integral(&self.pressure_between(ends), ends, (potential.abs(), DEPTH - KEPT_DEPTH))
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
        if end < high {
            let mean = (self.potential(high) - self.potential(low)) / (high - low);
            let own = self.curve.pressure(after, NodeContext::AT_THE_GAP);
            return [mean, (own - mean) / advance];
        }
        let at = |share: f64| before + share * advance;
        let mean =
            integral(&|share| self.curve.pressure_on_branch(branch, at(share)), [0.0, 1.0], (0.0, DEPTH));
        let own = self.curve.pressure_on_branch(branch, after);
        let change = own - mean;
        if change.abs() > SMALL * own.abs().max(mean.abs()) {
            return [mean, change / advance];
        }
        // An integral, too, has no rounding of a difference; the function is nearly constant.
        let [slope, _] = gauss(&|share| share * self.curve.on_branch(branch, at(share))[1], 0.0, 1.0);
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
