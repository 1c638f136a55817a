//! The potential of a curve over the penetration, by quadrature.

use super::Curve;
use crate::laws::contact::normal_law::{NodeContext, Response};
use crate::laws::contact::penetration_law::StoringGraph;
use crate::laws::expression::REACH;

/// Points of the quadrature of Gauss and Legendre on [-1, 1] and their weights; those at the negative points are the same.
const GAUSS: [[f64; 2]; 5] = [
    [0.148_874_338_981_631_22, 0.295_524_224_714_752_87],
    [0.433_395_394_129_247_2, 0.269_266_719_309_996_35],
    [0.679_409_568_299_024_4, 0.219_086_362_515_982_04],
    [0.865_063_366_688_984_5, 0.149_451_349_150_580_6],
    [0.973_906_528_517_171_7, 0.066_671_344_308_688_14],
];

/// Integrals are exact up to this share of that of the absolute value, about the rounding of values.
const EXACT: f64 = 1e-13;
/// Length of the first part in m, and ratio of the lengths of parts.
const NEAREST: f64 = 1e-12;
const GROWTH: f64 = 4.0;
/// Halvings of a part.
const DEPTH: usize = 10;

/// The integral of a smooth function from `a` to `b`, and that of its absolute value, by ten points.
fn gauss(function: &dyn Fn(f64) -> f64, a: f64, b: f64) -> [f64; 2] {
    let (middle, half) = (0.5 * (a + b), 0.5 * (b - a));
    let sum = GAUSS.iter().fold([0.0; 2], |[sum, size], [at, weight]| {
        let values = [function(middle - half * at), function(middle + half * at)];
        [sum + weight * (values[0] + values[1]), size + weight * (values[0].abs() + values[1].abs())]
    });
    [sum[0] * half, sum[1] * half.abs()]
}

/// The integral over a part with this integral by ten points, by halves until they agree within `slack`.
fn adaptive(
    function: &dyn Fn(f64) -> f64,
    [a, b]: [f64; 2],
    whole: f64,
    (slack, depth): (f64, usize),
) -> f64 {
    let middle = 0.5 * (a + b);
    let halves = [gauss(function, a, middle), gauss(function, middle, b)].map(|[sum, _]| sum);
    let sum = halves[0] + halves[1];
    if depth == 0 || (sum - whole).abs() <= slack {
        return sum;
    }
    let next = (slack, depth - 1);
    adaptive(function, [a, middle], halves[0], next) + adaptive(function, [middle, b], halves[1], next)
}

/// The integral from `a` to `b` in parts that grow with the distance from `a`, so that no scale is missed.
fn integral(function: &dyn Fn(f64) -> f64, a: f64, b: f64) -> f64 {
    let nearest = NEAREST.max(f64::EPSILON * a.abs());
    let ends = std::iter::successors(Some(nearest), |reach| Some(GROWTH * reach));
    let inner = ends.take_while(|reach| *reach < (b - a).abs()).map(|reach| a + reach.copysign(b - a));
    let (mut from, mut parts) = (a, Vec::new());
    for to in inner.chain([b]) {
        parts.push(([from, to], gauss(function, from, to)));
        from = to;
    }
    let slack = EXACT * parts.iter().map(|(_, [_, size])| size).sum::<f64>();
    parts.into_iter().map(|(part, [sum, _])| adaptive(function, part, sum, (slack, DEPTH))).sum()
}

/// A curve over the penetration in m, with its potential.
#[derive(Debug, Clone, PartialEq)]
pub struct StoringCurve {
    curve: Curve,
    /// The potential in J/m² at minus infinity.
    apart: f64,
    /// The potential at each corner.
    potentials: Vec<f64>,
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
        let mut storing = Self { curve, apart: 0.0, potentials: Vec::new() };
        storing.apart = storing.work(0.0, -REACH);
        let mut from = [0.0, 0.0];
        for corner in storing.curve.corners.clone() {
            let potential = from[1] + storing.work(from[0], corner[0]);
            storing.potentials.push(potential);
            from = [corner[0], potential];
        }
        Ok(storing)
    }

    /// The integral of the pressure from `a` to `b` over the branches between.
    fn work(&self, a: f64, b: f64) -> f64 {
        if b < a {
            return -self.work(b, a);
        }
        let corners = self.curve.corners.iter().map(|corner| corner[0]);
        let ends: Vec<f64> = corners.filter(|at| a < *at && *at < b).chain([b]).collect();
        let (mut sum, mut from) = (0.0, a);
        for to in ends {
            let branch = self.curve.branch(0.5 * (from + to), NodeContext::AT_THE_GAP);
            let pressure = |at: f64| self.curve.on_branch(branch, at)[0];
            // From the end that is nearer to the obstacle.
            sum += if from.abs() < to.abs() {
                integral(&pressure, from, to)
            } else {
                -integral(&pressure, to, from)
            };
            from = to;
        }
        sum
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
            return self.apart;
        }
        let before = self.curve.branch(penetration, NodeContext::AT_THE_GAP).saturating_sub(1);
        self.potentials[before] + self.work(self.curve.corners[before][0], penetration)
    }

    fn mean(&self, before: f64, after: f64) -> [f64; 2] {
        let (low, high) = (before.min(after), before.max(after));
        let branch = self.curve.branch(low, NodeContext::AT_THE_GAP);
        let end = self.curve.corners.get(branch).map_or(f64::INFINITY, |corner| corner[0]);
        let advance = after - before;
        if end < high {
            let mean = (self.potential(high) - self.potential(low)) / (high - low);
            let own = self.curve.pressure(after, NodeContext::AT_THE_GAP);
            return [mean, (own - mean) / advance];
        }
        // On one branch the derivative is an integral, too, without the rounding of a difference.
        let at = |share: f64| self.curve.on_branch(branch, before + share * advance);
        let mean = |function: &dyn Fn(f64) -> f64| {
            let [sum, size] = gauss(function, 0.0, 1.0);
            adaptive(function, [0.0, 1.0], sum, (EXACT * size, DEPTH))
        };
        [mean(&|share| at(share)[0]), mean(&|share| share * at(share)[1])]
    }
}
