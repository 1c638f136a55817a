//! Numbers for people.

use std::fmt::{self, Display, Formatter};

/// Significant digits.
const DIGITS: usize = 6;

/// A number with at most six significant digits, whatever its unit: `0.3855`, `22.4`, `2.7e-7`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Digits(pub f64);

impl Display for Digits {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self(number) = *self;
        if number == 0.0 || !number.is_finite() {
            return write!(f, "{}", number + 0.0);
        }
        let text = format!("{number:.*e}", DIGITS - 1);
        let Some((digits, Ok(exponent))) = text.split_once('e').map(|(digits, e)| (digits, e.parse::<i32>()))
        else {
            return f.write_str(&text);
        };
        if !(-4..DIGITS as i32).contains(&exponent) {
            return write!(f, "{}e{exponent}", without_zeros(digits));
        }
        let decimals = (DIGITS as i32 - 1 - exponent) as usize;
        f.write_str(without_zeros(&format!("{number:.decimals$}")))
    }
}

/// A decimal number without the zeros at its end.
fn without_zeros(text: &str) -> &str {
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_any_size_have_six_digits_at_most() {
        for (number, text) in [
            (0.0, "0"),
            (-0.0, "0"),
            (2.7e-7, "2.7e-7"),
            (1.234_567_89e-7, "1.23457e-7"),
            (1e-4, "0.0001"),
            (0.385_483_21, "0.385483"),
            (-22.4, "-22.4"),
            (10.0, "10"),
            (123_456.4, "123456"),
            (999_999.9, "1e6"),
            (100_000.0, "100000"),
            (2.1e11, "2.1e11"),
            (f64::INFINITY, "inf"),
            (f64::NAN, "NaN"),
        ] {
            assert_eq!(Digits(number).to_string(), text);
        }
    }
}
