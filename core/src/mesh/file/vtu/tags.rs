//! The tags of an XML file.

use crate::error::{Error, Result};

/// Longest tag.
const LONGEST: usize = 10_000;

/// A tag with its attributes.
#[derive(Debug, Default)]
pub(super) struct Tag {
    line: usize,
    /// With a slash at the beginning if it ends an element.
    pub(super) name: String,
    attributes: Vec<(String, String)>,
    /// Whether it ends the element that it begins.
    pub(super) is_alone: bool,
}

impl Tag {
    pub(super) fn attribute(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(other, _)| other == name).map(|(_, value)| value.as_str())
    }

    /// A whole number that is at most `most`.
    pub(super) fn number(&self, name: &str, most: u64) -> Result<u64> {
        let word = self.attribute(name).unwrap_or_default();
        word.parse().ok().filter(|number| *number <= most).ok_or_else(|| {
            let word: String = word.chars().take(40).collect();
            self.refuse(format_args!(
                "<{}> needs {name}=\"...\", a whole number of at most {most}; `{}` is none",
                self.name,
                word.escape_debug()
            ))
        })
    }

    /// A refusal with the number of the line.
    pub(super) fn refuse(&self, what: impl std::fmt::Display) -> Error {
        Error::Refused(format!("line {}: {what}", self.line))
    }
}

/// Goes from tag to tag.
pub(super) struct Tags<'a> {
    bytes: &'a [u8],
    at: usize,
    line: usize,
}

impl<'a> Tags<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, line: 1 }
    }

    /// The next tag that is no comment and no declaration.
    pub(super) fn next_tag(&mut self) -> Result<Option<Tag>> {
        loop {
            let text = self.text();
            self.advance(text.len());
            if self.rest().is_empty() {
                return Ok(None);
            }
            let (begin, end): (usize, &[u8]) = match self.rest() {
                [b'<', b'!', b'-', b'-', ..] => (4, b"-->"),
                [b'<', b'?' | b'!', ..] => (2, b">"),
                _ => break,
            };
            let rest = &self.rest()[begin..];
            let length = rest.windows(end.len()).position(|window| window == end);
            self.advance(begin + length.map_or(rest.len(), |length| length + end.len()));
        }
        let rest = &self.rest()[1..];
        let mut quote = None;
        let is_end = |byte: &u8| {
            match (quote, *byte) {
                (None, b'"' | b'\'') => quote = Some(*byte),
                (Some(open), byte) if open == byte => quote = None,
                (None, b'>') => return true,
                _ => {}
            }
            false
        };
        let mut tag = Tag { line: self.line, ..Tag::default() };
        let Some(length) = rest.iter().take(LONGEST).position(is_end) else {
            return Err(tag.refuse("a tag without end: the file is truncated or damaged"));
        };
        self.advance(length + 2);
        read(&mut tag, &String::from_utf8_lossy(&rest[..length]));
        Ok(Some(tag))
    }

    /// The text up to the next tag.
    pub(super) fn text(&self) -> &'a [u8] {
        let rest = self.rest();
        &rest[..rest.iter().position(|&byte| byte == b'<').unwrap_or(rest.len())]
    }

    /// All that follows.
    pub(super) fn rest(&self) -> &'a [u8] {
        &self.bytes[self.at..]
    }

    fn advance(&mut self, length: usize) {
        self.line += self.rest()[..length].iter().filter(|&&byte| byte == b'\n').count();
        self.at += length;
    }
}

/// Reads what is between `<` and `>`.
fn read(tag: &mut Tag, text: &str) {
    let inner = text.strip_suffix('/');
    tag.is_alone = inner.is_some();
    let mut rest = inner.unwrap_or(text).trim();
    let end = rest.find(char::is_whitespace).unwrap_or(rest.len());
    tag.name = rest[..end].to_owned();
    rest = &rest[end..];
    while let Some((name, behind)) = rest.split_once('=') {
        let behind = behind.trim_start();
        let Some(quote) = behind.chars().next().filter(|quote| matches!(quote, '"' | '\'')) else { return };
        let Some((value, more)) = behind[1..].split_once(quote) else { return };
        tag.attributes.push((name.trim().to_owned(), value.to_owned()));
        rest = more;
    }
}
