//! The line of the log after a step.

use crate::{laws::lines::WIDTH, solver::stepping::StepOutcome};
use std::fmt::{self, Display, Formatter, Write};

/// It is written without allocation, because runs log many steps.
pub(super) struct StepLine<'a> {
    pub step: u64,
    /// The last step of the run.
    pub last: u64,
    /// In s.
    pub time: f64,
    pub outcome: &'a StepOutcome,
    /// The columns of the run.
    pub has: ShownColumns,
    pub imbalance: f64,
    /// Wall time to the end in s.
    pub left: f64,
}

/// The columns that mean something in a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct ShownColumns {
    pub contact: bool,
    pub friction: bool,
    pub newton: bool,
    /// Whether steps take more than one linear iteration.
    pub iterative: bool,
}

impl StepLine<'_> {
    /// Writes the line with its columns in the order of their importance; columns for which there is no space are omitted.
    pub(super) fn write(&self, line: &mut String) {
        let Self { step, last, time, outcome, has, imbalance, left } = self;
        let points = &outcome.points;
        let touching = points.branches.iter().sum::<usize>() - points.open;
        let end = Text::of(format_args!("  {} left", ClockTime(*left)));
        line.clear();
        let mut push = |wanted: bool, words: fmt::Arguments<'_>| {
            let before = line.len();
            if wanted && line.write_fmt(words).is_ok() && line.len() + end.length > WIDTH {
                line.truncate(before);
            }
        };
        push(
            true,
            format_args!(
                "step {step:>width$}/{last}  t = {time} s",
                width = digits(*last),
                time = Short(*time)
            ),
        );
        push(has.contact, format_args!("  {touching} touch, {} open", points.open));
        push(has.friction, format_args!(", {} stick, {} slip", points.sticking, points.slipping));
        push(has.newton, format_args!("  Newton {}", outcome.newton_iterations));
        push(has.iterative, format_args!("  linear {}", outcome.linear_iterations));
        push(outcome.indefinite_solves > 0, format_args!("  indefinite {}", outcome.indefinite_solves));
        push(outcome.solutions > 0, format_args!("  solutions {}", outcome.solutions));
        push(has.contact, format_args!("  inclusion residual {:.0e}", outcome.inclusion_residual));
        push(true, format_args!("  energy imbalance {imbalance:.0e}"));
        line.push_str(end.text());
    }
}

/// A short text without allocation.
struct Text {
    bytes: [u8; 48],
    length: usize,
}

impl Text {
    fn of(words: fmt::Arguments<'_>) -> Self {
        let mut text = Self { bytes: [0; 48], length: 0 };
        // Characters beyond its capacity are omitted.
        let _ = text.write_fmt(words);
        text
    }

    fn text(&self) -> &str {
        std::str::from_utf8(&self.bytes[..self.length]).unwrap_or_default()
    }
}

impl Write for Text {
    fn write_str(&mut self, words: &str) -> fmt::Result {
        let space = self.bytes.get_mut(self.length..self.length + words.len()).ok_or(fmt::Error)?;
        space.copy_from_slice(words.as_bytes());
        self.length += words.len();
        Ok(())
    }
}

/// Number of decimal digits.
fn digits(number: u64) -> usize {
    number.checked_ilog10().map_or(1, |log| log as usize + 1)
}

/// A time with at most seven digits.
pub(super) struct Short(pub f64);

impl Display for Short {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self(time) = self;
        if *time != 0.0 && !(1e-3..1e6).contains(&time.abs()) {
            return write!(f, "{time:.4e}");
        }
        let text = Text::of(format_args!("{time:.6}"));
        let short = text.text().trim_end_matches('0').trim_end_matches('.');
        f.write_str(if short.is_empty() { "0" } else { short })
    }
}

/// Seconds as `12 s`, `3 min 05 s` or `2 h 07 min`.
struct ClockTime(f64);

impl Display for ClockTime {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let whole = self.0.round() as u64;
        match whole {
            0..60 => write!(f, "{whole} s"),
            60..3600 => write!(f, "{} min {:02} s", whole / 60, whole % 60),
            _ => write!(f, "{} h {:02} min", whole / 3600, whole / 60 % 60),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: ShownColumns = ShownColumns { contact: true, friction: true, newton: true, iterative: true };

    fn line(outcome: &StepOutcome, has: ShownColumns, [step, last]: [u64; 2], left: f64) -> String {
        let mut line = String::new();
        StepLine { step, last, time: 0.5, outcome, has, imbalance: 1e-9, left }.write(&mut line);
        line
    }

    #[test]
    fn a_line_tells_the_step_and_the_time_left() {
        let mut outcome =
            StepOutcome { newton_iterations: 2, linear_iterations: 31, ..StepOutcome::default() };
        (outcome.points.branches[0], outcome.points.branches[1], outcome.points.open) = (4, 1, 3);
        outcome.points.slipping = 2;
        assert_eq!(
            line(&outcome, ALL, [3, 64], 185.0),
            "step  3/64  t = 0.5 s  2 touch, 3 open, 0 stick, 2 slip  Newton 2  linear 31  3 min 05 s left"
        );
        assert_eq!(
            line(&outcome, ShownColumns::default(), [3, 64], 7.0),
            "step  3/64  t = 0.5 s  energy imbalance 1e-9  7 s left",
            "no contact, no Newton iterations"
        );
    }

    #[test]
    fn no_line_is_longer_than_a_hundred_characters() {
        let mut outcome = StepOutcome { newton_iterations: 50, ..StepOutcome::default() };
        outcome.linear_iterations = 123_456;
        outcome.points.branches = [1_000_000; 8];
        (outcome.points.open, outcome.points.sticking, outcome.points.slipping) = (123_456, 123_456, 123_456);
        let line = line(&outcome, ALL, [999_999, 1_000_000_000_000], 1e9);
        assert!(line.len() <= WIDTH && line.ends_with("277777 h 46 min left"), "{line}");
    }

    #[test]
    fn times_have_no_digits_without_meaning() {
        let short = [0.0, 0.5, 0.015625, 12.0, 1e-5, 3e7].map(|time| Short(time).to_string());
        assert_eq!(short, ["0", "0.5", "0.015625", "12", "1.0000e-5", "3.0000e7"]);
    }
}
