//! The TOML document with the positions of all keys and values.

use std::collections::BTreeMap;
use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::report::{Fault, Place};

/// A value and its position.
#[derive(Debug, Clone)]
pub(crate) struct Node {
    /// The value.
    pub value: Value,
    /// The position of the value; for a table, that of its header.
    pub at: Place,
    /// The position of the key; for the root and for items of lists, that of the value.
    pub key: Place,
}

/// A TOML value.
#[derive(Debug, Clone)]
pub(crate) enum Value {
    /// A string.
    Text(String),
    /// A whole number.
    Integer(i64),
    /// Any other number.
    Float(f64),
    /// true or false.
    Boolean(bool),
    /// A date, a time or both; no key of a job accepts one.
    Date,
    /// A list.
    Array(Vec<Node>),
    /// A table.
    Table(BTreeMap<String, Node>),
}

impl Value {
    /// The kind of value, in words.
    pub(crate) fn kind(&self) -> &'static str {
        match self {
            Self::Text(_) => "a string",
            Self::Integer(_) => "a whole number",
            Self::Float(_) => "a number",
            Self::Boolean(_) => "true or false",
            Self::Date => "a date",
            Self::Array(_) => "a list",
            Self::Table(_) => "a table",
        }
    }
}

impl Node {
    /// A value at this position.
    pub(super) fn new(value: Value, at: &Place) -> Self {
        Self { value, at: at.clone(), key: at.clone() }
    }

    /// The node at `path`, whose parts are keys and list positions, joined by dots.
    pub(crate) fn find(&self, path: &str) -> Option<&Node> {
        if path.is_empty() {
            return Some(self);
        }
        path.split('.').try_fold(self, |node, part| node.child(part))
    }

    /// The child called `part`, a key or a list position.
    pub(crate) fn child(&self, part: &str) -> Option<&Node> {
        match &self.value {
            Value::Table(table) => table.get(part),
            Value::Array(items) => items.get(part.parse::<usize>().ok()?),
            _ => None,
        }
    }

    /// The innermost existing node on `path`.
    pub(crate) fn deepest(&self, path: &str) -> &Node {
        let mut node = self;
        for part in path.split('.') {
            match node.child(part) {
                Some(child) => node = child,
                None => break,
            }
        }
        node
    }

    /// The place of the bytes `range` of a string with this `content`, in the document whose file has this `text`; the place of the
    /// whole value where the two differ, as with escape sequences.
    pub(super) fn place_within(&self, content: &str, range: Range<usize>, text: &str) -> Place {
        let (start, end) = (self.at.start + 1, self.at.end.saturating_sub(1));
        if self.at.file == 0 && text.get(start..end) == Some(content) {
            Place::new(0, start + range.start..start + range.end)
        } else {
            self.at.clone()
        }
    }

    /// The value without positions.
    pub(crate) fn plain(&self) -> toml::Value {
        match &self.value {
            Value::Text(text) => toml::Value::String(text.clone()),
            Value::Integer(number) => toml::Value::Integer(*number),
            Value::Float(number) => toml::Value::Float(*number),
            Value::Boolean(flag) => toml::Value::Boolean(*flag),
            Value::Date => toml::Value::String(String::new()),
            Value::Array(items) => toml::Value::Array(items.iter().map(Node::plain).collect()),
            Value::Table(table) => {
                toml::Value::Table(table.iter().map(|(key, node)| (key.clone(), node.plain())).collect())
            }
        }
    }
}

/// Parses the text of file 0.
pub(super) fn parse(text: &str) -> Result<Node, Fault> {
    match DeTable::parse(text) {
        Ok(table) => Ok(table_node(table.into_inner(), 0, 0, Place::new(0, 0..0))),
        Err(error) => Err(syntax_fault(&error, 0, 0..text.len())),
    }
}

/// Parses the value in the bytes `range` of an override.
pub(super) fn parse_value(text: &str, file: usize, range: Range<usize>) -> Result<Node, Fault> {
    match DeValue::parse(&text[range.clone()]) {
        Ok(value) => Ok(node(value, file, range.start)),
        Err(error) => Err(syntax_fault(&error, file, range)),
    }
}

fn syntax_fault(error: &toml::de::Error, file: usize, range: Range<usize>) -> Fault {
    let at = error.span().map_or(range.end..range.end, |span| {
        (range.start + span.start).min(range.end)..(range.start + span.end).min(range.end)
    });
    let fault = Fault::new(Place::new(file, at), format!("not TOML: {}", error.message()), "");
    match error.message().contains("inline table") {
        true => fault.help("a table in braces is complete: write this key inside the braces, or all of its keys under a header such as [time]"),
        false => fault,
    }
}

fn node(spanned: Spanned<DeValue<'_>>, file: usize, offset: usize) -> Node {
    let span = spanned.span();
    let at = Place::new(file, span.start + offset..span.end + offset);
    let value = match spanned.into_inner() {
        DeValue::String(text) => Value::Text(text.into_owned()),
        DeValue::Integer(number) => match i64::from_str_radix(number.as_str(), number.radix()) {
            Ok(integer) => Value::Integer(integer),
            Err(_) => Value::Float(number.as_str().parse().unwrap_or(f64::INFINITY)),
        },
        DeValue::Float(number) => Value::Float(number.as_str().parse().unwrap_or(f64::NAN)),
        DeValue::Boolean(flag) => Value::Boolean(flag),
        DeValue::Datetime(_) => Value::Date,
        DeValue::Array(items) => {
            Value::Array(items.into_iter().map(|item| node(item, file, offset)).collect())
        }
        DeValue::Table(table) => return table_node(table, file, offset, at),
    };
    Node::new(value, &at)
}

fn table_node(table: DeTable<'_>, file: usize, offset: usize, at: Place) -> Node {
    let children = table
        .into_iter()
        .map(|(key, value)| {
            let span = key.span();
            let mut child = node(value, file, offset);
            child.key = Place::new(file, span.start + offset..span.end + offset);
            (key.into_inner().into_owned(), child)
        })
        .collect();
    Node::new(Value::Table(children), &at)
}
