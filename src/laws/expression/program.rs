//! The program of an expression: instructions of a stack machine.

use std::fmt;
use std::sync::Arc;

/// Largest stack that is evaluated without allocation.
const SMALL: usize = 32;

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
}

/// A compiled program; clones share the instructions.
#[derive(Debug, Clone)]
pub(super) struct Program {
    pub(super) instructions: Arc<[Instruction]>,
    /// Points of the tables that the instructions interpolate.
    pub(super) tables: Arc<[Table]>,
    depth: usize,
}

impl Program {
    pub(super) fn new(instructions: Vec<Instruction>, tables: Vec<Table>) -> Self {
        let depth = stack_depth(&instructions);
        Self { instructions: instructions.into(), tables: tables.into(), depth }
    }

    /// Whether it contains `variable`.
    pub(super) fn uses(&self, variable: Variable) -> bool {
        self.instructions.contains(&Instruction::Variable(variable))
    }

    /// Whether one of its functions is piecewise.
    pub(super) fn has_pieces(&self) -> bool {
        self.instructions.iter().any(|instruction| match instruction {
            Instruction::Unary(function) => function.piece.is_some(),
            Instruction::Binary(function) => function.piece.is_some(),
            Instruction::Ternary(_) | Instruction::Interpolate(_) => true,
            Instruction::Number(_) | Instruction::Variable(_) => false,
        })
    }

    /// Value at `time` and `point`.
    pub(super) fn evaluate(&self, time: f64, point: &[f64]) -> f64 {
        self.with_stack(|stack| self.run::<false>(stack, time, point).0)
    }

    /// A digest of the pieces that determine the value at `time` and `point`.
    pub(super) fn pieces(&self, time: f64, point: &[f64]) -> u64 {
        self.with_stack(|stack| self.run::<true>(stack, time, point).1)
    }

    fn with_stack<T>(&self, run: impl FnOnce(&mut [f64]) -> T) -> T {
        if self.depth <= SMALL { run(&mut [0.0; SMALL]) } else { run(&mut vec![0.0; self.depth]) }
    }

    /// The value, and the digest of its pieces if it is requested.
    fn run<const PIECES: bool>(&self, stack: &mut [f64], time: f64, point: &[f64]) -> (f64, u64) {
        let (mut top, mut digest) = (0, 0);
        let mut note = |piece: f64| digest = mix(digest, piece);
        for instruction in self.instructions.iter() {
            match instruction {
                Instruction::Number(number) => {
                    stack[top] = *number;
                    top += 1;
                }
                Instruction::Variable(variable) => {
                    stack[top] = match variable {
                        Variable::T => time,
                        coordinate => point.get(*coordinate as usize - 1).copied().unwrap_or(0.0),
                    };
                    top += 1;
                }
                Instruction::Unary(function) => {
                    let argument = stack[top - 1];
                    if let (true, Some(piece)) = (PIECES, function.piece) {
                        note(piece(argument));
                    }
                    stack[top - 1] = (function.value)(argument);
                }
                Instruction::Binary(function) => {
                    top -= 1;
                    let (left, right) = (stack[top - 1], stack[top]);
                    if let (true, Some(piece)) = (PIECES, function.piece) {
                        note(piece(left, right));
                    }
                    stack[top - 1] = (function.value)(left, right);
                }
                Instruction::Ternary(function) => {
                    top -= 2;
                    let arguments = [stack[top - 1], stack[top], stack[top + 1]];
                    if PIECES {
                        note((function.piece)(arguments));
                    }
                    stack[top - 1] = (function.value)(arguments);
                }
                Instruction::Interpolate(table) => {
                    let (value, piece) = interpolate(&self.tables[*table], stack[top - 1]);
                    if PIECES {
                        note(piece as f64);
                    }
                    stack[top - 1] = value;
                }
            }
        }
        (stack[0], digest)
    }
}

/// One step of the stack machine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Instruction {
    Number(f64),
    Variable(Variable),
    Unary(Unary),
    Binary(Binary),
    Ternary(Ternary),
    /// The value of the table of this number, linear between its points.
    Interpolate(usize),
}

/// Points with ascending first coordinates, at least one.
pub(super) type Table = Box<[[f64; 2]]>;

/// The value of a table, constant before its first and after its last point, and the number of points before it.
fn interpolate(table: &Table, at: f64) -> (f64, usize) {
    if at.is_nan() {
        return (at, 0);
    }
    let behind = table.partition_point(|point| point[0] <= at);
    let value = match (behind.checked_sub(1).map(|k| table[k]), table.get(behind)) {
        (None, Some(first)) => first[1],
        (Some(last), None) => last[1],
        (Some([t0, v0]), Some([t1, v1])) => v0 + (v1 - v0) * ((at - t0) / (t1 - t0)),
        (None, None) => f64::NAN,
    };
    (value, behind)
}

/// A linear function of time: its value at time 0 and its slope.
pub(super) type Line = [f64; 2];

/// A piecewise function of the three topmost values.
#[derive(Clone, Copy)]
pub(super) struct Ternary {
    value: fn([f64; 3]) -> f64,
    /// Records which piece is active.
    piece: fn([f64; 3]) -> f64,
    /// Whether it switches where its first argument equals another one.
    pub(super) switches: bool,
}

impl Ternary {
    pub(super) const fn of_pieces(value: fn([f64; 3]) -> f64, piece: fn([f64; 3]) -> f64) -> Self {
        Self { value, piece, switches: false }
    }

    /// A function that has one value in each piece.
    pub(super) const fn switch(value: fn([f64; 3]) -> f64) -> Self {
        Self { value, piece: value, switches: true }
    }
}

/// A function of the topmost value.
#[derive(Clone, Copy)]
pub(super) struct Unary {
    pub(super) value: fn(f64) -> f64,
    /// Records which piece is active, for piecewise functions.
    piece: Option<fn(f64) -> f64>,
    /// Its value for a linear function of time, if that is linear, too.
    pub(super) line: Option<fn(Line) -> Line>,
    /// Whether it switches where its argument is 0.
    pub(super) switches: bool,
}

impl Unary {
    pub(super) const fn smooth(value: fn(f64) -> f64) -> Self {
        Self { value, piece: None, line: None, switches: false }
    }

    pub(super) const fn linear(value: fn(f64) -> f64, line: fn(Line) -> Line) -> Self {
        Self { line: Some(line), ..Self::smooth(value) }
    }

    pub(super) const fn of_pieces(value: fn(f64) -> f64, piece: fn(f64) -> f64) -> Self {
        Self { piece: Some(piece), ..Self::smooth(value) }
    }

    /// A function that has one value in each piece.
    pub(super) const fn switch(value: fn(f64) -> f64) -> Self {
        Self { switches: true, ..Self::of_pieces(value, value) }
    }
}

/// A function of the two topmost values.
#[derive(Clone, Copy)]
pub(super) struct Binary {
    pub(super) value: fn(f64, f64) -> f64,
    /// Records which piece is active, for piecewise functions.
    piece: Option<fn(f64, f64) -> f64>,
    /// Its value for linear functions of time, where that is linear, too.
    pub(super) line: Option<fn(Line, Line) -> Option<Line>>,
    /// Whether it switches where its arguments are equal.
    pub(super) switches: bool,
}

impl Binary {
    pub(super) const fn smooth(value: fn(f64, f64) -> f64) -> Self {
        Self { value, piece: None, line: None, switches: false }
    }

    pub(super) const fn linear(value: fn(f64, f64) -> f64, line: fn(Line, Line) -> Option<Line>) -> Self {
        Self { line: Some(line), ..Self::smooth(value) }
    }

    pub(super) const fn of_pieces(value: fn(f64, f64) -> f64, piece: fn(f64, f64) -> f64) -> Self {
        Self { piece: Some(piece), ..Self::smooth(value) }
    }

    /// A function that has one value in each piece.
    pub(super) const fn switch(value: fn(f64, f64) -> f64) -> Self {
        Self { switches: true, ..Self::of_pieces(value, value) }
    }
}

/// A digest extended by one number.
fn mix(digest: u64, number: f64) -> u64 {
    (digest ^ number.to_bits()).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29)
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
        std::ptr::fn_addr_eq(self.value, other.value)
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

fn stack_depth(program: &[Instruction]) -> usize {
    let (mut now, mut most) = (0_usize, 0);
    for instruction in program {
        match instruction {
            Instruction::Number(_) | Instruction::Variable(_) => now += 1,
            Instruction::Unary(_) | Instruction::Interpolate(_) => {}
            Instruction::Binary(_) => now -= 1,
            Instruction::Ternary(_) => now -= 2,
        }
        most = most.max(now);
    }
    most
}
