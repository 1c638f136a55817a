//! Times at which an expression switches, or at which one of its tables has a kink.

use super::program::{Instruction, Line, Program, Table, Variable};

/// A kink of a table is larger than this share of its largest value.
const STRAIGHT: f64 = 1e-12;

/// Times in s, in no order.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Breakpoints {
    /// Where `step`, `pulse` or a comparison switches.
    pub switches: Vec<f64>,
    /// The kinks of tables.
    pub kinks: Vec<f64>,
}

impl Program {
    /// The breakpoints that follow from arguments that are linear functions of time.
    pub(super) fn breakpoints(&self) -> Breakpoints {
        let mut found = Breakpoints::default();
        // The value of each entry of the stack, if it is a linear function of time.
        let mut stack: Vec<Option<Line>> = Vec::new();
        for instruction in self.instructions.iter() {
            let mut pop = || stack.pop().flatten();
            let line = match instruction {
                Instruction::Number(number) => Some([*number, 0.0]),
                Instruction::Variable(Variable::T) => Some([0.0, 1.0]),
                Instruction::Variable(_) => None,
                Instruction::Unary(function) => {
                    let argument = pop();
                    if function.switches {
                        found.switches.extend(crossing(argument, Some([0.0; 2])));
                    }
                    argument.and_then(|argument| match (function.line, argument) {
                        (Some(line), argument) => Some(line(argument)),
                        (None, [number, 0.0]) => Some([(function.value)(number), 0.0]),
                        (None, _) => None,
                    })
                }
                Instruction::Binary(function) => {
                    let (right, left) = (pop(), pop());
                    if function.switches {
                        found.switches.extend(crossing(left, right));
                    }
                    left.zip(right).and_then(|lines| match (function.line, lines) {
                        (Some(line), (left, right)) => line(left, right),
                        (None, ([left, 0.0], [right, 0.0])) => Some([(function.value)(left, right), 0.0]),
                        (None, _) => None,
                    })
                }
                Instruction::Ternary(function) => {
                    let (third, second, first) = (pop(), pop(), pop());
                    if function.switches {
                        found
                            .switches
                            .extend([second, third].into_iter().filter_map(|at| crossing(first, at)));
                    }
                    None
                }
                Instruction::Interpolate(table) => {
                    if let Some([at_start, slope]) = pop().filter(|line| line[1] != 0.0) {
                        found.kinks.extend(kinks(&self.tables[*table]).map(|at| (at - at_start) / slope));
                    }
                    None
                }
            };
            stack.push(line);
        }
        found
    }
}

/// The time at which two linear functions of time are equal.
fn crossing(left: Option<Line>, right: Option<Line>) -> Option<f64> {
    let ([a, p], [b, q]) = left.zip(right)?;
    (p != q).then(|| (b - a) / (p - q)).filter(|time| time.is_finite())
}

/// The first coordinates of the points of a table at which its slope changes.
fn kinks(table: &Table) -> impl Iterator<Item = f64> {
    let largest = table.iter().map(|point| point[1].abs()).fold(0.0, f64::max);
    let is_kink = move |at: usize| {
        let [time, value] = table[at];
        let before = at.checked_sub(1).map(|before| table[before]);
        let straight = match (before, table.get(at + 1)) {
            (Some([t0, v0]), Some([t1, v1])) => v0 + (v1 - v0) * ((time - t0) / (t1 - t0)),
            (Some([_, beside]), None) | (None, Some(&[_, beside])) => beside,
            (None, None) => value,
        };
        (value - straight).abs() > STRAIGHT * largest
    };
    (0..table.len()).filter(move |at| is_kink(*at)).map(|at| table[at][0])
}
