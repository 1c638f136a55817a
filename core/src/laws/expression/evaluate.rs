//! Evaluation of a program at numbers: its value, the pieces that determine it, and its derivative.

use super::program::{
    Binary, COUNT, Machine, Program, Table, Ternary, Unary, Variable, interpolate, points_before,
};

/// Values of the variables, in their order; 0 for those that have none.
pub(super) type Arguments = [f64; COUNT];

impl Program {
    /// Value at these arguments.
    pub(super) fn evaluate(&self, arguments: &Arguments) -> f64 {
        self.run(&mut Values(arguments))
    }

    /// A digest of the pieces that determine the value at these arguments.
    pub(super) fn pieces(&self, arguments: &Arguments) -> u64 {
        let mut machine = Pieces { values: Values(arguments), digest: 0 };
        self.run(&mut machine);
        machine.digest
    }

    /// Value at these arguments, and derivatives by some of them.
    pub(super) fn differentiate<const N: usize>(
        &self,
        arguments: &Arguments,
        by: [Variable; N],
    ) -> (f64, [f64; N]) {
        self.run(&mut Slopes { arguments, by })
    }
}

/// Numbers.
pub(super) struct Values<'a>(pub(super) &'a Arguments);

impl Machine for Values<'_> {
    type Entry = f64;

    fn number(&self, number: f64) -> f64 {
        number
    }

    fn variable(&self, variable: Variable) -> f64 {
        self.0[variable as usize]
    }

    fn unary(&mut self, function: &Unary, argument: f64) -> f64 {
        (function.value)(argument)
    }

    #[inline(always)]
    fn binary(&mut self, function: &Binary, [left, right]: [f64; 2]) -> f64 {
        function.value(left, right)
    }

    fn ternary(&mut self, function: &Ternary, arguments: [f64; 3]) -> f64 {
        let piece = (function.piece)(arguments);
        match function.switches || piece.is_nan() {
            true => piece,
            false if piece != 0.0 => arguments[1],
            false => arguments[2],
        }
    }

    fn interpolate(&mut self, table: &Table, at: f64) -> f64 {
        interpolate(table, points_before(table, at), at)[0]
    }
}

/// Values, and a digest of their pieces.
struct Pieces<'a> {
    values: Values<'a>,
    digest: u64,
}

impl Pieces<'_> {
    fn note(&mut self, piece: f64) {
        self.digest = (self.digest ^ piece.to_bits()).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29);
    }
}

impl Machine for Pieces<'_> {
    type Entry = f64;

    fn number(&self, number: f64) -> f64 {
        number
    }

    fn variable(&self, variable: Variable) -> f64 {
        self.values.variable(variable)
    }

    fn unary(&mut self, function: &Unary, argument: f64) -> f64 {
        if let Some(piece) = function.piece {
            self.note(piece(argument));
        }
        self.values.unary(function, argument)
    }

    fn binary(&mut self, function: &Binary, [left, right]: [f64; 2]) -> f64 {
        if let Some(piece) = function.piece {
            self.note((piece.at)(left, right));
        }
        self.values.binary(function, [left, right])
    }

    fn ternary(&mut self, function: &Ternary, arguments: [f64; 3]) -> f64 {
        self.note((function.piece)(arguments));
        self.values.ternary(function, arguments)
    }

    fn interpolate(&mut self, table: &Table, at: f64) -> f64 {
        self.note(points_before(table, at) as f64);
        self.values.interpolate(table, at)
    }
}

/// Values and derivatives by some variables.
struct Slopes<'a, const N: usize> {
    arguments: &'a Arguments,
    by: [Variable; N],
}

impl<const N: usize> Machine for Slopes<'_, N> {
    type Entry = (f64, [f64; N]);

    fn number(&self, number: f64) -> Self::Entry {
        (number, [0.0; N])
    }

    fn variable(&self, variable: Variable) -> Self::Entry {
        (self.arguments[variable as usize], self.by.map(|by| f64::from(u8::from(variable == by))))
    }

    fn unary(&mut self, function: &Unary, (argument, slopes): Self::Entry) -> Self::Entry {
        let value = (function.value)(argument);
        if slopes == [0.0; N] {
            return (value, slopes);
        }
        let slope = (function.slope)(argument);
        (value, slopes.map(|inner| chain(slope, inner)))
    }

    #[inline(always)]
    fn binary(&mut self, function: &Binary, [left, right]: [Self::Entry; 2]) -> Self::Entry {
        let value = function.value(left.0, right.0);
        let is_fixed = right.1 == [0.0; N];
        if is_fixed && left.1 == [0.0; N] {
            return (value, [0.0; N]);
        }
        let [by_left, by_right] = function.slopes([left.0, right.0], value, is_fixed);
        (value, std::array::from_fn(|k| chain(by_left, left.1[k]) + chain(by_right, right.1[k])))
    }

    fn ternary(&mut self, function: &Ternary, [first, then, otherwise]: [Self::Entry; 3]) -> Self::Entry {
        let piece = (function.piece)([first.0, then.0, otherwise.0]);
        match function.switches || piece.is_nan() {
            true => (piece, [0.0; N]),
            false if piece != 0.0 => then,
            false => otherwise,
        }
    }

    fn interpolate(&mut self, table: &Table, (at, slopes): Self::Entry) -> Self::Entry {
        let [value, steepness] = interpolate(table, points_before(table, at), at);
        (value, slopes.map(|slope| chain(steepness, slope)))
    }
}

/// The derivative of a function by a variable of which its argument may not depend: 0, also where the function has none.
#[inline(always)]
fn chain(outer: f64, inner: f64) -> f64 {
    if inner == 0.0 { 0.0 } else { outer * inner }
}
