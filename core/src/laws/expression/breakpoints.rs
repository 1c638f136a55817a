//! Times at which an expression switches, or at which one of its tables has a kink.

use super::program::{Binary, Line, Machine, Program, Table, Ternary, Unary, Variable};

/// A kink of a table is larger than this share of its largest value.
const STRAIGHT: f64 = 1e-12;

/// Times in s, in no order.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Breakpoints {
    /// Where `step`, `pulse` or a comparison switches.
    pub switches: Vec<f64>,
    /// The kinks of tables.
    pub kinks: Vec<f64>,
    /// From where to where tables reach.
    pub spans: Vec<Span>,
}

/// The times between which a table has points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Span {
    /// That of its first point, and that of its last one.
    pub ends: [f64; 2],
    /// Whether it goes to and fro and stops on its way: its last two values differ, and the last one is not zero. A ramp only rises or only
    /// falls.
    pub is_cut_off: bool,
}

impl Breakpoints {
    /// All of them between time 0 and the end of a run, ascending.
    pub fn within(&self, end: f64) -> Vec<f64> {
        let mut times = [&self.kinks[..], &self.switches].concat();
        times.retain(|time| *time > 0.0 && *time < end);
        times.sort_by(f64::total_cmp);
        times
    }
}

impl Program {
    /// The breakpoints that follow from arguments that are linear functions of time.
    pub(super) fn breakpoints(&self) -> Breakpoints {
        let mut lines = Lines::default();
        self.run(&mut lines);
        lines.0
    }
}

/// Linear functions of time, where the entries of the stack are such functions.
#[derive(Default)]
struct Lines(Breakpoints);

impl Machine for Lines {
    type Entry = Option<Line>;

    fn number(&self, number: f64) -> Option<Line> {
        Some([number, 0.0])
    }

    fn variable(&self, variable: Variable) -> Option<Line> {
        (variable == Variable::T).then_some([0.0, 1.0])
    }

    fn unary(&mut self, function: &Unary, argument: Option<Line>) -> Option<Line> {
        if function.switches {
            self.0.switches.extend(crossing(argument, Some([0.0; 2])));
        }
        match (function.line, argument?) {
            (Some(line), argument) => Some(line(argument)),
            (None, [number, 0.0]) => Some([(function.value)(number), 0.0]),
            (None, _) => None,
        }
    }

    fn binary(&mut self, function: &Binary, [left, right]: [Option<Line>; 2]) -> Option<Line> {
        if function.switches {
            self.0.switches.extend(crossing(left, right));
        }
        match (function.line, left?, right?) {
            (Some(line), left, right) => line(left, right),
            (None, [left, 0.0], [right, 0.0]) => Some([(function.value)(left, right), 0.0]),
            (None, ..) => None,
        }
    }

    fn ternary(&mut self, function: &Ternary, [first, second, third]: [Option<Line>; 3]) -> Option<Line> {
        if function.switches {
            self.0.switches.extend([second, third].into_iter().filter_map(|at| crossing(first, at)));
        }
        None
    }

    fn interpolate(&mut self, table: &Table, argument: Option<Line>) -> Option<Line> {
        if let Some([at_start, slope]) = argument.filter(|line| line[1] != 0.0) {
            let time = |at: f64| (at - at_start) / slope;
            self.0.kinks.extend(kinks(table).map(time));
            self.0.spans.extend(span(table, slope).map(|span| Span { ends: span.ends.map(time), ..span }));
        }
        None
    }
}

/// The time at which two linear functions of time are equal.
fn crossing(left: Option<Line>, right: Option<Line>) -> Option<f64> {
    let ([a, p], [b, q]) = left.zip(right)?;
    (p != q).then(|| (b - a) / (p - q)).filter(|time| time.is_finite())
}

/// The span of a table in its own coordinate, which is passed in the direction of this slope.
fn span(table: &Table, slope: f64) -> Option<Span> {
    // A table of one point is a constant.
    let before_last = table.len().checked_sub(2)?;
    let (low, high) = (table[0], table[before_last + 1]);
    let [first, last, beside] =
        if slope > 0.0 { [low, high, table[before_last]] } else { [high, low, table[1]] };
    let is_ramp = table.is_sorted_by(|a, b| a[1] <= b[1]) || table.is_sorted_by(|a, b| a[1] >= b[1]);
    let is_cut_off = !is_ramp && last[1] != 0.0 && last[1] != beside[1];
    Some(Span { ends: [first[0], last[0]], is_cut_off })
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
