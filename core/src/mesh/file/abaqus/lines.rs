//! The lines of a file: keywords with their parameters, and data.

use crate::error::{Error, Result};
use std::borrow::Cow;

/// A refusal with the number of a line.
pub(super) fn refuse(line: usize, what: impl std::fmt::Display) -> Error {
    Error::Refused(format!("line {line}: {what}"))
}

/// A keyword with its parameters.
#[derive(Debug)]
pub(super) struct Keyword {
    pub(super) line: usize,
    /// In capitals, with single spaces.
    pub(super) name: String,
    /// In capitals, with the value as it is written.
    parameters: Vec<(String, String)>,
}

impl Keyword {
    /// The value of a parameter; empty if it has none.
    pub(super) fn parameter(&self, name: &str) -> Option<&str> {
        self.parameters.iter().find(|(other, _)| other == name).map(|(_, value)| value.as_str())
    }

    /// The value of a parameter that has to be there.
    pub(super) fn required(&self, name: &str) -> Result<&str> {
        self.parameter(name)
            .filter(|value| !value.is_empty())
            .ok_or_else(|| refuse(self.line, format_args!("*{} needs the parameter {name}=...", self.name)))
    }
}

/// One line of data.
#[derive(Debug)]
pub(super) struct Data<'a> {
    pub(super) line: usize,
    /// The words between commas, without white space around them; empty at the end if the line ends with a comma.
    pub(super) words: Vec<Cow<'a, str>>,
}

impl Data<'_> {
    /// A whole number that is not negative.
    pub(super) fn number(&self, at: usize, what: &str) -> Result<u64> {
        let word = self.words.get(at).map_or("", |word| word);
        word.parse().map_err(|_| {
            refuse(self.line, format_args!("`{}` where {what}, a whole number, is expected", short(word)))
        })
    }

    /// A coordinate; 0 if the word is empty or missing.
    pub(super) fn coordinate(&self, at: usize) -> Result<f64> {
        let word = self.words.get(at).map_or("", |word| word);
        if word.is_empty() {
            return Ok(0.0);
        }
        // Fortran writes exponents of double precision with a D.
        word.parse().or_else(|_| word.replace(['d', 'D'], "e").parse()).map_err(|_| {
            refuse(self.line, format_args!("`{}` where a coordinate, a number, is expected", short(word)))
        })
    }
}

/// The beginning of a word, for messages.
pub(super) fn short(word: &str) -> String {
    word.chars().take(40).collect::<String>().escape_debug().to_string()
}

/// The lines of a file without comments and blank lines.
pub(super) struct Lines<'a> {
    bytes: &'a [u8],
    /// Number of the line at the beginning of `bytes`.
    next: usize,
}

impl<'a> Lines<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, next: 1 }
    }

    /// The next line with its number, not consumed, and the bytes after it.
    fn peek(&mut self) -> Option<(Cow<'a, str>, &'a [u8])> {
        while !self.bytes.is_empty() {
            let length = self.bytes.iter().position(|&byte| byte == b'\n').unwrap_or(self.bytes.len());
            let (line, rest) = (&self.bytes[..length], &self.bytes[(length + 1).min(self.bytes.len())..]);
            let line = line.trim_ascii();
            if !line.is_empty() && !line.starts_with(b"**") {
                return Some((String::from_utf8_lossy(line), rest));
            }
            self.bytes = rest;
            self.next += 1;
        }
        None
    }

    fn consume(&mut self, rest: &'a [u8]) -> usize {
        self.bytes = rest;
        self.next += 1;
        self.next - 1
    }

    /// The next keyword; data lines before it are skipped.
    pub(super) fn keyword(&mut self) -> Option<Keyword> {
        loop {
            let (text, rest) = self.peek()?;
            let line = self.consume(rest);
            let Some(start) = text.strip_prefix('*') else { continue };
            let mut text = start.to_owned();
            // A keyword continues on the next line behind a comma at the end.
            while text.ends_with(',')
                && let Some((more, rest)) = self.peek()
                && !more.starts_with(|c: char| c.is_ascii_digit() || "*+-.".contains(c))
            {
                text.push_str(&more);
                self.consume(rest);
            }
            let mut words = split(&text).into_iter();
            let name = words.next().map_or_else(String::new, |name| capitals(&name));
            let parameters = words.filter(|word| !word.is_empty()).map(|word| {
                let (name, value) = word.split_once('=').unwrap_or((&word, ""));
                (capitals(name), unquoted(value).to_owned())
            });
            return Some(Keyword { line, name, parameters: parameters.collect() });
        }
    }

    /// The next data line of the keyword before it.
    pub(super) fn data(&mut self) -> Option<Data<'a>> {
        let (text, rest) = self.peek()?;
        if text.starts_with('*') {
            return None;
        }
        let line = self.consume(rest);
        let words = match text {
            Cow::Borrowed(text) if !text.contains('"') => {
                text.split(',').map(|word| Cow::Borrowed(word.trim())).collect()
            }
            text => split(&text).into_iter().map(|word| Cow::Owned(unquoted(&word).to_owned())).collect(),
        };
        Some(Data { line, words })
    }
}

/// The words between commas that are not in quotes.
fn split(text: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut is_quoted = false;
    for character in text.chars() {
        match character {
            ',' if !is_quoted => words.push(String::new()),
            _ => {
                is_quoted ^= character == '"';
                words.last_mut().unwrap_or(&mut String::new()).push(character);
            }
        }
    }
    words.iter().map(|word| word.trim().to_owned()).collect()
}

fn unquoted(word: &str) -> &str {
    word.trim().trim_matches('"')
}

fn capitals(word: &str) -> String {
    word.split_whitespace().collect::<Vec<_>>().join(" ").to_ascii_uppercase()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keywords_have_parameters_and_continue_behind_a_comma() {
        let text = b"** comment\n\n*Solid  section,\n elset = \"my set, 2\" , Material=steel\n1., 2\n*NODE\n 1, 1.5D+1,,-2\n";
        let mut lines = Lines::new(text);
        let keyword = lines.keyword().expect("a keyword");
        assert_eq!((&*keyword.name, keyword.line), ("SOLID SECTION", 3));
        assert_eq!(keyword.parameter("ELSET"), Some("my set, 2"));
        assert_eq!(keyword.parameter("MATERIAL"), Some("steel"));
        assert!(
            keyword.required("NSET").expect_err("refused").to_string().starts_with("line 3: *SOLID SECTION")
        );
        assert_eq!(lines.data().expect("data").words, ["1.", "2"]);
        assert!(lines.data().is_none());
        assert_eq!(lines.keyword().expect("a keyword").name, "NODE");
        let data = lines.data().expect("data");
        assert_eq!((data.line, data.number(0, "a node").ok()), (7, Some(1)));
        assert_eq!([1, 2, 3, 4].map(|at| data.coordinate(at).ok()), [15.0, 0.0, -2.0, 0.0].map(Some));
        let words = data.number(1, "a node").expect_err("refused").to_string();
        assert_eq!(words, "line 7: `1.5D+1` where a node, a whole number, is expected");
    }
}
