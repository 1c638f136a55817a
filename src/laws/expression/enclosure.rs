//! Enclosures of a program: all values and derivatives that it takes while its variables are in intervals.

use super::evaluate::COUNT;
use super::interval::Interval;
use super::program::{Binary, Machine, Program, Table, Ternary, Unary, Variable, interpolate, points_before};

/// Intervals of the variables, in their order.
pub(super) type Ranges = [Interval; COUNT];

/// What is known of a formula while its variables are in intervals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Enclosure {
    /// Contains all values.
    pub value: Interval,
    /// Contains all derivatives by one variable within the pieces.
    pub slope: Interval,
    /// Whether one piece is active of each of its piecewise functions that depend on this variable.
    pub is_one_piece: bool,
    /// Whether one of its functions that depend on this variable may jump.
    pub(super) may_jump: bool,
}

impl Program {
    /// Its values and derivatives by one variable in these ranges.
    pub(super) fn enclose(&self, ranges: &Ranges, by: Variable) -> Enclosure {
        let mut machine = Enclosures { ranges, by, is_one_piece: true, may_jump: false };
        let [value, slope] = self.run(&mut machine);
        Enclosure { value, slope, is_one_piece: machine.is_one_piece, may_jump: machine.may_jump }
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

impl Machine for Enclosures<'_> {
    type Entry = [Interval; 2];

    fn number(&self, number: f64) -> [Interval; 2] {
        [number, 0.0].map(Interval::from)
    }

    fn variable(&self, variable: Variable) -> [Interval; 2] {
        let slope = f64::from(u8::from(variable == self.by));
        [self.ranges[variable as usize], Interval::from(slope)]
    }

    fn unary(&mut self, function: &Unary, [argument, slope]: [Interval; 2]) -> [Interval; 2] {
        if let Some(piece) = function.piece {
            self.note(&[slope], piece(argument.low) == piece(argument.high), function.jumps);
        }
        let [value, outer] = function.enclosures;
        [value(argument), chain(|| outer(argument), slope)]
    }

    fn binary(&mut self, function: &Binary, [left, right]: [[Interval; 2]; 2]) -> [Interval; 2] {
        let (value, slopes) = function.enclosures;
        let decided = function.piece.map(|piece| (piece.decide)(left[0], right[0]));
        self.note(&[left[1], right[1]], decided != Some(None), function.switches);
        let value = match (function.switches, decided.flatten()) {
            (true, Some(piece)) => Interval::from(piece),
            _ => value(left[0], right[0]),
        };
        if left[1].is(0.0) && right[1].is(0.0) {
            return [value, Interval::from(0.0)];
        }
        let [by_left, by_right] = slopes(left[0], right[0]);
        [value, chain(|| by_left, left[1]) + chain(|| by_right, right[1])]
    }

    fn ternary(&mut self, function: &Ternary, arguments: [[Interval; 2]; 3]) -> [Interval; 2] {
        let decided = (function.decide)(arguments.map(|argument| argument[0]));
        let decisive = if function.switches { 3 } else { 1 };
        let slopes = arguments.map(|argument| argument[1]);
        self.note(&slopes[..decisive], decided.is_some(), true);
        let [_, then, otherwise] = arguments;
        match (function.switches, decided) {
            (true, piece) => {
                let value = piece.map_or(Interval::new(0.0, 1.0), Interval::from);
                [value, Interval::from(0.0)]
            }
            (false, Some(1.0)) => then,
            (false, Some(_)) => otherwise,
            (false, None) => [then[0].hull(otherwise[0]), then[1].hull(otherwise[1])],
        }
    }

    fn interpolate(&mut self, table: &Table, [argument, slope]: [Interval; 2]) -> [Interval; 2] {
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
        [if first == last && outer.is(0.0) { value } else { wide }, chain(|| outer, slope)]
    }
}

/// The derivative of a function whose argument has this derivative: 0 if the argument does not depend on the variable, also where the
/// function has none.
fn chain(outer: impl FnOnce() -> Interval, inner: Interval) -> Interval {
    if inner.is(0.0) { inner } else { outer() * inner }
}
