//! Numbers in text, base64 or raw bytes.

use super::tags::Tag;
use crate::error::{Error, Result};
use std::io::Read;

/// A compressed byte stands for at most this many bytes.
const LARGEST_RATIO: usize = 1100;

/// How the arrays of a file are encoded.
#[derive(Debug, Default)]
pub(super) struct Encoding<'a> {
    is_big_endian: bool,
    /// Bytes of the numbers in front of data.
    header: usize,
    is_compressed: bool,
    appended: &'a [u8],
    is_appended_raw: bool,
}

impl<'a> Encoding<'a> {
    /// From the first tag of a file.
    pub(super) fn of_file(tag: &Tag) -> Result<Self> {
        let header = match tag.attribute("header_type").unwrap_or("UInt32") {
            "UInt32" => 4,
            "UInt64" => 8,
            _ => return Err(tag.refuse("header_type: UInt32 or UInt64 is expected")),
        };
        let is_compressed = match tag.attribute("compressor") {
            None | Some("") => false,
            Some("vtkZLibDataCompressor") => true,
            Some(other) => {
                let other: String = other.chars().take(40).collect();
                return Err(tag.refuse(format_args!(
                    "data compressed by {} are not read: write the file with zlib, uncompressed or in ASCII",
                    other.escape_debug()
                )));
            }
        };
        let is_big_endian = tag.attribute("byte_order") == Some("BigEndian");
        Ok(Self { is_big_endian, header, is_compressed, ..Self::default() })
    }

    /// The data at the end of the file, which begin behind `_`.
    pub(super) fn set_appended(&mut self, tag: &Tag, rest: &'a [u8]) -> Result<()> {
        self.is_appended_raw = match tag.attribute("encoding") {
            Some("raw") => true,
            Some("base64") | None => false,
            Some(_) => return Err(tag.refuse("<AppendedData> needs encoding=\"raw\" or \"base64\"")),
        };
        let Some(data) = rest.trim_ascii_start().strip_prefix(b"_") else {
            return Err(tag.refuse("<AppendedData> has no `_` in front of its data"));
        };
        self.appended = data;
        Ok(())
    }

    fn header_number(&self, bytes: &[u8]) -> u64 {
        let mut all = [0; 8];
        if self.is_big_endian {
            all[8 - bytes.len()..].copy_from_slice(bytes);
            u64::from_be_bytes(all)
        } else {
            all[..bytes.len()].copy_from_slice(bytes);
            u64::from_le_bytes(all)
        }
    }
}

/// Where the numbers of an array are.
#[derive(Debug)]
enum Place<'a> {
    Text(&'a [u8]),
    Base64(&'a [u8]),
    Appended(usize),
}

/// An array that is not yet decoded.
#[derive(Debug)]
pub(super) struct Array<'a> {
    name: String,
    kind: Kind,
    place: Place<'a>,
}

/// The type of numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Signed(usize),
    Unsigned(usize),
    Float(usize),
}

impl<'a> Array<'a> {
    /// The array that begins with a tag and has this text.
    pub(super) fn new(tag: &Tag, text: &'a [u8]) -> Result<Self> {
        let kind = match tag.attribute("type").unwrap_or_default() {
            "Int8" => Kind::Signed(1),
            "Int16" => Kind::Signed(2),
            "Int32" => Kind::Signed(4),
            "Int64" => Kind::Signed(8),
            "UInt8" => Kind::Unsigned(1),
            "UInt16" => Kind::Unsigned(2),
            "UInt32" => Kind::Unsigned(4),
            "UInt64" => Kind::Unsigned(8),
            "Float32" => Kind::Float(4),
            // Arrays of other types are not used; if one is, its numbers are missing.
            _ => Kind::Float(8),
        };
        let place = match tag.attribute("format").unwrap_or("ascii") {
            "appended" => Place::Appended(tag.number("offset", u32::MAX.into())? as usize),
            "binary" => Place::Base64(text),
            _ => Place::Text(text),
        };
        Ok(Self { name: tag.attribute("Name").unwrap_or("Points").chars().take(40).collect(), kind, place })
    }

    fn refuse(&self, what: impl std::fmt::Display) -> Error {
        Error::Refused(format!("array `{}`: {what}", self.name.escape_debug()))
    }

    /// Numbers with a point; `count` of them.
    pub(super) fn floats(&self, encoding: &Encoding, count: usize) -> Result<Vec<f64>> {
        let numbers = match &self.place {
            Place::Text(text) => self.words(text, Some(count), |word| word.parse().ok())?,
            _ => {
                let (bytes, is_big) = (self.bytes(encoding, Some(count))?, encoding.is_big_endian);
                let numbers = bytes.chunks_exact(self.size());
                match self.kind {
                    Kind::Float(4) => {
                        numbers.map(|b| f64::from(f32::from_bits(unsigned(b, is_big) as u32))).collect()
                    }
                    Kind::Float(_) => numbers.map(|bytes| f64::from_bits(unsigned(bytes, is_big))).collect(),
                    _ => return Err(self.refuse("Float32 or Float64 is expected")),
                }
            }
        };
        Ok(numbers)
    }

    /// Whole numbers; `count` of them, if it is known.
    pub(super) fn whole(&self, encoding: &Encoding, count: Option<usize>) -> Result<Vec<i64>> {
        if let Place::Text(text) = &self.place {
            return self.words(text, count, |word| word.parse().ok());
        }
        let (bytes, is_big) = (self.bytes(encoding, count)?, encoding.is_big_endian);
        let numbers = bytes.chunks_exact(self.size());
        match self.kind {
            Kind::Unsigned(_) => Ok(numbers.map(|bytes| unsigned(bytes, is_big) as i64).collect()),
            Kind::Signed(size) => {
                let shift = 64 - 8 * size;
                Ok(numbers.map(|bytes| ((unsigned(bytes, is_big) << shift) as i64) >> shift).collect())
            }
            Kind::Float(_) => Err(self.refuse("whole numbers are expected, such as type=\"Int32\"")),
        }
    }

    fn size(&self) -> usize {
        match self.kind {
            Kind::Signed(size) | Kind::Unsigned(size) | Kind::Float(size) => size,
        }
    }

    fn words<T>(
        &self,
        text: &[u8],
        count: Option<usize>,
        read: impl Fn(&str) -> Option<T>,
    ) -> Result<Vec<T>> {
        let words = text.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        let number = |word: &[u8]| {
            let word = String::from_utf8_lossy(word);
            read(&word).ok_or_else(|| {
                let word: String = word.chars().take(40).collect();
                self.refuse(format_args!("`{}` where a number is expected", word.escape_debug()))
            })
        };
        let numbers: Vec<T> = words.map(number).collect::<Result<_>>()?;
        self.refuse_other_length(numbers.len(), count)?;
        Ok(numbers)
    }

    fn refuse_other_length(&self, found: usize, count: Option<usize>) -> Result<()> {
        match count.filter(|count| *count != found) {
            None => Ok(()),
            Some(count) => Err(self.refuse(format_args!(
                "it has {found} numbers, {count} are expected: the file is truncated or damaged"
            ))),
        }
    }

    /// The decoded bytes of `count` numbers, if it is known.
    fn bytes(&self, encoding: &Encoding, count: Option<usize>) -> Result<Vec<u8>> {
        let missing = || self.refuse("its data are missing: the file is truncated or damaged");
        let source = match self.place {
            Place::Text(text) | Place::Base64(text) => Source { bytes: text.trim_ascii(), is_raw: false },
            Place::Appended(at) => {
                let bytes = encoding.appended.get(at..).ok_or_else(missing)?;
                Source { bytes, is_raw: encoding.is_appended_raw }
            }
        };
        let data = if encoding.is_compressed {
            self.inflate(encoding, source)?
        } else {
            let header = source.peek(encoding.header).ok_or_else(missing)?;
            let length = usize::try_from(encoding.header_number(&header)).ok();
            let all = length.and_then(|length| source.peek(length.checked_add(encoding.header)?));
            all.ok_or_else(missing)?.split_off(encoding.header)
        };
        if data.len() % self.size() != 0 {
            return Err(missing());
        }
        self.refuse_other_length(data.len() / self.size(), count)?;
        Ok(data)
    }

    /// Blocks that are compressed by zlib, behind their number, their length, that of the last one and their compressed lengths.
    fn inflate(&self, encoding: &Encoding, mut source: Source) -> Result<Vec<u8>> {
        let damaged = || self.refuse("its compressed data are damaged");
        let number = |bytes: &[u8]| usize::try_from(encoding.header_number(bytes)).map_err(|_| damaged());
        let first = source.peek(encoding.header).ok_or_else(damaged)?;
        let blocks = number(&first)?;
        let size = blocks.checked_add(3).and_then(|numbers| numbers.checked_mul(encoding.header));
        let header = size.and_then(|size| source.take(size)).ok_or_else(damaged)?;
        let numbers = header.chunks_exact(encoding.header).map(number).collect::<Result<Vec<_>>>()?;
        let lengths = &numbers[3..];
        let total =
            lengths.iter().try_fold(0, |sum: usize, length| sum.checked_add(*length)).ok_or_else(damaged)?;
        let packed = source.take(total).ok_or_else(damaged)?;
        let (mut data, mut at) = (Vec::new(), 0);
        for &length in lengths {
            let most = length.saturating_mul(LARGEST_RATIO).saturating_add(LARGEST_RATIO);
            let stream = flate2::read::ZlibDecoder::new(&packed[at..at + length]);
            stream.take(most as u64).read_to_end(&mut data).map_err(|_| damaged())?;
            at += length;
        }
        Ok(data)
    }
}

fn unsigned(bytes: &[u8], is_big_endian: bool) -> u64 {
    let add = |sum: u64, byte: &u8| sum << 8 | u64::from(*byte);
    if is_big_endian { bytes.iter().fold(0, add) } else { bytes.iter().rev().fold(0, add) }
}

/// Bytes, raw or in base64.
#[derive(Clone, Copy)]
struct Source<'a> {
    bytes: &'a [u8],
    is_raw: bool,
}

impl Source<'_> {
    /// The first bytes, if they exist.
    fn peek(&self, length: usize) -> Option<Vec<u8>> {
        if self.is_raw {
            return self.bytes.get(..length).map(<[u8]>::to_vec);
        }
        self.decode(length).map(|(bytes, _)| bytes)
    }

    /// The first bytes; the source goes on behind them, in base64 behind the characters that are needed for them.
    fn take(&mut self, length: usize) -> Option<Vec<u8>> {
        if self.is_raw {
            let (bytes, rest) = self.bytes.split_at_checked(length)?;
            self.bytes = rest;
            return Some(bytes.to_vec());
        }
        let (bytes, used) = self.decode(length)?;
        self.bytes = &self.bytes[used..];
        Some(bytes)
    }

    /// The first bytes from groups of four characters, each of which may end with padding, and the number of characters.
    fn decode(&self, length: usize) -> Option<(Vec<u8>, usize)> {
        if length / 3 > self.bytes.len() / 4 {
            return None;
        }
        let mut out = Vec::with_capacity(length + 3);
        let mut used = 0;
        while out.len() < length {
            let group: [u8; 4] = *self.bytes.get(used..)?.first_chunk()?;
            let padding = group.iter().rev().take_while(|&&byte| byte == b'=').count();
            let mut bits = 0;
            for &byte in &group[..4 - padding] {
                bits = bits << 6 | sextet(byte)?;
            }
            bits <<= 6 * padding;
            let [_, a, b, c] = u32::to_be_bytes(bits);
            out.extend(&[a, b, c][..3_usize.checked_sub(padding)?]);
            used += 4;
        }
        out.truncate(length);
        Some((out, used))
    }
}

fn sextet(byte: u8) -> Option<u32> {
    let value = match byte {
        b'A'..=b'Z' => byte - b'A',
        b'a'..=b'z' => byte - b'a' + 26,
        b'0'..=b'9' => byte - b'0' + 52,
        b'+' => 62,
        b'/' => 63,
        _ => return None,
    };
    Some(value.into())
}
