//! Values of a job that expressions of parameters give: the effective job keeps these expressions.

use toml_edit::{DocumentMut, Item, TableLike, Value};

/// All values that were computed from parameters.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Written(Vec<Computed>);

/// A value that was computed from parameters.
#[derive(Debug, Clone, PartialEq)]
struct Computed {
    /// Its key with positions in lists, joined by dots.
    path: String,
    /// The expression.
    text: String,
    value: Plain,
}

/// A computed value.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Plain {
    /// A whole number.
    Integer(i64),
    /// Any other number.
    Float(f64),
    /// An expression with numbers in place of the parameters.
    Text(String),
}

impl Written {
    /// Notes that the expression `text` of the key `path` has this value.
    pub(super) fn add(&mut self, path: &str, text: &str, value: Plain) {
        self.0.push(Computed { path: path.to_owned(), text: text.to_owned(), value });
    }

    /// The job `text` with the expressions in place of their values. Values that were changed since then stay.
    pub(super) fn restore(&self, text: String) -> Result<String, toml_edit::TomlError> {
        if self.0.is_empty() {
            return Ok(text);
        }
        let mut document: DocumentMut = text.parse()?;
        for Computed { path, text, value } in &self.0 {
            if let Some(there) = in_table(document.as_table_mut(), path).filter(|there| value.is(there)) {
                let decor = there.decor().clone();
                *there = Value::from(text.as_str());
                *there.decor_mut() = decor;
            }
        }
        Ok(document.to_string())
    }
}

impl Plain {
    /// Whether it equals a value of a document.
    fn is(&self, there: &Value) -> bool {
        match self {
            Self::Integer(number) => there.as_integer() == Some(*number),
            Self::Float(number) => there.as_float() == Some(*number),
            Self::Text(text) => there.as_str() == Some(text),
        }
    }
}

/// The value at `path`, the names in which may contain dots.
fn in_table<'a>(table: &'a mut dyn TableLike, path: &str) -> Option<&'a mut Value> {
    let rest_after = |key: &str| match path.strip_prefix(key)? {
        "" => Some(""),
        rest => rest.strip_prefix('.'),
    };
    let key = table.iter().map(|(key, _)| key).filter(|key| rest_after(key).is_some());
    let key = key.max_by_key(|key| key.len())?.to_owned();
    let rest = rest_after(&key)?;
    match table.get_mut(&key)? {
        Item::Value(value) => in_value(value, rest),
        Item::Table(table) => in_table(table, rest),
        Item::ArrayOfTables(tables) => {
            let (index, rest) = rest.split_once('.')?;
            in_table(tables.get_mut(index.parse().ok()?)?, rest)
        }
        Item::None => None,
    }
}

fn in_value<'a>(value: &'a mut Value, path: &str) -> Option<&'a mut Value> {
    if path.is_empty() {
        return Some(value);
    }
    match value {
        Value::InlineTable(table) => in_table(table, path),
        Value::Array(items) => {
            let (index, rest) = path.split_once('.').unwrap_or((path, ""));
            in_value(items.get_mut(index.parse().ok()?)?, rest)
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn expressions_return_where_their_values_are_unchanged() {
        let text = "end = 0.5\n[a]\nlist = [1, 2.5, { b = 3.0 }]\n[[c]]\nd = 4.0\n[[c]]\nd = 5.0\n[\"e.f\"]\ng = \"(2.0)*t\"\n";
        let mut written = Written::default();
        assert_eq!(written.restore(text.into()).expect("TOML"), text);
        for (path, expression, value) in [
            ("end", "T/2", Plain::Float(0.5)),
            ("a.list.0", "n", Plain::Integer(1)),
            ("a.list.1", "m", Plain::Float(2.0)),
            ("a.list.2.b", "3*n", Plain::Float(3.0)),
            ("c.1.d", "5 * n", Plain::Float(5.0)),
            ("c.2.d", "n", Plain::Float(5.0)),
            ("e.f.g", "T*t", Plain::Text("(2.0)*t".into())),
            ("e.f.h.i", "n", Plain::Float(0.0)),
        ] {
            written.add(path, expression, value);
        }
        let expected = "end = \"T/2\"\n[a]\nlist = [\"n\", 2.5, { b = \"3*n\" }]\n[[c]]\nd = 4.0\n[[c]]\nd = \"5 * n\"\n\
                        [\"e.f\"]\ng = \"T*t\"\n";
        assert_eq!(written.restore(text.into()).expect("TOML"), expected);
    }
}
