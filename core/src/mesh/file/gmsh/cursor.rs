//! Reads numbers and lines from the bytes of a file, ASCII or binary, and records their positions.

use crate::error::{Error, Result};

/// The encoding of numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    Binary { big_endian: bool, wide_sizes: bool },
}

/// A position in the file; every read checks that the bytes exist.
pub(super) struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
    /// The start of the last item read.
    began: usize,
    pub(super) encoding: Encoding,
    /// The section being read, for messages.
    pub(super) section: String,
}

impl<'a> Cursor<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, began: 0, encoding: Encoding::Ascii, section: String::new() }
    }

    /// A refusal with the section and the line (ASCII) or byte (binary) of the last item read.
    pub(super) fn refuse(&self, what: impl std::fmt::Display) -> Error {
        let place = match self.encoding {
            Encoding::Ascii => {
                let line = 1 + self.bytes[..self.began].iter().filter(|&&byte| byte == b'\n').count();
                format!("line {line}")
            }
            Encoding::Binary { .. } => format!("byte {}", self.began),
        };
        let section =
            if self.section.is_empty() { String::new() } else { format!("section ${}, ", self.section) };
        Error::Refused(format!("{section}{place}: {what}"))
    }

    pub(super) fn at_end(&mut self) -> bool {
        self.skip_space();
        self.at == self.bytes.len()
    }

    fn skip_space(&mut self) {
        while self.bytes.get(self.at).is_some_and(|byte| byte.is_ascii_whitespace()) {
            self.at += 1;
        }
    }

    /// The next word between white space, in any encoding.
    pub(super) fn word(&mut self, what: &str) -> Result<&'a str> {
        self.skip_space();
        self.began = self.at;
        while self.bytes.get(self.at).is_some_and(|byte| !byte.is_ascii_whitespace()) {
            self.at += 1;
        }
        match std::str::from_utf8(&self.bytes[self.began..self.at]) {
            Ok("") => Err(self.refuse(format_args!("the file ends where {what} is expected"))),
            Ok(word) => Ok(word),
            Err(_) => Err(self.refuse(format_args!("unreadable bytes where {what} is expected"))),
        }
    }

    /// The rest of this line without its end, which is consumed.
    pub(super) fn line(&mut self) -> &'a [u8] {
        self.began = self.at;
        let rest = &self.bytes[self.at..];
        let length = rest.iter().position(|&byte| byte == b'\n').unwrap_or(rest.len());
        self.at += (length + 1).min(rest.len());
        rest[..length].trim_ascii()
    }

    /// Moves after the line that is equal to `marker`; false if there is none.
    pub(super) fn skip_past(&mut self, marker: &str) -> bool {
        let mut from = self.at;
        while let Some(found) = find(&self.bytes[from..], marker.as_bytes()) {
            let (first, after) = (from + found, from + found + marker.len());
            let alone = self.bytes.get(after).is_none_or(|byte| byte.is_ascii_whitespace());
            if alone && first > 0 && self.bytes[first - 1] == b'\n' {
                self.at = after;
                return true;
            }
            from = first + 1;
        }
        false
    }

    fn number<T: std::str::FromStr>(&mut self, what: &str, kind: &str) -> Result<T> {
        let word = self.word(what)?;
        word.parse().map_err(|_| {
            let found: String = word.chars().take(40).collect();
            self.refuse(format_args!("`{}` where {what}, {kind}, is expected", found.escape_debug()))
        })
    }

    fn take<const N: usize>(&mut self, what: &str) -> Result<[u8; N]> {
        self.began = self.at;
        match self.bytes[self.at..].first_chunk::<N>() {
            Some(chunk) => {
                self.at += N;
                Ok(*chunk)
            }
            None => Err(self.refuse(format_args!("the file ends where {what} is expected"))),
        }
    }

    /// The next four bytes.
    pub(super) fn four_bytes(&mut self, what: &str) -> Result<[u8; 4]> {
        self.take(what)
    }

    /// A C `int`.
    #[inline]
    pub(super) fn int(&mut self, what: &str) -> Result<i32> {
        match self.encoding {
            Encoding::Ascii => self.number(what, "an integer"),
            Encoding::Binary { big_endian: false, .. } => Ok(i32::from_le_bytes(self.take(what)?)),
            Encoding::Binary { big_endian: true, .. } => Ok(i32::from_be_bytes(self.take(what)?)),
        }
    }

    /// A C `size_t`.
    #[inline]
    pub(super) fn size(&mut self, what: &str) -> Result<u64> {
        match self.encoding {
            Encoding::Ascii => self.number(what, "a non-negative integer"),
            Encoding::Binary { big_endian: false, wide_sizes: true } => {
                Ok(u64::from_le_bytes(self.take(what)?))
            }
            Encoding::Binary { big_endian: true, wide_sizes: true } => {
                Ok(u64::from_be_bytes(self.take(what)?))
            }
            Encoding::Binary { big_endian: false, .. } => Ok(u32::from_le_bytes(self.take(what)?).into()),
            Encoding::Binary { big_endian: true, .. } => Ok(u32::from_be_bytes(self.take(what)?).into()),
        }
    }

    /// A C `double`.
    #[inline]
    pub(super) fn double(&mut self, what: &str) -> Result<f64> {
        match self.encoding {
            Encoding::Ascii => self.number(what, "a number"),
            Encoding::Binary { big_endian: false, .. } => Ok(f64::from_le_bytes(self.take(what)?)),
            Encoding::Binary { big_endian: true, .. } => Ok(f64::from_be_bytes(self.take(what)?)),
        }
    }

    /// A C `int` that is not negative.
    #[inline]
    pub(super) fn natural(&mut self, what: &str) -> Result<u64> {
        let value = self.int(what)?;
        u64::try_from(value).map_err(|_| {
            self.refuse(format_args!("`{value}` where {what}, a non-negative integer, is expected"))
        })
    }

    /// Three coordinates.
    #[inline]
    pub(super) fn point(&mut self) -> Result<[f64; 3]> {
        let mut point = [0.0; 3];
        for x in &mut point {
            *x = self.double("a coordinate")?;
        }
        Ok(point)
    }

    /// The dimension of an entity.
    pub(super) fn dimension(&mut self) -> Result<usize> {
        match self.int("a dimension")? {
            dimension @ 0..=3 => Ok(dimension as usize),
            other => Err(self.refuse(format_args!("dimension {other}: 0, 1, 2 or 3 is expected"))),
        }
    }

    /// A number of following items; refused if the rest of the file is too short for them.
    pub(super) fn count(&mut self, what: &str, each: Least) -> Result<usize> {
        let count = self.size(what)?;
        self.refuse_count_above_rest(what, count, each)
    }

    /// The number of following items, unless the rest of the file is too short for them.
    pub(super) fn refuse_count_above_rest(&self, what: &str, count: u64, each: Least) -> Result<usize> {
        let least = match self.encoding {
            Encoding::Ascii => 2 * (each.ints + each.sizes + each.doubles),
            Encoding::Binary { wide_sizes, .. } => {
                4 * each.ints + if wide_sizes { 8 } else { 4 } * each.sizes + 8 * each.doubles
            }
        };
        // The last word of an ASCII file may have no white space after it.
        let rest = self.bytes.len() - self.at + 1;
        match usize::try_from(count) {
            Ok(count) if count <= rest / least.max(1) => Ok(count),
            _ => Err(self.refuse(format_args!(
                "{what} is {count}, more than the {rest} bytes left in the file can contain: the file is truncated or damaged"
            ))),
        }
    }
}

/// The smallest number of numbers of each kind for an item in the file.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Least {
    pub(super) ints: usize,
    pub(super) sizes: usize,
    pub(super) doubles: usize,
}

fn find(bytes: &[u8], marker: &[u8]) -> Option<usize> {
    bytes.windows(marker.len()).position(|window| window == marker)
}
