//! A graph of the pressure over one variable, given by a formula.
//!
//! Between corners the formula is smooth; a corner is a kink or an upward jump, which is filled: the graph is the Clarke subdifferential of
//! the potential `integral of p`, as that of a [`Polyline`](super::polyline::Polyline). Corners are found, and the steepest decrease is
//! bounded, by enclosures of the formula over all numbers: what a certificate takes from them is proven, for a formula that nobody has
//! seen before.

use super::normal_law::{NodeContext, Resolved, Response};
use super::penetration_law::StoringGraph;
use crate::laws::expression::{Enclosure, Formula, Interval, REACH, Unproven, Variable};
use crate::laws::law::increasing_root;

/// A pressure in Pa as a formula of a velocity in m/s or a penetration in m.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    formula: Formula,
    variable: Variable,
    corners: Vec<[f64; 2]>,
    /// For each branch the first and the last number at which the formula has its value; one number for a vertical branch.
    branches: Vec<[f64; 2]>,
    facts: Facts,
}

/// What is proven of a curve.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Facts {
    /// The steepest decrease.
    fall: f64,
    /// The largest pressure in Pa.
    greatest: f64,
    /// Growth constants in Pa and Pa per unit of the variable, if there are any.
    growth: Option<[f64; 2]>,
    /// Largest abscissa and pressure among the corners.
    reach: [f64; 2],
}

/// An unbounded quantity grows at least by this factor from the square root of the reach to the reach.
const UNBOUNDED: f64 = 1.1;

impl Curve {
    /// The graph of `formula` over `variable`, in Pa; otherwise message and advice.
    pub fn new(formula: Formula, variable: Variable) -> Result<Self, [String; 2]> {
        let name = variable.name();
        let borders = formula.borders(&[(variable, Interval::new(-REACH, REACH))], variable);
        let borders = borders.map_err(|unproven| explain(unproven, name))?;
        let (mut corners, mut branches) = (Vec::new(), Vec::new());
        let mut first = -REACH;
        for [before, after] in borders {
            branches.push([first, before]);
            first = after;
            let [low, high] = [before, after].map(|at| point(&formula, variable, at));
            let at = roundest(before, after);
            // How far the smooth parts may rise between the two numbers.
            let rise = |side: &Enclosure| side.slope.low.abs().max(side.slope.high.abs()) * (after - before);
            let slack =
                Some(2.0 * (rise(&low) + rise(&high))).filter(|slack| slack.is_finite()).unwrap_or(0.0);
            let [from, to] = [before, after].map(|at| formula.value(&[(variable, at)]));
            if low.value.low > high.value.high + slack {
                return Err([
                    format!(
                        "at {name} = {at} the pressure falls from {from} to {to}: a downward jump has no relaxed monotonicity constant"
                    ),
                    "no step is short enough to have a unique solution: replace the jump by a steep slope"
                        .into(),
                ]);
            }
            if high.value.low > low.value.high + slack {
                corners.push([at, from]);
                branches.push([at, at]);
            }
            corners.push([at, to]);
        }
        branches.push([first, REACH]);
        let facts = Facts::new(&formula, variable, &branches, &corners)?;
        if corners.is_empty() {
            // The smooth line is measured from rest.
            corners.push([0.0, formula.value(&[(variable, 0.0)])]);
            branches = vec![[-REACH, 0.0], [0.0, REACH]];
        }
        let reach = corners
            .iter()
            .fold([0.0; 2], |[v, p]: [f64; 2], corner| [v.max(corner[0].abs()), p.max(corner[1].abs())]);
        Ok(Self { formula, variable, corners, branches, facts: Facts { reach, ..facts } })
    }

    /// Pressure and slope on a branch.
    fn on_branch(&self, branch: usize, at: f64) -> [f64; 2] {
        let [first, last] = self.branches[branch];
        self.formula.differentiate(&[(self.variable, at.clamp(first, last))], self.variable)
    }

    fn is_vertical(&self, branch: usize) -> bool {
        let inner = branch.checked_sub(1).and_then(|before| self.corners.get(before..=branch));
        inner.is_some_and(|pair| pair[0][0] == pair[1][0])
    }

    /// Whether the pressure is zero at every value of the variable.
    pub(super) fn vanishes(&self) -> bool {
        self.facts.growth == Some([0.0; 2])
    }
}

/// Points of the quadrature of Gauss and Legendre on [-1, 1] and their weights; those at the negative points are the same.
const GAUSS: [[f64; 2]; 5] = [
    [0.148_874_338_981_631_22, 0.295_524_224_714_752_87],
    [0.433_395_394_129_247_2, 0.269_266_719_309_996_35],
    [0.679_409_568_299_024_4, 0.219_086_362_515_982_04],
    [0.865_063_366_688_984_5, 0.149_451_349_150_580_6],
    [0.973_906_528_517_171_7, 0.066_671_344_308_688_14],
];

/// Integrals are exact up to this share of that of the absolute value.
const EXACT: f64 = 1e-14;

/// The integral of a smooth function from `a` to `b`, and that of its absolute value, by ten points.
fn gauss(function: &dyn Fn(f64) -> f64, a: f64, b: f64) -> [f64; 2] {
    let (middle, half) = (0.5 * (a + b), 0.5 * (b - a));
    let sum = GAUSS.iter().fold([0.0; 2], |[sum, size], [at, weight]| {
        let values = [function(middle - half * at), function(middle + half * at)];
        [sum + weight * (values[0] + values[1]), size + weight * (values[0].abs() + values[1].abs())]
    });
    [sum[0] * half, sum[1] * half.abs()]
}

/// The same by halves, until they agree.
fn adaptive(function: &dyn Fn(f64) -> f64, [a, b]: [f64; 2], whole: [f64; 2], depth: usize) -> f64 {
    let middle = 0.5 * (a + b);
    let halves = [gauss(function, a, middle), gauss(function, middle, b)];
    let sum = halves[0][0] + halves[1][0];
    if depth == 0 || (sum - whole[0]).abs() <= EXACT * (halves[0][1] + halves[1][1]) {
        return sum;
    }
    adaptive(function, [a, middle], halves[0], depth - 1)
        + adaptive(function, [middle, b], halves[1], depth - 1)
}

/// The integral from `a` to `b` in parts that grow with the distance from `a`, so that no scale is missed.
fn integral(function: &dyn Fn(f64) -> f64, a: f64, b: f64) -> f64 {
    const NEAREST: f64 = 1e-12;
    let (mut sum, mut from) = (0.0, a);
    let mut reach = NEAREST.max(f64::EPSILON * a.abs());
    while from != b {
        let is_last = reach >= (b - a).abs();
        let to = if is_last { b } else { a + reach.copysign(b - a) };
        sum += adaptive(function, [from, to], gauss(function, from, to), 12);
        from = to;
        reach *= 8.0;
    }
    sum
}

/// A curve over the penetration in m, with its potential.
#[derive(Debug, Clone, PartialEq)]
pub struct StoringCurve {
    curve: Curve,
    /// The potential in J/m² at minus infinity.
    apart: f64,
}

impl StoringCurve {
    /// With the potential of this curve; otherwise message and advice.
    pub(super) fn new(curve: Curve) -> Result<Self, [String; 2]> {
        let far = curve.on_branch(0, -REACH)[0];
        if far.abs() > EXACT * curve.facts.reach[1].max(curve.on_branch(0, 0.0)[0].abs()) {
            return Err([
                format!(
                    "the pressure far from the obstacle is {far} Pa, but a boundary without contact has none"
                ),
                "let it vanish where the gap is open, for example by max(d, 0) in place of d".into(),
            ]);
        }
        let mut storing = Self { curve, apart: 0.0 };
        storing.apart = storing.potential(-REACH);
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
        if penetration == f64::NEG_INFINITY { self.apart } else { self.work(0.0, penetration) }
    }

    fn mean(&self, before: f64, after: f64) -> [f64; 2] {
        let (low, high) = (before.min(after), before.max(after));
        let branch = self.curve.branch(low, NodeContext::AT_THE_GAP);
        let end = self.curve.corners.get(branch).map_or(f64::INFINITY, |corner| corner[0]);
        let advance = after - before;
        if end < high {
            let mean = self.work(low, high) / (high - low);
            let own = self.curve.pressure(after, NodeContext::AT_THE_GAP);
            return [mean, (own - mean) / advance];
        }
        // On one branch the derivative is an integral, too, without the rounding of a difference.
        let at = |share: f64| self.curve.on_branch(branch, before + share * advance);
        let mean =
            |function: &dyn Fn(f64) -> f64| adaptive(function, [0.0, 1.0], gauss(function, 0.0, 1.0), 12);
        [mean(&|share| at(share)[0]), mean(&|share| share * at(share)[1])]
    }
}

impl Facts {
    fn new(
        formula: &Formula,
        variable: Variable,
        branches: &[[f64; 2]],
        corners: &[[f64; 2]],
    ) -> Result<Self, [String; 2]> {
        let name = variable.name();
        let explain = |unproven| explain(unproven, name);
        let parts = |reach: f64| -> Vec<[(Variable, Interval); 1]> {
            let kept = branches.iter().map(|[low, high]| [low.max(-reach), high.min(reach)]);
            kept.filter(|[low, high]| low < high)
                .map(|[low, high]| [(variable, Interval::new(low, high))])
                .collect()
        };
        let supremum = |reach: f64, of: &dyn Fn(&Enclosure) -> Interval| {
            let parts = parts(reach);
            formula.supremum(parts.iter().map(|part| &part[..]), variable, of)
        };
        let [fall, steepest] = supremum(REACH, &|known| -known.slope).map_err(explain)?;
        if fall == f64::INFINITY {
            return Err([
                format!(
                    "the pressure falls without bound near {name} = {steepest}, so that no step is short enough to have a unique solution"
                ),
                format!("bound the decrease, for example by max({name}, -1) in place of {name}"),
            ]);
        }
        let [greatest, _] = supremum(REACH, &|known| known.value).map_err(explain)?;
        let [nearer, _] = supremum(REACH.sqrt(), &|known| known.value).map_err(explain)?;
        let is_bounded = greatest <= nearer.max(0.0) * UNBOUNDED;
        // Beyond the corners the pressure grows by at most its steepest slope there.
        let outer = |reach: f64| {
            let [first, last] = [branches[0], branches[branches.len() - 1]];
            let ends = [first, last].map(|ends| ends.map(|end| end.clamp(-reach, reach)));
            let ends = ends.map(|[low, high]| [(variable, Interval::new(low, high))]);
            formula
                .supremum(ends.iter().map(|part| &part[..]), variable, |known| known.slope.size())
                .map_err(explain)
        };
        let ([steepest, _], [near, _]) = (outer(REACH)?, outer(REACH.sqrt())?);
        let reach = corners.iter().fold(0.0, |reach: f64, corner| reach.max(corner[0].abs()));
        let inner = formula.supremum(
            branches
                .iter()
                .map(|[low, high]| {
                    [(variable, Interval::new(low.clamp(-reach, reach), high.clamp(-reach, reach)))]
                })
                .collect::<Vec<_>>()
                .iter()
                .map(|part| &part[..]),
            variable,
            |known| known.value.size(),
        );
        let [inner, _] = inner.map_err(explain)?;
        let growth = (steepest <= near * 10.0 && steepest.is_finite()).then_some([inner, steepest]);
        Ok(Self {
            fall: fall.max(0.0),
            greatest: if is_bounded { greatest } else { f64::INFINITY },
            growth,
            reach: [0.0; 2],
        })
    }
}

/// What is known at one number.
fn point(formula: &Formula, variable: Variable, at: f64) -> Enclosure {
    formula.enclose(&[(variable, Interval::from(at))], variable)
}

/// The one of the few numbers from `before` to `after` that has the fewest digits.
fn roundest(before: f64, after: f64) -> f64 {
    let numbers =
        std::iter::successors(Some(before), |number| Some(number.next_up()).filter(|next| *next <= after));
    numbers.min_by_key(|number| format!("{number:e}").len()).unwrap_or(after)
}

fn explain(unproven: Unproven, name: &str) -> [String; 2] {
    match unproven {
        Unproven::Undefined(at) => [
            format!("the formula has no value near {name} = {at}"),
            format!("it must have one for every {name}: use max({name}, 0) in place of {name}, or if({name} < 0, ..., ...)"),
        ],
        Unproven::Pieces(at) => [
            format!("the formula has too many pieces, or they cannot be told apart, near {name} = {at}"),
            "it may have at most 1000 kinks and jumps in all: floor, ceil and round have one at every whole number".into(),
        ],
    }
}

impl Response for Curve {
    fn resolve(&self, s: f64, c: f64, _node: NodeContext) -> Resolved {
        let branch = self.corners.partition_point(|[v, p]| c * v + p <= s);
        let before = branch.checked_sub(1).map(|before| self.corners[before]);
        if self.is_vertical(branch) {
            let velocity = self.corners[branch][0];
            return Resolved { velocity, pressure: s - c * velocity, derivative: 0.0, branch };
        }
        let after = self.corners.get(branch).copied();
        // The parameter grows at least by this much with the velocity.
        let growth = c - self.facts.fall;
        let reach = |[v, p]: [f64; 2]| v + (s - c * v - p) / growth;
        let low = before.map_or_else(|| after.map_or(f64::NEG_INFINITY, reach), |corner| corner[0]);
        let high = after.map_or_else(|| before.map_or(f64::INFINITY, reach), |corner| corner[0]);
        let open = |velocity: f64| {
            let [pressure, slope] = self.on_branch(branch, velocity);
            [c * velocity + pressure - s, c + slope]
        };
        let free = s / c;
        let start = if low < free && free < high { free } else { 0.5 * (low + high) };
        let velocity = increasing_root(low, high, start, open);
        let [pressure, slope] = self.on_branch(branch, velocity);
        let derivative = 1.0 / (c + slope);
        Resolved { velocity, pressure, derivative, branch }
    }

    /// At a jump its upper end.
    fn pressure(&self, velocity: f64, node: NodeContext) -> f64 {
        self.on_branch(self.branch(velocity, node), velocity)[0]
    }

    /// At a kink that of the branch after it.
    fn slope(&self, velocity: f64, node: NodeContext) -> f64 {
        self.on_branch(self.branch(velocity, node), velocity)[1]
    }

    /// 0 before the first corner, `n` after the last of `n`.
    fn branch(&self, velocity: f64, _node: NodeContext) -> usize {
        self.corners.partition_point(|corner| corner[0] <= velocity)
    }

    /// The smaller one of the distances at the same velocity and from the point of the graph with the same parameter.
    fn distance(&self, velocity: f64, pressure: f64, node: NodeContext, range: [f64; 2]) -> f64 {
        let [width, height] = std::array::from_fn(|i| self.facts.reach[i].max(range[i]));
        let off = (self.pressure(velocity, node) - pressure).abs();
        let c = (height / width).max(2.0 * self.facts.fall);
        if off == 0.0 || off.is_nan() || !c.is_finite() || c == 0.0 {
            return off / height.max(f64::MIN_POSITIVE);
        }
        let found = self.resolve(c * velocity + pressure, c, node);
        let beside = ((found.velocity - velocity) / width).hypot((found.pressure - pressure) / height);
        beside.min(off / height)
    }

    fn has_vertical_parts(&self) -> bool {
        (0..self.branches.len()).any(|branch| self.is_vertical(branch))
    }

    fn is_zero(&self) -> bool {
        self.vanishes()
    }

    fn monotonicity_constant(&self, _step_length: f64) -> f64 {
        self.facts.fall
    }

    fn growth_constants(&self) -> Result<[f64; 2], &'static str> {
        self.facts
            .growth
            .ok_or("there are no growth constants because the pressure grows faster than the velocity")
    }

    fn greatest_pressure(&self) -> f64 {
        self.facts.greatest
    }

    fn corners(&self) -> &[[f64; 2]] {
        &self.corners
    }
}
