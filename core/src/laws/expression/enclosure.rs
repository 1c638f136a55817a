//! Enclosures of a program: all values and derivatives that it takes while its variables are in intervals.

use super::interval::Interval;
use super::program::{
    Binary, COUNT, Machine, Program, Table, Ternary, Unary, Variable, interpolate, points_before,
};

/// Intervals of the variables, in their order.
pub(super) type Ranges = [Interval; COUNT];

/// What is known of a formula while its variables are in intervals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Enclosure {
    /// Contains all values.
    pub value: Interval,
    /// Contains all derivatives by one variable within the pieces.
    pub slope: Interval,
    /// Contains all derivatives of the product with this variable within the pieces, except where it is 0. With the derivative by the
    /// logarithm of the variable over the value, this is sharp also where terms nearly cancel, as in `1/(1 + x) - x/(1 + x)^2` for the
    /// product `x/(1 + x)`.
    pub growth: Interval,
    /// Whether one piece is active of each of its piecewise functions that depend on this variable.
    pub is_one_piece: bool,
    /// Whether one of its functions that depend on this variable may jump.
    pub(super) may_jump: bool,
}

impl Program {
    /// Its values and derivatives by one variable in these ranges.
    pub(super) fn enclose(&self, ranges: &Ranges, by: Variable) -> Enclosure {
        let mut machine = Enclosures { ranges, by, is_one_piece: true, may_jump: false };
        let [value, slope, share] = self.run(&mut machine);
        let argument = ranges[by as usize];
        let is_known = share.low.is_finite() && share.high.is_finite();
        let growth = value + argument * slope;
        let (slope, growth) = match is_known {
            true => {
                let by_share = if argument.contains(0.0) { slope } else { value * share / argument };
                (slope.meet(by_share), growth.meet(value * (Interval::from(1.0) + share)))
            }
            false => (slope, growth),
        };
        let Enclosures { is_one_piece, may_jump, .. } = machine;
        Enclosure { value, slope, growth, is_one_piece, may_jump }
    }
}

struct Enclosures<'a> {
    ranges: &'a Ranges,
    by: Variable,
    is_one_piece: bool,
    may_jump: bool,
}

impl Enclosures<'_> {
    /// Notes a piecewise function of arguments with these derivatives, and whether one piece is active.
    fn note(&mut self, slopes: &[Interval], is_one_piece: bool, jumps: bool) {
        if !is_one_piece && slopes.iter().any(|slope| !slope.is(0.0)) {
            self.is_one_piece = false;
            self.may_jump |= jumps;
        }
    }
}

/// Values, derivatives, and derivatives by the logarithm of the variable over the values.
impl Machine for Enclosures<'_> {
    type Entry = [Interval; 3];

    fn number(&self, number: f64) -> [Interval; 3] {
        [number, 0.0, 0.0].map(Interval::from)
    }

    fn variable(&self, variable: Variable) -> [Interval; 3] {
        let slope = Interval::from(f64::from(u8::from(variable == self.by)));
        [self.ranges[variable as usize], slope, slope]
    }

    fn unary(&mut self, function: &Unary, [argument, slope, share]: [Interval; 3]) -> [Interval; 3] {
        if let Some(piece) = function.piece {
            self.note(&[slope], piece(argument.low) == piece(argument.high), function.jumps);
        }
        let [value, outer] = function.enclosures;
        let value = value(argument);
        [
            value,
            chain(|| outer(argument), slope),
            chain(
                || function.share.map_or_else(|| argument * outer(argument) / value, |of| of(argument)),
                share,
            ),
        ]
    }

    fn binary(&mut self, function: &Binary, [left, right]: [[Interval; 3]; 2]) -> [Interval; 3] {
        let (value, slopes) = function.enclosures;
        let decided = function.piece.map(|piece| (piece.decide)(left[0], right[0]));
        self.note(&[left[1], right[1]], decided != Some(None), function.switches);
        let value = match (function.switches, decided.flatten()) {
            (true, Some(piece)) => Interval::from(piece),
            _ => value(left[0], right[0]),
        };
        if left[1].is(0.0) && right[1].is(0.0) {
            return [value, Interval::from(0.0), Interval::from(0.0)];
        }
        let [by_left, by_right] = slopes(left[0], right[0]);
        let shares = match function.shares {
            Some(shares) => shares(left[0], right[0]),
            // The smaller or the larger one of both.
            None if function.piece.is_some() => [by_left, by_right],
            None => [left[0] * by_left / value, right[0] * by_right / value],
        };
        [
            value,
            chain(|| by_left, left[1]) + chain(|| by_right, right[1]),
            chain(|| shares[0], left[2]) + chain(|| shares[1], right[2]),
        ]
    }

    fn ternary(&mut self, function: &Ternary, arguments: [[Interval; 3]; 3]) -> [Interval; 3] {
        let decided = (function.decide)(arguments.map(|argument| argument[0]));
        let decisive = if function.switches { 3 } else { 1 };
        let slopes = arguments.map(|argument| argument[1]);
        self.note(&slopes[..decisive], decided.is_some(), true);
        let [_, then, otherwise] = arguments;
        match (function.switches, decided) {
            (true, piece) => {
                let value = piece.map_or(Interval::new(0.0, 1.0), Interval::from);
                [value, Interval::from(0.0), Interval::from(0.0)]
            }
            (false, Some(1.0)) => then,
            (false, Some(_)) => otherwise,
            (false, None) => std::array::from_fn(|part| then[part].hull(otherwise[part])),
        }
    }

    fn interpolate(&mut self, table: &Table, [argument, slope, share]: [Interval; 3]) -> [Interval; 3] {
        let [first, last] = [argument.low, argument.high].map(|end| points_before(table, end));
        self.note(&[slope], first == last, false);
        let ends = [interpolate(table, first, argument.low), interpolate(table, last, argument.high)];
        let mut value = Interval::from(ends[0][0]).hull(Interval::from(ends[1][0]));
        let mut outer = Interval::from(ends[0][1]);
        for behind in first..=last {
            outer = outer.hull(Interval::from(interpolate(table, behind, argument.low)[1]));
            value =
                table[first..last].iter().fold(value, |value, point| value.hull(Interval::from(point[1])));
        }
        // Interpolated values are rounded a few times.
        let slack = 8.0 * f64::EPSILON * value.low.abs().max(value.high.abs());
        let wide = Interval { low: value.low - slack, high: value.high + slack, ..argument };
        let value = if first == last && outer.is(0.0) { value } else { wide };
        [value, chain(|| outer, slope), chain(|| argument * outer / value, share)]
    }
}

/// The derivative of a function whose argument has this derivative: 0 if the argument does not depend on the variable, also where the
/// function has none.
fn chain(outer: impl FnOnce() -> Interval, inner: Interval) -> Interval {
    if inner.is(0.0) { inner } else { outer() * inner }
}
