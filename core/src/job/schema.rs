//! The JSON Schema of a kind of document, generated from the structs, without null, which TOML does not have.

use std::sync::LazyLock;

use schemars::JsonSchema;
use serde_json::{Map, Value, json};

use super::Job;

static JOB: LazyLock<Value> = LazyLock::new(schema_of::<Job>);

/// A kind of document.
#[derive(Clone, Copy)]
pub struct Kind {
    /// Its name in messages.
    pub name: &'static str,
    /// The prefix of table names on the command line.
    pub prefix: &'static str,
    /// The introduction of the reference of its keys.
    pub opening: &'static str,
    /// Its schema (draft 2020-12).
    pub schema: &'static Value,
}

impl Kind {
    /// Jobs.
    pub fn job() -> Self {
        Self { name: "job", prefix: "", opening: OPENING, schema: &JOB }
    }

    /// The schema of the whole document.
    pub fn root(&self) -> Schema {
        Schema::of_root(self.schema)
    }
}

const OPENING: &str = "\
A job is a TOML file with the tables below. [table] occurs at most once, [[table]] any number of times. An effect whose
table is absent is not simulated. All quantities are in SI units. Paths are relative to the job file.

Where an expression in t is accepted, a table of values over time is, too: { table = \"load.csv\" } with the times in
the first column of the file and the values in the second (column = 3: in the third), linear between the points and constant
before the first and after the last. Expressions have + - * / ^, comparisons < <= > >= (1 or 0), min, max, abs, sign, floor,
ceil, round, sqrt, cbrt, exp, ln, log10, sin, cos, tan, asin, acos, atan, atan2, hypot, sinh, cosh, tanh, step(x) (1 from 0
on), pulse(t, start, end) (1 from start to end), pi, e, inf, if(condition, then, otherwise) and interpolate(t, t1, v1, t2, v2, ...).

[parameters] gives numbers names. Where a number is accepted, an expression of such names in quotes is, too: end = \"2*T\".

";

/// The schema of a whole document; no key may be null, as in TOML.
pub fn schema_of<T: JsonSchema>() -> Value {
    let mut schema = schemars::schema_for!(T).to_value();
    remove_null(&mut schema);
    schema
}

/// A schema with its reference resolved; description and default of the referring part have priority.
fn resolve(root: &'static Value, schema: &'static Value) -> Schema {
    let target = schema["$ref"].as_str().and_then(|name| root.pointer(name.trim_start_matches('#')));
    Schema { root, own: schema, target: target.unwrap_or(schema) }
}

/// A schema, and the schema that refers to it.
#[derive(Clone, Copy)]
pub struct Schema {
    root: &'static Value,
    own: &'static Value,
    target: &'static Value,
}

impl Schema {
    /// The schema of a whole document.
    pub(crate) fn of_root(root: &'static Value) -> Self {
        resolve(root, root)
    }

    /// The value of a keyword.
    pub(crate) fn get(&self, keyword: &str) -> &'static Value {
        match &self.own[keyword] {
            Value::Null => &self.target[keyword],
            value => value,
        }
    }

    /// The text of a keyword.
    pub(crate) fn text(&self, keyword: &str) -> Option<&'static str> {
        self.get(keyword).as_str()
    }

    /// The number of a keyword.
    pub(crate) fn number(&self, keyword: &str) -> Option<f64> {
        self.get(keyword).as_f64()
    }

    /// Whether infinity is allowed, which is no number of JSON.
    pub(crate) fn may_be_infinite(&self) -> bool {
        self.get("infinite") == true
    }

    /// Whether a value of this JSON type is allowed.
    pub(crate) fn accepts(&self, kind: &str) -> bool {
        match self.get("type") {
            Value::String(only) => only == kind,
            Value::Array(several) => several.iter().any(|one| one == kind),
            _ => self.alternatives().iter().any(|alternative| alternative.accepts(kind)),
        }
    }

    /// The alternatives of a choice, with nested choices flattened; empty if there is no choice.
    pub(crate) fn alternatives(&self) -> Vec<Schema> {
        let branches = self.get("oneOf").as_array().or_else(|| self.get("anyOf").as_array());
        let mut all = Vec::new();
        for branch in branches.into_iter().flatten() {
            let branch = resolve(self.root, branch);
            match branch.alternatives() {
                nested if nested.is_empty() => all.push(branch),
                nested => all.extend(nested),
            }
        }
        all
    }

    /// The schema of the table itself where a table or a list of such tables is allowed; else this one.
    pub(crate) fn one(self) -> Self {
        match self.alternatives()[..] {
            [one, list] if one.tag().is_none() && one.accepts("object") && list.accepts("array") => {
                Self { own: one.target, ..one }
            }
            _ => self,
        }
    }

    /// The allowed words.
    pub(crate) fn words(&self) -> Vec<&'static str> {
        self.alternatives().iter().filter_map(|branch| branch.text("const")).collect()
    }

    /// Whether this word may stand in a list of this schema.
    pub(crate) fn lists(&self, word: &str) -> bool {
        self.items().is_some_and(|items| items.words().contains(&word))
    }

    /// The tables of which exactly one is allowed, each with its name and the schema of the alternative.
    pub(crate) fn tagged(&self) -> Vec<(&'static str, Schema)> {
        let branches = self.alternatives().into_iter();
        branches.filter_map(|branch| Some((branch.tag()?, branch))).collect()
    }

    /// The name of the table if this schema is an alternative in a choice between tables.
    pub(crate) fn tag(&self) -> Option<&'static str> {
        match &self.get("required").as_array()?[..] {
            [only] if self.alternatives().is_empty() => only.as_str(),
            _ => None,
        }
    }

    /// The keys of a table.
    pub fn properties(&self) -> impl Iterator<Item = (&'static String, Schema)> {
        let root = self.root;
        self.get("properties")
            .as_object()
            .into_iter()
            .flatten()
            .map(|(key, value)| (key, resolve(root, value)))
    }

    /// The schema of one key of a table.
    pub fn property(&self, key: &str) -> Option<Schema> {
        self.get("properties").get(key).map(|inner| resolve(self.root, inner))
    }

    /// The required keys of a table.
    pub fn required(&self) -> impl Iterator<Item = &'static str> {
        self.get("required").as_array().into_iter().flatten().filter_map(Value::as_str)
    }

    /// The schema of the items of a list, or of the values of a table with free keys.
    pub fn items(&self) -> Option<Schema> {
        [self.get("items"), self.get("additionalProperties")]
            .into_iter()
            .find(|inner| inner.is_object())
            .map(|inner| resolve(self.root, inner))
    }
}

/// Removes null from types and choices.
fn remove_null(schema: &mut Value) {
    match schema {
        Value::Object(object) => {
            object.values_mut().for_each(remove_null);
            remove_null_type(object);
            remove_null_branch(object);
        }
        Value::Array(items) => items.iter_mut().for_each(remove_null),
        _ => {}
    }
}

fn remove_null_type(object: &mut Map<String, Value>) {
    if let Some(Value::Array(kinds)) = object.get_mut("type") {
        kinds.retain(|kind| kind != "null");
        if let [only] = kinds.as_slice() {
            let only = only.clone();
            object.insert("type".into(), only);
        }
    }
}

fn remove_null_branch(object: &mut Map<String, Value>) {
    if let Some(Value::Array(branches)) = object.get_mut("anyOf") {
        branches.retain(|branch| *branch != json!({ "type": "null" }));
        if let [Value::Object(only)] = branches.as_slice() {
            let only = only.clone();
            object.remove("anyOf");
            object.extend(only);
        }
    }
}
