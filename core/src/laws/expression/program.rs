//! The program of an expression: instructions of a stack machine, and what runs them.

use super::interval::{Interval, Real};
use std::fmt;
use std::sync::Arc;

/// Sizes of stacks that are evaluated without allocation.
const SMALL: usize = 6;
const LARGE: usize = 32;

/// The variables of an expression.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Variable {
    /// Time in seconds.
    T,
    /// First coordinate in metres.
    X,
    /// Second coordinate.
    Y,
    /// Third coordinate.
    Z,
    /// Normal or sliding velocity in m/s.
    V,
    /// Penetration in metres.
    D,
    /// Slip distance in metres.
    L,
    /// Contact pressure, or mean stress, in Pa.
    P,
    /// Von Mises norm of the stress in Pa.
    Q,
    /// Accumulated viscoplastic strain, or equivalent strain.
    E,
    /// Equivalent strain rate in 1/s.
    G,
    /// Temperature in K.
    Temperature,
}

impl Variable {
    /// Those of expressions in time and place.
    pub const OF_TIME_AND_PLACE: &[Self] = &[Self::T, Self::X, Self::Y, Self::Z];
    /// All, in their order.
    pub const ALL: &[Self] = &[
        Self::T,
        Self::X,
        Self::Y,
        Self::Z,
        Self::V,
        Self::D,
        Self::L,
        Self::P,
        Self::Q,
        Self::E,
        Self::G,
        Self::Temperature,
    ];

    /// Its name in expressions.
    pub fn name(self) -> &'static str {
        ["t", "x", "y", "z", "v", "d", "l", "p", "q", "e", "g", "temperature"][self as usize]
    }

    /// What it is, with its unit.
    pub fn meaning(self) -> &'static str {
        [
            "time in s",
            "first coordinate in m",
            "second coordinate in m",
            "third coordinate in m",
            "normal or sliding velocity (speed) in m/s",
            "penetration in m",
            "slip distance in m",
            "contact pressure or mean stress in Pa",
            "von Mises norm of the stress in Pa",
            "equivalent or accumulated strain",
            "equivalent strain rate in 1/s",
            "temperature in K",
        ][self as usize]
    }
}

/// The number of variables.
pub(super) const COUNT: usize = Variable::Temperature as usize + 1;

/// A compiled program; clones share the instructions.
#[derive(Debug, Clone)]
pub(super) struct Program {
    instructions: Arc<[Instruction]>,
    /// Points of the tables that the instructions interpolate.
    pub(super) tables: Arc<[Table]>,
    depth: usize,
    has_pieces: bool,
    /// Whether it contains each variable.
    used: [bool; COUNT],
}

/// What the instructions of a program act on, and how: numbers, numbers with derivatives, enclosures.
pub(super) trait Machine {
    /// An entry of the stack.
    type Entry: Copy;

    fn number(&self, number: f64) -> Self::Entry;

    fn variable(&self, variable: Variable) -> Self::Entry;

    fn unary(&mut self, function: &Unary, argument: Self::Entry) -> Self::Entry;

    fn binary(&mut self, function: &Binary, arguments: [Self::Entry; 2]) -> Self::Entry;

    fn ternary(&mut self, function: &Ternary, arguments: [Self::Entry; 3]) -> Self::Entry;

    fn interpolate(&mut self, table: &Table, argument: Self::Entry) -> Self::Entry;
}

impl Program {
    pub(super) fn new(instructions: Vec<Instruction>, tables: Vec<Table>) -> Self {
        let instructions = with_numbers(instructions);
        let (depth, has_pieces) =
            (stack_depth(&instructions), instructions.iter().any(Instruction::has_pieces));
        let mut used = [false; COUNT];
        for instruction in &instructions {
            if let Instruction::Variable(variable) = instruction {
                used[*variable as usize] = true;
            }
        }
        Self { instructions: instructions.into(), tables: tables.into(), depth, has_pieces, used }
    }

    /// Whether it contains `variable`.
    pub(super) fn uses(&self, variable: Variable) -> bool {
        self.used[variable as usize]
    }

    /// Whether one of its functions is piecewise.
    pub(super) fn has_pieces(&self) -> bool {
        self.has_pieces
    }

    /// The numbers of the variables that it contains.
    pub(super) fn variables(&self) -> impl Iterator<Item = usize> {
        (0..COUNT).filter(|number| self.used[*number])
    }

    /// The result on this machine.
    pub(super) fn run<M: Machine>(&self, machine: &mut M) -> M::Entry {
        let zero = machine.number(0.0);
        // Most formulas need few entries, and clearing more of them takes as long as the formula.
        if self.depth <= SMALL {
            self.run_on(machine, &mut [zero; SMALL])
        } else if self.depth <= LARGE {
            self.run_on(machine, &mut [zero; LARGE])
        } else {
            self.run_on(machine, &mut vec![zero; self.depth])
        }
    }

    #[inline]
    fn run_on<M: Machine>(&self, machine: &mut M, stack: &mut [M::Entry]) -> M::Entry {
        let mut top = 0;
        for instruction in self.instructions.iter() {
            match instruction {
                Instruction::Number(number) => {
                    stack[top] = machine.number(*number);
                    top += 1;
                }
                Instruction::Variable(variable) => {
                    stack[top] = machine.variable(*variable);
                    top += 1;
                }
                Instruction::Unary(function) => stack[top - 1] = machine.unary(function, stack[top - 1]),
                Instruction::Binary(function) => {
                    top -= 1;
                    stack[top - 1] = machine.binary(function, [stack[top - 1], stack[top]]);
                }
                Instruction::BinaryWith(function, number) => {
                    let number = machine.number(*number);
                    stack[top - 1] = machine.binary(function, [stack[top - 1], number]);
                }
                Instruction::Ternary(function) => {
                    top -= 2;
                    stack[top - 1] = machine.ternary(function, [stack[top - 1], stack[top], stack[top + 1]]);
                }
                Instruction::Interpolate(table) => {
                    stack[top - 1] = machine.interpolate(&self.tables[*table], stack[top - 1]);
                }
            }
        }
        stack[0]
    }
}

/// One step of the stack machine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Instruction {
    Number(f64),
    Variable(Variable),
    Unary(Unary),
    Binary(Binary),
    /// Of the topmost value and this number.
    BinaryWith(Binary, f64),
    Ternary(Ternary),
    /// The value of the table of this number, linear between its points.
    Interpolate(usize),
}

impl Instruction {
    /// Whether it is a piecewise function.
    fn has_pieces(&self) -> bool {
        match self {
            Self::Unary(function) => function.piece.is_some(),
            Self::Binary(function) | Self::BinaryWith(function, _) => function.piece.is_some(),
            Self::Ternary(_) | Self::Interpolate(_) => true,
            Self::Number(_) | Self::Variable(_) => false,
        }
    }

    /// How many of the topmost values it replaces by its own.
    pub(super) fn operands(&self) -> usize {
        match self {
            Self::Number(_) | Self::Variable(_) => 0,
            Self::Unary(_) | Self::BinaryWith(..) | Self::Interpolate(_) => 1,
            Self::Binary(_) => 2,
            Self::Ternary(_) => 3,
        }
    }
}

/// Points with ascending first coordinates, at least one.
pub(super) type Table = Box<[[f64; 2]]>;

/// The number of points of a table that are not after `at`.
pub(super) fn points_before(table: &Table, at: f64) -> usize {
    table.partition_point(|point| point[0] <= at)
}

/// The value and the slope of a table behind this many of its points: constant before its first and after its last point.
pub(super) fn interpolate(table: &Table, behind: usize, at: f64) -> [f64; 2] {
    if at.is_nan() {
        return [at; 2];
    }
    match (behind.checked_sub(1).map(|k| table[k]), table.get(behind)) {
        (None, Some(first)) => [first[1], 0.0],
        (Some(last), None) => [last[1], 0.0],
        (Some([t0, v0]), Some([t1, v1])) => [v0 + (v1 - v0) * ((at - t0) / (t1 - t0)), (v1 - v0) / (t1 - t0)],
        (None, None) => [f64::NAN; 2],
    }
}

/// A linear function of time: its value at time 0 and its slope.
pub(super) type Line = [f64; 2];

/// A piecewise function of the three topmost values.
#[derive(Clone, Copy)]
pub(super) struct Ternary {
    /// Which piece is active: 1 or 0, or not a number.
    pub(super) piece: fn([f64; 3]) -> f64,
    /// The same for intervals, if it is one piece.
    pub(super) decide: fn([Interval; 3]) -> Option<f64>,
    /// Whether its value is the piece, and it switches where its first argument equals another one; otherwise it chooses the second
    /// argument or the third.
    pub(super) switches: bool,
}

/// A function of the topmost value.
#[derive(Clone, Copy)]
pub(super) struct Unary {
    pub(super) value: fn(f64) -> f64,
    /// Its derivative.
    pub(super) slope: fn(f64) -> f64,
    /// Values and derivatives at all points of an interval.
    pub(super) enclosures: [fn(Interval) -> Interval; 2],
    /// Its derivative by the logarithm of the argument over its value at all points of an interval, where that is sharper than a quotient
    /// of the other enclosures.
    pub(super) share: Option<fn(Interval) -> Interval>,
    /// Records which piece is active, for piecewise functions: never decreasing.
    pub(super) piece: Option<fn(f64) -> f64>,
    /// Its value for a linear function of time, if that is linear, too.
    pub(super) line: Option<fn(Line) -> Line>,
    /// Whether it switches where its argument is 0.
    pub(super) switches: bool,
    /// Whether it jumps between its pieces.
    pub(super) jumps: bool,
}

fn flat(_: f64) -> f64 {
    0.0
}

fn flat_everywhere(_: Interval) -> Interval {
    Interval::from(0.0)
}

impl Unary {
    pub(super) const fn smooth(
        [value, slope]: [fn(f64) -> f64; 2],
        enclosures: [fn(Interval) -> Interval; 2],
    ) -> Self {
        Self { value, slope, enclosures, share: None, piece: None, line: None, switches: false, jumps: false }
    }

    pub(super) const fn sharing(self, share: fn(Interval) -> Interval) -> Self {
        Self { share: Some(share), ..self }
    }

    pub(super) const fn linear(self, line: fn(Line) -> Line) -> Self {
        Self { line: Some(line), ..self }
    }

    /// The absolute value.
    pub(super) const fn abs() -> Self {
        fn negative(number: f64) -> f64 {
            f64::from(u8::from(number >= 0.0))
        }
        fn slope(number: f64) -> f64 {
            if number < 0.0 { -1.0 } else { 1.0 }
        }
        fn slopes(argument: Interval) -> Interval {
            Interval::new(slope(argument.low), slope(argument.high))
        }
        let smooth = Self::smooth([f64::abs, slope], [<Interval as Real>::abs, slopes]);
        Self { piece: Some(negative), ..smooth }
    }

    /// A nondecreasing function of steps, with its values at all points of an interval.
    pub(super) const fn of_steps(value: fn(f64) -> f64, enclosure: fn(Interval) -> Interval) -> Self {
        Self { piece: Some(value), jumps: true, ..Self::smooth([value, flat], [enclosure, flat_everywhere]) }
    }

    /// A function that has one value in each piece and switches at 0.
    pub(super) const fn switch(self) -> Self {
        Self { switches: true, ..self }
    }
}

/// Values and derivatives by both arguments.
type OfTwo<R> = (fn(R, R) -> R, fn(R, R) -> [R; 2]);

/// A function of the two topmost values.
#[derive(Clone, Copy)]
pub(super) struct Binary {
    pub(super) value: fn(f64, f64) -> f64,
    /// Its derivatives by both arguments.
    pub(super) slopes: fn(f64, f64) -> [f64; 2],
    /// The operator that it is, which is faster than its functions.
    pub(super) operator: Option<Operator>,
    /// Its derivative by the left argument, given its value, where that takes much less than both.
    pub(super) by_left: Option<fn(f64, f64, f64) -> f64>,
    /// Its values and derivatives at all points of intervals.
    pub(super) enclosures: OfTwo<Interval>,
    /// Its derivatives by the logarithms of both arguments over its value at all points of intervals, where they are sharper than
    /// quotients of the other enclosures.
    pub(super) shares: Option<fn(Interval, Interval) -> [Interval; 2]>,
    /// For piecewise functions which piece is active: 1 or 0.
    pub(super) piece: Option<Piece>,
    /// Its value for linear functions of time, where that is linear, too.
    pub(super) line: Option<fn(Line, Line) -> Option<Line>>,
    /// Whether it switches where its arguments are equal.
    pub(super) switches: bool,
}

/// An operator of arithmetic.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Operator {
    Add,
    Subtract,
    Multiply,
    Divide,
}

impl Operator {
    #[inline(always)]
    pub(super) fn value<R: Real>(self, left: R, right: R) -> R {
        match self {
            Self::Add => left + right,
            Self::Subtract => left - right,
            Self::Multiply => left * right,
            Self::Divide => left / right,
        }
    }

    /// Its derivatives by both arguments.
    #[inline(always)]
    pub(super) fn slopes<R: Real>(self, left: R, right: R) -> [R; 2] {
        match self {
            Self::Add => [R::from(1.0); 2],
            Self::Subtract => [R::from(1.0), R::from(-1.0)],
            Self::Multiply => [right, left],
            Self::Divide => [R::from(1.0) / right, -left / right.square()],
        }
    }
}

/// Which piece of a function of two arguments is active: at numbers, and for intervals, if it is one piece.
#[derive(Clone, Copy)]
pub(super) struct Piece {
    pub(super) at: fn(f64, f64) -> f64,
    pub(super) decide: fn(Interval, Interval) -> Option<f64>,
}

impl Binary {
    pub(super) const fn smooth((value, slopes): OfTwo<f64>, enclosures: OfTwo<Interval>) -> Self {
        Self {
            value,
            slopes,
            operator: None,
            by_left: None,
            enclosures,
            shares: None,
            piece: None,
            line: None,
            switches: false,
        }
    }

    pub(super) const fn operator(self, operator: Operator) -> Self {
        Self { operator: Some(operator), ..self }
    }

    /// Its value.
    #[inline(always)]
    pub(super) fn value(&self, left: f64, right: f64) -> f64 {
        self.operator.map_or_else(|| (self.value)(left, right), |operator| operator.value(left, right))
    }

    /// Its derivatives by both arguments, given its value; that by the right one counts only where that is no number.
    #[inline(always)]
    pub(super) fn slopes(&self, [left, right]: [f64; 2], value: f64, has_number: bool) -> [f64; 2] {
        match (self.operator, self.by_left) {
            (Some(operator), _) => operator.slopes(left, right),
            (None, Some(by_left)) if has_number => [by_left(left, right, value), 0.0],
            _ => (self.slopes)(left, right),
        }
    }

    pub(super) const fn sharing(self, shares: fn(Interval, Interval) -> [Interval; 2]) -> Self {
        Self { shares: Some(shares), ..self }
    }

    pub(super) const fn linear(self, line: fn(Line, Line) -> Option<Line>) -> Self {
        Self { line: Some(line), ..self }
    }

    pub(super) const fn piecewise(self, piece: Piece) -> Self {
        Self { piece: Some(piece), ..self }
    }

    /// A comparison.
    pub(super) const fn switch(
        at: fn(f64, f64) -> f64,
        decide: fn(Interval, Interval) -> Option<f64>,
    ) -> Self {
        fn flat(_: f64, _: f64) -> [f64; 2] {
            [0.0; 2]
        }
        fn either(_: Interval, _: Interval) -> Interval {
            Interval::new(0.0, 1.0)
        }
        fn flat_everywhere(_: Interval, _: Interval) -> [Interval; 2] {
            [Interval::from(0.0); 2]
        }
        let steps = Self::smooth((at, flat), (either, flat_everywhere));
        Self { switches: true, ..steps.piecewise(Piece { at, decide }) }
    }
}

impl fmt::Debug for Unary {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("Unary")
    }
}

impl fmt::Debug for Binary {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("Binary")
    }
}

impl fmt::Debug for Ternary {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("Ternary")
    }
}

impl PartialEq for Ternary {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::fn_addr_eq(self.piece, other.piece)
    }
}

impl PartialEq for Unary {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::fn_addr_eq(self.value, other.value)
    }
}

impl PartialEq for Binary {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::fn_addr_eq(self.value, other.value)
    }
}

/// The same instructions, with a number that is the second argument of a function in one with that function.
fn with_numbers(instructions: Vec<Instruction>) -> Vec<Instruction> {
    let mut joined: Vec<Instruction> = Vec::with_capacity(instructions.len());
    for instruction in instructions {
        match (joined.last().copied(), instruction) {
            (Some(Instruction::Number(number)), Instruction::Binary(function)) => {
                joined.pop();
                joined.push(Instruction::BinaryWith(function, number));
            }
            _ => joined.push(instruction),
        }
    }
    joined
}

fn stack_depth(program: &[Instruction]) -> usize {
    let (mut now, mut most) = (0_usize, 0);
    for instruction in program {
        now = now + 1 - instruction.operands();
        most = most.max(now);
    }
    most
}
