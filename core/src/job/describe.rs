//! The reference of all keys, generated from the structs.

use serde_json::{Value, json};

use super::schema::{Kind, Schema};
use crate::error::{Error, Result};
use crate::laws::{lines::wrapped, nearest::nearest};

/// A table of the document and its keys.
struct DescribedTable {
    /// Keys joined by dots.
    path: String,
    /// Whether the table is written with two brackets and may occur several times.
    several: bool,
    keys: Vec<Key>,
    meaning: String,
    /// Other words by which a search finds it, with commas.
    also: &'static str,
}

/// A key of a table.
struct Key {
    name: &'static str,
    schema: Schema,
    /// The alternative that the key is part of, if the table is a choice.
    branch: Option<Schema>,
    is_required: bool,
}

/// Meaning, unit, range, default and example of all keys of `table` and the tables below it (of all tables if `None`, after a list of
/// them), or of the single key that `table` names; where neither has this name, the tables and keys in which the word occurs.
pub fn describe(table: Option<&str>) -> Result<String> {
    describe_kind(Kind::job(), table, &[])
}

/// A name, for searches by a word.
#[derive(Clone)]
pub struct Named {
    /// The name.
    pub name: String,
    /// How lists show it.
    pub shown: String,
    /// What it means.
    pub meaning: String,
    /// Other words by which a search finds it, with commas.
    pub also: &'static str,
}

impl Named {
    /// Whether this word is one of its other words.
    fn is_called(&self, word: &str) -> bool {
        self.also.split(", ").any(|also| plain(also) == plain(word))
    }
}

/// A name or word in the spelling in which they are compared.
fn plain(text: &str) -> String {
    text.to_lowercase().replace(['-', '_'], " ")
}

/// As [`describe`], of any kind of document; words are also searched among `others`.
pub fn describe_kind(kind: Kind, table: Option<&str>, others: &[Named]) -> Result<String> {
    let all = tables(kind);
    let wanted = table.unwrap_or_default().trim_matches(['[', ']']);
    if let Some((path, key)) = wanted.rsplit_once('.') {
        let found = all.iter().find(|table| table.path == path);
        if let Some(found) = found.and_then(|table| table.keys.iter().find(|found| found.name == key)) {
            return Ok(format!("[{path}]\n{}", found.text()));
        }
    }
    let shown: Vec<&DescribedTable> = all
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
        return occurrences(kind, wanted, others).ok_or_else(|| unknown_table(kind, wanted, &all));
    }
    let mut opening = String::new();
    if wanted.is_empty() {
        kind.opening.split("\n\n").for_each(|text| opening += &(lines(text, 0) + "\n"));
        let list = |table: &&DescribedTable| entry(&table.path, &table.meaning);
        let tables: String =
            all.iter().filter(|table| !table.path.contains('.')).map(|table| list(&table)).collect();
        opening += &format!(
            "Tables (solver describe {}TABLE shows one, also by any word):\n\n{tables}\n",
            kind.prefix
        );
    }
    Ok(opening + &shown.iter().map(|table| table.text()).collect::<Vec<_>>().join("\n"))
}

/// The JSON Schema (draft 2020-12) of a job. Numbers may be strings, because they may be expressions of parameters.
pub fn describe_json() -> String {
    let mut schema = Kind::job().schema.clone();
    allow_strings(&mut schema);
    format!("{schema:#}")
}

/// Allows a string wherever a number is allowed.
fn allow_strings(schema: &mut Value) {
    match schema {
        Value::Object(object) => {
            for (keyword, value) in object {
                match value.as_str().filter(|_| keyword == "type") {
                    Some(kind @ ("number" | "integer")) => *value = json!([kind, "string"]),
                    _ => allow_strings(value),
                }
            }
        }
        Value::Array(items) => items.iter_mut().for_each(allow_strings),
        _ => {}
    }
}

/// The reference of all keys of a job as a page in Markdown.
pub fn describe_markdown() -> String {
    markdown_of(Kind::job())
}

/// As [`describe_markdown`], of another kind of document.
pub fn markdown_of(kind: Kind) -> String {
    let what = kind.prefix.replace('.', " ");
    let mut page = format!(
        "# Keys of a {}\n\n`solver describe {what}--markdown` prints this page; it is generated from the source. {}\n\n",
        kind.name,
        escaped(&flat(kind.opening))
    );
    for table in tables(kind) {
        page.push_str(&table.markdown());
    }
    page.truncate(page.trim_end().len());
    page
}

/// A line with the first sentence of the meaning.
fn entry(path: &str, meaning: &str) -> String {
    let sentence = meaning.split(". ").next().unwrap_or_default().trim_end_matches('.');
    lines(&format!("{path}: {sentence}."), 2)
}

/// All tables and keys of a kind of document, for searches by a word.
pub fn named(kind: Kind) -> Vec<Named> {
    let mut found = Vec::new();
    // Materials of regions have the keys of `material`.
    for table in tables(kind).iter().filter(|table| !table.path.starts_with("region.material")) {
        let prefix = kind.prefix.replace('.', " ");
        let mut add = |name: &str, path: &str, meaning: String, also: &'static str| {
            found.push(Named { name: name.to_owned(), shown: format!("{prefix}{path}"), meaning, also });
        };
        add(
            table.path.rsplit('.').next().unwrap_or_default(),
            &table.path,
            table.meaning.clone(),
            table.also,
        );
        for key in &table.keys {
            let choices: String =
                key.choices().iter().map(|(word, text)| format!(" \"{word}\": {text}")).collect();
            let also = key.schema.text("also").unwrap_or_default();
            add(key.name, &format!("{}.{}", table.path, key.name), key.meaning() + &choices, also);
        }
    }
    found
}

/// Words with fewer letters are searched at the beginning of words.
const SHORT: usize = 5;

/// The tables, keys and other names that are a word or, if it has three letters, contain it or have it among their other words or in their
/// meanings, those with the name first; `None` if there are none.
fn occurrences(kind: Kind, word: &str, others: &[Named]) -> Option<String> {
    let wanted = plain(word);
    // A few letters occur within many words.
    let mentions = |text: &str| match wanted.len() < SHORT {
        true => text.split(|letter: char| !letter.is_alphanumeric()).any(|word| word.starts_with(&wanted)),
        false => text.contains(&wanted),
    };
    let own = named(kind);
    let mut found: Vec<(usize, &Named)> = Vec::new();
    for one in own.iter().chain(others) {
        let rank = match plain(&one.name) {
            name if name == wanted => 0,
            _ if one.is_called(word) => 1,
            _ if wanted.len() < 3 => continue,
            name if mentions(&name) => 1,
            _ if mentions(&plain(&one.meaning)) => 2,
            _ => continue,
        };
        found.push((rank, one));
    }
    found.sort_by_key(|(rank, _)| *rank);
    let list: String = found.iter().map(|(_, one)| entry(&one.shown, &one.meaning)).collect();
    (!found.is_empty()).then(|| format!("`{word}` occurs in\n\n{list}"))
}

fn unknown_table(kind: Kind, wanted: &str, all: &[DescribedTable]) -> Error {
    let help = match nearest(wanted, all.iter().map(|table| table.path.as_str())) {
        Some(near) => format!("did you mean `{near}`?"),
        None => "`solver describe` lists all tables".into(),
    };
    Error::Refused(format!(
        "no table of a {} is called `{wanted}`, and no text mentions it; {help}",
        kind.name
    ))
}

/// The most names to which a word of other programs leads.
const MOST_NAMES: usize = 3;

/// What a word means that is no key in its place: where a key or table of this name belongs, or what is called so by other programs.
pub(super) fn meaning_of_key(kind: Kind, word: &str) -> Option<String> {
    let place = place_of(kind, word).map(|place| format!("`{word}` is {place}"));
    place.or_else(|| meaning_of_value(kind, word))
}

/// What other programs call by a word that is no value in its place.
pub(super) fn meaning_of_value(kind: Kind, word: &str) -> Option<String> {
    let all = named(kind);
    let called = all.iter().filter(|one| one.is_called(word)).take(MOST_NAMES);
    let names: Vec<String> = called.map(|one| format!("`{}`", one.shown)).collect();
    (!names.is_empty()).then(|| format!("for `{word}` see {}", names.join(", ")))
}

/// The command that describes the table at a path of a document.
pub(super) fn command(kind: Kind, path: &str) -> String {
    let names: Vec<&str> = path.split('.').filter(|part| part.parse::<usize>().is_err()).collect();
    format!("solver describe {}{}", kind.prefix.replace('.', " "), names.join("."))
}

/// What a key or a table of this name is where it belongs, as text.
fn place_of(kind: Kind, name: &str) -> Option<String> {
    let all = tables(kind);
    let is_inner = |inner: &DescribedTable, outer: &DescribedTable| {
        inner.path.rsplit_once('.') == Some((outer.path.as_str(), name))
    };
    let has = |table: &&DescribedTable| {
        table.keys.iter().any(|key| key.name == name) || all.iter().any(|inner| is_inner(inner, table))
    };
    let found: Vec<String> = all.iter().filter(has).map(DescribedTable::title).collect();
    let key = (!found.is_empty()).then(|| format!("a key of {}", found.join(", ")));
    let own = all.iter().find(|table| table.path == name);
    let own = own.map(|table| format!("a table of its own, {}", table.title()));
    let places: Vec<String> = own.into_iter().chain(key).collect();
    (!places.is_empty()).then(|| places.join(", and "))
}

fn tables(kind: Kind) -> Vec<DescribedTable> {
    let mut all = Vec::new();
    let document = kind.root();
    let required: Vec<&str> = document.required().collect();
    for (key, property) in document.properties() {
        collect(key, property, required.contains(&key.as_str()), &mut all);
    }
    all
}

fn collect(path: &str, schema: Schema, required: bool, all: &mut Vec<DescribedTable>) {
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
    for (key, inner, is_required) in properties {
        let inner = inner.one();
        let branch = tagged.iter().find(|(name, _)| *name == key).map(|(_, branch)| *branch);
        if is_table(inner) && inner.get("additionalProperties").is_boolean()
            || is_tables(inner)
            || !inner.tagged().is_empty()
        {
            collect(&format!("{path}.{key}"), inner, is_required, all);
        } else {
            keys.push(Key { name: key, schema: inner, branch, is_required });
        }
    }
    if let Some(free) = body.items().filter(|items| items.accepts("object")) {
        let alternatives = free.alternatives();
        let values = alternatives.into_iter().find(|one| one.accepts("object")).unwrap_or(free);
        for (key, inner) in values.properties() {
            let is_required = values.required().any(|name| name == key);
            keys.push(Key { name: key, schema: inner, branch: None, is_required });
        }
        let other =
            if free.accepts("array") { "\"name\" = [..]".to_owned() } else { format!("[{path}.\"name\"]") };
        meaning.push_str(&format!(" Each: {other} or \"name\" = {{ .. }}."));
    }
    let also = schema.text("also").or(body.text("also")).unwrap_or_default();
    all.insert(at, DescribedTable { path: path.to_owned(), several, keys, meaning, also });
}

/// Whether it is a table of keys; an expression, in place of which a table over time may stand, is a value.
fn is_table(schema: Schema) -> bool {
    schema.accepts("object") && schema.text("format") != Some("expression")
}

fn is_tables(schema: Schema) -> bool {
    schema.accepts("array") && schema.items().is_some_and(is_table)
}

impl DescribedTable {
    /// Its name in brackets, as in a document.
    fn title(&self) -> String {
        if self.several { format!("[[{}]]", self.path) } else { format!("[{}]", self.path) }
    }

    fn text(&self) -> String {
        let mut text = format!("{}\n{}", self.title(), lines(&self.meaning, 2));
        for key in &self.keys {
            text.push_str(&key.text());
        }
        text
    }

    /// A section with a row for each key.
    fn markdown(&self) -> String {
        let level = if self.path.contains('.') { "###" } else { "##" };
        let mut text = format!("{level} `{}`\n\n{}\n\n", self.title(), escaped(&self.meaning));
        if !self.keys.is_empty() {
            text.push_str("| key | value | unit | default | meaning |\n|---|---|---|---|---|\n");
            self.keys.iter().for_each(|key| text.push_str(&key.markdown()));
            text.push('\n');
        }
        text
    }
}

impl Key {
    /// The accepted kind of value with its range.
    fn value(&self) -> String {
        let range =
            range(self.schema.items().filter(|_| self.schema.accepts("array")).unwrap_or(self.schema));
        let kind = kind(self.schema);
        if range == "any number" { kind } else { format!("{kind}; {range}") }
    }

    /// The default, or that the key is required.
    fn default(&self) -> Option<String> {
        match self.schema.get("default") {
            Value::Null => self.is_required.then(|| "required".into()),
            default => Some(toml(default)),
        }
    }

    fn meaning(&self) -> String {
        let meaning = self.schema.text("description");
        flat(meaning.or(self.branch.and_then(|branch| branch.text("description"))).unwrap_or_default())
    }

    /// The allowed words with their meanings.
    fn choices(&self) -> Vec<(&'static str, String)> {
        let choice = |choice: &Schema| Some((choice.text("const")?, flat(choice.text("description")?)));
        let of_items = self.schema.items().filter(|_| self.schema.accepts("array"));
        of_items.unwrap_or(self.schema).alternatives().iter().filter_map(choice).collect()
    }

    /// Lines as in a document.
    fn examples(&self) -> Vec<String> {
        let examples = self.schema.get("examples").as_array().into_iter().flatten();
        examples.map(|example| format!("{} = {}", self.name, toml(example))).collect()
    }

    fn text(&self) -> String {
        let mut facts = vec![self.value()];
        facts.extend(self.schema.text("unit").map(|unit| format!("unit {unit}")));
        facts.extend(self.default().map(|default| match &*default {
            "required" => default,
            default => format!("default {default}"),
        }));
        let facts = format!("  {}: {}", self.name, facts.join("; "));
        let mut text = format!("\n{}\n", wrapped(&facts, 6));
        text.push_str(&lines(&self.meaning(), 6));
        for (word, meaning) in self.choices() {
            text.push_str(&lines(&format!("\"{word}\": {meaning}"), 8));
        }
        for example in self.examples() {
            text.push_str(&lines(&format!("example: {example}"), 6));
        }
        text
    }

    /// A row of a table.
    fn markdown(&self) -> String {
        let mut meaning = vec![escaped(&self.meaning())];
        let choices = self.choices();
        meaning.extend(choices.iter().map(|(word, text)| format!("`\"{word}\"`: {}", escaped(text))));
        meaning.extend(self.examples().iter().map(|example| format!("Example: {}", code(example))));
        let default = match self.default() {
            Some(word) if word == "required" => word,
            default => default.map_or(String::new(), |value| code(&value)),
        };
        format!(
            "| `{}` | {} | {} | {default} | {} |\n",
            self.name,
            escaped(&self.value()),
            escaped(self.schema.text("unit").unwrap_or_default()),
            meaning.join("<br>")
        )
    }
}

/// Text of a table in Markdown; what is between backquotes stays as it is.
pub fn escaped(text: &str) -> String {
    let plain = |part: &str| part.replace('*', "\\*").replace('<', "&lt;").replace('|', "\\|");
    let part = |(at, part): (usize, &str)| if at % 2 == 0 { plain(part) } else { part.replace('|', "\\|") };
    text.split('`').enumerate().map(part).collect::<Vec<_>>().join("`")
}

/// Code of a table in Markdown.
fn code(text: &str) -> String {
    format!("`{}`", text.replace('|', "\\|"))
}

/// The accepted kind of value, in words.
pub(super) fn kind(schema: Schema) -> String {
    kind_in(schema, schema.text("variables").unwrap_or("t, x, y, z"))
}

/// The same, with these variables of expressions.
fn kind_in(schema: Schema, variables: &str) -> String {
    let alternatives = schema.alternatives();
    if !alternatives.is_empty() {
        let mut kinds: Vec<String> = schema.words().iter().map(|word| format!("\"{word}\"")).collect();
        let tables: Vec<&str> = schema.tagged().iter().map(|(name, _)| *name).collect();
        if !tables.is_empty() {
            kinds.push(format!("a table with one of {}", tables.join(", ")));
        }
        let plain = |one: &&Schema| one.accepts("array") || one.accepts("object") && one.tag().is_none();
        kinds.extend(alternatives.iter().filter(plain).map(|one| kind(*one)));
        return kinds.join(" or ");
    }
    if schema.text("format") == Some("expression") {
        let infinite = if schema.may_be_infinite() { ", inf" } else { "" };
        return format!("a number{infinite} or an expression in {variables}");
    }
    if schema.text("format") == Some("parameter") {
        return "a number or an expression of other parameters".into();
    }
    if let Some(items) = schema.items().filter(|_| schema.accepts("array")) {
        let count = match (schema.number("minItems"), schema.number("maxItems")) {
            (Some(least), Some(most)) if least == most => format!("{least} "),
            _ => String::new(),
        };
        return format!("a list of {count}items, each {}", kind_in(items, variables));
    }
    let plain = [
        ("object", "a table"),
        ("integer", "a whole number"),
        ("number", "a number"),
        ("string", "a string"),
        ("boolean", "true or false"),
        ("array", "a list"),
    ];
    let mut accepted: Vec<&str> =
        plain.iter().filter(|(name, _)| schema.accepts(name)).map(|(_, words)| *words).collect();
    accepted.extend(schema.may_be_infinite().then_some("inf"));
    if accepted.is_empty() { "a value".into() } else { accepted.join(" or ") }
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

/// The text in lines, each after `indent` blanks.
pub fn lines(text: &str, indent: usize) -> String {
    if text.is_empty() {
        return String::new();
    }
    format!("{}\n", wrapped(&format!("{:indent$}{}", "", flat(text)), indent))
}
