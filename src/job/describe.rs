//! The reference of all keys, generated from the structs.

use serde_json::Value;

use super::schema::{Kind, Schema};
use crate::error::{Error, Result};
use crate::laws::nearest::nearest;

const WIDTH: usize = 100;

/// A table of the document and its keys.
struct Table {
    /// Keys joined by dots.
    path: String,
    /// Whether the table is written with two brackets and may occur several times.
    several: bool,
    /// The name and the text of each key.
    keys: Vec<(&'static str, String)>,
    meaning: String,
}

/// Meaning, unit, range, default and example of all keys of `table` and the tables below it (of all tables if `None`), or of the
/// single key that `table` names.
pub fn describe(table: Option<&str>) -> Result<String> {
    describe_kind(Kind::job(), table)
}

/// As [`describe`], of another kind of document.
pub(crate) fn describe_kind(kind: Kind, table: Option<&str>) -> Result<String> {
    let all = tables(kind);
    let wanted = table.unwrap_or_default().trim_matches(['[', ']']);
    if let Some((path, key)) = wanted.rsplit_once('.') {
        let found = all.iter().find(|table| table.path == path);
        if let Some((_, text)) = found.and_then(|table| table.keys.iter().find(|(name, _)| *name == key)) {
            return Ok(format!("[{path}]\n{text}"));
        }
    }
    let shown: Vec<&Table> = all
        .iter()
        .filter(|table| {
            wanted.is_empty()
                || table
                    .path
                    .strip_prefix(wanted)
                    .is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
        })
        .collect();
    if shown.is_empty() {
        return Err(unknown_table(kind, wanted, &all));
    }
    let opening = if wanted.is_empty() { kind.opening } else { "" };
    Ok(opening.to_owned() + &shown.iter().map(|table| table.text()).collect::<Vec<_>>().join("\n"))
}

/// The JSON Schema (draft 2020-12) of a job.
pub fn describe_json() -> String {
    format!("{:#}", Kind::job().schema)
}

fn unknown_table(kind: Kind, wanted: &str, all: &[Table]) -> Error {
    let help = match nearest(wanted, all.iter().map(|table| table.path.as_str())) {
        Some(near) => format!("did you mean `{near}`?"),
        None => match tables_with(kind, wanted) {
            Some(elsewhere) => {
                let table = elsewhere.split(']').next().unwrap_or_default().trim_start_matches('[');
                format!("it is a key of {elsewhere}: try solver describe {}{table}.{wanted}", kind.prefix)
            }
            None => {
                let names: Vec<&str> = all.iter().map(|table| table.path.as_str()).collect();
                format!("tables: {}", names.join(", "))
            }
        },
    };
    Error::Refused(format!("no table of a {} is called `{wanted}`; {help}", kind.name))
}

/// The tables that have a key of this name, as text.
pub(super) fn tables_with(kind: Kind, key: &str) -> Option<String> {
    let found: Vec<String> = tables(kind)
        .iter()
        .filter(|table| table.keys.iter().any(|(name, _)| *name == key))
        .map(|table| format!("[{}]", table.path))
        .collect();
    (!found.is_empty()).then(|| found.join(", "))
}

fn tables(kind: Kind) -> Vec<Table> {
    let mut all = Vec::new();
    let document = kind.root();
    let required: Vec<&str> = document.required().collect();
    for (key, property) in document.properties() {
        collect(key, property, required.contains(&key.as_str()), &mut all);
    }
    all
}

fn collect(path: &str, schema: Schema, required: bool, all: &mut Vec<Table>) {
    let several = schema.accepts("array");
    let body = if several { schema.items().unwrap_or(schema) } else { schema };
    let mut meaning = flat(schema.text("description").unwrap_or_default());
    if required {
        meaning.push_str(" Required.");
    }
    let tagged = body.tagged();
    let at = all.len();
    let mut keys = Vec::new();
    let required: Vec<&str> = body.required().collect();
    let mut properties: Vec<(&'static str, Schema, bool)> = body
        .properties()
        .map(|(key, inner)| (key.as_str(), inner, required.contains(&key.as_str())))
        .collect();
    if !body.alternatives().is_empty() {
        let names: Vec<&str> = tagged.iter().map(|(name, _)| *name).collect();
        let choice = if names.len() == 1 { "One table or key" } else { "Exactly one of" };
        meaning.push_str(&format!(" {choice}: {}.", names.join(", ")));
        let choices = tagged.iter().filter_map(|(name, branch)| Some((*name, branch.property(name)?, false)));
        properties.extend(choices);
    }
    for (key, inner, required) in properties {
        let branch = tagged.iter().find(|(name, _)| *name == key).map(|(_, branch)| *branch);
        if is_table(inner) && inner.get("additionalProperties").is_boolean()
            || is_tables(inner)
            || !inner.tagged().is_empty()
        {
            collect(&format!("{path}.{key}"), inner, required, all);
        } else {
            keys.push((key, key_text(key, inner, branch, required)));
        }
    }
    if let Some(free) = body.items().filter(|items| items.accepts("object")) {
        for (key, inner) in free.properties() {
            let required = free.required().any(|name| name == key);
            keys.push((key, key_text(key, inner, None, required)));
        }
        meaning.push_str(&format!(" Each: [{path}.\"name\"] or \"name\" = {{ .. }}."));
    }
    all.insert(at, Table { path: path.to_owned(), several, keys, meaning });
}

/// Whether it is a table of keys; an expression, in place of which a table over time may stand, is a value.
fn is_table(schema: Schema) -> bool {
    schema.accepts("object") && schema.text("format") != Some("expression")
}

fn is_tables(schema: Schema) -> bool {
    schema.accepts("array") && schema.items().is_some_and(is_table)
}

impl Table {
    fn text(&self) -> String {
        let name = if self.several { format!("[[{}]]", self.path) } else { format!("[{}]", self.path) };
        let mut text = format!("{name}\n{}", wrapped(&self.meaning, 2));
        for (_, key) in &self.keys {
            text.push_str(key);
        }
        text
    }
}

fn key_text(key: &str, schema: Schema, branch: Option<Schema>, required: bool) -> String {
    let mut facts = vec![kind(schema)];
    let range = range(schema.items().filter(|_| schema.accepts("array")).unwrap_or(schema));
    if range != "any number" {
        facts.push(range);
    }
    facts.extend(schema.text("unit").map(|unit| format!("unit {unit}")));
    match schema.get("default") {
        Value::Null if required => facts.push("required".into()),
        Value::Null => {}
        default => facts.push(format!("default {}", toml(default))),
    }
    let mut text = format!("\n  {key}: {}\n", facts.join("; "));
    let meaning = schema.text("description").or(branch.and_then(|branch| branch.text("description")));
    text.push_str(&wrapped(&flat(meaning.unwrap_or_default()), 6));
    for choice in schema.alternatives() {
        if let (Some(word), Some(meaning)) = (choice.text("const"), choice.text("description")) {
            text.push_str(&wrapped(&format!("\"{word}\": {}", flat(meaning)), 8));
        }
    }
    for example in schema.get("examples").as_array().into_iter().flatten() {
        text.push_str(&format!("      example: {key} = {}\n", toml(example)));
    }
    text
}

/// The accepted kind of value, in words.
pub(super) fn kind(schema: Schema) -> String {
    let alternatives = schema.alternatives();
    if !alternatives.is_empty() {
        let mut kinds: Vec<String> = schema.words().iter().map(|word| format!("\"{word}\"")).collect();
        let tables: Vec<&str> = schema.tagged().iter().map(|(name, _)| *name).collect();
        if !tables.is_empty() {
            kinds.push(format!("a table with one of {}", tables.join(", ")));
        }
        kinds.extend(alternatives.iter().filter(|one| one.accepts("array")).map(|one| kind(*one)));
        return kinds.join(" or ");
    }
    if schema.text("format") == Some("expression") {
        return "a number or an expression in t, x, y, z".into();
    }
    if schema.accepts("array") {
        let count = match (schema.number("minItems"), schema.number("maxItems")) {
            (Some(least), Some(most)) if least == most => format!("{least} "),
            _ => String::new(),
        };
        let item = schema.items().map(kind).unwrap_or_default();
        return format!("a list of {count}items, each {item}");
    }
    let plain = [
        ("object", "a table"),
        ("integer", "a whole number"),
        ("number", "a number"),
        ("string", "a string"),
        ("boolean", "true or false"),
    ];
    plain.iter().find(|(name, _)| schema.accepts(name)).map_or("a value", |(_, words)| words).into()
}

/// The range of a number, in words.
pub(super) fn range(schema: Schema) -> String {
    let bounds = [
        ("above", schema.number("exclusiveMinimum")),
        ("at least", schema.number("minimum")),
        ("below", schema.number("exclusiveMaximum")),
        ("at most", schema.number("maximum")),
    ];
    let words: Vec<String> =
        bounds.iter().filter_map(|(word, bound)| bound.map(|bound| format!("{word} {bound}"))).collect();
    if words.is_empty() { "any number".into() } else { words.join(" and ") }
}

/// A JSON value as TOML spells it.
pub(super) fn toml(value: &Value) -> String {
    match value {
        Value::Object(object) if object.is_empty() => "{}".into(),
        Value::Object(object) => {
            let pairs: Vec<String> =
                object.iter().map(|(key, value)| format!("{key} = {}", toml(value))).collect();
            format!("{{ {} }}", pairs.join(", "))
        }
        Value::Array(items) => format!("[{}]", items.iter().map(toml).collect::<Vec<_>>().join(", ")),
        other => other.to_string(),
    }
}

fn flat(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// The text in lines of at most WIDTH characters, each after `indent` blanks.
fn wrapped(text: &str, indent: usize) -> String {
    let mut out = String::new();
    let mut line = String::new();
    for word in text.split_whitespace() {
        if !line.is_empty() && indent + line.chars().count() + 1 + word.chars().count() > WIDTH {
            out.push_str(&format!("{:indent$}{line}\n", ""));
            line.clear();
        }
        if !line.is_empty() {
            line.push(' ');
        }
        line.push_str(word);
    }
    if !line.is_empty() {
        out.push_str(&format!("{:indent$}{line}\n", ""));
    }
    out
}
