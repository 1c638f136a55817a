//! A graph of the pressure over one variable, given by a formula.
//!
//! Between corners the formula is smooth; a corner is a kink or an upward jump, which is filled: the graph is the Clarke subdifferential of
//! the potential `integral of p`, as that of a [`Polyline`](super::polyline::Polyline). Corners are found, and the steepest decrease is
//! bounded, by enclosures of the formula over all numbers: what a certificate takes from them is proven, for a formula that nobody has
//! seen before.

mod facts;
mod storing;

pub(super) use storing::StoringCurve;

use super::normal_law::{NodeContext, Resolved, Response};
use crate::laws::expression::{Enclosure, Formula, Interval, OfMotion, REACH, Unproven, Variable, short};
use crate::laws::law::increasing_root;
use facts::{Facts, Search};

/// A pressure in Pa as a formula of a velocity in m/s or a penetration in m.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    formula: Formula<OfMotion>,
    variable: Variable,
    corners: Vec<[f64; 2]>,
    /// For each branch the first and the last number at which the formula has its value; one number for a vertical branch.
    branches: Vec<[f64; 2]>,
    /// Largest abscissa and pressure among the corners.
    reach: [f64; 2],
    facts: Facts,
}

impl Curve {
    /// The graph of `formula` over `variable`, in Pa; otherwise message and advice.
    pub fn new(formula: Formula<OfMotion>, variable: Variable) -> Result<Self, [String; 2]> {
        let name = variable.name();
        let borders = formula.borders(&[(variable, Interval::new(-REACH, REACH))], variable);
        let borders = borders.map_err(|unproven| explain(&formula, unproven))?;
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
                    format!("at {name} = {} the pressure falls from {} to {}: a downward jump has no relaxed monotonicity constant", short(at), short(from), short(to)),
                    "no step is short enough to have a unique solution: replace the jump by a slope, and check the theta of a step".into(),
                ]);
            }
            if high.value.low > low.value.high + slack {
                corners.push([at, from]);
                branches.push([at, at]);
            }
            corners.push([at, to]);
        }
        branches.push([first, REACH]);
        let search = Search { formula: &formula, variable };
        let facts = search.facts(&branches, &corners).map_err(|unproven| explain(&formula, unproven))?;
        if let Some(place) = facts.falls_without_bound {
            return Err([
                format!(
                    "the pressure falls without bound near {}, so that no step is short enough to have a unique solution",
                    formula.at(&place)
                ),
                format!("bound the decrease, for example by max(min({name}, 1), -1) in place of {name}"),
            ]);
        }
        if corners.is_empty() {
            // The smooth line is measured from rest.
            corners.push([0.0, formula.value(&[(variable, 0.0)])]);
            branches = vec![[-REACH, 0.0], [0.0, REACH]];
        }
        let larger = |[v, p]: [f64; 2], corner: &[f64; 2]| [v.max(corner[0].abs()), p.max(corner[1].abs())];
        let reach = corners.iter().fold([0.0; 2], larger);
        Ok(Self { formula, variable, corners, branches, reach, facts })
    }

    /// Pressure and slope on a branch.
    fn on_branch(&self, branch: usize, at: f64) -> [f64; 2] {
        let [first, last] = self.branches[branch];
        self.formula.differentiate(&[(self.variable, at.clamp(first, last))], self.variable)
    }

    /// The pressure on a branch.
    fn pressure_on_branch(&self, branch: usize, at: f64) -> f64 {
        let [first, last] = self.branches[branch];
        self.formula.value(&[(self.variable, at.clamp(first, last))])
    }

    fn is_vertical(&self, branch: usize) -> bool {
        let inner = branch.checked_sub(1).and_then(|before| self.corners.get(before..=branch));
        inner.is_some_and(|pair| pair[0][0] == pair[1][0])
    }
}

/// What is known at one number.
fn point(formula: &Formula<OfMotion>, variable: Variable, at: f64) -> Enclosure {
    formula.enclose(&[(variable, Interval::from(at))], variable)
}

/// The one of the few numbers from `before` to `after` that has the fewest digits.
fn roundest(before: f64, after: f64) -> f64 {
    let numbers =
        std::iter::successors(Some(before), |number| Some(number.next_up()).filter(|next| *next <= after));
    // Without the sign of a negative zero.
    numbers.min_by_key(|number| format!("{number:e}").len()).unwrap_or(after) + 0.0
}

fn explain(formula: &Formula<OfMotion>, unproven: Unproven) -> [String; 2] {
    match unproven {
        Unproven::Undefined(place) => [
            format!("the formula has no value near {}", formula.at(&place)),
            "it must have one from -1e30 to 1e30: bound the arguments of roots, logarithms and powers, as in sqrt(max(v, 0)), and \
             keep denominators away from 0, as in 1/(abs(v) + 1e-6)"
                .into(),
        ],
        Unproven::Pieces(place) => [
            format!("the formula has too many pieces, or they cannot be told apart, near {}", formula.at(&place)),
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
        let [width, height] = std::array::from_fn(|i| self.reach[i].max(range[i]));
        let off = (self.pressure(velocity, node) - pressure).abs();
        let c = (height / width).max(2.0 * self.facts.fall);
        if off == 0.0 || off.is_nan() || !c.is_finite() || c == 0.0 {
            return off / height.max(f64::MIN_POSITIVE);
        }
        let found = self.resolve(c * velocity + pressure, c, node);
        let beside = ((found.velocity - velocity) / width).hypot((found.pressure - pressure) / height);
        beside.min(off / height)
    }

    /// Infinite slopes, as that of a root, count as vertical.
    fn has_vertical_parts(&self) -> bool {
        self.facts.is_steep || (0..self.branches.len()).any(|branch| self.is_vertical(branch))
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
