//! Compiles an expression to the program of the stack machine, by recursive descent.
//!
//! `value = sum [(<|<=|>|>=) sum]`, which is 1 or 0, `sum = product {(+|-) product}`, `product = signed {(*|/) signed}`,
//! `signed = (+|-) signed | power`, `power = atom [^ signed]`, `atom = number | name | name(value, ...) | (value)`: so -x^2 is
//! -(x^2), and 2^3^2 is 2^(3^2).

use std::ops::Range;

use super::evaluate::Values;
use super::functions::{Meaning, Names, comparison, meaning, names, smooth_of_two};
use super::interval::{Interval, Real};
use super::program::{Binary, COUNT, Instruction, Machine, Operator, Program, Table, Unary, Variable};
use crate::laws::nearest::nearest;
use crate::linear_algebra::tensor::larger;

/// Longest permitted expression in bytes, without and with tables.
const LONGEST: [usize; 2] = [10_000, 1 << 20];
/// Deepest permitted nesting of parentheses, signs and powers.
const DEEPEST: usize = 200;

fn one() -> Interval {
    Interval::from(1.0)
}
macro_rules! operator {
    ($operator:expr) => {
        smooth_of_two!($operator.value(left, right), (left, right) => $operator.slopes(left, right))
            .operator($operator)
    };
}
const ADD: Binary = operator!(Operator::Add)
    .linear(|[a, p], [b, q]| Some([a + b, p + q]))
    .sharing(|left, right| [one() / (one() + right / left), one() / (one() + left / right)]);
const SUBTRACT: Binary = operator!(Operator::Subtract)
    .linear(|[a, p], [b, q]| Some([a - b, p - q]))
    .sharing(|left, right| [one() / (one() - right / left), one() / (one() - left / right)]);
const MULTIPLY: Binary = operator!(Operator::Multiply)
    .linear(|[a, p], [b, q]| (p == 0.0 || q == 0.0).then_some([a * b, a * q + b * p]))
    .sharing(|_, _| [one(); 2]);
const DIVIDE: Binary = operator!(Operator::Divide)
    .linear(|[a, p], [b, q]| (q == 0.0).then_some([a / b, p / b]))
    .sharing(|_, _| [one(), -one()]);
const POWER: Binary = {
    fn slopes<R: Real>(base: R, exponent: R) -> [R; 2] {
        [exponent * base.power(exponent - R::from(1.0)), base.power(exponent) * base.ln()]
    }
    fn slopes_of_numbers(base: f64, exponent: f64) -> [f64; 2] {
        let [by_base, by_exponent] = slopes(base, exponent);
        [if exponent == 0.0 { 0.0 } else { by_base }, by_exponent]
    }
    fn by_base(base: f64, exponent: f64, power: f64) -> f64 {
        // Neither underflow nor overflow.
        let is_ordinary = power.is_normal() && base.is_normal();
        if is_ordinary { exponent * (power / base) } else { slopes_of_numbers(base, exponent)[0] }
    }
    let smooth = Binary::smooth((f64::powf, slopes_of_numbers), (Interval::power, slopes));
    let alone = Binary { by_left: Some(by_base), ..smooth };
    alone.sharing(|base, exponent| [exponent, exponent * Real::ln(base)])
};
const BELOW: Binary = comparison!(<);
const AT_MOST: Binary = comparison!(<=);
const ABOVE: Binary = comparison!(>);
const AT_LEAST: Binary = comparison!(>=);
const NEGATE: Unary = {
    fn value<R: Real>(argument: R) -> R {
        -argument
    }
    fn slope<R: Real>(_: R) -> R {
        R::from(-1.0)
    }
    Unary::smooth([value, slope], [value, slope]).linear(|[a, p]| [-a, -p])
};

/// An error in an expression, and its position in the text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    /// Range of bytes of the text.
    pub at: Range<usize>,
    /// The error.
    pub message: String,
    /// The remedy.
    pub help: String,
    /// Whether a name is unknown.
    pub is_unknown_name: bool,
}

impl Fault {
    pub(super) fn new(at: Range<usize>, message: impl Into<String>, help: impl Into<String>) -> Self {
        Self { at, message: message.into(), help: help.into(), is_unknown_name: false }
    }
}

/// A compiled text.
pub(super) struct Compiled {
    /// The program.
    pub program: Program,
    /// The places of names of numbers in the text, in ascending order, with the numbers.
    pub named: Vec<(Range<usize>, f64)>,
}

/// Refuses a text that is too long.
pub(super) fn refuse_long(text: &str) -> Result<(), Fault> {
    let longest = LONGEST[usize::from(text.contains("interpolate("))];
    if text.len() <= longest {
        return Ok(());
    }
    let message = format!("this expression has {} characters", text.len());
    Err(Fault::new(0..text.len(), message, format!("at most {longest} are allowed")))
}

/// The program that evaluates `text`, an expression in these variables, in which these names stand for numbers.
pub(super) fn compile(text: &str, variables: &[Variable], names: &Names) -> Result<Compiled, Fault> {
    refuse_long(text)?;
    let (program, tables, named, operands) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut parser = Parser { text, variables, names, at: 0, depth: 0, program, tables, named, operands };
    parser.value()?;
    match parser.peek() {
        None => {
            parser.operands.iter().try_for_each(|whole| whole.refuse_infinite(text))?;
            let program = Program::new(parser.program, parser.tables);
            Ok(Compiled { program, named: parser.named })
        }
        Some(')') => Err(parser.here("this `)` has no matching `(`", "delete it, or add a `(` before it")),
        Some(',') => {
            Err(parser.here("a comma outside of a function", "numbers are written with a point: 0.5"))
        }
        Some('*') => Err(parser.here("an operator without a left side", "powers are written x^2")),
        Some('<' | '>' | '=' | '!') => Err(parser.no_comparison()),
        Some(c) if c == '(' || c == '.' || c.is_alphanumeric() => Err(parser.missing_operator()),
        Some(c) => Err(parser.unexpected(c)),
    }
}

/// A part of an expression: an entry of the stack when the program runs.
struct Operand {
    /// Its value, if it has no variables and tables.
    value: Option<f64>,
    /// The largest of its numbers that are not finite, which the text contains as such; 0 if there is none.
    infinite: f64,
    /// Its place in the text.
    at: Range<usize>,
}

impl Operand {
    /// Refuses a value that is not finite although its numbers are, as in 1/0 or sqrt(-1).
    fn refuse_infinite(&self, text: &str) -> Result<(), Fault> {
        let is_meant = |value: f64| self.infinite.is_nan() || (self.infinite > 0.0 && !value.is_nan());
        match self.value.filter(|value| !value.is_finite() && !is_meant(*value)) {
            None => Ok(()),
            Some(value) => {
                let message = format!("`{}` is {value}, not a finite number", &text[self.at.clone()]);
                Err(Fault::new(self.at.clone(), message, "correct the expression"))
            }
        }
    }
}

/// Names of units that numbers do not have.
const UNITS: [&str; 16] =
    ["Pa", "kPa", "MPa", "GPa", "N", "kN", "mm", "cm", "m", "s", "ms", "kg", "K", "C", "W", "J"];

struct Parser<'a> {
    text: &'a str,
    variables: &'a [Variable],
    names: &'a Names,
    at: usize,
    depth: usize,
    program: Vec<Instruction>,
    tables: Vec<Table>,
    named: Vec<(Range<usize>, f64)>,
    /// The entries of the stack after the program so far.
    operands: Vec<Operand>,
}

impl Parser<'_> {
    /// Adds an instruction that stands here in the text. Parts of the text that vary with its variables have operands that are finite.
    fn push(&mut self, instruction: Instruction, at: Range<usize>) -> Result<(), Fault> {
        self.program.push(instruction);
        let first = self.operands.len() - instruction.operands();
        let operands = &self.operands[first..];
        let values = Values(&[0.0; COUNT]);
        let value = match (&instruction, operands) {
            (Instruction::Number(number), _) => Some(*number),
            (Instruction::Unary(function), [Operand { value: Some(a), .. }]) => Some((function.value)(*a)),
            (
                Instruction::Binary(function),
                [Operand { value: Some(a), .. }, Operand { value: Some(b), .. }],
            ) => Some((function.value)(*a, *b)),
            (
                Instruction::Ternary(function),
                [
                    Operand { value: Some(a), .. },
                    Operand { value: Some(b), .. },
                    Operand { value: Some(c), .. },
                ],
            ) => Some({ values }.ternary(function, [*a, *b, *c])),
            _ => None,
        };
        if value.is_none() {
            operands.iter().try_for_each(|operand| operand.refuse_infinite(self.text))?;
        }
        let own = value.filter(|value| operands.is_empty() && !value.is_finite()).map_or(0.0, f64::abs);
        let whole = Operand {
            value,
            infinite: operands.iter().map(|operand| operand.infinite).fold(own, larger),
            at: operands
                .iter()
                .fold(at, |all, Operand { at, .. }| all.start.min(at.start)..all.end.max(at.end)),
        };
        self.operands.truncate(first);
        self.operands.push(whole);
        Ok(())
    }

    fn value(&mut self) -> Result<(), Fault> {
        self.sum()?;
        let operator = match self.peek() {
            Some('<') => [BELOW, AT_MOST],
            Some('>') => [ABOVE, AT_LEAST],
            _ => return Ok(()),
        };
        let sign = self.at;
        self.at += 1;
        let with_equality = self.text[self.at..].starts_with('=');
        self.at += usize::from(with_equality);
        self.sum()?;
        self.push(Instruction::Binary(operator[usize::from(with_equality)]), sign..sign)
    }

    /// Enters another level.
    fn descend(&mut self) -> Result<(), Fault> {
        self.depth += 1;
        if self.depth <= DEEPEST {
            return Ok(());
        }
        let message = "this expression is nested too deeply";
        Err(self.here(message, format!("at most {DEEPEST} levels are allowed")))
    }

    fn sum(&mut self) -> Result<(), Fault> {
        self.descend()?;
        self.product()?;
        loop {
            let operator = match self.peek() {
                Some('+') => ADD,
                Some('-') => SUBTRACT,
                _ => break,
            };
            let sign = self.at;
            self.at += 1;
            self.product()?;
            self.push(Instruction::Binary(operator), sign..sign)?;
        }
        self.depth -= 1;
        Ok(())
    }

    fn product(&mut self) -> Result<(), Fault> {
        self.signed()?;
        loop {
            let operator = match self.peek() {
                Some('*') => MULTIPLY,
                Some('/') => DIVIDE,
                _ => return Ok(()),
            };
            let sign = self.at;
            self.at += 1;
            if operator == MULTIPLY && self.text[self.at..].starts_with('*') {
                return Err(self.here("two stars in a row", "powers are written x^2"));
            }
            self.signed()?;
            self.push(Instruction::Binary(operator), sign..sign)?;
        }
    }

    fn signed(&mut self) -> Result<(), Fault> {
        let mut negative = false;
        self.take_while(char::is_whitespace);
        let start = self.at;
        while let Some(sign @ ('+' | '-')) = self.peek() {
            negative ^= sign == '-';
            self.at += 1;
        }
        self.power()?;
        if negative {
            self.push(Instruction::Unary(NEGATE), start..start)?;
        }
        Ok(())
    }

    fn power(&mut self) -> Result<(), Fault> {
        self.atom()?;
        if self.peek() == Some('^') {
            let sign = self.at;
            self.at += 1;
            self.descend()?;
            self.signed()?;
            self.depth -= 1;
            self.push(Instruction::Binary(POWER), sign..sign)?;
        }
        Ok(())
    }

    fn atom(&mut self) -> Result<(), Fault> {
        match self.peek() {
            None => {
                let message = if self.text.trim().is_empty() {
                    "this expression is empty"
                } else {
                    "the expression ends too early"
                };
                Err(self.here(message, "a number, a name or a parenthesis should follow"))
            }
            Some('(') => {
                let open = self.at;
                self.at += 1;
                self.value()?;
                self.close(open)?;
                self.operands.iter_mut().last().into_iter().for_each(|inner| inner.at = open..self.at);
                Ok(())
            }
            Some(c) if c.is_ascii_digit() || c == '.' => self.number(),
            Some(c) if c.is_ascii_alphabetic() || c == '_' => self.name(),
            Some(c) => Err(self.unexpected(c)),
        }
    }

    fn number(&mut self) -> Result<(), Fault> {
        let start = self.at;
        self.take_while(|c| c.is_ascii_digit() || c == '.');
        let rest = &self.text[self.at..];
        if let Some(exponent) = rest.strip_prefix(['e', 'E']) {
            let digits = exponent.strip_prefix(['+', '-']).unwrap_or(exponent);
            if digits.starts_with(|c: char| c.is_ascii_digit()) {
                self.at += rest.len() - digits.len();
                self.take_while(|c| c.is_ascii_digit());
            }
        }
        match self.text[start..self.at].parse::<f64>() {
            Ok(number) if number.is_finite() => self.push(Instruction::Number(number), start..self.at),
            _ => {
                let message = format!("`{}` is not a number", &self.text[start..self.at]);
                Err(Fault::new(start..self.at, message, "write it as in 0.5 or 1e-3"))
            }
        }
    }

    fn name(&mut self) -> Result<(), Fault> {
        let start = self.at;
        self.take_while(|c| c.is_ascii_alphanumeric() || c == '_');
        let span = start..self.at;
        let name = &self.text[span.clone()];
        let called = self.peek() == Some('(');
        let known = meaning(name, self.variables);
        let number = self.names.get(name).copied();
        // A name that is called is that of a function.
        let number = number.filter(|_| !called || known.is_none());
        if let (Some(Meaning::Value(Instruction::Variable(variable))), Some(_)) = (known, number) {
            let message = format!("`{name}` is a parameter, but here also the {}", variable.meaning());
            return Err(Fault::new(span, message, "give the parameter another name"));
        }
        match number.map(|number| Meaning::Value(Instruction::Number(number))).or(known) {
            None => Err(self.unknown(span)),
            Some(Meaning::Value(_)) if called => {
                let help = format!("a product is written {name}*(...)");
                Err(Fault::new(span, format!("`{name}` is not a function"), help))
            }
            Some(Meaning::Value(Instruction::Number(f64::INFINITY)))
                if self.variables != Variable::OF_TIME_AND_PLACE =>
            {
                let help = "write a large number, or the law of a rigid obstacle";
                Err(Fault::new(span, "an infinite number in a law", help))
            }
            Some(Meaning::Value(value)) => {
                self.push(value, span.clone())?;
                if let Some(number) = number {
                    // The number in parentheses takes a level.
                    self.descend()?;
                    self.depth -= 1;
                    self.named.push((span, number));
                }
                Ok(())
            }
            Some(_) if !called => {
                let help = format!("write {name}(...)");
                Err(Fault::new(span, format!("the function `{name}` has no arguments"), help))
            }
            Some(Meaning::One(function)) => {
                self.arguments(&span, [1, 1], None)?;
                self.push(Instruction::Unary(function), span.start..self.at)
            }
            Some(Meaning::Two(function)) => self.arguments(&span, [2, 2], Some(function)),
            Some(Meaning::Three(function)) => {
                self.arguments(&span, [3, 3], None)?;
                if name == "pulse"
                    && let [.., Instruction::Number(start), Instruction::Number(end)] = self.program[..]
                    && end < start
                {
                    let message = format!("the pulse ends at {end}, before its start at {start}");
                    return Err(Fault::new(span, message, "write pulse(t, start, end)"));
                }
                self.push(Instruction::Ternary(function), span.start..self.at)
            }
            Some(Meaning::Points) => self.points(&span),
            Some(Meaning::Many(function)) => self.arguments(&span, [2, usize::MAX], Some(function)),
        }
    }

    fn unknown(&self, span: Range<usize>) -> Fault {
        let name = &self.text[span.clone()];
        let known: Vec<&str> = names(self.variables).collect();
        let all = known.iter().copied().chain(self.names.keys().map(String::as_str));
        let lower = name.to_lowercase();
        let meant = self.variables.iter().find(|variable| {
            let mut words = variable.meaning().split(|c: char| !c.is_alphanumeric());
            lower.len() > 2 && words.any(|word| word == lower)
        });
        let near = meant.map(|variable| variable.name()).or_else(|| nearest(name, all));
        let near = near.map_or(String::new(), |near| format!("did you mean `{near}`? "));
        let variables: Vec<String> = self
            .variables
            .iter()
            .map(|variable| format!("{} ({})", variable.name(), variable.meaning()))
            .collect();
        let (variables, others) = (variables.join(", "), known[self.variables.len()..].join(", "));
        let help = format!("{near}known variables: {variables}; constants and functions: {others}");
        let message = format!("unknown name `{name}` in an expression");
        Fault { is_unknown_name: true, ..Fault::new(span, message, help) }
    }

    /// A parenthesised list of `least` to `most` arguments, with this function of the ones before and each of them except the first.
    fn arguments(
        &mut self,
        name: &Range<usize>,
        [least, most]: [usize; 2],
        function: Option<Binary>,
    ) -> Result<(), Fault> {
        let open = self.at;
        self.at += 1;
        self.value()?;
        let mut count = 1;
        while self.peek() == Some(',') {
            self.at += 1;
            self.value()?;
            if let Some(function) = function {
                self.push(Instruction::Binary(function), name.clone())?;
            }
            count += 1;
        }
        self.close(open)?;
        if (least..=most).contains(&count) {
            return Ok(());
        }
        let called = &self.text[name.clone()];
        let wanted = if least == most { least.to_string() } else { format!("at least {least}") };
        Err(Fault::new(
            name.start..self.at,
            format!("`{called}` has {count} argument{}", if count == 1 { "" } else { "s" }),
            format!("it takes {wanted}"),
        ))
    }

    /// The argument of `interpolate`, and its points.
    fn points(&mut self, name: &Range<usize>) -> Result<(), Fault> {
        let open = self.at;
        self.at += 1;
        self.value()?;
        let mut numbers = Vec::new();
        while self.peek() == Some(',') {
            self.at += 1;
            let (start, first) = (self.at, self.program.len());
            self.sum()?;
            let point = self.operands.pop().filter(|point| point.refuse_infinite(self.text).is_ok());
            let Some(number) = point.and_then(|point| point.value).filter(|number| !number.is_nan()) else {
                let message = "the points of a table must be numbers";
                return Err(Fault::new(start..self.at, message, "write interpolate(t, t1, v1, t2, v2, ...)"));
            };
            self.program.truncate(first);
            numbers.push(number);
        }
        self.close(open)?;
        let (points, rest) = numbers.as_chunks::<2>();
        let span = name.start..self.at;
        if points.is_empty() || !rest.is_empty() {
            let message = format!("`interpolate` has {} numbers after the first argument", numbers.len());
            return Err(Fault::new(span, message, "it takes pairs: interpolate(t, t1, v1, t2, v2, ...)"));
        }
        if let Some(pair) = points.windows(2).find(|pair| pair[0][0] >= pair[1][0]) {
            let message =
                format!("the points of a table must ascend: {} is not above {}", pair[1][0], pair[0][0]);
            return Err(Fault::new(span, message, "for a jump, put two points close together"));
        }
        self.push(Instruction::Interpolate(self.tables.len()), span)?;
        self.tables.push(points.into());
        Ok(())
    }

    fn no_comparison(&self) -> Fault {
        self.here(
            "this comparison is not available",
            "compare two values with <, <=, > or >=; for `and`, multiply comparisons",
        )
    }

    fn close(&mut self, open: usize) -> Result<(), Fault> {
        match self.peek() {
            Some(')') => {
                self.at += 1;
                Ok(())
            }
            None => Err(Fault::new(open..open + 1, "this parenthesis is never closed", "add a `)`")),
            Some(c) if c == '(' || c == '.' || c.is_alphanumeric() => Err(self.missing_operator()),
            Some('<' | '>' | '=' | '!') => Err(self.no_comparison()),
            Some(c) => Err(self.unexpected(c)),
        }
    }

    /// The next character that is not white space.
    fn peek(&mut self) -> Option<char> {
        self.take_while(char::is_whitespace);
        self.text[self.at..].chars().next()
    }

    fn take_while(&mut self, accept: impl Fn(char) -> bool) {
        let rest = &self.text[self.at..];
        self.at += rest.len() - rest.trim_start_matches(accept).len();
    }

    fn missing_operator(&self) -> Fault {
        let rest = &self.text[self.at..];
        let word = rest.split(|c: char| !c.is_alphanumeric()).next().unwrap_or_default();
        let help = match UNITS.contains(&word) {
            true => "numbers are in SI units, without their names: 2e6 for 2 MPa",
            false => "products are written with a star: 2*x",
        };
        self.here("an operator is missing here", help)
    }

    fn unexpected(&self, c: char) -> Fault {
        self.here(
            format!("unexpected `{c}`"),
            "expressions are made of numbers, names, + - * / ^ and parentheses",
        )
    }

    fn here(&self, message: impl Into<String>, help: impl Into<String>) -> Fault {
        let length = self.text[self.at..].chars().next().map_or(0, char::len_utf8);
        Fault::new(self.at..self.at + length, message, help)
    }
}
