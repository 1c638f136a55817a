//! Compiles an expression to the program of the stack machine, by recursive descent.
//!
//! `sum = product {(+|-) product}`, `product = signed {(*|/) signed}`, `signed = (+|-) signed | power`,
//! `power = atom [^ signed]`, `atom = number | name | name(sum, ...) | (sum)`: so -x^2 is -(x^2), and
//! 2^3^2 is 2^(3^2).

use std::ops::Range;

use super::functions::{Meaning, meaning, names};
use super::program::{Binary, Instruction, Unary};
use crate::laws::nearest::nearest;

/// Longest permitted expression in bytes.
const LONGEST: usize = 10_000;
/// Deepest permitted nesting of parentheses, signs and powers.
const DEEPEST: usize = 200;

const ADD: Binary = Binary::smooth(|a, b| a + b);
const SUBTRACT: Binary = Binary::smooth(|a, b| a - b);
const MULTIPLY: Binary = Binary::smooth(|a, b| a * b);
const DIVIDE: Binary = Binary::smooth(|a, b| a / b);
const POWER: Binary = Binary::smooth(f64::powf);
const NEGATE: Unary = Unary::smooth(|a| -a);

/// An error in an expression, and its position in the text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    /// Range of bytes of the text.
    pub at: Range<usize>,
    /// The error.
    pub message: String,
    /// The remedy.
    pub help: String,
}

impl Fault {
    fn new(at: Range<usize>, message: impl Into<String>, help: impl Into<String>) -> Self {
        Self { at, message: message.into(), help: help.into() }
    }
}

/// The program that evaluates `text`.
pub(super) fn compile(text: &str) -> Result<Vec<Instruction>, Fault> {
    if text.len() > LONGEST {
        let message = format!("this expression has {} characters", text.len());
        return Err(Fault::new(0..text.len(), message, format!("at most {LONGEST} are allowed")));
    }
    let mut parser = Parser { text, at: 0, depth: 0, program: Vec::new() };
    parser.sum()?;
    match parser.peek() {
        None => Ok(parser.program),
        Some(')') => Err(parser.here("this parenthesis closes no other", "delete it, or open one before it")),
        Some(',') => {
            Err(parser.here("a comma outside of a function", "numbers are written with a point: 0.5"))
        }
        Some('*') => Err(parser.here("an operator without a left side", "powers are written x^2")),
        Some('<' | '>' | '=' | '!') => {
            Err(parser.here("comparisons are not available", "use min, max, abs and sign instead"))
        }
        Some(c) if c == '(' || c == '.' || c.is_alphanumeric() => {
            Err(parser.here("an operator is missing here", "products are written with a star: 2*x"))
        }
        Some(c) => Err(parser.unexpected(c)),
    }
}

struct Parser<'a> {
    text: &'a str,
    at: usize,
    depth: usize,
    program: Vec<Instruction>,
}

impl Parser<'_> {
    fn sum(&mut self) -> Result<(), Fault> {
        self.depth += 1;
        if self.depth > DEEPEST {
            let message = "this expression is nested too deeply";
            return Err(self.here(message, format!("at most {DEEPEST} levels are allowed")));
        }
        self.product()?;
        loop {
            let operator = match self.peek() {
                Some('+') => ADD,
                Some('-') => SUBTRACT,
                _ => break,
            };
            self.at += 1;
            self.product()?;
            self.program.push(Instruction::Binary(operator));
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
            self.at += 1;
            if operator == MULTIPLY && self.text[self.at..].starts_with('*') {
                return Err(self.here("two stars in a row", "powers are written x^2"));
            }
            self.signed()?;
            self.program.push(Instruction::Binary(operator));
        }
    }

    fn signed(&mut self) -> Result<(), Fault> {
        let mut negative = false;
        while let Some(sign @ ('+' | '-')) = self.peek() {
            negative ^= sign == '-';
            self.at += 1;
        }
        self.power()?;
        if negative {
            self.program.push(Instruction::Unary(NEGATE));
        }
        Ok(())
    }

    fn power(&mut self) -> Result<(), Fault> {
        self.atom()?;
        if self.peek() == Some('^') {
            self.at += 1;
            self.depth += 1;
            if self.depth > DEEPEST {
                let message = "this expression is nested too deeply";
                return Err(self.here(message, format!("at most {DEEPEST} levels are allowed")));
            }
            self.signed()?;
            self.depth -= 1;
            self.program.push(Instruction::Binary(POWER));
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
                self.sum()?;
                self.close(open)
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
            Ok(number) if number.is_finite() => {
                self.program.push(Instruction::Number(number));
                Ok(())
            }
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
        match meaning(name) {
            None => {
                let help = match nearest(name, names()) {
                    Some(near) => format!("did you mean `{near}`?"),
                    None => format!("known names: {}", names().collect::<Vec<_>>().join(", ")),
                };
                Err(Fault::new(span, format!("unknown name `{name}` in an expression"), help))
            }
            Some(Meaning::Value(_)) if called => {
                let help = format!("a product is written {name}*(...)");
                Err(Fault::new(span, format!("`{name}` is not a function"), help))
            }
            Some(Meaning::Value(value)) => {
                self.program.push(value);
                Ok(())
            }
            Some(_) if !called => {
                let help = format!("write {name}(...)");
                Err(Fault::new(span, format!("the function `{name}` has no arguments"), help))
            }
            Some(Meaning::One(function)) => {
                self.arguments(&span, 1, 1, |_| {})?;
                self.program.push(Instruction::Unary(function));
                Ok(())
            }
            Some(Meaning::Two(function)) => self.arguments(&span, 2, 2, |program| {
                program.push(Instruction::Binary(function));
            }),
            Some(Meaning::Many(function)) => self.arguments(&span, 2, usize::MAX, |program| {
                program.push(Instruction::Binary(function));
            }),
        }
    }

    /// A parenthesised list of `least` to `most` arguments; `then` is called after each argument except the first.
    fn arguments(
        &mut self,
        name: &Range<usize>,
        least: usize,
        most: usize,
        then: impl Fn(&mut Vec<Instruction>),
    ) -> Result<(), Fault> {
        let open = self.at;
        self.at += 1;
        self.sum()?;
        let mut count = 1;
        while self.peek() == Some(',') {
            self.at += 1;
            self.sum()?;
            then(&mut self.program);
            count += 1;
        }
        self.close(open)?;
        if (least..=most).contains(&count) {
            return Ok(());
        }
        let function = &self.text[name.clone()];
        let wanted = if least == most { least.to_string() } else { format!("at least {least}") };
        Err(Fault::new(
            name.start..self.at,
            format!("`{function}` has {count} argument{}", if count == 1 { "" } else { "s" }),
            format!("it takes {wanted}"),
        ))
    }

    fn close(&mut self, open: usize) -> Result<(), Fault> {
        match self.peek() {
            Some(')') => {
                self.at += 1;
                Ok(())
            }
            None => Err(Fault::new(open..open + 1, "this parenthesis is never closed", "add a `)`")),
            Some(c) if c == '(' || c == '.' || c.is_alphanumeric() => {
                Err(self.here("an operator is missing here", "products are written with a star: 2*x"))
            }
            Some('<' | '>' | '=' | '!') => {
                Err(self.here("comparisons are not available", "use min, max, abs and sign instead"))
            }
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
